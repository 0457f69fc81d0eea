"""A*'s compiled loop."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brrt.events import Status
from brrt.kernels.emit import Buffer, emit_plan_end, paused, room
from brrt.kernels.jit import inline_helper, kernel
from brrt.kernels.lattice import (
    BLOCKED,
    LatticeArrays,
    SearchArrays,
    begin,
    best_open,
    emit_cell_path,
    enter_cells,
    expand,
    lattice_has_room,
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

SOLVED, NO_PATH = int(Status.SOLVED), int(Status.NO_PATH)

LAST, ARRIVED, COUNTS = range(OWN, OWN + 3)
"""Places in `AStarState.counts`: the cell that was expanded last or -1, and whether the goal is
reachable from it; and the number of places. An iteration expands a cell."""


class AStarOptions(NamedTuple):
    """No settings: the lattice holds them all."""


class AStarState(NamedTuple):
    """The search and the state of the loop.

    Attributes:
        lattice: The cells.
        search: The open list and the closed cells.
        counts: See `kernel_planner` and above, shape (COUNTS,).
    """

    lattice: LatticeArrays
    search: SearchArrays
    counts: NDArray[np.int64]


@inline_helper
def report_path(state: AStarState, log: Buffer) -> int:
    """Emit the path over the last cell to the goal; see `emit_cell_path`."""
    lattice, search, cell = state.lattice, state.search, int(state.counts[LAST])
    cost, n, at = search.g[cell], 0, cell
    while at >= 0:
        n += 1
        at = int(search.parent[at])
    # The heap is not needed any more.
    cells, at = search.heap_cell, cell
    for i in range(n - 1, -1, -1):
        cells[i] = at
        at = int(search.parent[at])
    if lattice.h[cell] > 0.0:
        cost += lattice.h[cell]
        cells[n] = BLOCKED
        n += 1
    return emit_cell_path(lattice, log, state.counts[DRAWS], cells, n, cost)


@kernel
def advance(
    state: AStarState,
    space: Any,
    rng: Random,  # noqa: ARG001 - it draws nothing
    log: Buffer,
    options: AStarOptions,  # noqa: ARG001
    limit: int,
    draw_limit: int,
) -> int:
    """Run until solved, proved infeasible, out of room, or until `limit` cells are expanded."""
    lattice, search, counts = state.lattice, state.search, state.counts
    enter_cells(lattice)
    if counts[LAST] < 0:
        counts[LAST] = 0
        begin(search, lattice, 0)
    while True:
        if counts[ARRIVED]:
            counts[POINTS] = report_path(state, log)
            if counts[POINTS] > 0:
                return BATCH_FULL
            emit_plan_end(log, counts[DRAWS], SOLVED)
            return ENDED
        # Events of a cell and its neighbours, or of the end.
        if room(log) < len(lattice.deltas) + 1:
            return BATCH_FULL
        if not lattice_has_room(lattice) or not search_has_room(search, lattice):
            return STATE_FULL
        best = best_open(search)
        if best < 0:
            emit_plan_end(log, counts[DRAWS], NO_PATH)
            return ENDED
        if counts[COUNTED] >= limit or counts[DRAWS] >= draw_limit:
            return LIMIT
        if paused(log):
            return PAUSED
        counts[DRAWS] += 1
        counts[COUNTED] = counts[DRAWS]
        counts[LAST] = best
        # The motion to the goal is as long as the estimate, so no other path is shorter.
        counts[ARRIVED] = expand(search, lattice, space, log, best, counts[DRAWS])
