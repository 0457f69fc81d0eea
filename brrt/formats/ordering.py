"""Put events in order that a file has in another one, as where each kind has chunks of its own."""

import numpy as np

from brrt.events import Events, Kind, Table


class Waiting:
    """Events that wait for earlier ones.

    Args:
        dof: Numbers in a configuration.

    Attributes:
        count: How many wait.
        last: The greatest number of an event that ever waited.
    """

    def __init__(self, dof: int) -> None:
        self._dof, self.count, self.last = dof, 0, -1
        self._tables: dict[Kind, list[Table]] = {}

    def add(self, kind: Kind, table: Table) -> None:
        """Let the events of a table wait."""
        self._tables.setdefault(kind, []).append(table)
        self.count += len(table)
        self.last = max(self.last, int(table["seq"].max(initial=-1)))

    def complete(self, first: int) -> bool:
        """Whether as many events wait as there are from the number `first` to the last one."""
        return self.last + 1 == first + self.count

    def events(self) -> Events:
        """Return all events, in order."""
        tables = {kind: in_order(parts) for kind, parts in sorted(self._tables.items())}
        return Events(self._dof, tables)

    def clear(self) -> None:
        """Let none wait any more."""
        self._tables, self.count = {}, 0

    def before_gap(self, first: int) -> Events:
        """Return the events from the number `first` up to the first that is missing, in order."""
        events = self.events()
        columns = [table["seq"] for table in events.tables.values()]
        seqs = np.unique(np.concatenate([np.empty(0, np.int64), *columns]))
        seqs = seqs[seqs >= first]
        end = first + int((seqs == first + np.arange(len(seqs))).sum())
        tables = dict[Kind, Table]()
        for kind, table in events.tables.items():
            chosen, places = np.unique(table["seq"], return_index=True)
            tables[kind] = table[places[(chosen >= first) & (chosen < end)]]
        return Events(self._dof, {kind: table for kind, table in tables.items() if len(table)})


def in_order(parts: list[Table]) -> Table:
    """Join tables of one kind, ordered by `seq`."""
    table = parts[0] if len(parts) == 1 else np.concatenate(parts)
    if (np.diff(table["seq"]) < 0).any():
        table = table[np.argsort(table["seq"], kind="stable")]
    return table
