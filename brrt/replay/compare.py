"""Two runs side by side: settings, versions, figures, and the first event at which they part."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from brrt.events import Events, Kind
from brrt.manifest import Manifest
from brrt.replay.diff import Deviation, Difference, first_difference
from brrt.replay.metrics import Metrics
from brrt.replay.told import Row, settings_of, versions_of
from brrt.worlds.world import World

METRICS = (
    "path_cost", "smoothed_cost", "first_path_cost", "first_path_iteration", "iterations",
    "moves", "charged_moves", "deadline_misses",
)  # fmt: skip
"""Figures that two runs are compared by, besides counts of events by kind."""

TIMES = ("plan_time_s", "smooth_time_s", "first_path_s", "max_move_time_s")
"""Figures that the clock makes; by the logical clock they mean nothing."""

_COUNTED = {
    "samples": Kind.SAMPLE, "rejects": Kind.REJECT, "edges": Kind.EDGE, "rewires": Kind.REWIRE,
    "links": Kind.CONNECT, "expanded": Kind.EXPAND, "learned": Kind.HEURISTIC,
    "shortcuts": Kind.SHORTCUT,
}  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class Side:
    """One of two runs.

    Attributes:
        name: What it is called.
        manifest: Its manifest.
        world: Its world.
        batches: Its events, in order; read no further than needed.
        result: The figures that its writer found; None where it did not get to the end.
        counts: Events of each kind, as its writer counted them; None where it is not known.
    """

    name: str
    manifest: Manifest
    world: World
    batches: Iterable[Events]
    result: Mapping[str, Any] | None = None
    counts: Mapping[Kind, int] | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Comparison:
    """What two runs have in common and what not; a is the first run, b the second.

    Attributes:
        names: What the runs are called.
        settings: The settings that differ: of the scenario, the planner with its defaults, the
            robot, the query and the world's content.
        notes: What differs and is no difference of the runs: a file's name, versions, platform.
        figures: Status and metrics of each; empty where a file has no end.
        timed: Whether the clocks of both were real; otherwise times mean nothing.
        events: Events by kind of each, as far as they are known.
        tolerance: How far apart numbers may be; see `brrt.replay.diff.Deviation`.
        first: The first event that differs, with the ones ahead of it; None where none does.
    """

    names: tuple[str, str]
    settings: tuple[Row, ...]
    notes: tuple[Row, ...]
    figures: tuple[Mapping[str, Any], Mapping[str, Any]]
    timed: bool
    events: tuple[Mapping[str, int], Mapping[str, int]]
    tolerance: float
    first: Difference | None

    @property
    def equal(self) -> bool:
        """Whether the settings are the same, and all events but for times and tolerance."""
        return self.first is None and not self.settings

    def lines(self) -> list[str]:
        """Tell it in plain text, on one screen of 80 columns."""
        from brrt.replay.side_by_side import lines  # noqa: PLC0415 - it imports this module

        return lines(self)

    def as_dict(self) -> dict[str, Any]:
        """Return it as `brrt diff --json` prints it."""
        from brrt.replay.side_by_side import as_dict  # noqa: PLC0415 - it imports this module

        return as_dict(self)


def compare_sides(a: Side, b: Side, tolerance: float = 0.0) -> Comparison:
    """Compare two runs; their events are read up to the first difference, and no further."""
    readers = _Reader(a), _Reader(b)
    first = first_difference(*readers, Deviation(allowed=tolerance))
    return Comparison(
        (a.name, b.name),
        tuple(settings_of(a.manifest, a.world, b.manifest, b.world)),
        tuple(versions_of(a.manifest, b.manifest)),
        (readers[0].figures(), readers[1].figures()),
        all(side.manifest.scenario.clock == "real" for side in (a, b)),
        (readers[0].counts(), readers[1].counts()),
        tolerance,
        first,
    )


class _Reader:
    """Hands on a side's events, and keeps the figures so far."""

    def __init__(self, side: Side) -> None:
        self._side = side
        self._metrics = Metrics(side.manifest)
        self._ended = False

    def __iter__(self) -> Iterator[Events]:
        for batch in self._side.batches:
            self._metrics.write(batch)
            yield batch
        self._ended = True

    def figures(self) -> Mapping[str, Any]:
        """Return the run's figures: its own fold where it was read to its end."""
        return self._metrics.as_dict() if self._ended else (self._side.result or {})

    def counts(self) -> Mapping[str, int]:
        """Return how many events of each kind there are, as far as that is known."""
        side, result = self._side, self._side.result or {}
        if self._ended or side.counts is not None:
            known = self._metrics.counts if self._ended else side.counts or {}
            return {kind.label: known.get(kind, 0) for kind in Kind}
        return {kind.label: result[name] for name, kind in _COUNTED.items() if name in result}
