"""LRTA*'s compiled loop."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brrt.events import Kind
from brrt.kernels.emit import Buffer, emit, room
from brrt.kernels.jit import inlined, kernel
from brrt.kernels.lattice import (
    ARRIVES,
    BLOCKED,
    EXPAND,
    HEAPED,
    UNSEEN,
    Lattice,
    Search,
    begin,
    best_open,
    enter_cells,
    exhausted,
    expand,
    is_closed,
    lattice_has_room,
    look,
    pop,
    push,
    search_has_room,
)

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

HEURISTIC, MOVE = int(Kind.HEURISTIC), int(Kind.MOVE)

BATCH_FULL, TABLE_FULL, TRACE_FULL, LIMIT, ARRIVED, NO_PATH = range(6)
"""Why `advance` returned."""

CELL, MOVES, TRIAL, STEP, STAGE, CLOSED, NEXT, END, LAST_LEG = range(9)
"""Places in `Walk.counts`."""

BEGIN, LOOK_AHEAD, LEARN, GO = range(4)
"""What comes next: a search's first cell, its others, what it teaches, and the moves."""


class Walk(NamedTuple):
    """Where the robot is, was and will be, and what it just looked at.

    Attributes:
        trace: Cells of this trial's moves, from the start on, shape (moves,).
        closed: Cells that the search expanded, in that order, shape (lookahead,).
        plan: The search's first cell and those to move to, shape (lookahead + 2,); -1: the goal.
        learnt: Estimates in the making, shape (capacity,).
        length: Length of this trial's moves, shape (1,).
        counts: The robot's cell, moves in all, the trial, its moves, what comes next, cells
            expanded, places in the plan of the next move and after the last, and whether the
            plan ends at the goal; shape (9,).
    """

    trace: Ints
    closed: Ints
    plan: Ints
    learnt: Floats
    length: Floats
    counts: NDArray[np.int64]


@inlined
def raise_estimate(walk: Walk, lattice: Lattice, log: Buffer, cell: int, h: float) -> None:
    """Keep the new estimate of a cell's cost to the goal if it is greater."""
    if h > lattice.h[cell]:
        lattice.h[cell] = h
        emit(log, HEURISTIC, walk.counts[MOVES], cell, 0, 0, h, lattice.q, cell)


@inlined
def plan_arrival(walk: Walk, lattice: Lattice, cell: int, end: int) -> None:
    """Let the plan end at the goal, which is in reach from its last cell or is there already."""
    if lattice.h[cell] > 0.0:
        walk.plan[end] = BLOCKED
        end += 1
    walk.counts[END], walk.counts[LAST_LEG] = end, 1


@inlined
def step_ahead(walk: Walk, lattice: Lattice, space: Any, log: Buffer) -> bool:
    """Look one cell ahead (Korf 1990): learn from the best neighbour and plan to go there.

    Return whether there is anything left to look for.
    """
    cell, moves = int(walk.counts[CELL]), walk.counts[MOVES]
    emit(log, EXPAND, moves, cell, -1, 0, 0.0, lattice.q, cell)
    if lattice.known[cell] == UNSEEN:
        look(lattice, space, log, cell, moves)
    walk.counts[STAGE], walk.counts[NEXT] = GO, 1
    if lattice.known[cell] == ARRIVES:
        plan_arrival(walk, lattice, cell, 1)
        return True
    if exhausted(lattice):
        return False
    best, best_f, best_h = BLOCKED, np.inf, np.inf
    for k in range(len(lattice.deltas)):
        other = int(lattice.near[cell, k])
        if other != BLOCKED:
            h = lattice.h[other]
            f = lattice.costs[k] + h
            if f < best_f or (f == best_f and (h < best_h or (h == best_h and other < best))):
                best, best_f, best_h = other, f, h
    raise_estimate(walk, lattice, log, cell, best_f)
    walk.plan[1], walk.counts[END] = best, 2
    return True


@inlined
def plan_moves(walk: Walk, search: Search, lattice: Lattice, best: int, arrives: bool) -> None:
    """Plan to go where the search leads, and from there to the goal if it is in reach."""
    n, cell = 0, best
    while cell >= 0:
        n += 1
        cell = int(search.parent[cell])
    cell = best
    for i in range(n - 1, -1, -1):
        walk.plan[i] = cell
        cell = int(search.parent[cell])
    walk.counts[NEXT], walk.counts[END] = 1, n
    if arrives:
        plan_arrival(walk, lattice, best, n)


@inlined
def learn(walk: Walk, search: Search, lattice: Lattice, log: Buffer) -> None:
    """Raise the estimates of the expanded cells to what those around them allow.

    By Dijkstra's algorithm from the frontier inwards (Koenig and Sun 2009, section 4); it leaves
    the search's heap empty.
    """
    learnt, n = walk.learnt, int(walk.counts[CLOSED])
    search.counts[HEAPED] = 0
    for i in range(n):
        cell = int(walk.closed[i])
        h = np.inf
        for k in range(len(lattice.deltas)):
            other = int(lattice.near[cell, k])
            if other != BLOCKED and not is_closed(search, other):
                h = min(h, lattice.costs[k] + lattice.h[other])
        learnt[cell] = h
        if h < np.inf:
            push(search, h, h, cell)
    while search.counts[HEAPED] > 0:
        h = search.heap_f[0]
        cell = pop(search)
        if h > learnt[cell]:
            continue
        for k in range(len(lattice.deltas)):
            other = int(lattice.near[cell, k])
            if other != BLOCKED and is_closed(search, other):
                through = lattice.costs[k] + h
                if through < learnt[other]:
                    learnt[other] = through
                    push(search, through, through, other)
    for i in range(n):
        cell = int(walk.closed[i])
        raise_estimate(walk, lattice, log, cell, learnt[cell])


@inlined
def go(walk: Walk, lattice: Lattice, log: Buffer) -> None:
    """Make the next move of the plan."""
    counts = walk.counts
    cell, target = int(counts[CELL]), int(walk.plan[counts[NEXT]])
    counts[NEXT] += 1
    counts[MOVES] += 1
    counts[STEP] += 1
    walk.trace[counts[STEP]] = target
    if target == BLOCKED:
        walk.length[0] += lattice.h[cell]
        emit(
            log, MOVE, counts[MOVES], counts[TRIAL], counts[STEP], target, walk.length[0],
            lattice.goal, 0,
        )  # fmt: skip
        return
    for k in range(len(lattice.deltas)):
        if lattice.near[cell, k] == target:
            walk.length[0] += lattice.costs[k]
            break
    counts[CELL] = target
    emit(
        log, MOVE, counts[MOVES], counts[TRIAL], counts[STEP], target, walk.length[0],
        lattice.q, target,
    )  # fmt: skip


@kernel
def advance(
    walk: Walk,
    lattice: Lattice,
    search: Search,
    space: Any,
    log: Buffer,
    lookahead: int,
    limit: int,
) -> int:
    """Run until at the goal, proved hopeless, out of room, or `limit` moves are made.

    Args:
        walk: The robot's way.
        lattice: The cells.
        search: Where to look ahead.
        space: Configuration space.
        log: Events.
        lookahead: Cells to expand before a move.
        limit: Moves to make in all.
    """
    counts = walk.counts
    enter_cells(lattice)
    while True:
        # Room for what any part below may say, so that none has to stop half-way, and for the
        # path and the end after it.
        if room(log) < max(len(lattice.deltas), lookahead) + 4:
            return BATCH_FULL
        if counts[STAGE] == GO:
            if counts[NEXT] == counts[END]:
                counts[STAGE] = BEGIN
                if counts[LAST_LEG] == 1:
                    return ARRIVED
                continue
            # Whoever stops here has looked and learnt: a run that is cut is always cut alike.
            if counts[MOVES] >= limit:
                return LIMIT
            if counts[STEP] + 1 >= len(walk.trace):
                return TRACE_FULL
            go(walk, lattice, log)
        elif counts[STAGE] == LEARN:
            learn(walk, search, lattice, log)
            counts[STAGE] = GO
        else:
            if not lattice_has_room(lattice) or not search_has_room(search, lattice):
                return TABLE_FULL
            if lookahead == 1:
                if not step_ahead(walk, lattice, space, log):
                    return NO_PATH
                continue
            if counts[STAGE] == BEGIN:
                begin(search, lattice, int(counts[CELL]))
                counts[STAGE], counts[CLOSED] = LOOK_AHEAD, 0
            best = best_open(search)
            if best < 0:
                return NO_PATH
            arrives = False
            if counts[CLOSED] < lookahead:
                arrives = expand(search, lattice, space, log, best, counts[MOVES])
                if not arrives:
                    walk.closed[counts[CLOSED]] = best
                    counts[CLOSED] += 1
                    if exhausted(lattice):
                        return NO_PATH
                    continue
            plan_moves(walk, search, lattice, best, arrives)
            counts[STAGE] = LEARN
