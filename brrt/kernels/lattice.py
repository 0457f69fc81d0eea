"""A lattice of cells around the start and best-first search on it.

Cells are found as they are needed: a hash table maps their integer coordinates from the start,
packed into one key, to their numbers. The neighbours of a cell are kept, so that no motion is
checked twice.
"""

from itertools import combinations, product
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brrt.events import Reason, Stage
from brrt.kernels.arrays import enlarged
from brrt.kernels.emit import (
    Buffer,
    emit_expand,
    emit_path,
    emit_reject,
    point_room,
    room,
    take_points,
)
from brrt.kernels.jit import helper, inline_helper
from brrt.kernels.space import distance, segment_free

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]
Longs = NDArray[np.int64]

_RAW, _COLLISION, _LIMITS = int(Stage.RAW), int(Reason.COLLISION), int(Reason.LIMITS)

MAX_CELLS = 1 << 19
"""Most cells along a side of the bounds: coordinates use at most half of a key's range."""

BLOCKED = -1
"""In place of a neighbour: the motion to it is not free."""

UNSEEN, SPREAD, ARRIVES = range(3)
"""State of a cell: nothing is known; its neighbours are; the goal is reachable by one motion."""

CELLS, HASHED, EXPANDED = range(3)
"""Places in `LatticeArrays.counts`."""

SEARCH, HEAPED = range(2)
"""Places in `SearchArrays.counts`."""

_OPEN, _CLOSED, _MARKS = range(3)
"""A cell's mark is the number of the search times `_MARKS`, plus `_OPEN` or `_CLOSED`."""

_BITS = 21
_OFFSET = 1 << (_BITS - 1)
_MASK = (1 << _BITS) - 1
_SCATTER = 0x1E3779B97F4A7C15
"""2^64 divided by the golden ratio (Knuth 1973, 6.4), without its highest bit to fit int64."""


class LatticeArrays(NamedTuple):
    """The cells of a lattice, numbered 0 (the start), 1, 2 ... in the order of discovery.

    Attributes:
        keys: Coordinates of each cell, 21 bits an axis, shape (capacity,).
        q: Position of each cell, shape (capacity, d); the row after the last is work space.
        h: Estimate of each cell's cost to the goal, shape (capacity,).
        near: Neighbours of each `SPREAD` cell in the order of the directions, or `BLOCKED`; shape
            (capacity, directions).
        known: State of each cell, shape (capacity,).
        slots: Hash table of cell numbers plus 1, 0 in free slots; its length is a power of two, at
            least twice the capacity.
        counts: Number of cells, of cells in `slots`, and of `SPREAD` cells; shape (3,).
        goal: The goal, shape (1, d).
        deltas: Difference of a neighbour's key in each direction, shape (directions,).
        costs: Length of a motion in each direction, shape (directions,).
        opposite: The opposite of each direction, shape (directions,).
        edge: Edge of a cell.
        max_move: The goal is reached by a straight motion of at most this length.
    """

    keys: Longs
    q: Floats
    h: Floats
    near: Ints
    known: NDArray[np.uint8]
    slots: Ints
    counts: Longs
    goal: Floats
    deltas: Longs
    costs: Floats
    opposite: Ints
    edge: float
    max_move: float


class SearchArrays(NamedTuple):
    """A best-first search: the one of A*, or the latest lookahead of LRTA*.

    The open list is a binary heap. A cell that is reached at a lower cost is entered again, and its
    earlier entry is dropped when it is popped.

    Attributes:
        g: Cost of each cell from the search's first cell, shape (capacity,).
        parent: Cell that each cell was reached from, or -1, shape (capacity,).
        mark: Search that reached each cell last, and whether it closed it, shape (capacity,).
        heap_f: g + h of each entry of the heap, shape (heap,).
        heap_h: h of each entry, shape (heap,).
        heap_cell: Cell of each entry, shape (heap,).
        counts: Number of this search, and number of entries of the heap; shape (2,).
    """

    g: Floats
    parent: Ints
    mark: Longs
    heap_f: Floats
    heap_h: Floats
    heap_cell: Ints
    counts: Longs


def directions(dim: int, *, diagonals: bool) -> list[tuple[int, ...]]:
    """Steps to a cell's neighbours, in the order in which they are checked.

    Steps along one axis come first, +x, -x, +y, -y, +z, -z; then those along two axes, then three.
    """
    return [
        tuple(signs[axes.index(k)] if k in axes else 0 for k in range(dim))
        for along in range(1, dim + 1 if diagonals else 2)
        for axes in combinations(range(dim), along)
        for signs in product((1, -1), repeat=along)
    ]


def rooted_lattice(
    start: Floats, goal: Floats, edge: float, max_move: float, capacity: int, *, diagonals: bool
) -> LatticeArrays:
    """Make a lattice whose only cell is the start.

    Args:
        start: Start, shape (d,).
        goal: Goal, shape (d,).
        edge: Edge of a cell.
        max_move: Longest motion to the goal.
        capacity: Number of cells to make room for.
        diagonals: Whether cells that share only a corner or an edge are neighbours.
    """
    steps = directions(len(start), diagonals=diagonals)
    capacity = max(capacity, 2 * len(steps) + 2)
    lattice = LatticeArrays(
        keys=np.empty(capacity, np.int64),
        q=np.empty((capacity, len(start))),
        h=np.empty(capacity),
        near=np.empty((capacity, len(steps)), np.int32),
        known=np.empty(capacity, np.uint8),
        slots=_slots(capacity),
        counts=np.array([1, 0, 0]),
        goal=np.array([goal]),
        deltas=np.array([sum(x << _BITS * k for k, x in enumerate(step)) for step in steps]),
        costs=edge * np.sqrt([sum(map(abs, step)) for step in steps]),
        opposite=np.array([steps.index(tuple(-x for x in step)) for step in steps], np.int32),
        edge=edge,
        max_move=max_move,
    )
    lattice.keys[0] = sum(_OFFSET << _BITS * k for k in range(len(start)))
    lattice.q[0], lattice.known[0] = start, UNSEEN
    # Sum like the kernels, so that equal positions have equal distances.
    square = 0.0
    for a, b in zip(start.tolist(), goal.tolist(), strict=True):
        square += (b - a) * (b - a)
    lattice.h[0] = np.sqrt(square)
    return lattice


def empty_search(capacity: int) -> SearchArrays:
    """Return a search with room for so many cells."""
    return SearchArrays(
        g=np.empty(capacity),
        parent=np.empty(capacity, np.int32),
        mark=np.zeros(capacity, np.int64),
        heap_f=np.empty(2 * capacity),
        heap_h=np.empty(2 * capacity),
        heap_cell=np.empty(2 * capacity, np.int32),
        counts=np.zeros(2, np.int64),
    )


def enlarged_lattice(lattice: LatticeArrays) -> LatticeArrays:
    """Return the same lattice with twice the room; kernels fill its hash table again."""
    larger = lattice._replace(**_doubled(lattice, ("keys", "q", "h", "near", "known")))
    larger.counts[HASHED] = 0
    return larger._replace(slots=_slots(len(larger.keys)))


def enlarged_search(search: SearchArrays) -> SearchArrays:
    """Return the same search with twice the room."""
    names = ("g", "parent", "mark", "heap_f", "heap_h", "heap_cell")
    return search._replace(**_doubled(search, names))


def _slots(capacity: int) -> Ints:
    return np.zeros(1 << (2 * capacity - 1).bit_length(), np.int32)


def _doubled(arrays: LatticeArrays | SearchArrays, names: tuple[str, ...]) -> dict[str, Any]:
    columns = {name: getattr(arrays, name) for name in names}
    return {
        name: enlarged(column, len(column), 2 * len(column)) for name, column in columns.items()
    }


@inline_helper
def lattice_has_room(lattice: LatticeArrays) -> bool:
    """Whether all neighbours of a cell fit."""
    return int(lattice.counts[CELLS]) + len(lattice.deltas) < len(lattice.keys)


@inline_helper
def search_has_room(search: SearchArrays, lattice: LatticeArrays) -> bool:
    """Whether all neighbours of a cell fit into the heap, and all cells into the search."""
    enough = int(search.counts[HEAPED]) + len(lattice.deltas) <= len(search.heap_cell)
    return enough and len(search.mark) == len(lattice.keys)


@inline_helper
def _place(lattice: LatticeArrays, key: int) -> int:
    """Return the slot that holds a key's cell, or the free one for it."""
    slots, keys = lattice.slots, lattice.keys
    last = len(slots) - 1
    place = ((key * _SCATTER) >> 32) & last
    while slots[place] > 0 and keys[slots[place] - 1] != key:
        place = (place + 1) & last
    return place


@helper
def enter_cells(lattice: LatticeArrays) -> None:
    """Enter the cells that are missing into the hash table: the start, or all once enlarged."""
    counts = lattice.counts
    while counts[HASHED] < counts[CELLS]:
        cell = int(counts[HASHED])
        lattice.slots[_place(lattice, int(lattice.keys[cell]))] = cell + 1
        counts[HASHED] = cell + 1


@helper
def find_neighbours(
    lattice: LatticeArrays, space: Any, log: Buffer, cell: int, iteration: int
) -> None:
    """Check whether the goal is reachable from a cell by one motion; if not, find its neighbours.

    A motion is checked once, from the cell with the lesser key, so that the result is the same for
    both cells. Each neighbour that is not reachable is rejected. The log must have room for all.
    """
    q, counts = lattice.q, lattice.counts
    if lattice.h[cell] <= lattice.max_move and segment_free(space, q, cell, lattice.goal, 0):
        lattice.known[cell] = ARRIVES
        return
    for k in range(len(lattice.deltas)):
        key = int(lattice.keys[cell]) + int(lattice.deltas[k])
        place = _place(lattice, key)
        other = int(lattice.slots[place]) - 1
        seen, reason = other >= 0, BLOCKED
        if seen and lattice.known[other] == SPREAD:
            if lattice.near[other, lattice.opposite[k]] == BLOCKED:
                reason = _COLLISION
        else:
            if not seen:
                other = int(counts[CELLS])
                for axis in range(len(space.lower)):
                    along = ((key >> (_BITS * axis)) & _MASK) - _OFFSET
                    x = q[0, axis] + lattice.edge * along
                    q[other, axis] = x
                    if x < space.lower[axis] or x > space.upper[axis]:
                        reason = _LIMITS
            if reason == BLOCKED:
                first, second = cell, other
                if lattice.deltas[k] < 0:
                    first, second = other, cell
                if not segment_free(space, q, first, q, second):
                    reason = _COLLISION
        if reason != BLOCKED:
            lattice.near[cell, k] = BLOCKED
            emit_reject(log, iteration, 0, cell, reason, q, other)
            continue
        lattice.near[cell, k] = other
        if not seen:
            lattice.keys[other] = key
            lattice.h[other] = distance(space, q, other, lattice.goal, 0)
            lattice.known[other] = UNSEEN
            lattice.slots[place] = other + 1
            counts[CELLS] = counts[HASHED] = other + 1
    lattice.known[cell] = SPREAD
    counts[EXPANDED] += 1


@inline_helper
def exhausted(lattice: LatticeArrays) -> bool:
    """Whether all reachable cells are `SPREAD`, so that the goal is not reachable.

    Motions can be reversed, so a goal that was reachable before still is.
    """
    return bool(lattice.counts[EXPANDED] == lattice.counts[CELLS])


@inline_helper
def _before(f: float, h: float, cell: int, search: SearchArrays, at: int) -> bool:
    """Whether an entry precedes another one: by f, then by h, then by the cell's number."""
    if f != search.heap_f[at]:
        return bool(f < search.heap_f[at])
    if h != search.heap_h[at]:
        return bool(h < search.heap_h[at])
    return bool(cell < search.heap_cell[at])


@inline_helper
def _put(search: SearchArrays, at: int, f: float, h: float, cell: int) -> None:
    search.heap_f[at], search.heap_h[at], search.heap_cell[at] = f, h, cell


@inline_helper
def push(search: SearchArrays, f: float, h: float, cell: int) -> None:
    """Push a cell onto the heap."""
    at = int(search.counts[HEAPED])
    search.counts[HEAPED] = at + 1
    while at > 0:
        above = (at - 1) >> 1
        if not _before(f, h, cell, search, above):
            break
        _put(search, at, search.heap_f[above], search.heap_h[above], search.heap_cell[above])
        at = above
    _put(search, at, f, h, cell)


@inline_helper
def pop(search: SearchArrays) -> int:
    """Pop the first cell of the heap."""
    top = int(search.heap_cell[0])
    n = int(search.counts[HEAPED]) - 1
    search.counts[HEAPED] = n
    f, h, cell = search.heap_f[n], search.heap_h[n], int(search.heap_cell[n])
    at, below = 0, 1
    while below < n:
        if below + 1 < n and not _before(
            search.heap_f[below], search.heap_h[below], search.heap_cell[below], search, below + 1
        ):
            below += 1
        if _before(f, h, cell, search, below):
            break
        _put(search, at, search.heap_f[below], search.heap_h[below], search.heap_cell[below])
        at, below = below, 2 * below + 1
    _put(search, at, f, h, cell)
    return top


@inline_helper
def begin(search: SearchArrays, lattice: LatticeArrays, root: int) -> None:
    """Begin a new search at a cell."""
    search.counts[SEARCH] += 1
    search.counts[HEAPED] = 0
    search.g[root], search.parent[root] = 0.0, -1
    search.mark[root] = search.counts[SEARCH] * _MARKS + _OPEN
    push(search, lattice.h[root], lattice.h[root], root)


@inline_helper
def is_closed(search: SearchArrays, cell: int) -> bool:
    """Whether this search has expanded a cell."""
    return bool(search.mark[cell] == search.counts[SEARCH] * _MARKS + _CLOSED)


@inline_helper
def best_open(search: SearchArrays) -> int:
    """Return the cell to expand next, or -1 if there is none."""
    while search.counts[HEAPED] > 0:
        if not is_closed(search, search.heap_cell[0]):
            return int(search.heap_cell[0])
        pop(search)
    return -1


@inline_helper
def expand(
    search: SearchArrays, lattice: LatticeArrays, space: Any, log: Buffer, cell: int, iteration: int
) -> bool:
    """Expand the cell that `best_open` returned; return whether the goal is reachable from it."""
    emit_expand(log, iteration, cell, search.parent[cell], search.g[cell], lattice.q, cell)
    if lattice.known[cell] == UNSEEN:
        find_neighbours(lattice, space, log, cell, iteration)
    if lattice.known[cell] == ARRIVES:
        return True
    pop(search)
    now = search.counts[SEARCH] * _MARKS + _OPEN
    search.mark[cell] = now + _CLOSED
    for k in range(len(lattice.deltas)):
        other = int(lattice.near[cell, k])
        if other == BLOCKED:
            continue
        g = search.g[cell] + lattice.costs[k]
        if search.mark[other] < now or (search.mark[other] == now and g < search.g[other]):
            search.g[other], search.parent[other], search.mark[other] = g, cell, now
            push(search, g + lattice.h[other], lattice.h[other], other)
    return False


@inline_helper
def emit_cell_path(
    lattice: LatticeArrays, log: Buffer, iteration: int, cells: Ints, n: int, cost: float
) -> int:
    """Emit the path along the first n cells, among which `BLOCKED` means the goal.

    Returns:
        0, or n if the log has no room for so many waypoints and nothing was emitted.
    """
    if room(log) < 2 or point_room(log) < n:
        return n
    first = take_points(log, n)
    for i in range(n):
        for k in range(lattice.q.shape[1]):
            at_goal = cells[i] == BLOCKED
            log.points[first + i, k] = lattice.goal[0, k] if at_goal else lattice.q[cells[i], k]
    emit_path(log, iteration, _RAW, cost, first, n)
    return 0
