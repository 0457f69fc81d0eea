"""Continuous collision checks of bodies made of convex parts.

A motion is halved until each piece is decided (adaptive bisection; Schwarzer, Saha and Latombe
2005). In the middle of a piece, separating axes give a lower bound of the distance between each
part of the body and each obstacle nearby; the robot bounds how far any point of the part moves
within the piece. If the distance is larger, the whole piece is free. Nothing is sampled, so a
motion that is reported free is free at any resolution. A part that comes closer than `margin` to
an obstacle is a hit, which ends the halving.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brrt.kernels.broad_phase import ObstacleGrid, bounding_boxes, build_obstacle_grid
from brrt.kernels.jit import helper, inline_helper
from brrt.kernels.space import by_space
from brrt.worlds.convex import axes_of
from brrt.worlds.world import World

Floats = NDArray[np.float64]

ROUND_UP = 1.0 + 1e-12
"""Factor that covers the rounding of a bound on a movement."""

_MARGIN = 1e-6
"""Least clearance that does not count as touching, as a part of the map's longest side."""

_ROUNDING = 1e-14
"""Bound on the rounding of a placed vertex or of a separation, as a part of the largest
coordinate and for each rotation on the way to it: about 20 roundings of 1.1e-16."""

HIT, UNDECIDED, FREE = range(3)
"""Results of the check of a piece of a motion."""


class ConvexShapes(NamedTuple):
    """Convex shapes: hulls of vertices, inflated by a radius.

    Attributes:
        vertices: Vertices of all shapes, shape by shape, shape (v, 2).
        axes: Outward normals of their edges, and the shape's greatest coordinate along each, shape
            (a, 3); see `brrt.worlds.convex.axes_of`.
        first: First row of each shape in `vertices` and in `axes`, and the end, shape (n + 1, 2).
        circles: Centre and radius of a circle around each inflated shape, shape (n, 3).
        radii: Radius that inflates each shape, shape (n,); above 0 for balls only.
    """

    vertices: Floats
    axes: Floats
    first: NDArray[np.int32]
    circles: Floats
    radii: Floats


class ConvexObstacles(NamedTuple):
    """A 2D world's obstacles as convex shapes, and the grid that finds those nearby.

    Attributes:
        shapes: Balls, boxes and polygons, in the order of the grid's obstacle numbers.
        boxes: Bounding boxes, shape (n, 4): least corner, greatest corner.
        entry: First cell of each obstacle along both axes, shape (n, 2).
        starts: First entry of each cell in `items`, and the end, shape (cells + 1,).
        items: Obstacle numbers.
        lower: Least corner of the grid.
        per_length: Reciprocals of a cell's edges.
        counts: Cells along each axis.
        walls: Bounds of the world: least corner, greatest corner.
        margin: Distance that counts as touching.
        rounding: Bound on the rounding of a distance.
    """

    shapes: ConvexShapes
    boxes: Floats
    entry: NDArray[np.int32]
    starts: NDArray[np.int32]
    items: NDArray[np.int32]
    lower: tuple[float, float]
    per_length: tuple[float, float]
    counts: tuple[int, int]
    walls: tuple[float, float, float, float]
    margin: float
    rounding: float


class MotionScratch(NamedTuple):
    """Work space of the check of one motion; so a space serves one thread at a time.

    Attributes:
        placed: The robot's parts at the pose that is checked.
        moves: Bound on how far any point of each part moves in the motion, shape (parts,).
        pairs: Parts that must not touch each other, shape (m, 2).
        pair_moves: Bound on how far points of a pair move towards each other, shape (m,).
        near: Numbers of the obstacles nearby, shape (obstacles,).
    """

    placed: ConvexShapes
    moves: Floats
    pairs: NDArray[np.int32]
    pair_moves: Floats
    near: NDArray[np.int32]


def build_shapes(hulls: list[Floats], radii: list[float] | None = None) -> ConvexShapes:
    """Build shapes from their vertices, counter-clockwise, shape (k, 2) each."""
    corners = np.array([len(hull) for hull in hulls], np.int64)
    # A point has no axes, a line segment four, a polygon one for each side.
    sides = np.choose(np.minimum(corners, 3), [0, 0, 4, corners])
    first = np.concatenate([[[0, 0]], np.cumsum([corners, sides], axis=1).T])
    vertices = np.concatenate([np.empty((0, 2)), *hulls])
    axes, circles = np.empty((first[-1, 1], 3)), np.empty((len(hulls), 3))
    for k in np.unique(corners).tolist():
        same = np.flatnonzero(corners == k)
        hulls_of_k = vertices[first[same, :1] + np.arange(k)]
        directions = axes_of(hulls_of_k)
        reach = directions[:, :, None, 0] * hulls_of_k[:, None, :, 0]
        reach = (reach + directions[:, :, None, 1] * hulls_of_k[:, None, :, 1]).max(axis=2)
        rows = first[same, 1:] + np.arange(directions.shape[1])
        axes[rows] = np.concatenate([directions, reach[..., None]], axis=2)
        # A circle around the bounding box's centre is close to the smallest one, and simple.
        centres = (hulls_of_k.min(axis=1) + hulls_of_k.max(axis=1)) / 2
        away = hulls_of_k - centres[:, None]
        circles[same, :2] = centres
        circles[same, 2] = np.hypot(away[..., 0], away[..., 1]).max(axis=1) * (1 + 1e-15)
    added = np.zeros(len(hulls)) if radii is None else np.array(radii, np.float64)
    circles[:, 2] += added
    return ConvexShapes(vertices, axes, first.astype(np.int32), circles, added)


def build_body(
    parts: list[Floats], obstacles: ConvexObstacles, pairs: list[tuple[int, int]] | None = None
) -> tuple[ConvexShapes, MotionScratch]:
    """Return a body's parts in their own frames, and the work space of its motion checks."""
    rows = np.array(pairs or [], np.int32).reshape(-1, 2)
    scratch = MotionScratch(
        placed=build_shapes(parts),
        moves=np.zeros(len(parts)),
        pairs=rows,
        pair_moves=np.zeros(len(rows)),
        near=np.zeros(len(obstacles.boxes), np.int32),
    )
    return build_shapes(parts), scratch


def build_convex_obstacles(world: World, reach: float, joints: int = 1) -> ConvexObstacles:
    """Build the convex obstacles of a 2D world and their grid.

    Args:
        world: The world.
        reach: Farthest distance of the body's points from its reference point.
        joints: Rotations between the reference point and the last part.
    """
    world = world.without_grid()
    grid: ObstacleGrid = build_obstacle_grid(world)
    hulls, radii = [ball[None, :2] for ball in world.balls], world.balls[:, 2].tolist()
    for a, b, c, d in world.boxes:
        corners = np.array([[a, b], [c, b], [c, d], [a, d]])
        hulls.append(np.unique(corners, axis=0) if a == c or b == d else corners)
    hulls += list(world.polygons)
    radii += [0.0] * (len(hulls) - len(radii))
    largest = float(np.abs([world.lower, world.upper]).max()) + reach
    rounding = _ROUNDING * (1 + joints) * largest
    return ConvexObstacles(
        shapes=build_shapes(hulls, radii),
        boxes=np.concatenate(bounding_boxes(world), axis=1),
        entry=_first_cells(grid, len(hulls)),
        starts=grid.starts,
        items=grid.items,
        lower=(grid.lower[0], grid.lower[1]),
        per_length=(grid.per_length[0], grid.per_length[1]),
        counts=(grid.shape[0], grid.shape[1]),
        walls=(*world.lower.tolist(), *world.upper.tolist()),
        margin=max(_MARGIN * world.extent, 4 * rounding),
        rounding=rounding,
    )


def _first_cells(grid: ObstacleGrid, n: int) -> NDArray[np.int32]:
    """Least column and row of the cells that list each obstacle, shape (n, 2)."""
    cells = np.repeat(np.arange(len(grid.starts) - 1), np.diff(grid.starts))
    entry = np.full((n, 2), np.iinfo(np.int32).max, np.int32)
    np.minimum.at(entry[:, 0], grid.items, (cells % grid.shape[0]).astype(np.int32))
    np.minimum.at(entry[:, 1], grid.items, (cells // grid.shape[0]).astype(np.int32))
    return entry


@by_space
def place(space: Any, A: Floats, i: int, B: Floats, j: int, part: float) -> None:
    """Place the body at a part (0 to 1) of the motion from A[i] to B[j] in `scratch.placed`."""
    space.place(space, A, i, B, j, part)


@by_space
def bound_moves(space: Any, A: Floats, i: int, B: Floats, j: int) -> None:
    """Write bounds on how far the parts' points move to `scratch.moves` and `pair_moves`."""
    space.bound_moves(space, A, i, B, j)


@inline_helper
def place_part(
    parts: ConvexShapes, placed: ConvexShapes, part: int, x: float, y: float, cos: float, sin: float
) -> None:
    """Rotate a part about its own origin and move the origin to (x, y)."""
    for v in range(parts.first[part, 0], parts.first[part + 1, 0]):
        px, py = parts.vertices[v, 0], parts.vertices[v, 1]
        placed.vertices[v, 0] = x + (cos * px - sin * py)
        placed.vertices[v, 1] = y + (sin * px + cos * py)
    for a in range(parts.first[part, 1], parts.first[part + 1, 1]):
        ax, ay = parts.axes[a, 0], parts.axes[a, 1]
        nx, ny = cos * ax - sin * ay, sin * ax + cos * ay
        placed.axes[a, 0], placed.axes[a, 1] = nx, ny
        placed.axes[a, 2] = parts.axes[a, 2] + (nx * x + ny * y)
    px, py = parts.circles[part, 0], parts.circles[part, 1]
    placed.circles[part, 0] = x + (cos * px - sin * py)
    placed.circles[part, 1] = y + (sin * px + cos * py)


@inline_helper
def _separation_along_axes(
    one: ConvexShapes, a: int, other: ConvexShapes, b: int, best: float, enough: float
) -> float:
    """Greatest separation along the axes of shape a, without radii; the first above `enough`."""
    for axis in range(one.first[a, 1], one.first[a + 1, 1]):
        nx, ny = one.axes[axis, 0], one.axes[axis, 1]
        low = np.inf
        for v in range(other.first[b, 0], other.first[b + 1, 0]):
            low = min(low, nx * other.vertices[v, 0] + ny * other.vertices[v, 1])
        best = max(best, low - one.axes[axis, 2])
        if best > enough:
            break
    return best


@inline_helper
def _separation_from_point(one: ConvexShapes, a: int, x: float, y: float) -> float:
    """Separation of a shape and a point in the direction from the nearest vertex to the point."""
    nearest, nx, ny = np.inf, 0.0, 0.0
    for v in range(one.first[a, 0], one.first[a + 1, 0]):
        dx, dy = x - one.vertices[v, 0], y - one.vertices[v, 1]
        if dx * dx + dy * dy < nearest:
            nearest, nx, ny = dx * dx + dy * dy, dx, dy
    if nearest == 0.0:
        return -np.inf
    size = np.sqrt(nearest)
    nx, ny = nx / size, ny / size
    reach = -np.inf
    for v in range(one.first[a, 0], one.first[a + 1, 0]):
        reach = max(reach, nx * one.vertices[v, 0] + ny * one.vertices[v, 1])
    return float(nx * x + ny * y - reach)


@inline_helper
def _separation(one: ConvexShapes, a: int, other: ConvexShapes, b: int, enough: float) -> float:
    """Lower bound of the distance of two shapes; one above `enough` need not be the best."""
    radius, first = other.radii[b], other.first[b, 0]
    best = _separation_along_axes(other, b, one, a, -np.inf, enough + radius)
    if best <= enough + radius:
        best = _separation_along_axes(one, a, other, b, best, enough + radius)
    if best <= enough + radius and other.first[b + 1, 0] - first == 1:
        x, y = other.vertices[first, 0], other.vertices[first, 1]
        best = max(best, _separation_from_point(one, a, x, y))
    return float(best - radius)


@inline_helper
def _may_meet(one: ConvexShapes, a: int, other: ConvexShapes, b: int, reach: float) -> bool:
    """Whether the circles around two shapes come closer than `reach`."""
    dx = one.circles[a, 0] - other.circles[b, 0]
    dy = one.circles[a, 1] - other.circles[b, 1]
    far = one.circles[a, 2] + other.circles[b, 2] + reach
    return bool(dx * dx + dy * dy <= far * far)


@helper
def _decide(scratch: MotionScratch, obstacles: ConvexObstacles, count: int, half: float) -> int:
    """Check the piece of a motion in whose middle the body is placed: HIT, UNDECIDED or FREE.

    Args:
        scratch: The placed body, and the obstacles nearby.
        obstacles: All obstacles.
        count: Number of obstacles nearby.
        half: Half the length of the piece, as a part of the motion.
    """
    placed, margin, result = scratch.placed, obstacles.margin + obstacles.rounding, FREE
    x0, y0, x1, y1 = obstacles.walls
    for part in range(len(scratch.moves)):
        reach = scratch.moves[part] * half + obstacles.rounding
        room = np.inf
        for v in range(placed.first[part, 0], placed.first[part + 1, 0]):
            x, y = placed.vertices[v, 0], placed.vertices[v, 1]
            room = min(room, x - x0, y - y0, x1 - x, y1 - y)
        if room <= margin:
            return HIT
        if room <= reach:
            result = UNDECIDED
        enough = max(reach, margin)
        for at in range(count):
            other = scratch.near[at]
            if not _may_meet(placed, part, obstacles.shapes, other, enough):
                continue
            apart = _separation(placed, part, obstacles.shapes, other, enough)
            if apart <= margin:
                return HIT
            if apart <= reach:
                result = UNDECIDED
    for pair in range(len(scratch.pair_moves)):
        one, two = scratch.pairs[pair, 0], scratch.pairs[pair, 1]
        reach = scratch.pair_moves[pair] * half + 2 * obstacles.rounding
        enough = max(reach, margin)
        if not _may_meet(placed, one, placed, two, enough):
            continue
        apart = _separation(placed, one, placed, two, enough)
        if apart <= margin:
            return HIT
        if apart <= reach:
            result = UNDECIDED
    return result


@inline_helper
def _cell(offset: float, per_length: float, count: int) -> int:
    return int(max(min(offset * per_length, count - 1.0), 0.0))


@helper
def _gather(scratch: MotionScratch, obstacles: ConvexObstacles) -> int:
    """List the obstacles that the body may meet in the whole motion; return their number.

    The body is placed in the middle of the motion.
    """
    placed = scratch.placed
    x0, y0, x1, y1 = np.inf, np.inf, -np.inf, -np.inf
    for part in range(len(scratch.moves)):
        reach = 0.5 * scratch.moves[part] + obstacles.margin + 2 * obstacles.rounding
        for v in range(placed.first[part, 0], placed.first[part + 1, 0]):
            x, y = placed.vertices[v, 0], placed.vertices[v, 1]
            x0, y0 = min(x0, x - reach), min(y0, y - reach)
            x1, y1 = max(x1, x + reach), max(y1, y + reach)
    (left, low), (per_x, per_y) = obstacles.lower, obstacles.per_length
    columns, rows = obstacles.counts
    first, last = _cell(x0 - left, per_x, columns), _cell(x1 - left, per_x, columns)
    bottom, top = _cell(y0 - low, per_y, rows), _cell(y1 - low, per_y, rows)
    n = 0
    for cy in range(bottom, top + 1):
        for cx in range(first, last + 1):
            cell = cx + columns * cy
            for entry in range(obstacles.starts[cell], obstacles.starts[cell + 1]):
                item = obstacles.items[entry]
                # Take each obstacle once: from the first cell that it shares with the body's box.
                if max(obstacles.entry[item, 0], first) != cx:
                    continue
                if max(obstacles.entry[item, 1], bottom) != cy:
                    continue
                if obstacles.boxes[item, 0] > x1 or obstacles.boxes[item, 2] < x0:
                    continue
                if obstacles.boxes[item, 1] > y1 or obstacles.boxes[item, 3] < y0:
                    continue
                scratch.near[n] = item
                n += 1
    return n


@helper
def motion_free(space: Any, A: Floats, i: int, B: Floats, j: int) -> bool:
    """Whether the motion from A[i] to B[j] is free everywhere, ends included.

    Pieces are checked from the end of the motion, because a planner's motions start in free space,
    so a collision is more likely near the end.
    """
    scratch, obstacles = space.scratch, space.obstacles
    bound_moves(space, A, i, B, j)
    count, level, piece, half = -1, 0, 0, 0.5
    while True:
        place(space, A, i, B, j, 1.0 - (2 * piece + 1) * half)
        if count < 0:
            count = _gather(scratch, obstacles)
        found = _decide(scratch, obstacles, count, half)
        if found == HIT:
            return False
        if found == FREE:
            while piece % 2 == 1:
                piece, level, half = piece // 2, level - 1, 2.0 * half
            if level == 0:
                return True
            piece += 1
        else:
            piece, level, half = 2 * piece, level + 1, 0.5 * half
