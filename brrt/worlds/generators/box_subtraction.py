"""Boxes that remain when a part of a box or of a grid of cells is removed."""

import numpy as np
from numpy.typing import ArrayLike

from brrt.worlds.arrays import Bools, Floats


def subtract_box(lower: ArrayLike, upper: ArrayLike, hole: ArrayLike) -> Floats:
    """Return boxes that together fill a box except for a hole; none of them is flat.

    Args:
        lower: Least corner of the box, shape (d,).
        upper: Its greatest corner.
        hole: Least and greatest corner of the hole, shape (2, d); it may reach beyond the box.

    Returns:
        Boxes as least and greatest corner, shape (k, 2 d): at most two for each axis, those of the
        first axis the largest.
    """
    low, high = np.array(lower, np.float64), np.array(upper, np.float64)
    first, last = np.clip(np.asarray(hole, np.float64), low, high)
    boxes = []
    for axis in range(len(low)):
        if low[axis] < first[axis]:
            boxes.append([*low, *np.where(np.arange(len(low)) == axis, first, high)])
        if last[axis] < high[axis]:
            boxes.append([*np.where(np.arange(len(low)) == axis, last, low), *high])
        low[axis], high[axis] = first[axis], last[axis]
        if low[axis] == high[axis]:
            break
    return np.array(boxes).reshape(-1, 2 * len(low))


def merge_cells(blocked: Bools, edges: Floats) -> Floats:
    """Return a few boxes that together fill the blocked cells of a grid.

    Cells are merged into runs along the first axis, equal adjacent runs into plates along the next.

    Args:
        blocked: Whether each cell is blocked, shape (n, ..., n), one axis for each dimension.
        edges: Coordinates between cells, the same for each axis, increasing, shape (n + 1,).

    Returns:
        Boxes as least and greatest corner, shape (k, 2 d); touching ones share coordinates.
    """
    low = np.argwhere(blocked)
    high = low + 1
    for axis in range(blocked.ndim):
        others = np.delete(np.concatenate([low, high], axis=1), [axis, axis + blocked.ndim], axis=1)
        order = np.lexsort([low[:, axis], *others.T])
        low, high, others = low[order], high[order], others[order]
        first = np.ones(len(low), np.bool_)
        first[1:] = (others[1:] != others[:-1]).any(axis=1) | (low[1:, axis] != high[:-1, axis])
        last = np.roll(first, -1)
        low, high = low[first], high[last]
    return np.concatenate([edges[low], edges[high]], axis=1)
