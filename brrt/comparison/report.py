"""A comparison in plain text, on one screen of 80 columns, and as JSON."""

import shlex
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from brrt.comparison.comparison import METRICS, TIMES, Comparison, Cut
from brrt.comparison.event_text import WIDTH, apart, fit, parting, parting_as_dict
from brrt.comparison.settings_diff import Row

_NAME, _VALUE = 22, 20
"""Columns of a name and of a run's value; what is left is for the change."""

_MOST_ROWS = 12
"""Settings that are told; there may be very many more."""


def lines(found: Comparison) -> list[str]:
    """Tell a comparison; no line is longer than the screen, but for commands to paste."""
    return list(_lines(found))


def _lines(found: Comparison) -> Iterator[str]:
    for letter, name, cut in zip("AB", found.names, found.cuts, strict=True):
        if name or cut is not None:
            yield fit(f"{letter}  {name}")
        if cut is not None:
            yield fit(f"   {_cut(cut)}")
    yield from _rows("settings", found.settings, "the same")
    if found.notes:
        yield from _rows("besides", found.notes, "")
    yield ""
    yield from _outcome(found)
    yield from _events(found)
    yield ""
    yield from _parting(found)


def _cut(cut: Cut) -> str:
    if not cut.events:
        return "cut ahead of its first event"
    return (
        f"cut behind event {cut.events - 1:,} ({cut.until_s:.6f} s): its figures go as far as that"
    )


def _rows(title: str, rows: tuple[Row, ...], none: str) -> Iterator[str]:
    """Tell what differs; values that are long stand one above the other."""
    if not rows:
        yield f"{title}: {none}"
        return
    yield _row(title, "A", "B")
    for row in rows[:_MOST_ROWS]:
        a, b = apart(row.a, row.b)
        if max(len(a), len(b)) < _VALUE:
            yield _row(f"  {row.name}", a, b)
        else:
            yield fit(f"  {row.name:{_NAME - 2}} A  {a}")
            yield fit(f"{'':{_NAME}} B  {b}")
    if len(rows) > _MOST_ROWS:
        yield f"  ... and {len(rows) - _MOST_ROWS} more: --json has them"


def _outcome(found: Comparison) -> Iterator[str]:
    """Tell how the runs ended, and their figures."""
    a, b = found.figures
    outcomes = ("solved" if each.get("solved") else "not solved" for each in (a, b))
    yield _row("outcome", *outcomes)
    ends = [str(each.get("status")) for each in (a, b)]
    if ends != ["solved", "solved"]:
        by = ("running when cut" if cut and end == "running" else end
              for end, cut in zip(ends, found.cuts, strict=True))  # fmt: skip
        yield _row("  ended by", *by)
    a, b = _motions(a), _motions(b)
    for name in _figures(found):
        x, y = a.get(name), b.get(name)
        if x is not None or y is not None:
            in_time = name in TIMES
            p, q = (_seconds(x), _seconds(y)) if in_time else apart(x, y)
            said = name.removesuffix("_s").replace("_", " ")
            yield _row(f"  {said}", p, q, _change(x, y))


def _figures(found: Comparison) -> Iterator[str]:
    """Yield the figures that are told, in order."""
    for name in METRICS:
        yield name
        if name == "iterations":
            yield "motions"
    if found.timed:
        yield from TIMES


def _motions(figures: Mapping[str, Any]) -> dict[str, Any]:
    """Return figures in which moves are those of a robot that moved, with the path's motions."""
    moved = figures.get("max_move_time_s") is not None
    path = figures.get("smoothed_path") or figures.get("path")
    return {
        **figures,
        "moves": figures.get("moves") if moved else None,
        "motions": len(path) - 1 if path else None,
    }


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
        yield f"The events are equal, {how}, but for the times."
        if found.settings:
            yield "The settings alone differ."
        return
    yield from parting(first, ("A", "B"), (found.cuts[0] is not None, found.cuts[1] is not None))
    # Of runs in memory a name is not one that a command takes.
    if all(name and Path(name).exists() for name in found.names):
        a, b = (shlex.quote(name) for name in found.names)
        partial = " --partial" if any(found.cuts) else ""
        yield ""
        yield f"brrt view {a} {b}{partial}"
        # A run that has ended has no such event.
        yield f"brrt replay {b if first.left is None else a} --at-event {first.seq}"


def _row(name: str, a: str, b: str, change: str = "") -> str:
    return fit(f"{name:{_NAME}}{a:>{_VALUE}}{b:>{_VALUE}}{change:>{WIDTH - _NAME - 2 * _VALUE}}")


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
        "cut": {side: cut and cut._asdict() for side, cut in zip("ab", found.cuts, strict=True)},
        "outcome": [
            {"solved": each.get("solved"), "status": each.get("status")} for each in (a, b)
        ],
        "metrics": metrics,
        "events": {name: {"a": x, "b": y} for name, x, y in _kinds(found)},
        "first": None if found.first is None else parting_as_dict(found.first, ("a", "b")),
    }


def _ratio(a: Any, b: Any) -> float | None:
    return None if a in (None, 0) or b is None else (b - a) / abs(a)
