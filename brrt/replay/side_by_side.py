"""A comparison in plain text, on one screen of 80 columns, and as JSON."""

import math
import shlex
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from brrt.replay.compare import METRICS, TIMES, Comparison, Part
from brrt.replay.diff import same
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
    yield from _part(found.part, found.names)


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
    yield _row("outcome", _status(a), _status(b))
    names = METRICS + TIMES if found.timed else METRICS
    for name in names:
        x, y = a.get(name), b.get(name)
        if x is not None or y is not None:
            p, q = _apart(x, y)
            yield _row("  " + name.replace("_", " "), p, q, _change(x, y))


def _events(found: Comparison) -> Iterator[str]:
    """Tell the events by kind."""
    a, b = found.events
    sums = [sum(each.values()) if each else None for each in (a, b)]
    yield _row("events", _count(sums[0]), _count(sums[1]), _change(*sums))
    for name in dict.fromkeys([*a, *b]):
        x, y = (None if not each else each.get(name, 0) for each in (a, b))
        yield _row(f"  {name}", _count(x), _count(y), _change(x, y))


def _part(part: Part | None, names: tuple[str, str]) -> Iterator[str]:
    """Tell where they part, and how to look at it."""
    if part is None:
        yield "The events are equal, every one to the last bit but the times."
        return
    seq, (a, b) = part.difference.seq, (part.difference.left, part.difference.right)
    yield f"They part at event {seq:,}; ahead of it:" if seq else "They part at their first event:"
    digits = len(f"{seq:,}")
    for event in part.before:
        yield _fit(f"  {event['seq']:>{digits},}  {_event(event)}")
    marked = {row.name for row in fields(part)}
    for letter, theirs in (("A", a), ("B", b)):
        text = "the run has ended" if theirs is None else _event(theirs, marked)
        yield _fit(f"{letter} {seq:>{digits},}  {text}")
    for row in fields(part):
        yield _fit(f"  {'':{digits}}  {row.name}: {' against '.join(_apart(row.a, row.b))}")
    if not all(names):
        return
    a_name, b_name = (shlex.quote(name) for name in names)
    yield ""
    yield f"brrt view {a_name} {b_name}"
    yield f"brrt replay {a_name} --at-event {seq}"


def fields(part: Part) -> list[Row]:
    """Return the fields in which the parting events differ; none where kinds differ or one ends."""
    a, b = part.difference.left, part.difference.right
    if a is None or b is None or a["kind"] != b["kind"]:
        return []
    return [Row(name, a[name], b[name]) for name in a if not same(a[name], b.get(name))]


def _event(event: Mapping[str, Any], marked: set[str] | frozenset[str] = frozenset()) -> str:
    """Tell an event in one line; a star marks the fields that differ."""
    parts = [f"{event['kind']:9}"]
    for name, value in event.items():
        if name not in ("seq", "kind"):
            short = {"iteration": "it"}.get(name, name)
            parts.append(f"{'*' if name in marked else ''}{short} {_text(value)}")
    return " ".join(parts)


def _row(name: str, a: str, b: str, change: str = "") -> str:
    return _fit(f"{name:{_NAME}}{a:>{_VALUE}}{b:>{_VALUE}}{change:>{WIDTH - _NAME - 2 * _VALUE}}")


def _fit(line: str) -> str:
    line = line.rstrip()
    return line if len(line) <= WIDTH else line[: WIDTH - 4] + " ..."


def _status(figures: Mapping[str, Any]) -> str:
    if not figures:
        return "cut: no result"
    status = str(figures["status"])
    return status if not figures["solved"] or status == "solved" else f"solved; {status}"


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
        return "auto"
    if isinstance(value, bool | np.bool_):
        return str(bool(value)).lower()
    if isinstance(value, float | np.floating):
        return f"{float(value):.{digits}g}"
    if isinstance(value, np.ndarray) and value.ndim > 1 and digits < 17:
        return f"{len(value)} waypoints"
    if isinstance(value, list | tuple | np.ndarray):
        return "(" + ", ".join(_text(x, digits) for x in np.ravel(np.asarray(value)).tolist()) + ")"
    return f"{value:,}" if isinstance(value, int | np.integer) else str(value)


def as_dict(found: Comparison) -> dict[str, Any]:
    """Return a comparison as JSON has it."""
    a, b = found.figures
    metrics = {
        name: {"a": a.get(name), "b": b.get(name), "change": _ratio(a.get(name), b.get(name))}
        for name in METRICS + TIMES
    }
    kinds = dict.fromkeys([*found.events[0], *found.events[1]])
    counts = [
        (lambda name, each=each: each.get(name, 0) if each else None) for each in found.events
    ]
    part = found.part
    return {
        "equal": found.equal,
        "names": list(found.names),
        "settings": [row._asdict() for row in found.settings],
        "besides": [row._asdict() for row in found.notes],
        "outcome": [
            {"solved": each.get("solved"), "status": each.get("status")} for each in (a, b)
        ],
        "metrics": metrics,
        "events": {name: {"a": counts[0](name), "b": counts[1](name)} for name in kinds},
        "first": None if part is None else _part_json(part),
    }


def _part_json(part: Part) -> dict[str, Any]:
    return {
        "seq": part.difference.seq,
        "a": _plain(part.difference.left),
        "b": _plain(part.difference.right),
        "fields": [row.name for row in fields(part)],
        "before": [_plain(event) for event in part.before],
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
