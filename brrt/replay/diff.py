"""Where two logs part: event by event, whatever the clock said."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrt.events import FIELDS, Events, Kind, Table


@dataclass(frozen=True, slots=True)
class Difference:
    """The first event that is not the same in both logs.

    Attributes:
        seq: Its number.
        left: It in the first log, fields by name and `kind`; None where that log has ended.
        right: It in the second.
    """

    seq: int
    left: dict[str, Any] | None
    right: dict[str, Any] | None

    def __str__(self) -> str:
        left, right = self.left, self.right
        if left is None or right is None:
            which, other = ("first", right) if left is None else ("second", left)
            return (
                f"event {self.seq}: the {which} run has ended; the other has {_text(other or {})}"
            )
        if left["kind"] != right["kind"]:
            return f"event {self.seq}: {_text(left)} against {_text(right)}"
        parts = [
            f"{name} {_value(left[name])} against {_value(right[name])}"
            for name in left
            if not same(left[name], right[name])
        ]
        return f"event {self.seq} ({left['kind']}): {'; '.join(parts)}"


def first_difference(left: Iterable[Events], right: Iterable[Events]) -> Difference | None:
    """Compare two logs, given in batches of any size; read no further than needed.

    Everything counts, to the last bit, but the times.
    """
    a_batches, b_batches = iter(left), iter(right)
    a, b = next(a_batches, None), next(b_batches, None)
    while a is not None and b is not None:
        end = min(_end(a), _end(b))
        found = _compare(a.until(seq=end - 1), b.until(seq=end - 1))
        if found is not None:
            return found
        a, b = _rest(a, end, a_batches), _rest(b, end, b_batches)
    if a is None and b is None:
        return None
    rest = a if a is not None else b
    assert rest is not None  # noqa: S101 - one of them is left
    seq, _ = rest.kinds_in_order()
    event = event_at(rest, seq)
    return Difference(seq, event if a is not None else None, event if b is not None else None)


def _end(events: Events) -> int:
    """Return the number behind the last event."""
    return max((int(t["seq"][-1]) for t in events.tables.values()), default=-1) + 1


def _rest(events: Events, end: int, batches: Iterator[Events]) -> Events | None:
    """Return what a batch holds from `end` on, or the next batch."""
    if _end(events) == end:
        return next((b for b in batches if len(b)), None)
    tables = {k: t[np.searchsorted(t["seq"], end) :] for k, t in events.tables.items()}
    return Events(events.dof, {k: t for k, t in tables.items() if len(t)})


def _compare(a: Events, b: Events) -> Difference | None:
    """Compare two stretches that end with the same number."""
    if not len(a) and not len(b):
        return None
    first, kinds = a.kinds_in_order()
    if a.dof != b.dof:
        ours, theirs = ({**(event_at(e, first) or {}), "dof": e.dof} for e in (a, b))
        return Difference(first, ours, theirs)
    other_first, other_kinds = b.kinds_in_order()
    seqs: list[int] = []
    if first != other_first:
        seqs.append(min(first, other_first))
    else:
        n = min(len(kinds), len(other_kinds))
        parted = np.flatnonzero(kinds[:n] != other_kinds[:n])
        limit = first + (int(parted[0]) if len(parted) else n)
        if limit < first + max(len(kinds), len(other_kinds)):
            seqs.append(limit)
        for kind in Kind:
            left, right = (e.until(seq=limit - 1)[kind] for e in (a, b))
            wrong = np.flatnonzero(_unequal(kind, left, right))
            if len(wrong):
                seqs.append(int(left["seq"][wrong[0]]))
    if not seqs:
        return None
    seq = min(seqs)
    return Difference(seq, event_at(a, seq), event_at(b, seq))


def _unequal(kind: Kind, a: Table, b: Table) -> NDArray[np.bool_]:
    """Whether each pair of events differs in anything but the time."""
    wrong = a["iteration"] != b["iteration"]
    for field in FIELDS[kind]:
        x, y = a[field.name], b[field.name]
        if field.type == "q[]":
            wrong |= np.array([not np.array_equal(p, q) for p, q in zip(x, y, strict=True)], bool)
            continue
        same = (x == y) | ((x != x) & (y != y))  # noqa: PLR0124 - not a number, twice
        wrong |= ~(same.all(axis=1) if same.ndim > 1 else same)
    return np.asarray(wrong)


def event_at(events: Events, seq: int) -> dict[str, Any] | None:
    """Return an event's fields by name, with `kind` and `iteration`; None if it is not there."""
    for kind, table in events.tables.items():
        at = int(np.searchsorted(table["seq"], seq))
        if at < len(table) and table["seq"][at] == seq:
            row = table[at]
            named = {
                f.name: f.choices(int(row[f.name])).name.lower() if f.choices else row[f.name]
                for f in FIELDS[kind]
            }
            return {"kind": kind.label, "iteration": int(row["iteration"]), **named}
    return None


def same(a: Any, b: Any) -> bool:
    """Whether two values of a field are the same, to the last bit."""
    return np.array_equal(a, b, equal_nan=not isinstance(a, str))


def _value(value: Any) -> str:
    if isinstance(value, np.ndarray) and value.ndim > 1:
        return f"{len(value)} waypoints"
    if isinstance(value, np.ndarray):
        return "(" + ", ".join(repr(float(x)) for x in value) + ")"
    return repr(value.item()) if isinstance(value, np.generic) else str(value)


def _text(event: dict[str, Any]) -> str:
    fields = ", ".join(f"{n} {_value(v)}" for n, v in event.items() if n != "kind")
    return f"{event.get('kind', 'nothing')} ({fields})"
