"""The first event that differs between two logs: as data, in plain text and as JSON."""

import math
import textwrap
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

WIDTH = 80
"""Columns of a screen."""

Event = Mapping[str, Any]
"""The fields of an event by name, and its `kind`; most have their `seq` too."""


@dataclass(frozen=True, slots=True)
class Difference:
    """The first event that differs between two logs.

    Attributes:
        seq: Its number.
        left: The event in the first log; None if that log ends before it.
        right: The event in the second log; None if that log ends before it.
        before: The events right before it, from the first log.
    """

    seq: int
    left: Event | None
    right: Event | None
    before: tuple[Event, ...] = ()

    @property
    def fields(self) -> list[str]:
        """Names of the fields that differ; none if the kinds differ or a log has ended."""
        left, right = self.left, self.right
        if left is None or right is None or left["kind"] != right["kind"]:
            return []
        return [name for name in left if not equal_values(left[name], right.get(name))]

    def __str__(self) -> str:
        left, right = self.left, self.right
        if left is None or right is None:
            which, other = ("first", right) if left is None else ("second", left)
            there = _full(other or {})
            return f"event {self.seq}: the {which} log has ended; the other has {there}"
        if left["kind"] != right["kind"]:
            return f"event {self.seq}: {_full(left)} against {_full(right)}"
        parts = [f"{name} {_text(a)} against {_text(b)}" for name, a, b in self._values()]
        return f"event {self.seq} ({left['kind']}): {'; '.join(parts)}"

    def lines(
        self, names: tuple[str, str], cut: tuple[bool, bool] = (False, False)
    ) -> Iterator[str]:
        """Yield the difference, and the events before it, as lines of 80 columns.

        Args:
            names: What the logs are called; short names leave more room for the events.
            cut: Whether each log is cut, that is, ends before its run's end.
        """
        digits, margin = len(f"{self.seq:,}"), max(map(len, names))
        yield self._heading(names, cut)
        for event in self.before:
            yield clipped(f"{'':{margin}} {event['seq']:>{digits},}  {_line(event)}")
        differ = self.fields
        for name, given, is_cut in zip(names, (self.left, self.right), cut, strict=True):
            end = "the recording is cut here" if is_cut else "the run has ended"
            text = end if given is None else _line(given, differ)
            yield clipped(f"{name:{margin}} {self.seq:>{digits},}  {text}")
        for name, a, b in self._values():
            values = " against ".join(brief_pair(a, b))
            yield clipped(f"{'':{margin}} {'':{digits}}  {name}: {values}")

    def _heading(self, names: tuple[str, str], cut: tuple[bool, bool]) -> str:
        if not self.seq:
            return "The first events differ:"
        if self.left is not None and self.right is not None:
            return f"The first difference is event {self.seq:,}; before it:"
        shorter = 0 if self.left is None else 1
        name, other, last = names[shorter], names[1 - shorter], f"event {self.seq - 1:,}"
        if cut[shorter]:
            return f"{name} is cut after {last} and equals {other} up to there:"
        return f"{name} ends after {last}; {other} equals it up to there and continues:"

    def _values(self) -> Iterator[tuple[str, Any, Any]]:
        """Yield the fields that differ, with both values; of paths the first such waypoint."""
        for name in self.fields:
            a, b = ((event or {})[name] for event in (self.left, self.right))
            if name != "waypoints":
                yield name, a, b
            elif len(a) != len(b):
                yield name, len(a), len(b)
            else:
                pairs = enumerate(zip(a, b, strict=True))
                yield next((f"waypoint {i}", p, q) for i, (p, q) in pairs if not equal_values(p, q))

    def as_dict(self, names: tuple[str, str]) -> dict[str, Any]:
        """Return the difference as plain data for JSON; `names` are keys of the two events."""
        return {
            "seq": self.seq,
            names[0]: plain(self.left),
            names[1]: plain(self.right),
            "fields": self.fields,
            "before": plain(self.before),
        }


def event_lines(events: Sequence[Event]) -> Iterator[str]:
    """Yield the last of some events in full, and the ones before it briefly, in 80 columns."""
    if not events:
        return
    *before, last = events
    yield ""
    digits = len(f"{last['seq']:,}")
    yield f"event {last['seq']:,}" + (" and the events before it:" if before else ":")
    for event in before:
        yield clipped(f"  {event['seq']:>{digits},}  {_line(event)}")
    text = f"  {last['seq']:>{digits},}  {_line(last, digits=None)}"
    yield from textwrap.wrap(text, WIDTH, subsequent_indent=" " * (digits + 14))


def _line(event: Event, marked: Collection[str] = (), digits: int | None = 5) -> str:
    """Write an event in one line; a star marks the fields that differ."""
    parts = [f"{event['kind']:9}"]
    for name, value in event.items():
        if name not in ("seq", "kind"):
            short = {"iteration": "it"}.get(name, name)
            parts.append(f"{'*' if name in marked else ''}{short} {_text(value, digits)}")
    return " ".join(parts)


def _full(event: Event) -> str:
    """Write an event with all digits, without columns."""
    return " ".join(_line(event, digits=None).split())


def clipped(line: str) -> str:
    """Return a line without what exceeds the screen."""
    line = line.rstrip()
    return line if len(line) <= WIDTH else line[: WIDTH - 4] + " ..."


def brief_pair(a: Any, b: Any) -> tuple[str, str]:
    """Write two values briefly; with all digits if they differ and would look alike."""
    brief = _text(a, 6), _text(b, 6)
    return brief if brief[0] != brief[1] or equal_values(a, b) else (_text(a), _text(b))


def _text(value: Any, digits: int | None = None) -> str:
    """Write a value; numbers to so many digits, or to as many as distinguish them."""
    if value is None:
        return "none"
    if isinstance(value, bool | np.bool_):
        return str(bool(value)).lower()
    if isinstance(value, float | np.floating):
        return repr(float(value)) if digits is None else f"{float(value):.{digits}g}"
    if isinstance(value, np.ndarray) and value.ndim > 1:
        return str(len(value))
    if isinstance(value, list | tuple | np.ndarray):
        return "(" + ", ".join(_text(x, digits) for x in np.ravel(np.asarray(value)).tolist()) + ")"
    return f"{value:,}" if isinstance(value, int | np.integer) else str(value)


def equal_values(a: Any, b: Any) -> bool:
    """Whether two values of a field are equal, to the last bit."""
    return np.array_equal(a, b, equal_nan=not isinstance(a, str))


def plain(value: Any) -> Any:
    """Return a value as JSON has it, without infinities and nan."""
    if isinstance(value, Mapping):
        return {name: plain(each) for name, each in value.items()}
    if isinstance(value, np.ndarray | list | tuple):
        return [plain(each) for each in value]
    if isinstance(value, np.generic):
        return plain(value.item())
    return None if isinstance(value, float) and not math.isfinite(value) else value
