"""Two runs side by side: settings, versions, figures, and the first event at which they part."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

from brrt.comparison.events import Deviation, Difference, first_difference
from brrt.comparison.settings_diff import Row, settings_of, versions_of
from brrt.errors import RecordingError
from brrt.events import Events, Kind
from brrt.replay.metrics import Metrics
from brrt.scenario.manifest import Manifest
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


_NEEDED = ("solved", "status", "iterations", "events")
"""Figures without which an end of a recording says too little."""


@dataclass(frozen=True, slots=True, eq=False)
class Side:
    """One of two runs.

    Attributes:
        name: What it is called.
        manifest: Its manifest.
        world: Its world.
        batches: Its events, in order; where the figures are known, read no further than needed.
        result: The figures that its writer found; None where it did not get to the end.
        counts: Events of each kind, as its writer counted them; None where it is not known.
        cut: Whether it is a recording without figures: it ends ahead of its run's end, unless it
            has counts and its last phase has ended, as what other programs write.
    """

    name: str
    manifest: Manifest
    world: World
    batches: Iterable[Events]
    result: Mapping[str, Any] | None = None
    counts: Mapping[Kind, int] | None = None
    cut: bool = False


class Cut(NamedTuple):
    """How far a recording goes that ends ahead of its run's end.

    Attributes:
        events: How many it has.
        until_s: When the last of them happened, in seconds of the run.
    """

    events: int
    until_s: float


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Comparison:
    """What two runs have in common and what not; a is the first run, b the second.

    Attributes:
        names: What the runs are called.
        settings: The settings that differ: of the scenario, the planner with its defaults, the
            robot, the query and the world's content.
        notes: What differs and is no difference of the runs: a file's name, versions, platform.
        cuts: How far each goes whose recording ends ahead of its run's end, so that its figures
            and counts go as far as that; None where it does not.
        figures: Status and metrics of each.
        timed: Whether the clocks of both were real; otherwise times mean nothing.
        events: Events by kind of each, as far as they are known.
        tolerance: How far apart numbers may be; see `brrt.comparison.events.Deviation`.
        first: The first event that differs, with the ones ahead of it; None where none does.
    """

    names: tuple[str, str]
    settings: tuple[Row, ...]
    notes: tuple[Row, ...]
    cuts: tuple[Cut | None, Cut | None]
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
        from brrt.comparison.report import lines  # noqa: PLC0415 - it imports this module

        return lines(self)

    def __str__(self) -> str:
        return "\n".join(self.lines())

    def __repr__(self) -> str:
        a, b = (name or letter for name, letter in zip(self.names, "AB", strict=True))
        parts = [f"{len(self.settings)} settings differ"] if self.settings else []
        if self.first is not None:
            parts.append(f"events part at {self.first.seq:,}")
        return f"<Comparison of {a} and {b}: {', '.join(parts) or 'equal'}>"

    def as_dict(self) -> dict[str, Any]:
        """Return it as `brrt diff --json` prints it."""
        from brrt.comparison.report import as_dict  # noqa: PLC0415 - it imports this module

        return as_dict(self)


def compare_sides(a: Side, b: Side, tolerance: float = 0.0) -> Comparison:
    """Compare two runs.

    Their events are read up to the first difference, and no further unless a run's figures stand
    nowhere else: those are never of another part of the run than the counts beside them.

    Raises:
        RecordingError: A recording is cut or damaged ahead of the first difference.
    """
    readers = _Reader(a), _Reader(b)
    first = first_difference(*readers, Deviation(allowed=tolerance))
    for reader in readers:
        reader.finish()
    return Comparison(
        (a.name, b.name),
        tuple(settings_of(a.manifest, a.world, b.manifest, b.world)),
        tuple(versions_of(a.manifest, b.manifest)),
        (readers[0].cut(), readers[1].cut()),
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
        self._batches = iter(side.batches)
        self._metrics = Metrics(side.manifest)
        self._last_t = 0
        self._cut, self._ended = side.cut, False

    def __iter__(self) -> Iterator[Events]:
        for batch in self._batches:
            self._metrics.write(batch)
            self._last_t = max(self._last_t, batch.last.t)
            yield batch
        self._ended = True

    def finish(self) -> None:
        """Read the rest for the figures, where the end of the recording does not have them."""
        if self._ended or (not self._side.cut and set(_NEEDED) <= (self._side.result or {}).keys()):
            return
        try:
            for _ in self:
                pass
        except RecordingError:
            # Behind the first difference it takes nothing from that: the figures end here.
            self._cut = self._ended = True

    def cut(self) -> Cut | None:
        """Return how far the recording goes, where it ends ahead of its run's end."""
        if not self._cut or (self._side.counts is not None and not self._metrics.breaks_off):
            return None
        return Cut(sum(self._metrics.counts.values()), self._last_t / 1e9)

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
