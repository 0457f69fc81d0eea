"""Motions of bodies made of convex parts: free only if free everywhere on the way.

A motion is halved until each piece is decided (adaptive bisection; Schwarzer, Saha and Latombe
2005). In the middle of a piece, separating axes give a lower bound of the distance between each
part of the body and each obstacle nearby; the robot bounds how far any point of the part moves
within the piece. Where the distance is larger, the whole piece is free. So nothing is sampled:
whatever is called free is free at any finer resolution. What comes closer than `margin` to an
obstacle is called a hit, which ends the halving.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brrt.kernels.broad_phase import Obstacles, bounding_boxes, build_obstacles
from brrt.kernels.jit import helper, inline_helper
from brrt.kernels.spaces.space import by_robot
from brrt.worlds.convex import axes_of
from brrt.worlds.world import World

Floats = NDArray[np.float64]

_MARGIN = 1e-6
"""Least clearance that is told from a touch, as a part of the map's longest side."""

_ROUNDING = 1e-14
"""Bound on the rounding of a placed vertex or of a separation, as a part of the largest
coordinate and for each rotation that comes before: some 20 roundings of 1.1e-16."""

HIT, UNDECIDED, FREE = range(3)
"""What is known of a piece of a motion."""


class Shapes(NamedTuple):
    """Convex shapes: hulls of vertices, inflated by a radius.

    Attributes:
        vertices: Of all shapes, one after the other, shape (v, 2).
        axes: Outward normals of their edges, and how far the shape reaches along them, shape
            (a, 3); see `brrt.worlds.convex.axes_of`.
        first: Where each shape begins in `vertices` and in `axes`, and the end, shape (n + 1, 2).
        circles: A circle around each shape, radius included: centre and radius, shape (n, 3).
        radii: Radius that inflates each, shape (n,); above 0 for balls alone.
    """

    vertices: Floats
    axes: Floats
    first: NDArray[np.int32]
    circles: Floats
    radii: Floats


class Scenery(NamedTuple):
    """A world's obstacles as shapes, and the grid that finds those nearby.

    Attributes:
        shapes: Balls, boxes and polygons, in the order of the grid's numbers.
        boxes: Box around each, shape (n, 4): least corner, greatest corner.
        entry: First cell of each along both axes, shape (n, 2).
        starts: Where each cell's entries begin in `items`, shape (cells + 1,).
        items: Obstacle numbers.
        lower: Least corner of the grid.
        per_length: Reciprocals of a cell's edges.
        counts: Cells along each axis.
        walls: Bounds of the world: least corner, greatest corner.
        margin: Distance that counts as touching.
        rounding: Bound on the rounding of a distance.
    """

    shapes: Shapes
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


class Body(NamedTuple):
    """What a motion's check works on. One space serves one thread: all of it is scratch.

    Attributes:
        placed: The robot's parts at the pose that is looked at.
        moves: How far any point of each part moves in the whole motion, shape (parts,).
        pairs: Parts that must not meet each other, shape (m, 2).
        pair_moves: How far any points of these move towards each other, shape (m,).
        near: Numbers of the obstacles nearby, shape (obstacles,).
    """

    placed: Shapes
    moves: Floats
    pairs: NDArray[np.int32]
    pair_moves: Floats
    near: NDArray[np.int32]


def build_shapes(hulls: list[Floats], radii: list[float] | None = None) -> Shapes:
    """Lay out shapes for the kernels; vertices counter-clockwise, shape (k, 2) each."""
    corners = np.array([len(hull) for hull in hulls], np.int64)
    # A point has no axes, a line segment four, a polygon one for each side.
    sides = np.choose(np.minimum(corners, 3), [0, 0, 4, corners])
    first = np.concatenate([[[0, 0]], np.cumsum([corners, sides], axis=1).T])
    vertices = np.concatenate([np.empty((0, 2)), *hulls])
    axes, circles = np.empty((first[-1, 1], 3)), np.empty((len(hulls), 3))
    for k in np.unique(corners).tolist():
        alike = np.flatnonzero(corners == k)
        some = vertices[first[alike, :1] + np.arange(k)]
        directions = axes_of(some)
        reach = directions[:, :, None, 0] * some[:, None, :, 0]
        reach = (reach + directions[:, :, None, 1] * some[:, None, :, 1]).max(axis=2)
        places = first[alike, 1:] + np.arange(directions.shape[1])
        axes[places] = np.concatenate([directions, reach[..., None]], axis=2)
        # Around the middle of the bounding box: close to the smallest circle, and simple.
        centres = (some.min(axis=1) + some.max(axis=1)) / 2
        away = some - centres[:, None]
        circles[alike, :2] = centres
        circles[alike, 2] = np.hypot(away[..., 0], away[..., 1]).max(axis=1) * (1 + 1e-15)
    added = np.zeros(len(hulls)) if radii is None else np.array(radii, np.float64)
    circles[:, 2] += added
    return Shapes(vertices, axes, first.astype(np.int32), circles, added)


def build_body(
    parts: list[Floats], scenery: Scenery, pairs: list[tuple[int, int]] | None = None
) -> tuple[Shapes, Body]:
    """Return a body's parts as the robot defines them, and room for the checks of its motions."""
    shapes, forbidden = build_shapes(parts), np.array(pairs or [], np.int32).reshape(-1, 2)
    body = Body(
        placed=build_shapes(parts),
        moves=np.zeros(len(parts)),
        pairs=forbidden,
        pair_moves=np.zeros(len(forbidden)),
        near=np.zeros(len(scenery.boxes), np.int32),
    )
    return shapes, body


def build_scenery(world: World, reach: float, joints: int = 1) -> Scenery:
    """Enter a 2D world's obstacles into a grid.

    Args:
        world: The world.
        reach: Farthest that the body's points come from its reference point.
        joints: Rotations that follow each other from there to the last part.
    """
    world = world.solid()
    grid: Obstacles = build_obstacles(world)
    hulls, radii = [ball[None, :2] for ball in world.balls], world.balls[:, 2].tolist()
    for a, b, c, d in world.boxes:
        corners = np.array([[a, b], [c, b], [c, d], [a, d]])
        hulls.append(np.unique(corners, axis=0) if a == c or b == d else corners)
    hulls += list(world.polygons)
    radii += [0.0] * (len(hulls) - len(radii))
    largest = float(np.abs([world.lower, world.upper]).max()) + reach
    rounding = _ROUNDING * (1 + joints) * largest
    return Scenery(
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


def _first_cells(grid: Obstacles, n: int) -> NDArray[np.int32]:
    """Least column and row of the cells that name each obstacle, shape (n, 2)."""
    cells = np.repeat(np.arange(len(grid.starts) - 1), np.diff(grid.starts))
    entry = np.full((n, 2), np.iinfo(np.int32).max, np.int32)
    np.minimum.at(entry[:, 0], grid.items, (cells % grid.shape[0]).astype(np.int32))
    np.minimum.at(entry[:, 1], grid.items, (cells // grid.shape[0]).astype(np.int32))
    return entry


@by_robot
def place(space: Any, A: Floats, i: int, B: Floats, j: int, part: float) -> None:
    """Put the body at a part (0 to 1) of the way from A[i] to B[j], into `space.body.placed`."""
    space.place(space, A, i, B, j, part)


@by_robot
def bound_moves(space: Any, A: Floats, i: int, B: Floats, j: int) -> None:
    """Bound how far the parts' points move on the way, into `moves` and `pair_moves`."""
    space.bound_moves(space, A, i, B, j)


@inline_helper
def place_part(
    parts: Shapes, placed: Shapes, part: int, x: float, y: float, cos: float, sin: float
) -> None:
    """Turn a part about its own origin and move the origin to (x, y)."""
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
def _apart_along(one: Shapes, a: int, other: Shapes, b: int, best: float, enough: float) -> float:
    """Greatest separation of shape b along the axes of shape a, radii aside, or just `enough`."""
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
def _apart_from_centre(one: Shapes, a: int, x: float, y: float) -> float:
    """Separation of a shape and a point along the direction of its nearest vertex."""
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
def _separation(one: Shapes, a: int, other: Shapes, b: int, enough: float) -> float:
    """Lower bound of the distance of two shapes; exactness beyond `enough` is not sought."""
    radius, first = other.radii[b], other.first[b, 0]
    best = _apart_along(other, b, one, a, -np.inf, enough + radius)
    if best <= enough + radius:
        best = _apart_along(one, a, other, b, best, enough + radius)
    if best <= enough + radius and other.first[b + 1, 0] - first == 1:
        x, y = other.vertices[first, 0], other.vertices[first, 1]
        best = max(best, _apart_from_centre(one, a, x, y))
    return float(best - radius)


@inline_helper
def _may_meet(one: Shapes, a: int, other: Shapes, b: int, reach: float) -> bool:
    """Whether the circles around two shapes come closer than `reach`."""
    dx = one.circles[a, 0] - other.circles[b, 0]
    dy = one.circles[a, 1] - other.circles[b, 1]
    far = one.circles[a, 2] + other.circles[b, 2] + reach
    return bool(dx * dx + dy * dy <= far * far)


@helper
def _decide(body: Body, scenery: Scenery, count: int, half: float) -> int:
    """Decide about the piece of a motion whose middle is placed and which is 2 `half` of it long.

    Args:
        body: The body, placed; `count` obstacles in `near`.
        scenery: What is in the way.
        count: Obstacles nearby.
        half: Half the piece, as a part of the motion.
    """
    placed, margin, result = body.placed, scenery.margin + scenery.rounding, FREE
    x0, y0, x1, y1 = scenery.walls
    for part in range(len(body.moves)):
        reach = body.moves[part] * half + scenery.rounding
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
            other = body.near[at]
            if not _may_meet(placed, part, scenery.shapes, other, enough):
                continue
            apart = _separation(placed, part, scenery.shapes, other, enough)
            if apart <= margin:
                return HIT
            if apart <= reach:
                result = UNDECIDED
    for pair in range(len(body.pair_moves)):
        one, two = body.pairs[pair, 0], body.pairs[pair, 1]
        reach = body.pair_moves[pair] * half + 2 * scenery.rounding
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
def _gather(body: Body, scenery: Scenery) -> int:
    """List the obstacles that the placed body may meet in the whole motion; return how many."""
    placed = body.placed
    x0, y0, x1, y1 = np.inf, np.inf, -np.inf, -np.inf
    for part in range(len(body.moves)):
        # The body stands in the middle of the motion.
        reach = 0.5 * body.moves[part] + scenery.margin + 2 * scenery.rounding
        for v in range(placed.first[part, 0], placed.first[part + 1, 0]):
            x, y = placed.vertices[v, 0], placed.vertices[v, 1]
            x0, y0 = min(x0, x - reach), min(y0, y - reach)
            x1, y1 = max(x1, x + reach), max(y1, y + reach)
    (left, low), (per_x, per_y) = scenery.lower, scenery.per_length
    columns, rows = scenery.counts
    first, last = _cell(x0 - left, per_x, columns), _cell(x1 - left, per_x, columns)
    bottom, top = _cell(y0 - low, per_y, rows), _cell(y1 - low, per_y, rows)
    n = 0
    for cy in range(bottom, top + 1):
        for cx in range(first, last + 1):
            cell = cx + columns * cy
            for entry in range(scenery.starts[cell], scenery.starts[cell + 1]):
                item = scenery.items[entry]
                # Each obstacle is taken once: from the first cell that it shares with the body.
                if max(scenery.entry[item, 0], first) != cx:
                    continue
                if max(scenery.entry[item, 1], bottom) != cy:
                    continue
                if scenery.boxes[item, 0] > x1 or scenery.boxes[item, 2] < x0:
                    continue
                if scenery.boxes[item, 1] > y1 or scenery.boxes[item, 3] < y0:
                    continue
                body.near[n] = item
                n += 1
    return n


@helper
def motion_free(space: Any, A: Floats, i: int, B: Floats, j: int) -> bool:
    """Whether the motion from A[i] to B[j] is free everywhere, ends included.

    Pieces are numbered from the end of the motion, because that is where obstacles are: planners
    move on from where they know it is free.
    """
    body, scenery = space.body, space.scenery
    bound_moves(space, A, i, B, j)
    count, level, piece, half = -1, 0, 0, 0.5
    while True:
        place(space, A, i, B, j, 1.0 - (2 * piece + 1) * half)
        if count < 0:
            count = _gather(body, scenery)
        found = _decide(body, scenery, count, half)
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
