"""Which events are kept until the end of a log: all of rare kinds, a selection of the others."""

import numpy as np
from numpy.typing import NDArray

from brrt.events import Events, Kind, Reason, Table
from brrt.scenario.contract import Contract


class SpreadRows:
    """Keeps rows of a long table, evenly spread over it.

    Args:
        dtype: Layout of the table.
        most: The number of rows to keep, at most.
    """

    def __init__(self, dtype: np.dtype[np.void], most: int) -> None:
        self._rows, self._most, self._stride, self._seen = np.empty(0, dtype), most, 1, 0

    def due(self, count: int) -> slice:
        """Return which of the next rows to keep: those of a number that the stride divides."""
        first = -self._seen % self._stride
        self._seen += count
        return slice(first, None, self._stride)

    def add(self, table: Table) -> None:
        """Take the next rows of the table."""
        self.keep(table[self.due(len(table))])

    def keep(self, rows: Table) -> None:
        """Keep rows that `due` has chosen."""
        self._rows = np.concatenate([self._rows, rows])
        while len(self._rows) > 2 * self._most:
            self._rows, self._stride = self._rows[::2], 2 * self._stride

    def rows(self) -> Table:
        """Return the kept rows, no more than wanted."""
        rows = self._rows
        if len(rows) > self._most:
            rows = rows[np.linspace(0, len(rows) - 1, self._most).astype(np.int64)]
        return rows


class _GrowingTable:
    """A table that grows row by row.

    It is one block, which doubles when it is full: large blocks are returned to the system, where
    many small ones would leave holes.
    """

    def __init__(self) -> None:
        self._block: Table | None = None
        self._count = 0

    def add(self, rows: Table) -> None:
        """Append rows; the first ones are not copied."""
        if self._block is None:
            self._block, self._count = rows, len(rows)
            return
        first, self._count = self._count, self._count + len(rows)
        if self._count > len(self._block):
            larger = np.empty(max(self._count, 2 * len(self._block)), rows.dtype)
            larger[:first] = self._block[:first]
            self._block = larger
        self._block[first : self._count] = rows

    def table(self) -> Table | None:
        """Return the rows; None if there are none."""
        return None if self._block is None else self._block[: self._count]


class KeptEvents:
    """The events that rules judge once all have been read.

    For planners that grow trees that is everything but samples and most rejections, which rules
    judge window by window.

    Args:
        dof: Numbers in a configuration.
        contract: What the planner promises.

    Attributes:
        last_iteration: The greatest iteration so far.
        count: Events so far, kept or not.
        kinds: The kinds that have occurred, kept or not.
    """

    def __init__(self, dof: int, contract: Contract) -> None:
        self._dof, self._contract = dof, contract
        self._tables: dict[Kind, _GrowingTable] = {kind: _GrowingTable() for kind in Kind}
        self.last_iteration = self.count = 0
        self.kinds: set[Kind] = set()

    def add(self, window: Events) -> None:
        """Keep what is needed of the next events."""
        for kind, table in window.tables.items():
            if not len(table):
                continue
            self.kinds.add(kind)
            self.count += len(table)
            self.last_iteration = max(self.last_iteration, int(table["iteration"].max()))
            rows = self._needed(kind, table)
            if rows is not None:
                self._tables[kind].add(table if rows.all() else table[rows])

    def _needed(self, kind: Kind, table: Table) -> NDArray[np.bool_] | None:
        if kind is Kind.SAMPLE:
            return None
        if kind is Kind.REJECT and self._contract.lattice is None:
            if self._contract.near is None:
                return None
            return np.asarray(table["reason"] == Reason.NEAR_BLOCKED)
        return np.ones(len(table), bool)

    def events(self) -> Events:
        """Return the kept events."""
        tables = {kind: rows.table() for kind, rows in self._tables.items()}
        return Events(self._dof, {k: table for k, table in tables.items() if table is not None})
