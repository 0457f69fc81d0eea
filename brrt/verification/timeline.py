"""The events of tree planners in one table, iteration by iteration."""

from collections.abc import Iterable
from collections.abc import Set as AbstractSet
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrt.events import Events, Kind, Source, Table

Ints = NDArray[np.int64]
Floats = NDArray[np.float64]


def row_dtype(dof: int) -> np.dtype[np.void]:
    """Return the layout of a timeline: the fields that the events of tree planners share."""
    return np.dtype(
        [
            ("seq", "<i8"), ("t", "<i8"), ("iteration", "<i8"), ("kind", "u1"), ("tree", "i1"),
            ("why", "i1"), ("node", "<i4"), ("parent", "<i4"), ("q", "<f8", (dof,)),
        ]
    )  # fmt: skip


_FIELDS = {
    Kind.SAMPLE: {"tree": "tree", "why": "source", "q": "q"},
    Kind.REJECT: {"tree": "tree", "why": "reason", "node": "node", "q": "q"},
    Kind.EDGE: {"tree": "tree", "node": "node", "parent": "parent", "q": "q"},
    Kind.REWIRE: {"tree": "tree", "node": "node", "parent": "parent"},
    Kind.CONNECT: {"node": "node", "parent": "other"},
}
"""For each kind, which of its fields each column comes from; the other columns are -1."""


def timeline_of(events: Events) -> Table:
    """Put events into one table, by number.

    `why` is the source of a sample and the reason of a rejection. For a link, `node` is the node
    of tree 0 and `parent` that of tree 1.
    """
    rows = np.zeros(len(events), row_dtype(events.dof))
    rows["tree"] = rows["why"] = rows["node"] = rows["parent"] = -1
    first = 0
    for kind, table in events.tables.items():
        part = rows[first : first + len(table)]
        part["kind"] = kind
        for name in ("seq", "t", "iteration"):
            part[name] = table[name]
        for name, field in _FIELDS.get(kind, {}).items():
            part[name] = table[field]
        first += len(table)
    if (np.diff(rows["seq"]) < 0).any():
        rows = rows[np.argsort(rows["seq"], kind="stable")]
    return rows


class Timeline:
    """Splits the log into whole iterations: from the last sample on, events wait.

    Args:
        dof: Numbers in a configuration.
        firsts: Numbers of events that begin an iteration in any case, since another contract
            applies from there.
    """

    def __init__(self, dof: int, firsts: AbstractSet[int]) -> None:
        self._firsts = firsts
        self._waiting = np.empty(0, row_dtype(dof))

    def next(self, window: Events) -> Table:
        """Return the iterations that end in the next window."""
        rows = np.concatenate([self._waiting, timeline_of(window)])
        samples = np.flatnonzero(rows["kind"] == Kind.SAMPLE)
        end = int(samples[-1]) if len(samples) else 0
        if len(rows) and int(rows["seq"][-1]) + 1 in self._firsts:
            end = len(rows)
        self._waiting = rows[end:]
        return rows[:end]

    def rest(self) -> Table:
        """Return the last iteration, once all windows have been read."""
        return self._waiting


def followed(rows: Table) -> Table:
    """Append the next iteration's first row, of which only the kind is known: a sample."""
    rows = np.append(rows, np.zeros(1, rows.dtype))
    rows["kind"][-1] = Kind.SAMPLE
    return rows


def last_where(chosen: NDArray[np.bool_]) -> Ints:
    """Return for each row the last chosen one up to it, or -1, shape (n,)."""
    return np.maximum.accumulate(np.where(chosen, np.arange(len(chosen)), -1))


def row_keys(columns: Iterable[NDArray[Any]], q: Floats | None = None) -> NDArray[np.uint64]:
    """Return a number for each row of some columns, equal for equal rows, shape (n,).

    Args:
        columns: Columns of whole numbers, shape (n,) each.
        q: Configurations that belong to the rows, shape (n, dof).
    """
    parts = [np.asarray(column).astype(np.uint64) for column in columns]
    if q is not None:
        parts += list(np.ascontiguousarray(q + 0.0).view(np.uint64).reshape(q.shape).T)
    keys = np.zeros(len(parts[0]), np.uint64)
    for part in parts:
        keys = (keys ^ part) * np.uint64(0x9E3779B97F4A7C15)
        keys ^= keys >> np.uint64(29)
    return keys


def aims_at_other_tree(rows: Table) -> NDArray[np.bool_]:
    """Return which rows are samples at the other tree's newest node, shape (n,)."""
    return np.asarray((rows["kind"] == Kind.SAMPLE) & (rows["why"] == Source.OTHER_TREE))
