"""Where two logs part: event by event, whatever the clock said."""

from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrt.events import FIELDS, Events, Kind, Table

BEFORE = 10
"""Events that are told ahead of a difference."""


@dataclass(slots=True)
class Deviation:
    """How far apart numbers may be to pass for the same, and how far apart such numbers were.

    A deviation is relative to the greater of the two numbers, and to 1 where both are less.

    Attributes:
        allowed: The greatest that passes; 0 where everything counts, to the last bit.
        worst: The greatest that was found and passed.
        seq: The event that it was found in; -1 where there is none.
        name: The field.
    """

    allowed: float = 0.0
    worst: float = 0.0
    seq: int = -1
    name: str = ""


@dataclass(frozen=True, slots=True)
class Difference:
    """The first event that is not the same in both logs.

    Attributes:
        seq: Its number.
        left: It in the first log, fields by name and `kind`; None where that log has ended.
        right: It in the second.
        before: The events right ahead of it, as the first log has them; with `seq`.
    """

    seq: int
    left: dict[str, Any] | None
    right: dict[str, Any] | None
    before: tuple[dict[str, Any], ...] = ()

    @property
    def fields(self) -> list[str]:
        """Names of the fields that differ; none where the kinds do, or where a log has ended."""
        left, right = self.left, self.right
        if left is None or right is None or left["kind"] != right["kind"]:
            return []
        return [name for name in left if not same(left[name], right.get(name))]

    def __str__(self) -> str:
        left, right = self.left, self.right
        if left is None or right is None:
            which, other = ("first", right) if left is None else ("second", left)
            return (
                f"event {self.seq}: the {which} log has ended; the other has {_text(other or {})}"
            )
        if left["kind"] != right["kind"]:
            return f"event {self.seq}: {_text(left)} against {_text(right)}"
        parts = [
            f"{name} {_value(left[name])} against {_value(right[name])}" for name in self.fields
        ]
        return f"event {self.seq} ({left['kind']}): {'; '.join(parts)}"


def first_difference(
    left: Iterable[Events], right: Iterable[Events], deviation: Deviation | None = None
) -> Difference | None:
    """Compare two logs, given in batches of any size; read no further than needed.

    Everything counts but the times.

    Args:
        left: The first log.
        right: The second.
        deviation: How far apart numbers may be; by default everything counts to the last bit. It
            takes in how far apart they were.
    """
    deviation = Deviation() if deviation is None else deviation
    newest = Newest()
    a_batches, b_batches = newest.taking(left), iter(right)
    a, b = next(a_batches, None), next(b_batches, None)
    while a is not None and b is not None:
        end = min(_end(a), _end(b))
        found = _compare(a.until(seq=end - 1), b.until(seq=end - 1), deviation)
        if found is not None:
            return replace(found, before=newest.before(found.seq))
        a, b = _rest(a, end, a_batches), _rest(b, end, b_batches)
    rest = a if a is not None else b
    if rest is None:
        return None
    seq, _ = rest.kinds_in_order()
    event = event_at(rest, seq)
    ours, theirs = (event, None) if a is not None else (None, event)
    return Difference(seq, ours, theirs, newest.before(seq))


class Newest:
    """Keeps those of a log's batches that hold its newest events."""

    def __init__(self) -> None:
        self._kept: deque[Events] = deque()

    def taking(self, batches: Iterable[Events]) -> Iterator[Events]:
        """Hand on batches, and take them in."""
        for batch in batches:
            self.write(batch)
            yield batch

    def write(self, events: Events) -> None:
        """Take in a batch."""
        self._kept.append(events)
        while sum(map(len, self._kept)) - len(self._kept[0]) >= len(events) + BEFORE:
            self._kept.popleft()

    @property
    def next(self) -> int:
        """The number behind the newest event."""
        return max(map(_end, self._kept), default=0)

    def before(self, seq: int) -> tuple[dict[str, Any], ...]:
        """Return the events right ahead of a number that was not handed on long ago."""
        found = []
        for number in range(max(0, seq - BEFORE), seq):
            events = (event_at(batch, number) for batch in self._kept)
            found += [{"seq": number, **event} for event in events if event is not None]
        return tuple(found)


def _end(events: Events) -> int:
    """Return the number behind the last event."""
    return max((int(t["seq"][-1]) for t in events.tables.values()), default=-1) + 1


def _rest(events: Events, end: int, batches: Iterator[Events]) -> Events | None:
    """Return what a batch holds from `end` on, or the next batch."""
    if _end(events) == end:
        return next((b for b in batches if len(b)), None)
    tables = {k: t[np.searchsorted(t["seq"], end) :] for k, t in events.tables.items()}
    return Events(events.dof, {k: t for k, t in tables.items() if len(t)})


def _compare(a: Events, b: Events, deviation: Deviation) -> Difference | None:
    """Compare two stretches that end with the same number."""
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
    parted = np.flatnonzero(kinds[:n] != other_kinds[:n])
    seq = end = first + (int(parted[0]) if len(parted) else n)
    a_part, b_part = a.until(seq=end - 1), b.until(seq=end - 1)
    apart = [(table["seq"], *_apart(kind, table, b_part[kind], deviation.allowed))
             for kind, table in a_part.tables.items()]  # fmt: skip
    for numbers, wrong, _ in apart:
        at = np.flatnonzero(wrong)
        seq = min([seq, *numbers[at[:1]].tolist()])
    for numbers, _, fields in apart:
        for name, far in fields.items():
            _note(deviation, numbers, far, seq, name)
    if seq == first + max(len(kinds), len(other_kinds)):
        return None
    return Difference(seq, event_at(a, seq), event_at(b, seq))


def _note(
    deviation: Deviation, numbers: NDArray[np.int64], far: NDArray[np.float64], end: int, name: str
) -> None:
    """Take in how far apart a field is in the events ahead of a number."""
    far = far[numbers < end]
    if len(far) and far.max() > deviation.worst:
        at = int(far.argmax())
        deviation.worst, deviation.seq, deviation.name = float(far[at]), int(numbers[at]), name


def _apart(
    kind: Kind, a: Table, b: Table, allowed: float
) -> tuple[NDArray[np.bool_], dict[str, NDArray[np.float64]]]:
    """Whether each pair of events differs, and how far apart the fields are that do by rounding.

    The times do not count.
    """
    wrong, fields = a["iteration"] != b["iteration"], {}
    for field in FIELDS[kind]:
        x, y = a[field.name], b[field.name]
        if field.type == "q[]":
            pairs = zip(x, y, strict=True)
            far = np.array([_far(p, q) if p.shape == q.shape else np.inf for p, q in pairs])
        elif field.type in ("q", "float64"):
            far = _far(x, y, axis=tuple(range(1, x.ndim)))
        else:
            wrong |= x != y
            continue
        if far.any():
            wrong |= far > allowed
            fields[field.name] = far
    return wrong, fields


def _far(x: Any, y: Any, axis: tuple[int, ...] | None = None) -> Any:
    """Return how far numbers are apart, the greatest along the axes; see `Deviation`."""
    same = (x == y) | ((x != x) & (y != y))  # noqa: PLR0124 - not a number, twice
    if same.all():
        return np.zeros(len(x)) if axis is not None else 0.0
    with np.errstate(all="ignore"):
        far = np.abs(x - y) / np.maximum(1.0, np.maximum(np.abs(x), np.abs(y)))
    # What is infinite or no number on one side alone is as far apart as can be.
    return np.where(same, 0.0, np.where(np.isfinite(far), far, np.inf)).max(axis=axis, initial=0.0)


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
