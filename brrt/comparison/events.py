"""The first difference of two logs: event by event, apart from the times."""

from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrt.comparison.difference import Difference
from brrt.events import FIELDS, Events, Kind, Table

BEFORE = 10
"""Events that are shown before a difference."""


@dataclass(slots=True)
class Deviation:
    """The tolerance for numbers, and the greatest deviation within it.

    A deviation is relative to the greater of the two numbers, and to 1 if both are less.

    Attributes:
        allowed: The greatest deviation that counts as equal; 0 compares every bit.
        worst: The greatest deviation found that counts as equal.
        seq: Number of the event that has it; -1 if all numbers are equal.
        name: The field that has it.
    """

    allowed: float = 0.0
    worst: float = 0.0
    seq: int = -1
    name: str = ""


def first_difference(
    left: Iterable[Events], right: Iterable[Events], deviation: Deviation | None = None
) -> Difference | None:
    """Return the first event that differs between two logs, apart from times; None if none does.

    The logs come in batches of any size; nothing is read after that event's batch. `deviation`
    takes in the greatest deviation; by default every bit counts.
    """
    deviation, recent = deviation or Deviation(), RecentEvents()
    a_batches, b_batches = recent.passing(left), iter(right)
    a, b = next(a_batches, None), next(b_batches, None)
    while a is not None and b is not None:
        end = min(_end(a), _end(b))
        found = _compare(a.until(seq=end - 1), b.until(seq=end - 1), deviation)
        if found is not None:
            return replace(found, before=recent.before(found.seq))
        a, b = _rest(a, end, a_batches), _rest(b, end, b_batches)
    rest = a if a is not None else b
    if rest is None:
        return None
    seq, _ = rest.kinds_in_order()
    ours, theirs = (None if log is None else event_at(log, seq) for log in (a, b))
    return Difference(seq, ours, theirs, recent.before(seq))


class RecentEvents:
    """A fold that keeps the last batches of a log, enough for `BEFORE` events before any other."""

    def __init__(self) -> None:
        self._kept: deque[Events] = deque()

    def passing(self, batches: Iterable[Events]) -> Iterator[Events]:
        """Yield batches and keep them."""
        for batch in batches:
            self.write(batch)
            yield batch

    def write(self, events: Events) -> None:
        """Take a batch."""
        self._kept.append(events)
        while sum(map(len, self._kept)) - len(self._kept[0]) >= len(events) + BEFORE:
            self._kept.popleft()

    @property
    def next(self) -> int:
        """Number of the event that follows."""
        return max(map(_end, self._kept), default=0)

    def before(self, seq: int) -> tuple[dict[str, Any], ...]:
        """Return up to `BEFORE` events before a number that lies in the last batch, or after it."""
        found = []
        for number in range(max(0, seq - BEFORE), seq):
            events = (event_at(batch, number) for batch in self._kept)
            found += [{"seq": number, **event} for event in events if event is not None]
        return tuple(found)


def _end(events: Events) -> int:
    """Return the number after the last event's."""
    return max((int(t["seq"][-1]) for t in events.tables.values()), default=-1) + 1


def _rest(events: Events, end: int, batches: Iterator[Events]) -> Events | None:
    """Return the part of a batch from `end` on, or the next batch."""
    if _end(events) == end:
        return next(filter(len, batches), None)
    tables = {k: t[np.searchsorted(t["seq"], end) :] for k, t in events.tables.items()}
    return Events(events.dof, {k: t for k, t in tables.items() if len(t)})


def _compare(a: Events, b: Events, deviation: Deviation) -> Difference | None:
    """Compare two batches that end with the same number."""
    if not len(a) and not len(b):
        return None
    first, kinds = a.kinds_in_order()
    if a.dof != b.dof:
        ours, theirs = ({**(event_at(e, first) or {}), "dof": e.dof} for e in (a, b))
        return Difference(first, ours, theirs)
    other_first, other_kinds = b.kinds_in_order()
    if first != other_first:
        seq = min(first, other_first)
        return Difference(seq, event_at(a, seq), event_at(b, seq))
    n = min(len(kinds), len(other_kinds))
    unlike = np.flatnonzero(kinds[:n] != other_kinds[:n])
    seq = end = first + (int(unlike[0]) if len(unlike) else n)
    a_part, b_part = a.until(seq=end - 1), b.until(seq=end - 1)
    found = [(table["seq"], *_compare_tables(kind, table, b_part[kind], deviation.allowed))
             for kind, table in a_part.tables.items()]  # fmt: skip
    for numbers, differs, _ in found:
        at = np.flatnonzero(differs)
        seq = min([seq, *numbers[at[:1]].tolist()])
    for numbers, _, fields in found:
        for name, far in fields.items():
            _note(deviation, numbers, far, seq, name)
    if seq == first + max(len(kinds), len(other_kinds)):
        return None
    return Difference(seq, event_at(a, seq), event_at(b, seq))


def _note(
    deviation: Deviation, numbers: NDArray[np.int64], far: NDArray[np.float64], end: int, name: str
) -> None:
    """Take in the greatest deviation of a field in the events before a number."""
    far = far[numbers < end]
    if len(far) and far.max() > deviation.worst:
        at = int(far.argmax())
        deviation.worst, deviation.seq, deviation.name = float(far[at]), int(numbers[at]), name


def _compare_tables(
    kind: Kind, a: Table, b: Table, allowed: float
) -> tuple[NDArray[np.bool_], dict[str, NDArray[np.float64]]]:
    """Compare events in pairs, apart from the times.

    Returns:
        Whether each pair differs, shape (n,), and the deviations of each field of numbers that is
        not equal to the last bit everywhere.
    """
    differs, fields = a["iteration"] != b["iteration"], {}
    for field in FIELDS[kind]:
        x, y = a[field.name], b[field.name]
        if field.type == "q[]":
            pairs = zip(x, y, strict=True)
            far = np.array([_deviation(p, q) if p.shape == q.shape else np.inf for p, q in pairs])
        elif field.type in ("q", "float64"):
            far = _deviation(x, y, axis=tuple(range(1, x.ndim)))
        else:
            differs |= x != y
            continue
        if far.any():
            differs |= far > allowed
            fields[field.name] = far
    return differs, fields


def _deviation(x: Any, y: Any, axis: tuple[int, ...] | None = None) -> Any:
    """Return the deviation of numbers, the greatest along the axes; see `Deviation`."""
    same = (x == y) | ((x != x) & (y != y))  # noqa: PLR0124 - both nan
    if same.all():
        return np.zeros(len(x)) if axis is not None else 0.0
    with np.errstate(all="ignore"):
        far = np.abs(x - y) / np.maximum(1.0, np.maximum(np.abs(x), np.abs(y)))
    # Infinite or nan on one side alone is the greatest deviation.
    return np.where(same, 0.0, np.where(np.isfinite(far), far, np.inf)).max(axis=axis, initial=0.0)


def event_at(events: Events, seq: int) -> dict[str, Any] | None:
    """Return an event's fields by name, with `kind` and `iteration`; None if it does not exist."""
    for kind, table in events.tables.items():
        at = int(np.searchsorted(table["seq"], seq))
        if at < len(table) and table["seq"][at] == seq:
            row = table[at]
            named = {
                f.name: f.choices(int(row[f.name])).key if f.choices else row[f.name]
                for f in FIELDS[kind]
            }
            return {"kind": kind.label, "iteration": int(row["iteration"]), **named}
    return None
