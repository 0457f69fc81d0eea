"""A*'s compiled loop."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brrt.events import Status
from brrt.kernels.emit import Buffer, emit_end, room
from brrt.kernels.jit import inline_helper, kernel
from brrt.kernels.lattice import (
    BLOCKED,
    Lattice,
    Search,
    begin,
    best_open,
    emit_way,
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
    POINTS,
    STATE_FULL,
)

SOLVED, NO_PATH = int(Status.SOLVED), int(Status.NO_PATH)

LAST, ARRIVED, COUNTS = range(OWN, OWN + 3)
"""Places in `Frontier.counts` of the newest cell that was expanded or -1, and of whether the goal
is in reach from it; and how many places there are. An iteration is a cell expanded."""


class Options(NamedTuple):
    """The loop has nothing to set: its lattice is laid."""


class Frontier(NamedTuple):
    """The search so far, and the loop's place in it.

    Attributes:
        lattice: The cells.
        search: What is open and closed.
        counts: See `drive` and above, shape (COUNTS,).
    """

    lattice: Lattice
    search: Search
    counts: NDArray[np.int64]


@inline_helper
def say_path(frontier: Frontier, log: Buffer) -> int:
    """Say which way led to the newest cell, and on to the goal; see `emit_way`."""
    lattice, search, cell = frontier.lattice, frontier.search, int(frontier.counts[LAST])
    cost, n, at = search.g[cell], 0, cell
    while at >= 0:
        n += 1
        at = int(search.parent[at])
    # What is still in the heap does not matter any more.
    cells, at = search.heap_cell, cell
    for i in range(n - 1, -1, -1):
        cells[i] = at
        at = int(search.parent[at])
    if lattice.h[cell] > 0.0:
        cost += lattice.h[cell]
        cells[n] = BLOCKED
        n += 1
    return emit_way(lattice, log, frontier.counts[DRAWS], cells, n, cost)


@kernel
def advance(
    frontier: Frontier,
    space: Any,
    rng: Random,  # noqa: ARG001 - it draws nothing
    log: Buffer,
    options: Options,  # noqa: ARG001
    limit: int,
    draw_limit: int,
) -> int:
    """Run until solved, proved hopeless, out of room, or until that many cells are expanded."""
    lattice, search, counts = frontier.lattice, frontier.search, frontier.counts
    enter_cells(lattice)
    if counts[LAST] < 0:
        counts[LAST] = 0
        begin(search, lattice, 0)
    while True:
        if counts[ARRIVED]:
            counts[POINTS] = say_path(frontier, log)
            if counts[POINTS] > 0:
                return BATCH_FULL
            emit_end(log, counts[DRAWS], SOLVED)
            return ENDED
        # Room for a cell and its neighbours, or for the end.
        if room(log) < len(lattice.deltas) + 1:
            return BATCH_FULL
        if not lattice_has_room(lattice) or not search_has_room(search, lattice):
            return STATE_FULL
        best = best_open(search)
        if best < 0:
            emit_end(log, counts[DRAWS], NO_PATH)
            return ENDED
        if counts[COUNTED] >= limit or counts[DRAWS] >= draw_limit:
            return LIMIT
        counts[DRAWS] += 1
        counts[COUNTED] = counts[DRAWS]
        counts[LAST] = best
        # The straight way on is as long as the estimate: no other path can be shorter.
        counts[ARRIVED] = expand(search, lattice, space, log, best, counts[DRAWS])
