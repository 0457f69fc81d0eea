"""Where and whether a recorded run can go on with other settings."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, fields
from os import PathLike
from typing import Any, Protocol, runtime_checkable

from brrt.errors import BrrtError, unknown
from brrt.events import Events, Kind, Phase, Status
from brrt.planners import PLANNERS, check_params, make_planner, make_stop
from brrt.planners.base.kernel_planner import KernelPlanner, KernelRun
from brrt.planners.base.stop import Stop
from brrt.scenario.manifest import Manifest
from brrt.scenario.scenario import Scenario
from brrt.worlds.world import World

_CHANGEABLE = ("iterations", "time", "smooth", "shortcuts", "execute", "max_move", "deadline")
"""What of a scenario may be another from a branch on, beside the planner's parameters."""


@runtime_checkable
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
        BrrtError: Planning had ended before, or nothing was recorded.
    """
    if not any(map(len, recorded.batches())):
        raise BrrtError(f"{called(recorded)}: it holds no event to branch behind")
    iteration, status = last_whole_iteration(recorded.batches(), limits)
    if "iteration" in limits and limits["iteration"] > iteration:
        end = "it breaks off behind" if status is None else "planning ended with"
        raise BrrtError(
            f"{called(recorded)}: {end} iteration {iteration:,}; branch there at the latest, and "
            "what follows planning is made anew"
        )
    return max(iteration, 0), status


def check_recording(given: Any) -> None:
    """See that what is to be gone on from is a recording.

    Raises:
        BrrtError: It is the name of one, or something else.
    """
    if isinstance(given, str | PathLike):
        path = str(given)
        raise BrrtError(f"a branch goes on from a recording: give brrt.read({path!r})")
    if not isinstance(given, Recorded):
        kind = type(given).__name__
        raise BrrtError(f"a branch goes on from what brrt.read returns, not from {kind}")


def check_open(
    recorded: Recorded,
    iteration: int,
    ended: Status | None,
    before: KernelPlanner,
    now: KernelPlanner,
) -> None:
    """See that a run can go on behind its end.

    Args:
        recorded: The recording.
        iteration: Where the branch is to be.
        ended: How planning ended there; None where it did not.
        before: The planner up to there.
        now: The planner from there on.

    Raises:
        BrrtError: The run ended with a path and the settings say to stop there, or with the proof
            that there is no path.
    """
    if ended is Status.SOLVED and now.ends_where(before):
        remedy = f", or {now.resume_hint}" if now.resume_hint else ""
        outcome = "its path"
    elif ended is Status.NO_PATH:
        remedy, outcome = "", "the proof that there is no path"
    else:
        return
    raise BrrtError(
        f"{called(recorded)}: the run ended with {outcome} at iteration {iteration:,}; branch "
        f"before that (--at-iteration){remedy}"
    )


def check_budget(recorded: Recorded, drive: KernelRun, t: int, stop: Stop) -> None:
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
            raise BrrtError(f"a branch keeps the {name} of its recording; leave out {name}")
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
    return check_params(Scenario.parse(values))


def loop_planner(scenario: Scenario) -> KernelPlanner:
    """Make a scenario's planner, which must be one that can take other settings on its way.

    Raises:
        BrrtError: It is not.
    """
    if scenario.planner not in PLANNERS:
        raise BrrtError(
            f"planner {scenario.planner} is not known here, so nobody can go on with it"
        )
    planner = make_planner(scenario)
    if not isinstance(planner, KernelPlanner):
        raise BrrtError(
            f"planner {scenario.planner} cannot be stopped and go on (it is no LoopPlanner): plan "
            "again with other settings"
        )
    return planner


def plans_alike(before: Scenario, now: Scenario) -> bool:
    """Whether two scenarios differ, but in nothing that planning knows of."""
    same = make_planner(before) == make_planner(now) and make_stop(before) == make_stop(now)
    return same and before != now


def check_settled(before: KernelPlanner, now: KernelPlanner) -> None:
    """See that nothing is another that was settled when the run began.

    Raises:
        BrrtError: Something is.
    """
    for name in now.fixed_params:
        then, wanted = getattr(before, name), getattr(now, name)
        if wanted != then:
            raise BrrtError(
                f"{name} cannot be {wanted} from here on: the lattice was laid at the start, with "
                f"{name} {then}; leave it out, or plan again"
            )
