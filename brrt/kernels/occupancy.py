"""Collision of segments with the blocked cells of an occupancy grid."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brrt.kernels.jit import helper, inline_helper
from brrt.worlds.world import World

_STRIDES = 16
"""Longest stride, in cells; the time to compute the clearances grows with it."""

_SLACK = 4e-15
"""Bound on the rounding of a position in the grid, as a part of the lengths that it is computed
from: six roundings of 1.1e-16 for the grid's axes, and four along the segment."""


class ClearanceGrid(NamedTuple):
    """An occupancy grid with the clearance of each cell.

    Attributes:
        clearance: 0 in blocked cells; k if all cells less than k columns and rows away are free;
            shape (rows, columns). Empty if the world has no grid.
        frame: Origin x and y, cosine and sine of the yaw, cells per unit of length.
    """

    clearance: NDArray[np.uint8]
    frame: tuple[float, float, float, float, float]


def build_clearance_grid(world: World) -> ClearanceGrid:
    """Compute the clearance of each cell of a world's grid.

    If the world reaches beyond the grid, a ring of blocked cells is added.
    """
    grid = world.grid
    if grid is None:
        return ClearanceGrid(np.empty((0, 0), np.uint8), (0.0, 0.0, 1.0, 0.0, 1.0))
    blocked, origin = grid.cells, grid.origin
    if not grid.contains_box(world.lower, world.upper):
        blocked, origin = (
            np.pad(blocked, 1, constant_values=True),
            grid.to_world(np.full(2, -grid.resolution)),
        )
    clearance = np.where(blocked, 0, 1).astype(np.uint8)
    for _ in range(_STRIDES - 1):
        blocked = _dilated(blocked)
        clearance += ~blocked
    cos, sin = grid.axes
    return ClearanceGrid(clearance, (*origin.tolist(), cos, sin, 1.0 / grid.resolution))


def _dilated(blocked: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Add the eight neighbours of each cell."""
    for first, last in ((np.s_[1:], np.s_[:-1]), (np.s_[:, 1:], np.s_[:, :-1])):
        larger = blocked.copy()
        larger[first] |= blocked[last]
        larger[last] |= blocked[first]
        blocked = larger
    return blocked


@inline_helper
def _cell(at: float, count: int) -> int:
    return int(max(min(np.floor(at), count - 1.0), 0.0))


@helper
def segment_hits_cells(cells: ClearanceGrid, ax: float, ay: float, dx: float, dy: float) -> bool:
    """Whether the closed segment from (ax, ay) along (dx, dy) touches a blocked cell.

    The segment is traversed along its longer side, column by column; a corner belongs to all four
    cells around it. After a cell with clearance k the next k - 1 columns are skipped, because a
    segment rises by at most one row in a column.
    """
    clearance, (ox, oy, cos, sin, per_length) = cells.clearance, cells.frame
    px, py = ax - ox, ay - oy
    u, v = (cos * px + sin * py) * per_length, (cos * py - sin * px) * per_length
    du, dv = (cos * dx + sin * dy) * per_length, (cos * dy - sin * dx) * per_length
    slack = _SLACK * (abs(px) + abs(py) + abs(dx) + abs(dy)) * per_length
    rows, columns = clearance.shape
    steep = abs(dv) > abs(du)
    if steep:
        u, v, du, dv, rows, columns = v, u, dv, du, columns, rows
    slope = 0.0 if du == 0.0 else dv / du
    low, high = min(u, u + du), max(u, u + du)
    column, last = _cell(low - slack, columns), _cell(high + slack, columns)
    while column <= last:
        # The outermost cells extend to everything outside the grid.
        left = low if column == 0 else min(max(low, float(column)), high)
        right = high if column == columns - 1 else max(min(high, column + 1.0), low)
        one, two = v + (left - u) * slope, v + (right - u) * slope
        stride = _STRIDES
        for row in range(
            _cell(min(one, two) - slack, rows), _cell(max(one, two) + slack, rows) + 1
        ):
            free = int(clearance[column, row] if steep else clearance[row, column])
            if free == 0:
                return True
            stride = min(stride, free)
        column += stride
    return False
