"""Where two runs part: the event and those ahead of it, in plain text and as JSON."""

import math
import textwrap
from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from brrt.comparison.events import Difference, same

WIDTH = 80
"""Columns of a screen."""


def parting(
    first: Difference, names: tuple[str, str], cut: tuple[bool, bool] = (False, False)
) -> Iterator[str]:
    """Tell the first event that differs in two runs, and the ones ahead of it.

    Args:
        first: The event.
        names: What the runs are called; the shorter, the more there is to see.
        cut: Which of them is a recording that ends ahead of its run's end.
    """
    seq, digits, margin = first.seq, len(f"{first.seq:,}"), max(map(len, names))
    yield _heading(first, names, cut)
    for event in first.before:
        yield fit(f"{'':{margin}} {event['seq']:>{digits},}  {told(event)}")
    marked = first.fields
    for name, theirs, is_cut in zip(names, (first.left, first.right), cut, strict=True):
        over = "the recording is cut here" if is_cut else "the run has ended"
        text = over if theirs is None else told(theirs, marked)
        yield fit(f"{name:{margin}} {seq:>{digits},}  {text}")
    for name in marked:
        values = [(theirs or {})[name] for theirs in (first.left, first.right)]
        where, (a, b) = _unlike(*values) if name == "waypoints" else (name, values)
        yield fit(f"{'':{margin}} {'':{digits}}  {where}: {' against '.join(apart(a, b))}")


def event_lines(events: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """Tell an event in full, the last one given, and those ahead of it briefly.

    Args:
        events: In order, fields by name with `seq` and `kind`.
    """
    if not events:
        return
    *before, last = events
    yield ""
    digits = len(f"{last['seq']:,}")
    yield f"event {last['seq']:,}" + (", and those ahead of it:" if before else ":")
    for event in before:
        yield fit(f"  {event['seq']:>{digits},}  {told(event)}")
    text = f"  {last['seq']:>{digits},}  {told(last, digits=None)}"
    yield from textwrap.wrap(text, WIDTH, subsequent_indent=" " * (digits + 14))


def _heading(first: Difference, names: tuple[str, str], cut: tuple[bool, bool]) -> str:
    """Say whether the runs part, or one of them only goes on."""
    seq = first.seq
    if not seq:
        return "They part at their first event:"
    if first.left is not None and first.right is not None:
        return f"They part at event {seq:,}; ahead of it:"
    short = 0 if first.left is None else 1
    name, other = names[short], names[1 - short]
    what = (
        f"{name} is cut, and up to there equal to {other}"
        if cut[short]
        else (f"{name} is the beginning of {other}")
    )
    return f"{what}: {other} goes on after event {seq - 1:,}:"


def _unlike(a: Any, b: Any) -> tuple[str, tuple[Any, Any]]:
    """Return the first waypoint that is another in two paths, or how many they have."""
    if len(a) != len(b):
        return "waypoints", (len(a), len(b))
    at = next(i for i, (p, q) in enumerate(zip(a, b, strict=True)) if not same(p, q))
    return f"waypoint {at}", (a[at], b[at])


def told(event: Mapping[str, Any], marked: Collection[str] = (), digits: int | None = 5) -> str:
    """Tell an event in one line; a star marks the fields that differ."""
    parts = [f"{event['kind']:9}"]
    for name, value in event.items():
        if name not in ("seq", "kind"):
            short = {"iteration": "it"}.get(name, name)
            parts.append(f"{'*' if name in marked else ''}{short} {_text(value, digits)}")
    return " ".join(parts)


def fit(line: str) -> str:
    """Cut a line that is longer than the screen."""
    line = line.rstrip()
    return line if len(line) <= WIDTH else line[: WIDTH - 4] + " ..."


def apart(a: Any, b: Any) -> tuple[str, str]:
    """Write two values briefly, or in full where that would make them look alike."""
    brief = _text(a), _text(b)
    return brief if brief[0] != brief[1] or same(a, b) else (_text(a, None), _text(b, None))


def _text(value: Any, digits: int | None = 6) -> str:
    """Write a value, numbers to so many digits, or to as many as tell them from all others."""
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


def parting_as_dict(first: Difference, names: tuple[str, str]) -> dict[str, Any]:
    """Return the first event that differs as JSON has it; see `parting`."""
    return {
        "seq": first.seq,
        names[0]: _plain(first.left),
        names[1]: _plain(first.right),
        "fields": first.fields,
        "before": [_plain(event) for event in first.before],
    }


def _plain(value: Any) -> Any:
    """Bring a value to what JSON has; it has no infinity."""
    if isinstance(value, dict):
        return {name: _plain(each) for name, each in value.items()}
    if isinstance(value, np.ndarray | list | tuple):
        return [_plain(each) for each in value]
    if isinstance(value, np.generic):
        return _plain(value.item())
    return None if isinstance(value, float) and not math.isfinite(value) else value
