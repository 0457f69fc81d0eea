"""A lattice of cells around the start, found as they are needed, and the best-first search on it.

Cells are implicit: integer coordinates from the start, packed into one key, behind a hash table.
What is found about a cell's neighbours is kept, so that a second visit checks no motion.
"""

from itertools import combinations, product
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from brrt.events import Kind, Reason, Stage
from brrt.kernels.emit import Buffer, emit, point_room, room, take_points
from brrt.kernels.jit import helper, inline_helper
from brrt.kernels.space import distance, segment_free

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]
Longs = NDArray[np.int64]
Columns = TypeVar("Columns", "Lattice", "Search")

EXPAND, REJECT = int(Kind.EXPAND), int(Kind.REJECT)
_PATH, _RAW = int(Kind.PATH), int(Stage.RAW)
COLLISION, LIMITS = int(Reason.COLLISION), int(Reason.LIMITS)

MOST_CELLS = 1 << 19
"""Cells along a side of the bounds, at most: coordinates stay within half of what a key holds."""

BLOCKED = -1

UNSEEN, SPREAD, ARRIVES = range(3)
"""What is known of a cell: nothing; its neighbours; that the goal can be reached from it."""

CELLS, HASHED, EXPANDED = range(3)
"""Places in `Lattice.counts`."""

SEARCH, HEAPED = range(2)
"""Places in `Search.counts`."""

_OPEN, _CLOSED, _MARKS = range(3)
"""What `Search.mark` adds to the search's number, and the stride of these numbers."""

_BITS = 21
_OFFSET = 1 << (_BITS - 1)
_MASK = (1 << _BITS) - 1
_SCATTER = 0x1E3779B97F4A7C15
"""2^64 over the golden ratio (Knuth 1973, 6.4) less its highest bit, which would not fit."""


class Lattice(NamedTuple):
    """What is known of the lattice; a cell is numbered 0 (the start's), 1, 2 ... as first seen.

    Attributes:
        keys: Each cell's coordinates, 21 bits an axis, shape (capacity,).
        q: Each cell's position, shape (capacity, d); the row after the last is scratch.
        h: Estimate of each cell's cost to the goal, shape (capacity,).
        near: Each cell's neighbours in the order of the directions, or `BLOCKED`; known once the
            cell is `SPREAD`; shape (capacity, directions).
        known: What is known of each cell, shape (capacity,).
        slots: Hash table: a cell's number plus 1, or 0; a power of two, at least twice as many.
        counts: Cells, cells entered into `slots`, and cells whose neighbours are known; shape (3,).
        goal: The goal, shape (1, d).
        deltas: What each direction adds to a key, shape (directions,).
        costs: Length of a motion in each direction, shape (directions,).
        opposite: The direction that leads back, shape (directions,).
        epsilon: Edge of a cell.
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
    epsilon: float
    max_move: float


class Search(NamedTuple):
    """A best-first search: A*'s only one, or one of those before each of LRTA*'s moves.

    Attributes:
        g: Cost of each cell from the search's first, shape (capacity,).
        parent: The cell that each was reached from, or -1, shape (capacity,).
        mark: Which search saw the cell last, and whether it closed it, shape (capacity,).
        heap_f: g + h of what is open, a binary heap, shape (heap,). A cell that is reached at
            less cost is entered again; what is left of the earlier entry is dropped on its way out.
        heap_h: Its estimate, shape (heap,).
        heap_cell: Its cell, shape (heap,).
        counts: Number of this search, and entries of the heap; shape (2,).
    """

    g: Floats
    parent: Ints
    mark: Longs
    heap_f: Floats
    heap_h: Floats
    heap_cell: Ints
    counts: Longs


def directions(dim: int, *, diagonals: bool) -> list[tuple[int, ...]]:
    """Steps to a cell's neighbours, in the order in which they are looked at.

    Those along one axis come first, +x, -x, +y, -y, +z, -z; then those along two, then three.
    """
    return [
        tuple(signs[axes.index(k)] if k in axes else 0 for k in range(dim))
        for along in range(1, dim + 1 if diagonals else 2)
        for axes in combinations(range(dim), along)
        for signs in product((1, -1), repeat=along)
    ]


def rooted_lattice(
    start: Floats, goal: Floats, epsilon: float, max_move: float, capacity: int, *, diagonals: bool
) -> Lattice:
    """Make a lattice that knows the start's cell alone.

    Args:
        start: Origin, shape (d,).
        goal: Where to, shape (d,).
        epsilon: Edge of a cell.
        max_move: Longest motion to the goal.
        capacity: Cells to make room for; memory is taken only as they come.
        diagonals: Whether cells that share a corner or an edge are neighbours.
    """
    steps = directions(len(start), diagonals=diagonals)
    capacity = max(capacity, 2 * len(steps) + 2)
    lattice = Lattice(
        keys=np.empty(capacity, np.int64),
        q=np.empty((capacity, len(start))),
        h=np.empty(capacity),
        near=np.empty((capacity, len(steps)), np.int32),
        known=np.empty(capacity, np.uint8),
        slots=_slots(capacity),
        counts=np.array([1, 0, 0]),
        goal=np.array([goal]),
        deltas=np.array([sum(x << _BITS * k for k, x in enumerate(step)) for step in steps]),
        costs=epsilon * np.sqrt([sum(map(abs, step)) for step in steps]),
        opposite=np.array([steps.index(tuple(-x for x in step)) for step in steps], np.int32),
        epsilon=epsilon,
        max_move=max_move,
    )
    lattice.keys[0] = sum(_OFFSET << _BITS * k for k in range(len(start)))
    lattice.q[0], lattice.known[0] = start, UNSEEN
    # Summed as kernels sum, so that equal positions have equal distances.
    square = 0.0
    for a, b in zip(start.tolist(), goal.tolist(), strict=True):
        square += (b - a) * (b - a)
    lattice.h[0] = np.sqrt(square)
    return lattice


def empty_search(capacity: int) -> Search:
    """Make room for a search among so many cells."""
    return Search(
        g=np.empty(capacity),
        parent=np.empty(capacity, np.int32),
        mark=np.zeros(capacity, np.int64),
        heap_f=np.empty(2 * capacity),
        heap_h=np.empty(2 * capacity),
        heap_cell=np.empty(2 * capacity, np.int32),
        counts=np.zeros(2, np.int64),
    )


def grown_lattice(lattice: Lattice) -> Lattice:
    """Return the same lattice with twice the room; kernels fill its hash table anew."""
    larger = _doubled(lattice, ("keys", "q", "h", "near", "known"))
    larger.counts[HASHED] = 0
    return larger._replace(slots=_slots(len(larger.keys)))


def grown_search(search: Search) -> Search:
    """Return the same search with twice the room."""
    return _doubled(search, ("g", "parent", "mark", "heap_f", "heap_h", "heap_cell"))


def _slots(capacity: int) -> Ints:
    return np.zeros(1 << (2 * capacity - 1).bit_length(), np.int32)


def _doubled(columns: Columns, names: tuple[str, ...]) -> Columns:
    larger: dict[str, Any] = {}
    for name in names:
        old: NDArray[Any] = getattr(columns, name)
        larger[name] = np.zeros((2 * len(old), *old.shape[1:]), old.dtype)
        larger[name][: len(old)] = old
    return columns._replace(**larger)


@inline_helper
def lattice_has_room(lattice: Lattice) -> bool:
    """Whether all neighbours of a cell fit."""
    return int(lattice.counts[CELLS]) + len(lattice.deltas) < len(lattice.keys)


@inline_helper
def search_has_room(search: Search, lattice: Lattice) -> bool:
    """Whether all neighbours of a cell can be opened."""
    enough = int(search.counts[HEAPED]) + len(lattice.deltas) <= len(search.heap_cell)
    return enough and len(search.mark) == len(lattice.keys)


@inline_helper
def _place(lattice: Lattice, key: int) -> int:
    """Find the slot of a key: where its cell stands, or the free one where it belongs."""
    slots, keys = lattice.slots, lattice.keys
    last = len(slots) - 1
    place = ((key * _SCATTER) >> 32) & last
    while slots[place] > 0 and keys[slots[place] - 1] != key:
        place = (place + 1) & last
    return place


@helper
def enter_cells(lattice: Lattice) -> None:
    """Enter into the hash table what is not in it yet: the start, or all after it grew."""
    counts = lattice.counts
    while counts[HASHED] < counts[CELLS]:
        cell = int(counts[HASHED])
        lattice.slots[_place(lattice, int(lattice.keys[cell]))] = cell + 1
        counts[HASHED] = cell + 1


@helper
def look(lattice: Lattice, space: Any, log: Buffer, cell: int, iteration: int) -> None:
    """See whether the goal can be reached from a cell; if not, find its neighbours.

    A motion is checked once, from the cell of the lesser key, so that both its ends see the same.
    Each neighbour that cannot be reached is reported. The caller saw to it that there is room.
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
                reason = COLLISION
        else:
            if not seen:
                other = int(counts[CELLS])
                for axis in range(len(space.lower)):
                    along = ((key >> (_BITS * axis)) & _MASK) - _OFFSET
                    x = q[0, axis] + lattice.epsilon * along
                    q[other, axis] = x
                    if x < space.lower[axis] or x > space.upper[axis]:
                        reason = LIMITS
            if reason == BLOCKED:
                first, second = cell, other
                if lattice.deltas[k] < 0:
                    first, second = other, cell
                if not segment_free(space, q, first, q, second):
                    reason = COLLISION
        if reason != BLOCKED:
            lattice.near[cell, k] = BLOCKED
            emit(log, REJECT, iteration, 0, cell, reason, 0.0, q, other)
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
def exhausted(lattice: Lattice) -> bool:
    """Whether all that can be reached has been seen, and the goal from nowhere.

    Motions lead both ways, so a goal that had been in reach once would still be.
    """
    return bool(lattice.counts[EXPANDED] == lattice.counts[CELLS])


@inline_helper
def _before(f: float, h: float, cell: int, search: Search, at: int) -> bool:
    """Whether an entry goes before another: less f, then less h, then the lesser number."""
    if f != search.heap_f[at]:
        return bool(f < search.heap_f[at])
    if h != search.heap_h[at]:
        return bool(h < search.heap_h[at])
    return bool(cell < search.heap_cell[at])


@inline_helper
def _put(search: Search, at: int, f: float, h: float, cell: int) -> None:
    search.heap_f[at], search.heap_h[at], search.heap_cell[at] = f, h, cell


@inline_helper
def push(search: Search, f: float, h: float, cell: int) -> None:
    """Enter a cell into the heap."""
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
def pop(search: Search) -> int:
    """Take the first cell from the heap."""
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
def begin(search: Search, lattice: Lattice, root: int) -> None:
    """Begin a search at a cell."""
    search.counts[SEARCH] += 1
    search.counts[HEAPED] = 0
    search.g[root], search.parent[root] = 0.0, -1
    search.mark[root] = search.counts[SEARCH] * _MARKS + _OPEN
    push(search, lattice.h[root], lattice.h[root], root)


@inline_helper
def is_closed(search: Search, cell: int) -> bool:
    """Whether this search expanded a cell."""
    return bool(search.mark[cell] == search.counts[SEARCH] * _MARKS + _CLOSED)


@inline_helper
def best_open(search: Search) -> int:
    """Return the cell to expand next, or -1 where there is none."""
    while search.counts[HEAPED] > 0:
        if not is_closed(search, search.heap_cell[0]):
            return int(search.heap_cell[0])
        pop(search)
    return -1


@inline_helper
def expand(
    search: Search, lattice: Lattice, space: Any, log: Buffer, cell: int, iteration: int
) -> bool:
    """Expand the cell that `best_open` returned; return whether the goal is in reach from it."""
    emit(log, EXPAND, iteration, cell, search.parent[cell], 0, search.g[cell], lattice.q, cell)
    if lattice.known[cell] == UNSEEN:
        look(lattice, space, log, cell, iteration)
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
def emit_way(
    lattice: Lattice, log: Buffer, iteration: int, cells: Ints, n: int, cost: float
) -> int:
    """Say that there is a path along the first n cells, where `BLOCKED` stands for the goal.

    Returns:
        0, or n where so many waypoints do not fit into the log any more; then nothing was said.
    """
    if room(log) < 2 or point_room(log) < n:
        return n
    first = take_points(log, n)
    for i in range(n):
        for k in range(lattice.q.shape[1]):
            at_goal = cells[i] == BLOCKED
            log.points[first + i, k] = lattice.goal[0, k] if at_goal else lattice.q[cells[i], k]
    emit(log, _PATH, iteration, _RAW, first, n, cost, lattice.q, 0)
    return 0
