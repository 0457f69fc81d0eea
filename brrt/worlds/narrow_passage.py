"""The narrowest passage on the widest path from start to goal, for a point, by rasters of cells.

Clearance is measured from cell to cell, so that widths are known to about two cells; the rasters
get finer until that is a small part of the width.
"""

import itertools
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from brrt.worlds.arrays import Bools, Floats, Ints
from brrt.worlds.free_space import grid_only, nearest_free_cell
from brrt.worlds.obstacle_arrays import obstacle_arrays
from brrt.worlds.rasterize import Raster, components
from brrt.worlds.world import World

Cell = tuple[int, ...]

CELLS = (1 << 12, 1 << 16, 1 << 18, 1 << 20)
"""Cells of the rasters, from coarse to fine."""

_ENOUGH = 12
"""A passage that many cells wide is measured well enough."""

_WIDE = 0.05
"""A passage wider than this part of the world's longest side is not narrow; no finer raster."""

_FARTHEST = 32
"""Largest clearance that is distinguished, in cells."""

_THIN = 64
"""Maximum number of bottleneck cells that distances are measured to."""

_ENLARGED = 1 + 1e-6
"""Factor that makes up for rounding, and for cells that an obstacle only nearly touches."""


@dataclass(frozen=True, slots=True, eq=False)
class Passage:
    """The narrowest passage on the widest path from start to goal.

    A path is as wide as twice its least clearance to obstacles and bounds. Its ends do not count:
    they are moved to the local maximum of clearance that is reached by climbing from start and
    goal.

    Attributes:
        low: Lower estimate of the width.
        high: Upper estimate.
        place: Middle of the passage, shape (d,).
        cell: Longest side of the cells that it was measured with.
        raster: These cells.
        beyond: Which of the cells lie beyond the passage as seen from the start, of those with more
            clearance; none where no narrow passage separates start and goal.
        bottleneck: Middles of the consecutive cells with the least clearance, shape (k, d).
    """

    low: float
    high: float
    place: Floats
    cell: float
    raster: Raster
    beyond: Bools
    bottleneck: Floats

    def is_beyond(self, points: Floats) -> Bools:
        """Whether each point, shape (n, d), lies in a cell beyond the passage."""
        return np.asarray(self.beyond[tuple(self.raster.index(points).T)])

    def distance(self, points: Floats) -> Floats:
        """Return the distance of each point, shape (n, d), from the bottleneck, shape (n,)."""
        square = np.full(len(points), np.inf)
        for middle in self.bottleneck[:: len(self.bottleneck) // _THIN + 1]:
            np.minimum(square, ((points - middle) ** 2).sum(axis=1), out=square)
        return np.asarray(np.sqrt(square))


def narrowest_passage(world: World, start: Floats, goal: Floats) -> Passage | None:
    """Find the narrowest passage on the widest path; None if no raster shows a path.

    Args:
        world: The world.
        start: Shape (d,).
        goal: Shape (d,).
    """
    found, most = None, np.inf
    for raster, free, ends in _rasters(world, start, goal):
        size = float(raster.cell.max())
        label = None if ends is None else components(free)
        if ends is None or label is None or label[ends[0]] != label[ends[1]] or label[ends[0]] < 0:
            # A passage in any direction without a chain of free cells is at most a few cells wide.
            most = 4 * size
            continue
        farthest = int(min(_FARTHEST, 0.5 * most / size + 2))
        found = _measure(raster, free, ends, farthest)
        most = found.high
        if found.high >= _ENOUGH * size or found.low >= _WIDE * world.extent:
            break
    return found


def _rasters(
    world: World, start: Floats, goal: Floats
) -> Iterator[tuple[Raster, Bools, tuple[Cell, Cell] | None]]:
    """Yield rasters, which of their cells are free, and the cells of start and goal if free."""
    grid = grid_only(world)
    if grid is not None and grid.yaw == 0 and grid.cells.size <= 2 * CELLS[-1]:
        # A grid is measured by its own cells: obstacles end at their sides.
        raster = Raster(grid.origin, np.full(2, grid.resolution), grid.cells.shape[::-1])
        here, there = (tuple(raster.index(end).tolist()) for end in (start, goal))
        yield raster, ~grid.cells.T, (here, there)
        return
    obstacles = obstacle_arrays(world.without_grid())
    for cells in CELLS:
        raster = Raster.over(world.lower, world.upper, cells)
        free = ~raster.blocked(obstacles)
        one, other = (nearest_free_cell(raster, free, obstacles, end) for end in (start, goal))
        yield raster, free, None if one is None or other is None else (one, other)


def _measure(raster: Raster, free: Bools, ends: tuple[Cell, Cell], farthest: int) -> Passage:
    """Measure the narrowest passage on the widest path of free cells between two cells."""
    size = float(raster.cell.max())
    square = clearance(free, raster.cell, farthest)
    start, goal = (_climb(square, end) for end in ends)
    least, label = _bottleneck(square, start, goal)
    beyond = np.zeros(free.shape, np.bool_)
    if label[start] >= 0 and label[goal] >= 0:
        beyond = label == label[goal]
        row = _bottleneck_cells(square >= least, label, start, goal)
    else:  # one of the ends has the least clearance
        row = np.array([start if square[start] <= square[goal] else goal])
    width = 2 * float(np.sqrt(least))
    middles = np.mean(raster.corners(row), axis=0)
    place = middles[len(middles) // 2]
    return Passage(width - size, width + 2 * size, place, size, raster, beyond, middles)


def max_width(world: World, start: Floats, goal: Floats, cells: int, enough: float) -> float:
    """Bound the diameter of a disc or ball that can move from start to goal, by proof.

    The clearance of a point is at most the distance between the middles of its cell and of a cell
    that an obstacle touches, plus half the diagonal of each. It is 0 in a cell that an obstacle
    fills. A path leads through faces of cells; where it leads through a corner, it touches all
    cells around it.

    Args:
        world: The world.
        start: Where the centre of the disc is at first, shape (d,).
        goal: Where it should get to.
        cells: Cells of the raster.
        enough: Widths from here on are not distinguished.

    Returns:
        The bound, or inf if it is more than `enough`; 0 if not even a point can move there.
    """
    obstacles = obstacle_arrays(world.without_grid())
    raster = Raster.over(world.lower, world.upper, cells)
    size, diagonal = float(raster.cell.max()), float(np.hypot.reduce(raster.cell))
    farthest = int(enough / 2 / size) + 2
    square = clearance(~raster.blocked(obstacles), raster.cell, farthest)
    bound = np.where(raster.filled(obstacles), 0.0, (np.sqrt(square) + diagonal) * _ENLARGED)
    one, other = (tuple(raster.index(end).tolist()) for end in (start, goal))
    label = components(bound > 0)
    if label[one] != label[other] or label[one] < 0:
        return 0.0
    width = 2 * _bottleneck(bound, one, other)[0]
    return width if width <= enough else np.inf


def clearance(free: Bools, cell: Floats, farthest: int) -> Floats:
    """Measure from each cell's middle to that of the nearest cell that is not free.

    Cells outside the raster are not free. The least sum of squares is taken along one axis after
    the other (Felzenszwalb and Huttenlocher 2012).

    Args:
        free: Whether each cell is free.
        cell: Sides of a cell, shape (d,).
        farthest: Longer distances, in cells, are replaced by this one.

    Returns:
        The squares of the distances, shape of `free`.
    """
    most = float((farthest * cell.max()) ** 2)
    square = np.pad(np.where(free, most, 0.0), 1)
    for axis, side in enumerate(cell.tolist()):
        lines = np.moveaxis(square, axis, 0)
        before = lines.copy()
        for k in range(1, min(int(farthest * cell.max() / side), len(lines) - 1) + 1):
            apart = (k * side) ** 2
            np.minimum(lines[k:], before[:-k] + apart, out=lines[k:])
            np.minimum(lines[:-k], before[k:] + apart, out=lines[:-k])
    return square[(slice(1, -1),) * free.ndim]


def _climb(square: Floats, cell: Cell) -> Cell:
    """Climb from a cell to a local maximum of clearance."""
    around = np.array(list(itertools.product((-1, 0, 1), repeat=len(cell))))
    here = np.array(cell)
    while True:
        cells = here + around
        cells = cells[((cells >= 0) & (cells < square.shape)).all(axis=1)]
        values = square[tuple(cells.T)]
        if values.max() <= square[tuple(here)]:
            return tuple(here.tolist())
        here = cells[int(values.argmax())]


def _bottleneck(values: Floats, start: Cell, goal: Cell) -> tuple[float, Ints]:
    """Find the greatest value such that cells with at least that value connect start and goal.

    Args:
        values: Clearance of each cell, or its square.
        start: A cell.
        goal: Another, connected with the first by values above 0.

    Returns:
        The value, and labels of the components of cells with more, -1 for all others.
    """
    levels = np.unique(values[values > 0])
    levels = levels[levels <= min(values[start], values[goal])]
    low, high = 0, len(levels)
    # The cells connect at levels[low] and do not at levels[high].
    while high - low > 1:
        middle = (low + high) // 2
        label = components(values >= levels[middle])
        low, high = (middle, high) if label[start] == label[goal] else (low, middle)
    return float(levels[low]), components(values > levels[low])


def _bottleneck_cells(passable: Bools, label: Ints, start: Cell, goal: Cell) -> Ints:
    """Find the longest run of bottleneck cells on the path with fewest of them, shape (k, d).

    Args:
        passable: Cells with at least the bottleneck's clearance.
        label: Components of the cells with more, -1 for others.
        start: A cell of one component.
        goal: A cell of another.
    """
    tight = np.flatnonzero(passable & (label < 0))
    # Nodes of a graph: the components, numbered from 0, then the bottleneck cells.
    number, first = label.copy(), int(label.max()) + 1
    number[np.unravel_index(tight, label.shape)] = first + np.arange(len(tight))
    links: dict[int, list[int]] = {}
    for axis in range(label.ndim):
        one, other = (np.moveaxis(number, axis, 0)[part] for part in (slice(-1), slice(1, None)))
        meet = (one >= 0) & (other >= 0) & (one != other)
        for a, b in np.unique(np.stack([one[meet], other[meet]], axis=1), axis=0).tolist():
            links.setdefault(a, []).append(b)
            links.setdefault(b, []).append(a)
    parents = _shortest_paths(links, int(label[start]), int(label[goal]), first)
    runs: list[list[int]] = [[]]
    at = int(label[goal])
    while at != label[start]:
        at = parents[at]
        if at >= first:
            runs[-1].append(at)
        else:
            runs.append([])
    flat = tight[np.array(max(runs, key=len)) - first]
    return np.stack(np.unravel_index(flat, label.shape), axis=1)


def _shortest_paths(
    links: dict[int, list[int]], start: int, goal: int, first: int
) -> dict[int, int]:
    """Search a graph (0-1 breadth-first) and return the parent of each node reached.

    Nodes from number `first` on cost 1, the others nothing.
    """
    parents, cost, waiting = {start: start}, {start: 0}, deque([start])
    done: set[int] = set()
    while waiting:
        at = waiting.popleft()
        if at == goal:
            break
        if at in done:
            continue
        done.add(at)
        for other in links.get(at, []):
            through = cost[at] + (other >= first)
            if through < cost.get(other, 1 << 62):
                cost[other], parents[other] = through, at
                (waiting.append if other >= first else waiting.appendleft)(other)
    return parents
