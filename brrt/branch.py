"""Go on from a recorded state with other settings.

Planning is deterministic, so the state after an iteration is made by planning again up to there,
and it is proved to be the recorded one by holding every event on the way against the recording.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, Protocol

import numpy as np

from brrt.errors import BrrtError, unknown
from brrt.events import Events, Kind, Phase, Status
from brrt.kernels.emit import EventLog
from brrt.planners import PLANNERS
from brrt.planners.drive import Drive, Loop, TreePlanner
from brrt.planners.stop import Stop
from brrt.problem import Problem
from brrt.replay.diff import first_difference
from brrt.scenario import Branch, Manifest, Scenario
from brrt.worlds.world import World

_CHANGEABLE = ("iterations", "time", "smooth", "shortcuts", "execute", "max_move", "deadline")
"""What of a scenario may be another from a branch on, beside the planner's parameters."""

_UNCOUNTED = 10**15


class Recorded(Protocol):
    """A recording, as far as it matters here."""

    @property
    def manifest(self) -> Manifest:
        """What the run was."""

    @property
    def world(self) -> World:
        """The world it ran in."""

    @property
    def batches(self) -> Callable[[], Iterable[Events]]:
        """Call it for the events, in batches, in order."""

    @property
    def name(self) -> str:
        """The file's name, empty where there is none."""


@dataclass(slots=True)
class Shared:
    """The recorded events of planning up to the end of an iteration, all but planning's own end.

    Attributes:
        recorded: The recording.
        iteration: The last that counts.
        events: How many there are, once they were read.
        t: Time of the last of them in ns.
    """

    recorded: Recorded
    iteration: int
    events: int = 0
    t: int = 0

    def __iter__(self) -> Iterator[Events]:
        """Read them."""
        self.events = self.t = 0
        for batch in self.recorded.batches():
            end, _ = _end_of_planning(batch)
            part = batch.until(seq=end, iteration=self.iteration)
            if len(part):
                self.events, self.t = self.events + len(part), part.last.t
                yield part
            if len(part) < len(batch):
                return


def _end_of_planning(batch: Events) -> tuple[int | None, Status | None]:
    """Return the number of the last event ahead of planning's end, and how it ended, if it did."""
    phases = batch[Kind.PHASE]
    ends = phases[(phases["name"] == Phase.PLAN) & (phases["status"] != Status.BEGIN)]
    return (int(ends["seq"][0]) - 1, Status(int(ends["status"][0]))) if len(ends) else (None, None)


def last_whole_iteration(
    batches: Iterable[Events], limits: Mapping[str, int]
) -> tuple[int, Status | None]:
    """Find the last iteration of planning that was over at an instant; -1 if none was.

    Args:
        batches: The events.
        limits: The instant, as `Events.until` takes it; by default the end of planning.

    Returns:
        The iteration, and how planning ended if it did right behind it.
    """
    last = -1
    for batch in batches:
        end, status = _end_of_planning(batch)
        inside = batch.until(seq=end)
        part = inside.until(**limits)
        if len(part):
            last = part.last.iteration
        if len(part) < len(inside):
            following = min(
                int(table["iteration"][len(part[kind])])
                for kind, table in inside.tables.items()
                if len(part[kind]) < len(table)
            )
            return (last if following > last else last - 1), None
        if status is not None:
            return last, status
    # The log breaks off: more of its last iteration may have happened.
    return last - 1, None


def called(recorded: Recorded) -> str:
    """Name a recording in messages."""
    return recorded.name or "the recording"


def branching_point(recorded: Recorded, limits: Mapping[str, int]) -> tuple[int, Status | None]:
    """Find the iteration to branch behind; see `last_whole_iteration`.

    Raises:
        BrrtError: Planning had ended before.
    """
    iteration, status = last_whole_iteration(recorded.batches(), limits)
    if "iteration" in limits and limits["iteration"] > iteration:
        raise BrrtError(
            f"{called(recorded)}: planning ended with iteration {iteration:,}; branch there at the "
            "latest, and what follows planning is made anew"
        )
    return max(iteration, 0), status


def check_open(recorded: Recorded, iteration: int, planner: TreePlanner) -> None:
    """See that a run that ended with a path can go on behind its end.

    Raises:
        BrrtError: The settings say to stop at a path.
    """
    if planner.open_ended() != planner:
        never = planner.open_ended() is None
        remedy = "" if never else ", or let it improve on its path: --param stop_at_first=false"
        raise BrrtError(
            f"{called(recorded)}: the run ended with its path at iteration {iteration:,}; branch "
            f"before that (--at-iteration){remedy}"
        )


def check_budget(recorded: Recorded, drive: Drive, t: int, stop: Stop) -> None:
    """See that the budget, which counts from the start of the run, is not used up.

    Raises:
        BrrtError: It is.
    """
    due = stop.reached(drive.counted, t / 1e9)
    if due is Status.TIME_LIMIT:
        spent = f"{t / 1e9:.6g} s have passed of {stop.time_s:g}; give more by --time"
    elif due is not None or (stop.draws is not None and drive.drawn >= stop.draws):
        most = min(stop.iterations, stop.iterations if stop.draws is None else stop.draws)
        spent = f"{drive.counted:,} of {most:,} iterations are made; give more by --iterations"
    else:
        return
    raise BrrtError(f"{called(recorded)}: at the branch {spent}, counted from the run's start")


def ruling(manifest: Manifest, iteration: int) -> Manifest:
    """Return what a manifest would be without the branches that came after an iteration."""
    kept = tuple(b for b in manifest.branches if b.iteration <= iteration)
    later = manifest.branches[len(kept) :]
    return replace(
        manifest, branches=kept, scenario=later[0].scenario if later else manifest.scenario
    )


def changed(
    manifest: Manifest, params: Mapping[str, Any], seed: int | None, settings: Mapping[str, Any]
) -> Scenario:
    """Return the scenario of a run with other settings; what is not given stays as it was.

    Raises:
        BrrtError: A setting cannot change, or a value is of no use.
    """
    for name in settings:
        if name in _CHANGEABLE:
            continue
        if name in (f.name for f in fields(Scenario)):
            raise BrrtError(f"a branch keeps the {name} of its recording; leave {name} away")
        raise unknown("setting of a branch", name, _CHANGEABLE)
    scenario = manifest.scenario
    values = {**scenario.as_dict(), **settings, "params": {**scenario.params, **params}}
    if "iterations" in settings:
        values["draws"] = None
    if seed is not None:
        values["seed"] = seed
    # The query was drawn from the first seed.
    for name in ("start", "goal"):
        if isinstance(values[name], str):
            values[name] = getattr(manifest, name)
    return Scenario.parse(values)


def tree_planner(scenario: Scenario) -> TreePlanner:
    """Make a scenario's planner, which must be one that can take other settings on its way.

    Raises:
        BrrtError: It is not.
    """
    if scenario.planner not in PLANNERS:
        raise BrrtError(
            f"planner {scenario.planner} is not known here, so nobody can go on with it"
        )
    planner = scenario.make_planner()
    if not isinstance(planner, TreePlanner):
        raise BrrtError(
            f"planner {scenario.planner} draws nothing and its lattice is laid at the start, so "
            "there is nothing to branch from: plan again with other settings"
        )
    return planner


def at_start(
    manifest: Manifest, problem: Problem, rng: np.random.Generator, log: EventLog
) -> Drive:
    """Begin to plan what a manifest says."""
    return Drive(_endless(manifest.stretches[0][1], problem), problem, rng, log)


def _endless(scenario: Scenario, problem: Problem) -> Loop[Any]:
    """Make the loop of a stretch, which ends by count alone."""
    planner = tree_planner(scenario)
    return (planner.open_ended() or planner).loop(problem, Stop(iterations=_UNCOUNTED))


def retrace(
    drive: Drive, manifest: Manifest, problem: Problem, log: EventLog, iteration: int
) -> Iterator[Events]:
    """Plan from the start of a run to the end of an iteration; yield what happens on the way."""
    turns = [(b.iteration, b.seed, after) for b, after in _turns(manifest)]
    for end, seed, scenario in turns:
        yield from drive.go_on(Stop(iterations=_UNCOUNTED, draws=end))
        drive.turn(_endless(scenario, problem), seed)
    yield from drive.go_on(Stop(iterations=_UNCOUNTED, draws=iteration))
    yield log.drain()


def _turns(manifest: Manifest) -> list[tuple[Branch, Scenario]]:
    """Return each branch with the scenario that rules behind it."""
    return [
        (branch, scenario)
        for branch, (_, scenario) in zip(manifest.branches, manifest.stretches[1:], strict=True)
    ]


def proved(
    shared: Shared,
    before: Manifest,
    problem: Problem,
    rng: np.random.Generator,
    log: EventLog,
    made_by: Mapping[str, str],
) -> Drive:
    """Plan again up to the branch; return what plans, in the state that was recorded.

    Args:
        shared: The recorded events up to there.
        before: What ruled up to there.
        problem: Robot, world, start and goal.
        rng: Every random draw comes from here.
        log: Numbers and times the events.
        made_by: The versions here, to be named beside the recorded ones.

    Raises:
        BrrtError: An event is not the recorded one.
    """
    drive = at_start(before, problem, rng, log)
    again = retrace(drive, before, problem, log, shared.iteration)
    found = first_difference(shared, again)
    if found is not None:
        raise BrrtError(
            f"{called(shared.recorded)}: planned again, the run parts from its recording at "
            f"{found} (recorded against planned); {_versions(before.made_by, made_by)}"
        )
    return drive


def _versions(then: Mapping[str, str], now: Mapping[str, str]) -> str:
    unlike = [
        f"{name} {then.get(name)} then, {here} now"
        for name, here in now.items()
        if then.get(name) != here
    ]
    same = ", ".join(f"{name} {here}" for name, here in now.items())
    return "; ".join(unlike) or f"both by {same}"


@dataclass(frozen=True, slots=True)
class Onward:
    """Plans on from a state that was proved to be the recorded one; a solver, see `Planner.solve`.

    Attributes:
        drive: What plans, at the branch.
        shared: The recorded events up to there.
    """

    drive: Drive
    shared: Shared

    def solve(
        self,
        problem: Problem,  # noqa: ARG002
        rng: np.random.Generator,  # noqa: ARG002
        log: EventLog,
        stop: Stop,
    ) -> Iterator[Events]:
        """Yield what was recorded, then what happens from there on."""
        yield from self.shared
        log.resume(self.shared.t)
        yield from self.drive.finish(stop)


@dataclass(frozen=True, slots=True)
class Anew:
    """Plans what a manifest with branches says, from the start; a solver, see `Planner.solve`.

    Attributes:
        manifest: The manifest.
    """

    manifest: Manifest

    def solve(
        self, problem: Problem, rng: np.random.Generator, log: EventLog, stop: Stop
    ) -> Iterator[Events]:
        """Yield everything that happens."""
        *earlier, last = self.manifest.branches
        before = replace(self.manifest, branches=tuple(earlier), scenario=last.scenario)
        drive = at_start(before, problem, rng, log)
        yield from retrace(drive, before, problem, log, last.iteration)
        drive.turn(tree_planner(self.manifest.scenario).loop(problem, stop), last.seed)
        yield from drive.finish(stop)
