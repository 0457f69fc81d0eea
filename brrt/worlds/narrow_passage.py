"""The narrowest place on the widest way from start to goal, for a point: a fold over cells.

Clearance is measured from cell to cell, so widths are known to about two cells; finer cells are
taken until that is little, or there are no finer ones.
"""

import itertools
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from brrt.worlds.free_space import grid_only, nearest_free_cell
from brrt.worlds.obstacle_arrays import Bools, Floats, Ints, obstacle_arrays
from brrt.worlds.rasterize import Raster, components
from brrt.worlds.world import World

Cell = tuple[int, ...]

CELLS = (1 << 12, 1 << 16, 1 << 18, 1 << 20)
"""Cells of the lattices, each finer than the one before."""

_ENOUGH = 12
"""Cells across a passage that is measured well enough."""

_WIDE = 0.05
"""Part of the map's longest side that is no narrow place: it need not be measured any better."""

_FARTHEST = 32
"""Clearances beyond so many cells are taken to be that."""

_THIN = 64
"""Cells of a neck that points are compared with."""

_SURE = 1 + 1e-6
"""Makes up for cells that an obstacle only nearly touches, and for rounding."""


@dataclass(frozen=True, slots=True, eq=False)
class Passage:
    """The narrowest place on the widest way.

    A way is as wide as twice the least clearance on it, to obstacles and bounds; where it begins
    and ends does not count: both are taken to the roomiest place that clearance rises to from
    there.

    Attributes:
        low: The passage is about that wide at least.
        high: And at most.
        place: Its middle, shape (d,).
        cell: Side of the cells that it was measured with.
        lattice: These.
        behind: Which of these lie behind it, as one comes from the start, as far as they have more
            clearance; none where no narrow place parts start and goal.
        neck: Middles of the cells without room to spare in a row about the place, shape (k, d).
    """

    low: float
    high: float
    place: Floats
    cell: float
    lattice: Raster
    behind: Bools
    neck: Floats

    def passed(self, points: Floats) -> Bools:
        """Whether each point, shape (n, d), lies in a cell behind the passage."""
        return np.asarray(self.behind[tuple(self.lattice.index(points).T)])

    def apart(self, points: Floats) -> Floats:
        """How far each point, shape (n, d), is from the neck, shape (n,)."""
        thin = self.neck[:: len(self.neck) // _THIN + 1]
        square = np.full(len(points), np.inf)
        for middle in thin:
            np.minimum(square, ((points - middle) ** 2).sum(axis=1), out=square)
        return np.asarray(np.sqrt(square))


def narrowest(world: World, start: Floats, goal: Floats) -> Passage | None:
    """Find the narrowest place on the widest way; None where cells of no size show a way.

    Args:
        world: The world.
        start: Where the way begins, shape (d,).
        goal: Where it ends.
    """
    found, most = None, np.inf
    for lattice, free, ends in _lattices(world, start, goal):
        size = float(lattice.cell.max())
        label = None if ends is None else components(free)
        if ends is None or label is None or label[ends[0]] != label[ends[1]] or label[ends[0]] < 0:
            # What lets no cell through is narrower than a few of them, whichever way it runs.
            most = 4 * size
            continue
        farthest = int(min(_FARTHEST, 0.5 * most / size + 2))
        found = _measured(lattice, free, ends, farthest)
        most = found.high
        if found.high >= _ENOUGH * size or found.low >= _WIDE * world.extent:
            break
    return found


def _lattices(
    world: World, start: Floats, goal: Floats
) -> Iterator[tuple[Raster, Bools, tuple[Cell, Cell] | None]]:
    """Yield lattices, which of their cells are free, and the cells of start and goal if free."""
    grid = grid_only(world)
    if grid is not None and grid.yaw == 0 and grid.cells.size <= 2 * CELLS[-1]:
        # A map is measured by its own cells: their borders are where its obstacles end.
        lattice = Raster(grid.origin, np.full(2, grid.resolution), grid.cells.shape[::-1])
        here, there = (tuple(lattice.index(end).tolist()) for end in (start, goal))
        yield lattice, ~grid.cells.T, (here, there)
        return
    obstacles = obstacle_arrays(world.without_grid())
    for cells in CELLS:
        lattice = Raster.over(world.lower, world.upper, cells)
        free = ~lattice.blocked(obstacles)
        one, other = (nearest_free_cell(lattice, free, obstacles, end) for end in (start, goal))
        yield lattice, free, None if one is None or other is None else (one, other)


def _measured(lattice: Raster, free: Bools, ends: tuple[Cell, Cell], farthest: int) -> Passage:
    """Measure the narrowest place among cells that lead from one end to the other."""
    size = float(lattice.cell.max())
    square = clearance(free, lattice.cell, farthest)
    start, goal = (_roomiest(square, end) for end in ends)
    least, label = _bottleneck(square, start, goal)
    beyond = np.zeros(free.shape, np.bool_)
    if label[start] >= 0 and label[goal] >= 0:
        beyond = label == label[goal]
        row = _neck(square >= least, label, start, goal)
    else:  # one of the ends itself is where there is least room
        row = np.array([start if square[start] <= square[goal] else goal])
    width = 2 * float(np.sqrt(least))
    neck = np.mean(lattice.corners(row), axis=0)
    place = neck[len(neck) // 2]
    return Passage(width - size, width + 2 * size, place, size, lattice, beyond, neck)


def widest(world: World, start: Floats, goal: Floats, cells: int, enough: float) -> float:
    """Prove how wide a disc, or a ball, can be at most that gets from start to goal.

    No point of a cell has more room than there is from its middle to that of a cell with some of
    an obstacle in it, and half a diagonal of each. In a cell that an obstacle fills there is none.
    A way leads through faces of cells; where it goes through a corner, it touches all cells around.

    Args:
        world: The world.
        start: Where the middle of the disc is at first, shape (d,).
        goal: Where it should get.
        cells: Cells of the lattice.
        enough: Widths from here on need not be told apart.

    Returns:
        The greatest width, or inf if that is more than `enough`; 0 where not even a point gets
        through.
    """
    obstacles = obstacle_arrays(world.without_grid())
    lattice = Raster.over(world.lower, world.upper, cells)
    size, diagonal = float(lattice.cell.max()), float(np.hypot.reduce(lattice.cell))
    farthest = int(enough / 2 / size) + 2
    square = clearance(~lattice.blocked(obstacles), lattice.cell, farthest)
    room = np.where(lattice.filled(obstacles), 0.0, (np.sqrt(square) + diagonal) * _SURE)
    one, other = (tuple(lattice.index(end).tolist()) for end in (start, goal))
    label = components(room > 0)
    if label[one] != label[other] or label[one] < 0:
        return 0.0
    width = 2 * _bottleneck(room, one, other)[0]
    return width if width <= enough else np.inf


def clearance(free: Bools, cell: Floats, farthest: int) -> Floats:
    """Measure from each cell's middle to that of the nearest cell that is not free.

    Cells around the lattice are not free. One axis after the other, the least sum of squares is
    taken (Felzenszwalb and Huttenlocher 2012), over so many cells as are of interest.

    Args:
        free: Whether each cell is free.
        cell: Sides of a cell, shape (d,).
        farthest: Distances beyond so many cells are taken to be that.

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


def _roomiest(square: Floats, cell: Cell) -> Cell:
    """Climb from a cell to where there is more room, as long as a cell around has more."""
    around = np.array(list(itertools.product((-1, 0, 1), repeat=len(cell))))
    here = np.array(cell)
    while True:
        cells = here + around
        cells = cells[((cells >= 0) & (cells < square.shape)).all(axis=1)]
        rooms = square[tuple(cells.T)]
        if rooms.max() <= square[tuple(here)]:
            return tuple(here.tolist())
        here = cells[int(rooms.argmax())]


def _bottleneck(square: Floats, start: Cell, goal: Cell) -> tuple[float, Ints]:
    """Find the greatest clearance, as the square or itself, with which cells lead from end to end.

    Returns:
        It, and the sets of cells that hang together and have more, -1 for all others.
    """
    rooms = np.unique(square[square > 0])
    rooms = rooms[rooms <= min(square[start], square[goal])]
    low, high = 0, len(rooms)
    # With the least clearance there is a way; with one beyond the last there is none.
    while high - low > 1:
        middle = (low + high) // 2
        label = components(square >= rooms[middle])
        low, high = (middle, high) if label[start] == label[goal] else (low, middle)
    return float(rooms[low]), components(square > rooms[low])


def _neck(open_: Bools, label: Ints, start: Cell, goal: Cell) -> Ints:
    """Find the longest stretch without room to spare on the way with fewest of it, shape (k, d).

    Args:
        open_: Cells with at least the bottleneck's clearance.
        label: Sets of cells that have more, -1 for others.
        start: A cell of one set.
        goal: A cell of another.
    """
    tight = np.flatnonzero(open_ & (label < 0))
    # Sets of cells are numbered from 0 on, tight cells behind them.
    number, first = label.copy(), int(label.max()) + 1
    number[np.unravel_index(tight, label.shape)] = first + np.arange(len(tight))
    links: dict[int, list[int]] = {}
    for axis in range(label.ndim):
        one, other = (np.moveaxis(number, axis, 0)[part] for part in (slice(-1), slice(1, None)))
        meet = (one >= 0) & (other >= 0) & (one != other)
        for a, b in np.unique(np.stack([one[meet], other[meet]], axis=1), axis=0).tolist():
            links.setdefault(a, []).append(b)
            links.setdefault(b, []).append(a)
    before = _fewest(links, int(label[start]), int(label[goal]), first)
    stretches: list[list[int]] = [[]]
    at = int(label[goal])
    while at != label[start]:
        at = before[at]
        if at >= first:
            stretches[-1].append(at)
        else:
            stretches.append([])
    longest = max(stretches, key=len)
    flat = tight[np.array(longest) - first]
    return np.stack(np.unravel_index(flat, label.shape), axis=1)


def _fewest(links: dict[int, list[int]], start: int, goal: int, first: int) -> dict[int, int]:
    """Search from set to set through as few tight cells as can be; say where each is reached from.

    Numbers from `first` on are tight cells, which cost 1; sets cost nothing.
    """
    before, cost, waiting = {start: start}, {start: 0}, deque([start])
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
                cost[other], before[other] = through, at
                (waiting.append if other >= first else waiting.appendleft)(other)
    return before


__all__ = ["Passage", "clearance", "narrowest", "widest"]
