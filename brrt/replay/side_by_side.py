"""A comparison in plain text, on one screen of 80 columns, and as JSON."""

import math
import shlex
from collections.abc import Collection, Iterator, Mapping
from typing import Any

import numpy as np

from brrt.replay.compare import METRICS, TIMES, Comparison
from brrt.replay.diff import Difference, same
from brrt.replay.told import Row

WIDTH = 80
_NAME, _VALUE = 22, 20
"""Columns of a name and of a run's value; what is left is for the change."""

_MOST_ROWS = 12
"""Settings that are told; there may be very many more."""


def lines(found: Comparison) -> list[str]:
    """Tell a comparison; no line is longer than the screen, but for commands to paste."""
    return list(_lines(found))


def _lines(found: Comparison) -> Iterator[str]:
    for letter, name in zip("AB", found.names, strict=True):
        if name:
            yield _fit(f"{letter}  {name}")
    yield from _rows("settings", found.settings, "the same")
    if found.notes:
        yield from _rows("besides", found.notes, "")
    yield ""
    yield from _outcome(found)
    yield from _events(found)
    yield ""
    yield from _parting(found)


def _rows(title: str, rows: tuple[Row, ...], none: str) -> Iterator[str]:
    """Tell what differs; values that are long stand one above the other."""
    if not rows:
        yield f"{title}: {none}"
        return
    yield _row(title, "A", "B")
    for row in rows[:_MOST_ROWS]:
        a, b = _apart(row.a, row.b)
        if max(len(a), len(b)) < _VALUE:
            yield _row(f"  {row.name}", a, b)
        else:
            yield _fit(f"  {row.name:{_NAME - 2}}{a}")
            yield _fit(f"{'':{_NAME}}{b}")
    if len(rows) > _MOST_ROWS:
        yield f"  ... and {len(rows) - _MOST_ROWS} more: --json has them"


def _outcome(found: Comparison) -> Iterator[str]:
    """Tell how the runs ended, and their figures."""
    a, b = found.figures
    yield _row("outcome", _outcome_of(a), _outcome_of(b))
    ends = [each.get("status", "solved") for each in (a, b)]
    if ends != ["solved", "solved"]:
        yield _row("  ended by", *ends)
    names = METRICS + TIMES if found.timed else METRICS
    for name in names:
        x, y = a.get(name), b.get(name)
        if x is not None or y is not None:
            in_time = name in TIMES
            p, q = (_seconds(x), _seconds(y)) if in_time else _apart(x, y)
            said = name.removesuffix("_s").replace("_", " ")
            yield _row(f"  {said}", p, q, _change(x, y))


def _events(found: Comparison) -> Iterator[str]:
    """Tell the events by kind."""
    rows = [Row("events", *(each.get("events") for each in found.figures)), *_kinds(found)]
    for name, a, b in rows:
        yield _row(name if name == "events" else f"  {name}", _count(a), _count(b), _change(a, b))


def _kinds(found: Comparison) -> Iterator[Row]:
    """Yield the kinds of events that one of the runs has, with None where that is not known."""
    a, b = found.events
    for name in dict.fromkeys([*a, *b]):
        if a.get(name) or b.get(name):
            yield Row(name, a.get(name), b.get(name))


def _parting(found: Comparison) -> Iterator[str]:
    """Tell where they part, and how to look at it."""
    first = found.first
    if first is None:
        how = f"numbers within {found.tolerance:g}" if found.tolerance else "to the last bit"
        but = "; the settings alone differ" if found.settings else ""
        yield f"The events are equal, {how}, but for the times{but}."
        return
    yield from parting(first, ("A", "B"))
    if all(found.names):
        a, b = (shlex.quote(name) for name in found.names)
        yield ""
        yield f"brrt view {a} {b}"
        yield f"brrt replay {a} --at-event {first.seq}"


def parting(first: Difference, names: tuple[str, str]) -> Iterator[str]:
    """Tell the first event that differs in two runs, and the ones ahead of it.

    Args:
        first: The event.
        names: What the runs are called; the shorter, the more there is to see.
    """
    seq, digits, margin = first.seq, len(f"{first.seq:,}"), max(map(len, names))
    yield f"They part at event {seq:,}; ahead of it:" if seq else "They part at their first event:"
    for event in first.before:
        yield _fit(f"{'':{margin}} {event['seq']:>{digits},}  {_event(event)}")
    marked = first.fields
    for name, theirs in zip(names, (first.left, first.right), strict=True):
        text = "the run has ended" if theirs is None else _event(theirs, marked)
        yield _fit(f"{name:{margin}} {seq:>{digits},}  {text}")
    for name in marked:
        values = [(theirs or {})[name] for theirs in (first.left, first.right)]
        where, (a, b) = _unlike(*values) if name == "waypoints" else (name, values)
        yield _fit(f"{'':{margin}} {'':{digits}}  {where}: {' against '.join(_apart(a, b))}")


def _unlike(a: Any, b: Any) -> tuple[str, tuple[Any, Any]]:
    """Return the first waypoint that is another in two paths, or how many they have."""
    if len(a) != len(b):
        return "waypoints", (len(a), len(b))
    at = next(i for i, (p, q) in enumerate(zip(a, b, strict=True)) if not same(p, q))
    return f"waypoint {at}", (a[at], b[at])


def _event(event: Mapping[str, Any], marked: Collection[str] = ()) -> str:
    """Tell an event in one line; a star marks the fields that differ."""
    parts = [f"{event['kind']:9}"]
    for name, value in event.items():
        if name not in ("seq", "kind"):
            short = {"iteration": "it"}.get(name, name)
            parts.append(f"{'*' if name in marked else ''}{short} {_text(value, 5)}")
    return " ".join(parts)


def _row(name: str, a: str, b: str, change: str = "") -> str:
    return _fit(f"{name:{_NAME}}{a:>{_VALUE}}{b:>{_VALUE}}{change:>{WIDTH - _NAME - 2 * _VALUE}}")


def _fit(line: str) -> str:
    line = line.rstrip()
    return line if len(line) <= WIDTH else line[: WIDTH - 4] + " ..."


def _outcome_of(figures: Mapping[str, Any]) -> str:
    if not figures:
        return "cut: no result"
    return "solved" if figures["solved"] else "not solved"


def _seconds(value: float | None) -> str:
    if value is None:
        return "none"
    for unit, size in (("s", 1.0), ("ms", 1e-3)):
        if value >= size:
            return f"{value / size:.3g} {unit}"
    return f"{value * 1e6:.3g} us"


def _count(value: int | None) -> str:
    return "not known" if value is None else f"{value:,}"


def _change(a: Any, b: Any) -> str:
    """Return how much more the second is, relative to the first."""
    if a is None or b is None:
        return ""
    if a == b:
        return "="
    if a == 0:
        return ""
    change = 100 * (b - a) / abs(a)
    return f"{change:+,.3g} %" if abs(change) < 1000 else f"x {b / a:,.3g}"


def _apart(a: Any, b: Any) -> tuple[str, str]:
    """Write two values briefly, or in full where that would make them look alike."""
    brief = _text(a), _text(b)
    return brief if brief[0] != brief[1] or same(a, b) else (_text(a, 17), _text(b, 17))


def _text(value: Any, digits: int = 6) -> str:
    if value is None:
        return "none"
    if isinstance(value, bool | np.bool_):
        return str(bool(value)).lower()
    if isinstance(value, float | np.floating):
        return f"{float(value):.{digits}g}"
    if isinstance(value, np.ndarray) and value.ndim > 1:
        return str(len(value))
    if isinstance(value, list | tuple | np.ndarray):
        return "(" + ", ".join(_text(x, digits) for x in np.ravel(np.asarray(value)).tolist()) + ")"
    return f"{value:,}" if isinstance(value, int | np.integer) else str(value)


def as_dict(found: Comparison) -> dict[str, Any]:
    """Return a comparison as JSON has it."""
    a, b = found.figures
    metrics = {
        name: {"a": a.get(name), "b": b.get(name), "change": _ratio(a.get(name), b.get(name))}
        for name in ("events", *METRICS, *TIMES)
    }
    return {
        "equal": found.equal,
        "names": list(found.names),
        "settings": [row._asdict() for row in found.settings],
        "besides": [row._asdict() for row in found.notes],
        "outcome": [
            {"solved": each.get("solved"), "status": each.get("status")} for each in (a, b)
        ],
        "metrics": metrics,
        "events": {name: {"a": x, "b": y} for name, x, y in _kinds(found)},
        "first": None if found.first is None else parting_as_dict(found.first, ("a", "b")),
    }


def parting_as_dict(first: Difference, names: tuple[str, str]) -> dict[str, Any]:
    """Return the first event that differs as JSON has it; see `parting`."""
    return {
        "seq": first.seq,
        names[0]: _plain(first.left),
        names[1]: _plain(first.right),
        "fields": first.fields,
        "before": [_plain(event) for event in first.before],
    }


def _ratio(a: Any, b: Any) -> float | None:
    return None if a in (None, 0) or b is None else (b - a) / abs(a)


def _plain(value: Any) -> Any:
    """Bring a value to what JSON has; it has no infinity."""
    if isinstance(value, dict):
        return {name: _plain(each) for name, each in value.items()}
    if isinstance(value, np.ndarray | list | tuple):
        return [_plain(each) for each in value]
    if isinstance(value, np.generic):
        return _plain(value.item())
    return None if isinstance(value, float) and not math.isfinite(value) else value
