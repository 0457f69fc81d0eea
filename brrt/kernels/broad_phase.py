"""Collision of segments with obstacles, with a uniform grid as the broad phase."""

from typing import Any, NamedTuple

import numpy as np
from numba.extending import overload
from numpy.typing import NDArray

from brrt.kernels.jit import HELPER, helper, inline_helper
from brrt.kernels.occupancy import ClearanceGrid, build_clearance_grid, segment_hits_cells
from brrt.worlds.world import World

Floats = NDArray[np.float64]

_CELLS_PER_OBSTACLE = 8.0
_MAX_CELLS = 1 << 22
_ENTRIES_PER_OBSTACLE = 64
_PAD = 1e-6
"""Obstacles are enlarged by this part of a cell when they are entered, so that a traversal which
rounds to one side of a cell border finds the obstacles that touch it from the other side."""

_SLACK = 1e-15
"""Bound on the rounding of an entry or exit parameter in [0, 1]: the subtraction, the direction,
its reciprocal and the product round once each, together by less than 4.5e-16."""

_TINY = 1e-290
"""A component of a segment below this counts as zero: its reciprocal would overflow."""


class ObstacleGrid(NamedTuple):
    """Balls, boxes and convex polygons, and the grid that finds those near a segment.

    The tuples have one number per axis, so that kernels are compiled for the dimension.

    Attributes:
        lower: Least corner of the grid.
        cell: Edges of a cell.
        per_length: Their reciprocals.
        shape: Cells along each axis.
        starts: First entry of each cell in `items`, and the end, shape (cells + 1,).
        items: Obstacle numbers: balls first, then boxes, then polygons.
        balls: Centre and radius, shape (n, d + 1).
        boxes: Least corner and greatest corner, shape (m, 2 d).
        vertices: Vertices of all polygons, counter-clockwise, shape (v, 2).
        corners: First row of each polygon in `vertices`, and the end, shape (k + 1,).
        cells: Occupancy grid of a 2D world.
    """

    lower: tuple[float, ...]
    cell: tuple[float, ...]
    per_length: tuple[float, ...]
    shape: tuple[int, ...]
    starts: NDArray[np.int32]
    items: NDArray[np.int32]
    balls: Floats
    boxes: Floats
    vertices: Floats
    corners: NDArray[np.int32]
    cells: ClearanceGrid


def bounding_boxes(world: World) -> tuple[Floats, Floats]:
    """Least and greatest corners of balls, boxes and polygons, shape (n, d) each."""
    d, balls, boxes = world.dim, world.balls, world.boxes
    least, most = [balls[:, :d] - balls[:, d:], boxes[:, :d]], [balls[:, :d] + balls[:, d:]]
    most += [boxes[:, d:]]
    least += [polygon.min(axis=0, keepdims=True) for polygon in world.polygons]
    most += [polygon.max(axis=0, keepdims=True) for polygon in world.polygons]
    return np.concatenate(least), np.concatenate(most)


def build_obstacle_grid(world: World) -> ObstacleGrid:
    """Enter a world's obstacles into a grid with about 8 cells per obstacle."""
    d = world.dim
    least, most = bounding_boxes(world)
    extent = world.upper - world.lower
    longest = float(extent.max())
    volume = float((extent / longest).prod()) / max(1.0, _CELLS_PER_OBSTACLE * len(least))
    edge = longest * max(volume ** (1 / d), 1 / _MAX_CELLS)
    while True:
        shape = np.maximum(1.0, np.ceil(extent / edge))  # may exceed int64 in flat worlds
        if shape.prod() > _MAX_CELLS:
            edge *= 1.5
            continue
        shape = shape.astype(np.int64)
        cell = extent / shape
        first = np.clip(np.floor((least - world.lower) / cell - _PAD), 0, shape - 1)
        last = np.clip(np.floor((most - world.lower) / cell + _PAD), 0, shape - 1)
        spans = (last - first + 1).astype(np.int64)
        entries = int(spans.prod(axis=1).sum())
        small = entries <= _ENTRIES_PER_OBSTACLE * len(least) + 4096
        if small:
            break
        edge *= 1.5
    starts, items = _entries(first.astype(np.int64), spans, shape)
    corner, edges, counts = (tuple(a.tolist()) for a in (world.lower, cell, shape))
    per_length = tuple((1.0 / cell).tolist())
    ends = np.cumsum([0, *map(len, world.polygons)], dtype=np.int32)
    vertices = np.concatenate([np.empty((0, 2)), *world.polygons])
    return ObstacleGrid(
        corner,
        edges,
        per_length,
        counts,
        starts,
        items,
        world.balls,
        world.boxes,
        vertices,
        ends,
        build_clearance_grid(world),
    )


def _entries(
    first: NDArray[np.int64], spans: NDArray[np.int64], shape: NDArray[np.int64]
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """List the cells of all obstacles' boxes, sorted by cell: (starts, items)."""
    counts = spans.prod(axis=1)
    item = np.repeat(np.arange(len(counts)), counts)
    rank = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    cells = np.zeros(len(item), np.int64)
    stride = 1
    for axis in range(len(shape)):
        span = spans[item, axis]
        cells += (first[item, axis] + rank % span) * stride
        rank //= span
        stride *= int(shape[axis])
    order = np.argsort(cells, kind="stable")
    per_cell = np.bincount(cells, minlength=int(shape.prod()))
    starts = np.concatenate([[0], np.cumsum(per_cell)]).astype(np.int32)
    return starts, item[order].astype(np.int32)


@inline_helper
def _cell_of(offset: float, per_length: float, count: int) -> int:
    return max(min(int(offset * per_length), count - 1), 0)


@inline_helper
def _crossing(offset: float, step: float, inverse: float, width: float, cell: int) -> float:
    """Parameter at which a segment leaves a cell along one axis; infinite if it is parallel to it.

    `offset` counts from the grid's corner: far from the origin, coordinates would round by more
    than obstacles are padded.
    """
    if abs(step) < _TINY:
        return np.inf
    return ((cell + 1 if step > 0 else cell) * width - offset) * inverse


@inline_helper
def _inverse(step: float) -> float:
    """Reciprocal of a component; 0, which is not used, if the component counts as zero."""
    return 0.0 if abs(step) < _TINY else 1.0 / step


@inline_helper
def _hits_slab(
    x: float, step: float, inverse: float, low: float, high: float
) -> tuple[float, float]:
    """Parameters between which a line is inside a slab; (inf, -inf) if it never is."""
    if abs(step) < _TINY:
        if max(x, x + step) < low or min(x, x + step) > high:
            return np.inf, -np.inf
        return -np.inf, np.inf
    u, v = (low - x) * inverse, (high - x) * inverse
    return min(u, v), max(u, v)


@helper
def _hits_hull(
    vertices: Floats, first: int, end: int, ax: float, ay: float, dx: float, dy: float
) -> bool:
    """Whether the segment from (ax, ay) along (dx, dy) touches a convex polygon.

    By separating axes: a line that separates the two is parallel to an edge or to the segment.
    Coordinates count from a vertex or from the segment's first end, so each difference rounds
    once; a cross product of two differences rounds by less than 1e-15 of its terms, and a smaller
    separation is a hit.
    """
    left, right, behind, beyond = True, True, True, True
    square = dx * dx + dy * dy
    for v in range(first, end):
        px, py = vertices[v, 0] - ax, vertices[v, 1] - ay
        across, slack = dx * py - dy * px, 1e-15 * (abs(dx * py) + abs(dy * px))
        left, right = left and across > slack, right and across < -slack
        along, slack = dx * px + dy * py, 1e-15 * (abs(dx * px) + abs(dy * py) + square)
        behind, beyond = behind and along < -slack, beyond and along > square + slack
    if left or right or behind or beyond:
        return False
    before = end - 1
    for v in range(first, end):
        ux, uy = vertices[before, 0], vertices[before, 1]
        ex, ey = vertices[v, 0] - ux, vertices[v, 1] - uy
        px, py = ax - ux, ay - uy
        slack = 3e-15 * (abs(ex) * (abs(py) + abs(dy)) + abs(ey) * (abs(px) + abs(dx)))
        start = ex * py - ey * px
        if max(start, start + (ex * dy - ey * dx)) < -slack:
            return False
        if end - first == 2:
            # Beyond the end of a line segment, its own direction is a separating axis.
            slack = 3e-15 * (abs(ex) * (abs(px) + abs(dx)) + abs(ey) * (abs(py) + abs(dy)))
            start = ex * px + ey * py
            if max(start, start + (ex * dx + ey * dy)) < -slack:
                return False
        before = v
    return True


def _hits_polygon(o: ObstacleGrid, polygon: int, line: tuple[float, float, float, float]) -> bool:
    """Whether the segment from (ax, ay) along (dx, dy) touches a polygon of a 2D world."""
    ax, ay, dx, dy = line
    return _hits_hull(o.vertices, o.corners[polygon], o.corners[polygon + 1], ax, ay, dx, dy)


@overload(_hits_polygon, strict=False, jit_options=HELPER)  # type: ignore[arg-type]
def _by_dimension(o: Any, *rest: Any) -> Any:  # noqa: ARG001 - numba's types are untyped
    """Compile the test for polygons in 2D only; 3D worlds have none."""
    if len(o.types[0]) == 2:
        return _hits_polygon

    def never(o: Any, polygon: Any, line: Any) -> bool:  # noqa: ARG001
        return False

    return never


def _hits_cells(o: ObstacleGrid, line: tuple[float, float, float, float]) -> bool:
    """Whether the segment from (ax, ay) along (dx, dy) touches a cell of a 2D world's grid."""
    ax, ay, dx, dy = line
    return len(o.cells.clearance) > 0 and segment_hits_cells(o.cells, ax, ay, dx, dy)


@overload(_hits_cells, strict=False, jit_options=HELPER)  # type: ignore[arg-type]
def _in_the_plane(o: Any, *rest: Any) -> Any:  # noqa: ARG001 - numba's types are untyped
    """Compile the test for occupancy grids in 2D only."""
    if len(o.types[0]) == 2:
        return _hits_cells

    def never(o: Any, line: Any) -> bool:  # noqa: ARG001
        return False

    return never


@inline_helper
def segment_hits(o: ObstacleGrid, A: Floats, i: int, B: Floats, j: int) -> bool:
    """Whether the closed segment from A[i] to B[j] touches an obstacle.

    The test is exact: slabs for boxes, the closest point for balls, separating axes for polygons, a
    traversal of the cells of an occupancy grid. Rounding only turns misses by less than about 1e-15
    of the lengths involved into hits.

    Args:
        o: The obstacles, d axes.
        A: Points, shape (n, >= d).
        i: Row of A.
        B: Points, shape (m, >= d).
        j: Row of B.
    """
    d = len(o.lower)
    n_balls = o.balls.shape[0]
    n_round_or_box = n_balls + o.boxes.shape[0]
    ax, ay, az = A[i, 0], A[i, 1], 0.0
    dx, dy, dz = B[j, 0] - ax, B[j, 1] - ay, 0.0
    nx, ny = o.shape[0], o.shape[1]
    ox, oy, oz = ax - o.lower[0], ay - o.lower[1], 0.0
    wx, wy, wz = o.cell[0], o.cell[1], 1.0
    cx, cy, cz = _cell_of(ox, o.per_length[0], nx), _cell_of(oy, o.per_length[1], ny), 0
    nz = 1
    if d == 3:
        # A constant index 2 is an error for tuples of two, which this also compiles for.
        z = d - 1
        az = A[i, z]
        dz = B[j, z] - az
        oz, wz, nz = az - o.lower[z], o.cell[z], o.shape[z]
        cz = _cell_of(oz, o.per_length[z], nz)
    ix, iy, iz = _inverse(dx), _inverse(dy), _inverse(dz)
    square = dx * dx + dy * dy + dz * dz
    next_x = _crossing(ox, dx, ix, wx, cx)
    next_y = _crossing(oy, dy, iy, wy, cy)
    next_z = _crossing(oz, dz, iz, wz, cz)
    if _hits_cells(o, (ax, ay, dx, dy)):
        return True
    while True:
        cell = cx + nx * (cy + ny * cz)
        for entry in range(o.starts[cell], o.starts[cell + 1]):
            item = o.items[entry]
            if item < n_balls:
                px, py, pz = ax - o.balls[item, 0], ay - o.balls[item, 1], 0.0
                radius = o.balls[item, d]
                if d == 3:
                    pz = az - o.balls[item, 2]
                # Rounding of the distance: 16 roundings of 1.1e-16, each of a length that is at
                # most the sum. (A slack added to the square would enlarge small balls.)
                reach = radius + 2e-15 * (
                    abs(px) + abs(py) + abs(pz) + abs(dx) + abs(dy) + abs(dz) + radius
                )
                if square > 0.0:
                    u = min(1.0, max(0.0, -(px * dx + py * dy + pz * dz) / square))
                    px, py, pz = px + u * dx, py + u * dy, pz + u * dz
                if px * px + py * py + pz * pz <= reach * reach:
                    return True
            elif item < n_round_or_box:
                box = item - n_balls
                enter, leave = _hits_slab(ax, dx, ix, o.boxes[box, 0], o.boxes[box, d])
                low, high = _hits_slab(ay, dy, iy, o.boxes[box, 1], o.boxes[box, d + 1])
                enter, leave = max(enter, low), min(leave, high)
                if d == 3:
                    low, high = _hits_slab(az, dz, iz, o.boxes[box, 2], o.boxes[box, 5])
                    enter, leave = max(enter, low), min(leave, high)
                if max(enter, 0.0) <= min(leave, 1.0) + _SLACK:
                    return True
            elif _hits_polygon(o, item - n_round_or_box, (ax, ay, dx, dy)):
                return True
        if next_x <= next_y and next_x <= next_z:
            if next_x > 1.0:
                return False
            cx += 1 if dx > 0 else -1
            if cx < 0 or cx >= nx:
                return False
            next_x = _crossing(ox, dx, ix, wx, cx)
        elif next_y <= next_z:
            if next_y > 1.0:
                return False
            cy += 1 if dy > 0 else -1
            if cy < 0 or cy >= ny:
                return False
            next_y = _crossing(oy, dy, iy, wy, cy)
        else:
            if next_z > 1.0:
                return False
            cz += 1 if dz > 0 else -1
            if cz < 0 or cz >= nz:
                return False
            next_z = _crossing(oz, dz, iz, wz, cz)
