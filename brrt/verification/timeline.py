"""A log as a planner acts it out: iteration after iteration, in one table."""

from collections.abc import Iterable
from collections.abc import Set as AbstractSet
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrt.events import Events, Kind, Source, Table

Ints = NDArray[np.int64]
Floats = NDArray[np.float64]


def script_dtype(dof: int) -> np.dtype[np.void]:
    """Layout of a script: what the kinds of a tree planner's events have in common."""
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
"""For each kind, what the script's columns are filled from; the others stay -1."""


def script(events: Events) -> Table:
    """Put events into one table, by number; `why` is a sample's source, a rejection's reason.

    Of a link, `node` is the node of tree 0 and `parent` that of tree 1.
    """
    lines = np.zeros(len(events), script_dtype(events.dof))
    lines["tree"] = lines["why"] = lines["node"] = lines["parent"] = -1
    at = 0
    for kind, table in events.tables.items():
        part = lines[at : at + len(table)]
        part["kind"] = kind
        for name in ("seq", "t", "iteration"):
            part[name] = table[name]
        for name, field in _FIELDS.get(kind, {}).items():
            part[name] = table[field]
        at += len(table)
    if (np.diff(lines["seq"]) < 0).any():
        lines = lines[np.argsort(lines["seq"], kind="stable")]
    return lines


class Scripts:
    """Scripts of whole iterations: what follows the last sample waits for the next window.

    Several rules ask for the script of the same window; it is made once.

    Args:
        dof: Numbers in a configuration.
        firsts: Events that an iteration begins with in any case, since other settings rule it.
        growing: Whether trees grow; else there are no samples, and nothing is acted out.
    """

    def __init__(self, dof: int, firsts: AbstractSet[int], *, growing: bool = True) -> None:
        self._firsts, self._growing = firsts, growing
        self._window: Events | None = None
        self._held = self._made = np.empty(0, script_dtype(dof))
        self._ended = False

    def of(self, window: Events | None) -> Table:
        """Return the iterations that end in a window; at the end of the log, the last one."""
        if not self._growing:
            return self._made
        if window is None:
            if not self._ended:
                self._made, self._ended = self._held, True
        elif window is not self._window:
            lines = np.concatenate([self._held, script(window)])
            samples = np.flatnonzero(lines["kind"] == Kind.SAMPLE)
            end = int(samples[-1]) if len(samples) else 0
            if len(lines) and int(lines["seq"][-1]) + 1 in self._firsts:
                end = len(lines)
            self._made, self._held, self._window = lines[:end], lines[end:], window
        return self._made


def followed(lines: Table) -> Table:
    """Add to a script what the next one begins with, a sample, of which only that is known."""
    lines = np.append(lines, np.zeros(1, lines.dtype))
    lines["kind"][-1] = Kind.SAMPLE
    return lines


def last_where(chosen: NDArray[np.bool_]) -> Ints:
    """For each line the last one up to it that is chosen, or -1, shape (n,)."""
    return np.maximum.accumulate(np.where(chosen, np.arange(len(chosen)), -1))


def numbered(parts: Iterable[NDArray[Any]], q: Floats | None = None) -> NDArray[np.uint64]:
    """One number for each row of what is in columns; rows that are equal have equal numbers.

    Args:
        parts: Columns of whole numbers, shape (n,) each.
        q: Configurations besides, shape (n, dof).
    """
    columns = [np.asarray(part).astype(np.uint64) for part in parts]
    if q is not None:
        columns += list(np.ascontiguousarray(q + 0.0).view(np.uint64).reshape(q.shape).T)
    keys = np.zeros(len(columns[0]), np.uint64)
    for column in columns:
        keys = (keys ^ column) * np.uint64(0x9E3779B97F4A7C15)
        keys ^= keys >> np.uint64(29)
    return keys


def heads_for_other(lines: Table) -> NDArray[np.bool_]:
    """Which lines are samples by which a tree heads for the other's newest node, shape (n,)."""
    return np.asarray((lines["kind"] == Kind.SAMPLE) & (lines["why"] == Source.OTHER_TREE))
