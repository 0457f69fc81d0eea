"""What a comparison found: as data, in plain text on a screen of 80 columns, and as JSON."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from brrt.comparison.difference import WIDTH, Difference, brief_pair, clipped
from brrt.comparison.settings import Row
from brrt.replay.text import seconds
from brrt.shell import file_argument

METRICS = (
    "path_cost", "smoothed_cost", "first_path_cost", "first_path_iteration", "iterations",
    "moves", "charged_moves", "deadline_misses",
)  # fmt: skip
"""Metrics that are compared, besides counts of events by kind."""

TIMES = ("plan_time_s", "smooth_time_s", "first_path_s", "max_move_time_s")
"""Metrics that a clock measures; of a logical clock they mean nothing."""

_NAME, _VALUE = 22, 20
"""Columns of a name and of a run's value; the rest is for the change."""

_MOST_ROWS = 12
"""Settings that are printed; there may be very many more."""


class Cut(NamedTuple):
    """The end of a recording that ends before its run's end.

    Attributes:
        events: How many events it has.
        until_s: Time of the last of them, in seconds of the run.
    """

    events: int
    until_s: float


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Comparison:
    """How two runs differ; a is the first run, b the second.

    Attributes:
        names: What the runs are called.
        settings: The settings that differ: of the scenario, the planner, the robot, the query and
            the world's content.
        metadata: What differs but does not decide what a run does: names of files, versions,
            platform.
        cuts: The end of each recording that is cut, so that its metrics and counts cover only the
            run up to there; None for one that is not.
        metrics: Status and metrics of each.
        timed: Whether the clocks of both were real; otherwise times mean nothing.
        counts: Events of each by kind, as far as they are known.
        tolerance: How far apart numbers may be; see `brrt.comparison.events.Deviation`.
        first: The first event that differs; None if none does.
    """

    names: tuple[str, str]
    settings: tuple[Row, ...]
    metadata: tuple[Row, ...]
    cuts: tuple[Cut | None, Cut | None]
    metrics: tuple[Mapping[str, Any], Mapping[str, Any]]
    timed: bool
    counts: tuple[Mapping[str, int], Mapping[str, int]]
    tolerance: float
    first: Difference | None

    @property
    def equal(self) -> bool:
        """Whether all settings and, apart from times, all events are equal."""
        return self.first is None and not self.settings

    def lines(self) -> list[str]:
        """Return what `brrt diff` prints; no line but the commands exceeds 80 columns."""
        return list(_lines(self))

    def __str__(self) -> str:
        return "\n".join(self.lines())

    def __repr__(self) -> str:
        a, b = (name or letter for name, letter in zip(self.names, "AB", strict=True))
        parts = [f"{len(self.settings)} settings differ"] if self.settings else []
        if self.first is not None:
            parts.append(f"the first difference is event {self.first.seq:,}")
        return f"<Comparison of {a} and {b}: {', '.join(parts) or 'equal'}>"

    def as_dict(self) -> dict[str, Any]:
        """Return what `brrt diff --json` prints."""
        a, b = self.metrics
        return {
            "equal": self.equal,
            "names": list(self.names),
            "settings": [row._asdict() for row in self.settings],
            "besides": [row._asdict() for row in self.metadata],
            "cut": {side: cut and cut._asdict() for side, cut in zip("ab", self.cuts, strict=True)},
            "outcome": [
                {"solved": each.get("solved"), "status": each.get("status")} for each in (a, b)
            ],
            "metrics": {
                name: _pair(a.get(name), b.get(name)) for name in ("events", *METRICS, *TIMES)
            },
            "events": {name: {"a": x, "b": y} for name, x, y in _kinds(self)},
            "first": None if self.first is None else self.first.as_dict(("a", "b")),
        }


def _lines(found: Comparison) -> Iterator[str]:
    for letter, name, cut in zip("AB", found.names, found.cuts, strict=True):
        if name or cut is not None:
            yield clipped(f"{letter}  {name}")
        if cut is not None:
            yield clipped(f"   {_cut(cut)}")
    yield from _rows("settings", found.settings, "equal")
    if found.metadata:
        yield from _rows("metadata", found.metadata, "")
    yield ""
    yield from _outcome(found)
    yield from _events(found)
    yield ""
    yield from _difference(found)


def _cut(cut: Cut) -> str:
    if not cut.events:
        return "cut before its first event"
    end = f"event {cut.events - 1:,} ({cut.until_s:.6f} s)"
    return f"cut after {end}; the metrics cover the run up to there"


def _rows(title: str, rows: tuple[Row, ...], none: str) -> Iterator[str]:
    """Yield what differs; long values take a line each."""
    if not rows:
        yield f"{title}: {none}"
        return
    yield _row(title, "A", "B")
    for row in rows[:_MOST_ROWS]:
        a, b = brief_pair(row.a, row.b)
        if max(len(a), len(b)) < _VALUE:
            yield _row(f"  {row.name}", a, b)
        else:
            yield clipped(f"  {row.name:{_NAME - 2}} A  {a}")
            yield clipped(f"{'':{_NAME}} B  {b}")
    if len(rows) > _MOST_ROWS:
        yield f"  ... and {len(rows) - _MOST_ROWS} more (see --json)"


def _outcome(found: Comparison) -> Iterator[str]:
    """Yield how the runs ended, and their metrics."""
    a, b = found.metrics
    yield _row("outcome", *("solved" if each.get("solved") else "not solved" for each in (a, b)))
    ends = [str(each.get("status")) for each in (a, b)]
    if ends != ["solved", "solved"]:
        by = ("running when cut" if cut and end == "running" else end
              for end, cut in zip(ends, found.cuts, strict=True))  # fmt: skip
        yield _row("  ended by", *by)
    a, b = _motions(a), _motions(b)
    printed = [*METRICS, *(TIMES if found.timed else ())]
    printed.insert(METRICS.index("moves"), "motions")
    for name in printed:
        x, y = a.get(name), b.get(name)
        if x is not None or y is not None:
            values = (_seconds(x), _seconds(y)) if name in TIMES else brief_pair(x, y)
            text = name.removesuffix("_s").replace("_", " ")
            yield _row(f"  {text}", *values, _change(x, y))


def _motions(metrics: Mapping[str, Any]) -> dict[str, Any]:
    """Return metrics with the path's motions; moves are kept only of a robot that moved."""
    path = metrics.get("smoothed_path") or metrics.get("path")
    moves = None if metrics.get("max_move_time_s") is None else metrics.get("moves")
    return {**metrics, "moves": moves, "motions": len(path) - 1 if path else None}


def _events(found: Comparison) -> Iterator[str]:
    """Yield the number of events, by kind."""
    rows = [Row("events", *(each.get("events") for each in found.metrics)), *_kinds(found)]
    for name, a, b in rows:
        yield _row(name if name == "events" else f"  {name}", _count(a), _count(b), _change(a, b))


def _kinds(found: Comparison) -> Iterator[Row]:
    """Yield the kinds of events that one of the runs has; None for a number that is unknown."""
    a, b = found.counts
    for name in dict.fromkeys([*a, *b]):
        if a.get(name) or b.get(name):
            yield Row(name, a.get(name), b.get(name))


def _difference(found: Comparison) -> Iterator[str]:
    """Yield the first difference, and the commands that show it."""
    first = found.first
    if first is None:
        how = f"within {found.tolerance:g}" if found.tolerance else "to the last bit"
        yield f"All events are equal {how}, apart from their times."
        if found.settings:
            yield "Only the settings differ."
        return
    yield from first.lines(("A", "B"), (found.cuts[0] is not None, found.cuts[1] is not None))
    if all(name and Path(name).exists() for name in found.names):  # runs in memory have no command
        a, b = map(file_argument, found.names)
        partial = " --partial" if any(found.cuts) else ""
        yield ""
        yield f"brrt view {a} {b}{partial}"
        # Only the longer run has this event.
        yield f"brrt replay {b if first.left is None else a} --at-event {first.seq}"


def _row(name: str, a: str, b: str, change: str = "") -> str:
    rest = WIDTH - _NAME - 2 * _VALUE
    return clipped(f"{name:{_NAME}}{a:>{_VALUE}}{b:>{_VALUE}}{change:>{rest}}")


def _seconds(value: float | None) -> str:
    return "none" if value is None else seconds(value)


def _count(value: int | None) -> str:
    return "unknown" if value is None else f"{value:,}"


def _change(a: Any, b: Any) -> str:
    """Write the change from the first value to the second, relative to the first."""
    if a is None or b is None:
        return ""
    if a == b:
        return "="
    if a == 0:
        return ""
    change = 100 * (b - a) / abs(a)
    return f"{change:+,.3g} %" if abs(change) < 1000 else f"x {b / a:,.3g}"


def _pair(a: Any, b: Any) -> dict[str, Any]:
    """Return two values of a metric, and the change relative to the first."""
    change = None if a in (None, 0) or b is None else (b - a) / abs(a)
    return {"a": a, "b": b, "change": change}
