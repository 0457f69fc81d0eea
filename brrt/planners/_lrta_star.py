"""LRTA*'s compiled loop."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brrt.events import Status
from brrt.kernels.emit import (
    Buffer,
    emit_expand,
    emit_heuristic,
    emit_move,
    emit_plan_end,
    paused,
    room,
)
from brrt.kernels.jit import inline_helper, kernel
from brrt.kernels.lattice import (
    ARRIVES,
    BLOCKED,
    HEAPED,
    UNSEEN,
    LatticeArrays,
    SearchArrays,
    begin,
    best_open,
    emit_cell_path,
    enter_cells,
    exhausted,
    expand,
    find_neighbours,
    is_closed,
    lattice_has_room,
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
    PAUSED,
    POINTS,
    STATE_FULL,
)

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

SOLVED, NO_PATH = int(Status.SOLVED), int(Status.NO_PATH)

MOVES = DRAWS
"""An iteration is a move."""

CELL, TRIAL, STEP, STAGE, CLOSED, NEXT, END, LAST_LEG, LOOKAHEAD, COUNTS = range(OWN, OWN + 10)
"""Places in `LRTAStarState.counts`: the robot's cell, the trial, its moves, the stage, cells
expanded, the indices in the plan of the next move and after the last, whether the plan ends at the
goal, and the lookahead that it was made with; and the number of places."""

BEGIN, LOOK_AHEAD, LEARN, GO, ARRIVED = range(5)
"""Stages: begin a search, continue it, learn from it, move, emit the path of the trial."""


class LRTAStarOptions(NamedTuple):
    """The settings that the loop needs; see `LRTAStar`.

    Attributes:
        lookahead: Cells to expand before a move.
        trials: Times to go to the goal.
        open_ended: Whether to stop after the last trial without the end of planning, because the
            run may continue with more trials.
    """

    lookahead: int
    trials: int
    open_ended: bool


class LRTAStarState(NamedTuple):
    """The lattice, the latest search, and the robot's past and planned moves.

    Attributes:
        lattice: The cells.
        search: The latest lookahead.
        trace: Cells of this trial's moves, from the start on, shape (moves,).
        closed: Cells that the search expanded, in that order, shape (n,).
        plan: The search's first cell and those to move to, shape (n + 2,); -1: the goal.
        learned: Estimates while they are learned, shape (capacity,).
        length: Length of this trial's moves, shape (1,).
        counts: See `kernel_planner` and above, shape (COUNTS,).
    """

    lattice: LatticeArrays
    search: SearchArrays
    trace: Ints
    closed: Ints
    plan: Ints
    learned: Floats
    length: Floats
    counts: NDArray[np.int64]


@inline_helper
def raise_estimate(state: LRTAStarState, log: Buffer, cell: int, h: float) -> None:
    """Set the estimate of a cell's cost to the goal if the new one is greater."""
    lattice = state.lattice
    if h > lattice.h[cell]:
        lattice.h[cell] = h
        emit_heuristic(log, state.counts[MOVES], cell, h, lattice.q, cell)


@inline_helper
def plan_arrival(state: LRTAStarState, cell: int, end: int) -> None:
    """End the plan at the goal, which is reachable from its last cell or equal to it."""
    if state.lattice.h[cell] > 0.0:
        state.plan[end] = BLOCKED
        end += 1
    state.counts[END], state.counts[LAST_LEG] = end, 1


@inline_helper
def step_ahead(state: LRTAStarState, space: Any, log: Buffer) -> bool:
    """Look one cell ahead (Korf 1990): learn from the best neighbour and plan to move there.

    Returns:
        Whether the goal may still be reachable.
    """
    lattice, cell, moves = state.lattice, int(state.counts[CELL]), state.counts[MOVES]
    emit_expand(log, moves, cell, -1, 0.0, lattice.q, cell)
    if lattice.known[cell] == UNSEEN:
        find_neighbours(lattice, space, log, cell, moves)
    state.counts[STAGE], state.counts[NEXT] = GO, 1
    if lattice.known[cell] == ARRIVES:
        plan_arrival(state, cell, 1)
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
    raise_estimate(state, log, cell, best_f)
    state.plan[1], state.counts[END] = best, 2
    return True


@inline_helper
def plan_moves(state: LRTAStarState, best: int, arrives: bool) -> None:
    """Plan to move to the best cell, and from there to the goal if it is reachable."""
    search, n, cell = state.search, 0, best
    while cell >= 0:
        n += 1
        cell = int(search.parent[cell])
    cell = best
    for i in range(n - 1, -1, -1):
        state.plan[i] = cell
        cell = int(search.parent[cell])
    state.counts[NEXT], state.counts[END] = 1, n
    if arrives:
        plan_arrival(state, best, n)


@inline_helper
def learn(state: LRTAStarState, log: Buffer) -> None:
    """Raise the estimates of the expanded cells to the least that the cells around them allow.

    Dijkstra's algorithm from the frontier inwards (Koenig and Sun 2009, section 4); the heap of the
    search is empty afterwards.
    """
    lattice, search, learned, n = (
        state.lattice,
        state.search,
        state.learned,
        int(state.counts[CLOSED]),
    )
    search.counts[HEAPED] = 0
    for i in range(n):
        cell = int(state.closed[i])
        h = np.inf
        for k in range(len(lattice.deltas)):
            other = int(lattice.near[cell, k])
            if other != BLOCKED and not is_closed(search, other):
                h = min(h, lattice.costs[k] + lattice.h[other])
        learned[cell] = h
        if h < np.inf:
            push(search, h, h, cell)
    while search.counts[HEAPED] > 0:
        h = search.heap_f[0]
        cell = pop(search)
        if h > learned[cell]:
            continue
        for k in range(len(lattice.deltas)):
            other = int(lattice.near[cell, k])
            if other != BLOCKED and is_closed(search, other):
                through = lattice.costs[k] + h
                if through < learned[other]:
                    learned[other] = through
                    push(search, through, through, other)
    for i in range(n):
        cell = int(state.closed[i])
        raise_estimate(state, log, cell, learned[cell])


@inline_helper
def go(state: LRTAStarState, log: Buffer) -> None:
    """Make the next move of the plan."""
    lattice, counts = state.lattice, state.counts
    cell, target = int(counts[CELL]), int(state.plan[counts[NEXT]])
    counts[NEXT] += 1
    counts[MOVES] += 1
    counts[COUNTED] = counts[MOVES]
    counts[STEP] += 1
    state.trace[counts[STEP]] = target
    if target == BLOCKED:
        state.length[0] += lattice.h[cell]
        trial, step, length = counts[TRIAL], counts[STEP], state.length[0]
        emit_move(log, counts[MOVES], trial, step, target, length, lattice.goal, 0)
        return
    for k in range(len(lattice.deltas)):
        if lattice.near[cell, k] == target:
            state.length[0] += lattice.costs[k]
            break
    counts[CELL] = target
    trial, step, length = counts[TRIAL], counts[STEP], state.length[0]
    emit_move(log, counts[MOVES], trial, step, target, length, lattice.q, target)


@inline_helper
def report_path(state: LRTAStarState, log: Buffer) -> int:
    """Emit the path of the trial that has ended; see `emit_cell_path`."""
    n, moves = int(state.counts[STEP]) + 1, state.counts[MOVES]
    return emit_cell_path(state.lattice, log, moves, state.trace, n, state.length[0])


@inline_helper
def return_to_start(state: LRTAStarState) -> None:
    """Begin the next trial."""
    state.counts[TRIAL] += 1
    state.counts[CELL] = state.counts[STEP] = state.counts[LAST_LEG] = 0
    state.length[0] = 0.0


@kernel
def advance(
    state: LRTAStarState,
    space: Any,
    rng: Random,  # noqa: ARG001 - it draws nothing
    log: Buffer,
    options: LRTAStarOptions,
    limit: int,
    draw_limit: int,
) -> int:
    """Run until at the goal, proved infeasible, out of room, or until `limit` moves are made."""
    counts, lattice, search, lookahead = (
        state.counts,
        state.lattice,
        state.search,
        options.lookahead,
    )
    enter_cells(lattice)
    while True:
        # Events of any stage below, so that none has to stop in the middle.
        if room(log) < max(len(lattice.deltas), lookahead) + 4:
            return BATCH_FULL
        if counts[STAGE] == GO:
            if counts[NEXT] == counts[END]:
                counts[STAGE] = ARRIVED if counts[LAST_LEG] == 1 else BEGIN
                continue
            if counts[LOOKAHEAD] != lookahead:
                # The run continues with another lookahead, so it needs another plan.
                counts[STAGE], counts[LAST_LEG] = BEGIN, 0
                continue
            # Stop only here, after learning: runs with different budgets have the same prefix.
            if counts[COUNTED] >= limit or counts[MOVES] >= draw_limit:
                return LIMIT
            if paused(log):
                return PAUSED
            if counts[STEP] + 1 >= len(state.trace):
                return STATE_FULL
            go(state, log)
        elif counts[STAGE] == ARRIVED:
            counts[POINTS] = report_path(state, log)
            if counts[POINTS] > 0:
                return BATCH_FULL
            return_to_start(state)
            counts[STAGE] = BEGIN
        elif counts[STAGE] == LEARN:
            learn(state, log)
            counts[STAGE] = GO
        else:
            if counts[STEP] == 0 and counts[TRIAL] >= options.trials:
                if options.open_ended and counts[MOVES] >= draw_limit:
                    return LIMIT
                emit_plan_end(log, counts[MOVES], SOLVED)
                return ENDED
            if paused(log):
                return PAUSED
            if not lattice_has_room(lattice) or not search_has_room(search, lattice):
                return STATE_FULL
            counts[LOOKAHEAD] = lookahead
            if lookahead == 1:
                if not step_ahead(state, space, log):
                    emit_plan_end(log, counts[MOVES], NO_PATH)
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
                    state.closed[counts[CLOSED]] = best
                    counts[CLOSED] += 1
                    if not exhausted(lattice):
                        continue
                    best = -1
            if best < 0:
                emit_plan_end(log, counts[MOVES], NO_PATH)
                return ENDED
            plan_moves(state, best, arrives)
            counts[STAGE] = LEARN
