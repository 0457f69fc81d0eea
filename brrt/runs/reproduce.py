"""Reproduce a recorded run from its manifest alone, and compare event by event."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, Self

from brrt.comparison.difference import Difference
from brrt.comparison.events import Deviation, first_difference
from brrt.comparison.settings import Row, differing
from brrt.errors import BrrtError
from brrt.events import Events, Kind, Phase, Status
from brrt.planners import PLANNERS, make_planner, make_stop
from brrt.recording import Recording
from brrt.runs.resume import BranchedPlan, RecordedRun
from brrt.scenario.contracts import as_planned
from brrt.scenario.manifest import made_by
from brrt.scenario.scenario import Scenario

TOLERANCE = 1e-9
"""Greatest deviation of numbers that another machine may have rounded; see `Deviation`."""

_BY_COUNT: Mapping[tuple[int, int], int] = {
    (Phase.PLAN, Status.TIME_LIMIT): Status.ITERATION_LIMIT,
    (Phase.PLAN, Status.INTERRUPTED): Status.ITERATION_LIMIT,
    (Phase.SMOOTH, Status.INTERRUPTED): Status.DONE,
    (Phase.EXECUTE, Status.INTERRUPTED): Status.DONE,
}
"""How a phase that the clock or an interruption ended ends when a count ends it instead."""


class ReproducedRun(RecordedRun):
    """Runs again what a recording's manifest states, its branches included.

    Args:
        recording: The recording; its events are not read.
        draws: Iteration at which planning ends, for a run that the clock or an interruption ended.
        batch: Events in a batch at most; the log does not depend on it.

    Raises:
        BrrtError: The planner is not registered, or the manifest is damaged.
    """

    def __init__(
        self, recording: Recording, *, draws: int | None = None, batch: int = 8192
    ) -> None:
        manifest = recording.manifest
        scenario = manifest.scenario
        if draws is not None:
            scenario = stopped_at(scenario, draws)
        planner = make_planner(as_planned(manifest, recording.world)[-1])
        super().__init__(recording, manifest, scenario, planner, batch)
        if manifest.branches:
            self._planner = BranchedPlan(replace(manifest, scenario=scenario))
            self.manifest = replace(self.manifest, branches=manifest.branches)


def stopped_at(scenario: Scenario, iteration: int) -> Scenario:
    """Return the scenario of a run that ends at an iteration instead of by the clock."""
    limit = make_stop(scenario).iterations
    return replace(scenario, draws=max(1, iteration), iterations=limit, time=None)


@dataclass(frozen=True, slots=True, eq=False)
class Reproduction:
    """How a reproduced run compares with its recording.

    Attributes:
        events: Events that were compared.
        first: The first one that differs; None if none does.
        deviation: The allowed and the greatest deviation of numbers.
        versions: Versions, and the platform, that differ here.
        ended: What ended the recorded run from outside; empty if nothing did.
    """

    events: int
    first: Difference | None
    deviation: Deviation
    versions: tuple[Row, ...]
    ended: str

    @property
    def equal(self) -> bool:
        """Whether all integers are equal, and all numbers within the tolerance."""
        return self.first is None

    def lines(self) -> Iterator[str]:
        """Write it as plain text."""
        for row in self.versions:
            yield f"made with {row.name} {row.a or 'unknown'}; here it is {row.b or 'unknown'}"
        if self.ended:
            yield f"{self.ended}; it was planned again up to there"
        if self.first is not None:
            yield from self.first.lines(("recorded", "again"))
            return
        far = self.deviation
        how = "equal to the last bit"
        if far.worst:
            how = f"equal within {far.allowed:g}: at most {far.worst:.2g} apart"
            how += f" (event {far.seq:,}, {far.name})"
        yield f"planned again: {self.events:,} events, {how}"

    def as_dict(self) -> dict[str, Any]:
        """Return it as `brrt verify --rerun --json` prints it."""
        first, far = self.first, self.deviation
        return {
            "equal": self.equal,
            "events": self.events,
            "tolerance": far.allowed,
            "worst_deviation": far.worst,
            "worst_event": far.seq if far.worst else None,
            "worst_field": far.name or None,
            "versions": [row._asdict() for row in self.versions],
            "ended": self.ended or None,
            "first": first and first.as_dict(("recorded", "again")),
        }


def reproduce(
    recording: Recording,
    *,
    tolerance: float = TOLERANCE,
    watch: Callable[[int, int], None] | None = None,
) -> Reproduction:
    """Run a recording's manifest again and compare the events; neither log is kept in memory.

    World, robot, start and goal are the recorded ones. Times are not compared. A run that the
    clock or an interruption ended is ended at the same iteration.

    Args:
        recording: The recording; its events are read twice.
        tolerance: Greatest deviation of numbers; see `Deviation`.
        watch: Called with the events made so far and their number in the recording.

    Raises:
        BrrtError: The planner is not registered, or the manifest is damaged.
    """
    manifest = recording.manifest
    planner, deviation = manifest.scenario.planner, Deviation(allowed=tolerance)
    if planner not in PLANNERS:
        raise BrrtError(
            f"planner {planner} is not registered; only a program that has it can plan the run "
            "again"
        )
    end = _Ending.of(recording.batches())
    made = _run(recording, end).events()
    if watch is not None:
        made = _watched(made, end.events, watch)
    if end.cut or end.interrupted:
        made = _first(end.compared, made)
    kept = map(_ended_by_count, _first(end.compared, recording.batches()))
    first, ended = first_difference(kept, made, deviation), end.text()
    extra = first.right if first is not None and first.left is None else None
    if extra is not None and (extra["kind"], extra.get("status")) == ("phase", "begin"):
        # An interruption between two phases leaves no event: the next phase is missing.
        ended, first = f"the run was interrupted before the phase {extra['name']}", None
    versions = tuple(differing("", manifest.made_by, made_by()))
    return Reproduction(end.compared, first, deviation, versions, ended)


def _run(recording: Recording, end: "_Ending") -> ReproducedRun:
    """Make the run, ended by counts where the clock or an interruption ended the recorded one."""
    if end.attempts is not None:
        manifest = recording.manifest
        scenario = replace(manifest.scenario, shortcuts=end.attempts)
        recording = replace(recording, manifest=replace(manifest, scenario=scenario))
    run = ReproducedRun(recording, draws=end.draws)
    # A run may have ended before its first draw, or within an iteration; a scenario cannot state
    # that.
    run.stop.draws = run.stop.draws if end.draws is None else end.draws
    run.stop.events, run.stop.time_s = end.planned, None
    return run


@dataclass(slots=True)
class _Ending:
    """How a recorded run ended.

    Attributes:
        events: Number of events.
        draws: The iteration at which the clock or an interruption ended planning.
        planned: The number of events before that.
        attempts: Shortcuts after which smoothing was interrupted.
        by_clock: Whether the clock ended planning.
        interrupted: Whether a phase was interrupted.
        moving: Whether that phase was execution.
        cut: Whether the log ends within a phase.
    """

    events: int = 0
    draws: int | None = None
    planned: int | None = None
    attempts: int | None = None
    by_clock: bool = False
    interrupted: bool = False
    moving: bool = False
    cut: bool = True

    @classmethod
    def of(cls, batches: Iterable[Events]) -> Self:
        """Fold a log."""
        end, attempts = cls(), 0
        for batch in batches:
            end.events += len(batch)
            attempts += len(batch[Kind.SHORTCUT])
            for event in batch[Kind.PHASE]:
                end._take(event, attempts)
                end.cut = int(event["seq"]) < end.events - 1 or event["status"] == Status.BEGIN
            if len(batch) and not len(batch[Kind.PHASE]):
                end.cut = True
        return end

    def _take(self, event: Any, attempts: int) -> None:
        """Take the event that begins or ends a phase."""
        phase, status = int(event["name"]), int(event["status"])
        if (phase, status) not in _BY_COUNT:
            return
        self.by_clock |= status == Status.TIME_LIMIT
        self.interrupted |= status == Status.INTERRUPTED
        if phase == Phase.PLAN:
            self.draws, self.planned = int(event["iteration"]), int(event["seq"])
        elif phase == Phase.SMOOTH:
            self.attempts = attempts
        else:
            self.moving = True

    @property
    def compared(self) -> int:
        """Events to compare: where execution was interrupted, the reproduced run makes a move."""
        return self.events - self.moving

    def text(self) -> str:
        """Say what ended the run from outside; empty if nothing did."""
        if self.interrupted:
            place = f" in iteration {self.draws:,}" if self.draws else ""
            return f"the run was interrupted{place}"
        if self.cut:
            place = f"after event {self.events - 1:,}" if self.events else "before any event"
            return f"the recording is cut {place}"
        return f"the clock ended planning in iteration {self.draws:,}" if self.by_clock else ""


def _first(count: int, batches: Iterable[Events]) -> Iterator[Events]:
    """Yield the first events of a log; the last batch is cut."""
    left = count
    for batch in batches:
        part = batch.until(seq=count - 1)
        if len(part):
            yield part
        left -= len(batch)
        if left <= 0:
            return


def _watched(
    batches: Iterable[Events], total: int, watch: Callable[[int, int], None]
) -> Iterator[Events]:
    """Yield batches and report the progress after each."""
    done = 0
    for batch in batches:
        yield batch
        done += len(batch)
        watch(done, total)


def _ended_by_count(batch: Events) -> Events:
    """Replace the status of phases that the clock or an interruption ended."""
    phases = batch[Kind.PHASE]
    if not len(phases):
        return batch
    changed = phases.copy()
    for row in changed:
        row["status"] = _BY_COUNT.get((int(row["name"]), int(row["status"])), row["status"])
    return Events(batch.dof, {**batch.tables, Kind.PHASE: changed})
