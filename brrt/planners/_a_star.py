"""A*'s compiled loop."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrt.kernels.emit import Buffer, room
from brrt.kernels.jit import kernel
from brrt.kernels.lattice import (
    Lattice,
    Search,
    begin,
    best_open,
    enter_cells,
    expand,
    lattice_has_room,
    search_has_room,
)

BATCH_FULL, TABLE_FULL, LIMIT, SOLVED, NO_PATH = range(5)
"""Why `advance` returned."""

EXPANSIONS, LAST = range(2)
"""Places in `counts`."""


@kernel
def advance(
    lattice: Lattice,
    search: Search,
    counts: NDArray[np.int64],
    space: Any,
    log: Buffer,
    limit: int,
) -> int:
    """Run until solved, proved hopeless, out of room, or `limit` cells are expanded.

    Args:
        lattice: The cells.
        search: What is open and closed.
        counts: Cells expanded, and the newest of them or -1 before the first; shape (2,).
        space: Configuration space.
        log: Events.
        limit: Cells to expand in all.
    """
    enter_cells(lattice)
    if counts[LAST] < 0:
        counts[LAST] = 0
        begin(search, lattice, 0)
    while True:
        # Room for a cell and its neighbours, and for the path and the end after them.
        if room(log) < len(lattice.deltas) + 3:
            return BATCH_FULL
        if not lattice_has_room(lattice) or not search_has_room(search, lattice):
            return TABLE_FULL
        best = best_open(search)
        if best < 0:
            return NO_PATH
        if counts[EXPANSIONS] >= limit:
            return LIMIT
        counts[EXPANSIONS] += 1
        counts[LAST] = best
        # The straight way on is as long as the estimate: no other path can be shorter.
        if expand(search, lattice, space, log, best, counts[EXPANSIONS]):
            return SOLVED
