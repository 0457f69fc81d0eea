"""LRTA*'s compiled loop."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brrt.events import Kind, Status
from brrt.kernels.emit import Buffer, emit, emit_end, room
from brrt.kernels.jit import inline_helper, kernel
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
    emit_way,
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
from brrt.kernels.random import Random
from brrt.planners.base.kernel_planner import (
    BATCH_FULL,
    COUNTED,
    DRAWS,
    ENDED,
    LIMIT,
    OWN,
    POINTS,
    STATE_FULL,
)

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

HEURISTIC, MOVE = int(Kind.HEURISTIC), int(Kind.MOVE)

SOLVED, NO_PATH = int(Status.SOLVED), int(Status.NO_PATH)

MOVES = DRAWS
"""An iteration is a move."""

CELL, TRIAL, STEP, STAGE, CLOSED, NEXT, END, LAST_LEG, AHEAD, COUNTS = range(OWN, OWN + 10)
"""Places in `Walk.counts` of the robot's cell, the trial, its moves, what comes next, cells
expanded, places in the plan of the next move and after the last, whether the plan ends at the goal,
and the lookahead that it was made with; and how many places there are."""

BEGIN, LOOK_AHEAD, LEARN, GO, ARRIVED = range(5)
"""What comes next: a search's first cell, its others, what it teaches, the moves, and the word that
they led to the goal."""


class Options(NamedTuple):
    """What of the settings the loop needs; see `LRTAStar`.

    Attributes:
        lookahead: Cells to expand before a move.
        trials: Times to go to the goal.
        retraces: Whether to stop after the last trial without a word, for there may be more.
    """

    lookahead: int
    trials: int
    retraces: bool


class Walk(NamedTuple):
    """Where the robot is, was and will be, and what it just looked at.

    Attributes:
        lattice: The cells.
        search: Where to look ahead.
        trace: Cells of this trial's moves, from the start on, shape (moves,).
        closed: Cells that the search expanded, in that order, shape (n,).
        plan: The search's first cell and those to move to, shape (n + 2,); -1: the goal.
        learnt: Estimates in the making, shape (capacity,).
        length: Length of this trial's moves, shape (1,).
        counts: See `drive` and above, shape (COUNTS,).
    """

    lattice: Lattice
    search: Search
    trace: Ints
    closed: Ints
    plan: Ints
    learnt: Floats
    length: Floats
    counts: NDArray[np.int64]


@inline_helper
def raise_estimate(walk: Walk, log: Buffer, cell: int, h: float) -> None:
    """Keep the new estimate of a cell's cost to the goal if it is greater."""
    lattice = walk.lattice
    if h > lattice.h[cell]:
        lattice.h[cell] = h
        emit(log, HEURISTIC, walk.counts[MOVES], cell, 0, 0, h, lattice.q, cell)


@inline_helper
def plan_arrival(walk: Walk, cell: int, end: int) -> None:
    """Let the plan end at the goal, which is in reach from its last cell or is there already."""
    if walk.lattice.h[cell] > 0.0:
        walk.plan[end] = BLOCKED
        end += 1
    walk.counts[END], walk.counts[LAST_LEG] = end, 1


@inline_helper
def step_ahead(walk: Walk, space: Any, log: Buffer) -> bool:
    """Look one cell ahead (Korf 1990): learn from the best neighbour and plan to go there.

    Return whether there is anything left to look for.
    """
    lattice, cell, moves = walk.lattice, int(walk.counts[CELL]), walk.counts[MOVES]
    emit(log, EXPAND, moves, cell, -1, 0, 0.0, lattice.q, cell)
    if lattice.known[cell] == UNSEEN:
        look(lattice, space, log, cell, moves)
    walk.counts[STAGE], walk.counts[NEXT] = GO, 1
    if lattice.known[cell] == ARRIVES:
        plan_arrival(walk, cell, 1)
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
    raise_estimate(walk, log, cell, best_f)
    walk.plan[1], walk.counts[END] = best, 2
    return True


@inline_helper
def plan_moves(walk: Walk, best: int, arrives: bool) -> None:
    """Plan to go where the search leads, and from there to the goal if it is in reach."""
    search, n, cell = walk.search, 0, best
    while cell >= 0:
        n += 1
        cell = int(search.parent[cell])
    cell = best
    for i in range(n - 1, -1, -1):
        walk.plan[i] = cell
        cell = int(search.parent[cell])
    walk.counts[NEXT], walk.counts[END] = 1, n
    if arrives:
        plan_arrival(walk, best, n)


@inline_helper
def learn(walk: Walk, log: Buffer) -> None:
    """Raise the estimates of the expanded cells to what those around them allow.

    By Dijkstra's algorithm from the frontier inwards (Koenig and Sun 2009, section 4); it leaves
    the search's heap empty.
    """
    lattice, search, learnt, n = walk.lattice, walk.search, walk.learnt, int(walk.counts[CLOSED])
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
        raise_estimate(walk, log, cell, learnt[cell])


@inline_helper
def go(walk: Walk, log: Buffer) -> None:
    """Make the next move of the plan."""
    lattice, counts = walk.lattice, walk.counts
    cell, target = int(counts[CELL]), int(walk.plan[counts[NEXT]])
    counts[NEXT] += 1
    counts[MOVES] += 1
    counts[COUNTED] = counts[MOVES]
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


@inline_helper
def say_path(walk: Walk, log: Buffer) -> int:
    """Say which way the robot went in the trial that just ended; see `emit_way`."""
    counts = walk.counts
    return emit_way(
        walk.lattice, log, counts[MOVES], walk.trace, int(counts[STEP]) + 1, walk.length[0]
    )


@inline_helper
def return_to_start(walk: Walk) -> None:
    """Begin the next trial."""
    walk.counts[TRIAL] += 1
    walk.counts[CELL] = walk.counts[STEP] = walk.counts[LAST_LEG] = 0
    walk.length[0] = 0.0


@kernel
def advance(
    walk: Walk,
    space: Any,
    rng: Random,  # noqa: ARG001 - it draws nothing
    log: Buffer,
    options: Options,
    limit: int,
    draw_limit: int,
) -> int:
    """Run until at the goal, proved hopeless, out of room, or until that many moves are made."""
    counts, lattice, search, lookahead = walk.counts, walk.lattice, walk.search, options.lookahead
    enter_cells(lattice)
    while True:
        # Room for what any part below may say, so that none has to stop half-way.
        if room(log) < max(len(lattice.deltas), lookahead) + 4:
            return BATCH_FULL
        if counts[STAGE] == GO:
            if counts[NEXT] == counts[END]:
                counts[STAGE] = ARRIVED if counts[LAST_LEG] == 1 else BEGIN
                continue
            if counts[AHEAD] != lookahead:
                # The run goes on with another lookahead, and so with another plan.
                counts[STAGE], counts[LAST_LEG] = BEGIN, 0
                continue
            # Whoever stops here has looked and learnt: a run that is cut is always cut alike.
            if counts[COUNTED] >= limit or counts[MOVES] >= draw_limit:
                return LIMIT
            if counts[STEP] + 1 >= len(walk.trace):
                return STATE_FULL
            go(walk, log)
        elif counts[STAGE] == ARRIVED:
            counts[POINTS] = say_path(walk, log)
            if counts[POINTS] > 0:
                return BATCH_FULL
            return_to_start(walk)
            counts[STAGE] = BEGIN
        elif counts[STAGE] == LEARN:
            learn(walk, log)
            counts[STAGE] = GO
        else:
            if counts[STEP] == 0 and counts[TRIAL] >= options.trials:
                if options.retraces and counts[MOVES] >= draw_limit:
                    return LIMIT
                emit_end(log, counts[MOVES], SOLVED)
                return ENDED
            if not lattice_has_room(lattice) or not search_has_room(search, lattice):
                return STATE_FULL
            counts[AHEAD] = lookahead
            if lookahead == 1:
                if not step_ahead(walk, space, log):
                    emit_end(log, counts[MOVES], NO_PATH)
                    return ENDED
                continue
            if counts[STAGE] == BEGIN:
                begin(search, lattice, int(counts[CELL]))
                counts[STAGE], counts[CLOSED] = LOOK_AHEAD, 0
            best = best_open(search)
            arrives = False
            if best >= 0 and counts[CLOSED] < lookahead:
                arrives = expand(search, lattice, space, log, best, counts[MOVES])
                if not arrives:
                    walk.closed[counts[CLOSED]] = best
                    counts[CLOSED] += 1
                    if not exhausted(lattice):
                        continue
                    best = -1
            if best < 0:
                emit_end(log, counts[MOVES], NO_PATH)
                return ENDED
            plan_moves(walk, best, arrives)
            counts[STAGE] = LEARN
