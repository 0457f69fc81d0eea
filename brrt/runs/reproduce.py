"""Plan a recorded run again, from its manifest alone, and compare event by event."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, Self, TypeGuard

from brrt.comparison.difference import Difference, Event
from brrt.comparison.events import Deviation, first_difference
from brrt.comparison.settings import Row, rows_of
from brrt.errors import BrrtError
from brrt.events import Events, Kind, Phase, Status
from brrt.planners import PLANNERS
from brrt.runs.branched import RepeatedRun
from brrt.runs.run import Run, made_by
from brrt.scenario.manifest import Manifest
from brrt.worlds.world import World

TOLERANCE = 1e-9
"""How far apart numbers may be that another machine has rounded; see `Deviation`."""

_BY_COUNT: Mapping[tuple[int, int], int] = {
    (Phase.PLAN, Status.TIME_LIMIT): Status.ITERATION_LIMIT,
    (Phase.PLAN, Status.INTERRUPTED): Status.ITERATION_LIMIT,
    (Phase.SMOOTH, Status.INTERRUPTED): Status.DONE,
    (Phase.EXECUTE, Status.INTERRUPTED): Status.DONE,
}
"""How a phase ends that the clock or a person ended, where it is ended by count instead."""


@dataclass(frozen=True, slots=True, eq=False)
class Again:
    """How a run that was planned again compares with its recording.

    Attributes:
        events: Events that were compared.
        first: The first one that differs; None where none does.
        deviation: How far apart numbers may be, and how far apart they were.
        versions: What is another version, or platform, here.
        ended: What ended the recorded run, where that was not the run itself; empty where it was.
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
        """Tell it in plain text."""
        for row in self.versions:
            yield f"made with {row.name} {row.a or 'unknown'}; here it is {row.b or 'unknown'}"
        if self.ended:
            yield f"{self.ended}; it was planned again as far as that"
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


def plan_again(
    manifest: Manifest,
    world: World,
    batches: Callable[[], Iterable[Events]],
    *,
    tolerance: float = TOLERANCE,
    watch: Callable[[int, int], None] | None = None,
) -> Again:
    """Plan a recorded run again and compare; neither log is held in memory.

    World, robot, start and goal are those of the recording, wherever they came from. Times do not
    count. Where the clock or a person ended the run, it is ended after the same iteration.

    Args:
        manifest: The run's.
        world: The run's.
        batches: Call it for the recorded events, in order; it is called twice.
        tolerance: How far apart numbers may be; see `Deviation`.
        watch: Called with the events planned so far and those that there are.

    Raises:
        BrrtError: The planner is not known here, or the recording is of no use.
    """
    scenario, deviation = manifest.scenario, Deviation(allowed=tolerance)
    if scenario.planner not in PLANNERS:
        raise BrrtError(
            f"planner {scenario.planner} is not known here; only a program that has it can plan "
            f"the run again"
        )
    end = _Ending.of(batches())
    run = _run(manifest, world, end)
    again = run.events() if watch is None else _watched(run.events(), end.events, watch)
    if end.cut or end.by_person:
        again = _up_to(end.compared, again)
    first = first_difference(
        map(_ended_by_count, _up_to(end.compared, batches())), again, deviation
    )
    ended = end.told()
    if first is not None and first.left is None and _begins_phase(first.right):
        # Between two phases no event says that a person ended the run: the next phase is missing.
        ended, first = f"somebody ended the run ahead of the phase {first.right['name']}", None
    versions = tuple(rows_of("", manifest.made_by, made_by()))
    return Again(end.compared, first, deviation, versions, ended)


def _run(manifest: Manifest, world: World, end: "_Ending") -> Run:
    """Make the run that the manifest tells of, ended by count where it was ended otherwise."""
    if end.attempts is not None:
        manifest = replace(manifest, scenario=replace(manifest.scenario, shortcuts=end.attempts))
    run = RepeatedRun(manifest, world, draws=end.draws)
    # A run may have been ended ahead of its first draw, which no scenario can say.
    run.stop.draws = run.stop.draws if end.draws is None else end.draws
    run.stop.time_s = None
    return run


@dataclass(slots=True)
class _Ending:
    """How a recorded run ended.

    Attributes:
        events: Events that there are.
        draws: The iteration at which the clock or a person ended planning.
        attempts: Shortcuts after which a person ended smoothing.
        by_clock: Whether the clock ended planning.
        by_person: Whether a person ended a phase.
        driving: Whether that was the robot's drive.
        cut: Whether the log breaks off within a phase.
    """

    events: int = 0
    draws: int | None = None
    attempts: int | None = None
    by_clock: bool = False
    by_person: bool = False
    driving: bool = False
    cut: bool = True

    @classmethod
    def of(cls, batches: Iterable[Events]) -> Self:
        """Go through a log."""
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
        """Take in the beginning or the end of a phase."""
        phase, status = int(event["name"]), int(event["status"])
        if (phase, status) not in _BY_COUNT:
            return
        self.by_clock |= status == Status.TIME_LIMIT
        self.by_person |= status == Status.INTERRUPTED
        if phase == Phase.PLAN:
            self.draws = int(event["iteration"])
        elif phase == Phase.SMOOTH:
            self.attempts = attempts
        else:
            self.driving = True

    @property
    def compared(self) -> int:
        """Events that a run can be held to; a drive that goes on has a move for its last."""
        return self.events - self.driving

    def told(self) -> str:
        """Say what ended the run, where that was not the run itself."""
        if self.by_person:
            return "somebody ended the run" + (
                f" in iteration {self.draws:,}" if self.draws else ""
            )
        if self.cut:
            place = f"behind event {self.events - 1:,}" if self.events else "ahead of any event"
            return f"the recording breaks off {place}"
        return f"the clock ended planning in iteration {self.draws:,}" if self.by_clock else ""


def _up_to(count: int, batches: Iterable[Events]) -> Iterator[Events]:
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
    """Say after each batch how far the run is."""
    done = 0
    for batch in batches:
        yield batch
        done += len(batch)
        watch(done, total)


def _ended_by_count(batch: Events) -> Events:
    """Let a phase that the clock or a person ended have ended by count."""
    phases = batch[Kind.PHASE]
    if not len(phases):
        return batch
    changed = phases.copy()
    for row in changed:
        row["status"] = _BY_COUNT.get((int(row["name"]), int(row["status"])), row["status"])
    return Events(batch.dof, {**batch.tables, Kind.PHASE: changed})


def _begins_phase(event: Event | None) -> TypeGuard[Event]:
    return event is not None and event["kind"] == "phase" and event["status"] == "begin"
