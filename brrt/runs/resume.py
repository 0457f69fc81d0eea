"""Plan a recorded run again up to an iteration, and continue from there.

Planning is deterministic, so planning again restores the state after an iteration. Comparing every
event on the way with the recording proves that it is the recorded state.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from brrt.comparison.events import first_difference
from brrt.errors import BrrtError
from brrt.events import Events, Kind, Phase, Status
from brrt.kernels.event_log import EventLog
from brrt.planners import PLANNERS, make_planner, state_contract
from brrt.planners.base.kernel_planner import Kernel, KernelPlanner, KernelRun
from brrt.planners.base.problem import Problem
from brrt.planners.base.stop import Stop
from brrt.recording import Recording
from brrt.runs.run import Run, Solver
from brrt.scenario.contracts import as_planned
from brrt.scenario.manifest import Manifest, made_by
from brrt.scenario.scenario import UNLIMITED, Scenario


class RecordedRun(Run):
    """A run with the robot, world, start and goal of a recording; the base of runs that repeat it.

    `manifest` is the recording's or a part of it; scenario and planner are those of this run.
    """

    def __init__(
        self,
        recording: Recording,
        manifest: Manifest,
        scenario: Scenario,
        planner: Solver,
        batch: int,
    ) -> None:
        self._set_up(scenario, Problem.recorded(manifest, recording.world), planner, batch)
        contract = state_contract(planner, self.problem, make_planner(scenario))
        self.manifest = replace(self.manifest, contract=contract)
        # A branch may have changed the seed.
        self._rng = np.random.Generator(np.random.PCG64(manifest.stretches[0][1].seed))


@dataclass(slots=True)
class SharedEvents:
    """The recorded events of planning up to the end of an iteration, without the end of planning.

    Attributes:
        recording: The recording.
        iteration: The last iteration.
        count: Number of these events, once they were read.
        t: Time of the last of them in ns, once they were read.
    """

    recording: Recording
    iteration: int
    count: int = 0
    t: int = 0

    def __iter__(self) -> Iterator[Events]:
        """Read them."""
        self.count = self.t = 0
        for batch in self.recording.batches():
            end, _ = end_of_planning(batch)
            part = batch.until(seq=end, iteration=self.iteration)
            if len(part):
                self.count, self.t = self.count + len(part), part.last.t
                yield part
            if len(part) < len(batch):
                return


def end_of_planning(batch: Events) -> tuple[int | None, Status | None]:
    """Return the number of the event before planning ended, and how it ended, if it did."""
    phases = batch[Kind.PHASE]
    ends = phases[(phases["name"] == Phase.PLAN) & (phases["status"] != Status.BEGIN)]
    return (int(ends["seq"][0]) - 1, Status(int(ends["status"][0]))) if len(ends) else (None, None)


def name_of(recording: Recording) -> str:
    """Name a recording in messages."""
    return recording.name or "the recording"


def kernel_planner(scenario: Scenario) -> KernelPlanner:
    """Make a scenario's planner, which must be one that can change settings between iterations.

    Raises:
        BrrtError: It cannot, or is not registered.
    """
    if scenario.planner not in PLANNERS:
        raise BrrtError(
            f"planner {scenario.planner} is not registered, so its runs cannot be continued"
        )
    planner = make_planner(scenario)
    if not isinstance(planner, KernelPlanner):
        raise BrrtError(
            f"planner {scenario.planner} is not a KernelPlanner, so its runs cannot be continued: "
            "plan from the start with other settings"
        )
    return planner


def restored(
    shared: SharedEvents,
    before: Manifest,
    problem: Problem,
    rng: np.random.Generator,
    log: EventLog,
) -> KernelRun | None:
    """Plan again up to the last shared iteration and return the planner in that state.

    Returns:
        The planner; None if the recording ends within that iteration.

    Raises:
        BrrtError: An event differs from the recorded one.
    """
    run = _started(before, problem, rng, log)
    found = first_difference(shared, _replan(run, before, problem, log, shared.iteration))
    if found is not None and found.left is None:
        return None
    if found is not None:
        raise BrrtError(
            f"{name_of(shared.recording)}: planned again, the run differs from its recording at "
            f"{found} (recorded against planned); {_versions(before.made_by, made_by())}"
        )
    return run


def _started(
    manifest: Manifest, problem: Problem, rng: np.random.Generator, log: EventLog
) -> KernelRun:
    first = as_planned(manifest, problem.world)[0]
    return KernelRun(_replan_kernel(first, problem), problem, rng, log)


def _replan_kernel(scenario: Scenario, problem: Problem) -> Kernel[Any]:
    return kernel_planner(scenario).replan_kernel(problem)


def _replan(
    run: KernelRun, manifest: Manifest, problem: Problem, log: EventLog, iteration: int
) -> Iterator[Events]:
    """Plan to the end of an iteration, with the settings of each stretch of the manifest."""
    following = as_planned(manifest, problem.world)[1:]
    for branch, after in zip(manifest.branches, following, strict=True):
        yield from run.advance(Stop(iterations=UNLIMITED, draws=branch.iteration))
        run.switch_settings(_replan_kernel(after, problem), branch.seed)
    yield from run.advance(Stop(iterations=UNLIMITED, draws=iteration))
    yield log.drain()


def _versions(then: Mapping[str, str], now: Mapping[str, str]) -> str:
    unlike = [
        f"{name} {then.get(name)} then, {here} now"
        for name, here in now.items()
        if then.get(name) != here
    ]
    same = ", ".join(f"{name} {here}" for name, here in now.items())
    return "; ".join(unlike) or f"both by {same}"


@dataclass(frozen=True, slots=True)
class Continuation:
    """Continues planning from a restored state after shared events; a solver."""

    run: KernelRun
    shared: SharedEvents

    def solve(
        self,
        problem: Problem,  # noqa: ARG002
        rng: np.random.Generator,  # noqa: ARG002
        log: EventLog,
        stop: Stop,
    ) -> Iterator[Events]:
        """Yield the recorded events, then those of this run."""
        yield from self.shared
        log.resume(self.shared.t)
        yield from self.run.finish(stop)


@dataclass(frozen=True, slots=True)
class BranchedPlan:
    """Plans from the start what a manifest with branches states; a solver."""

    manifest: Manifest

    def solve(
        self, problem: Problem, rng: np.random.Generator, log: EventLog, stop: Stop
    ) -> Iterator[Events]:
        """Yield all events."""
        *earlier, last = self.manifest.branches
        before = replace(
            self.manifest,
            branches=tuple(earlier),
            scenario=last.scenario,
            contract=last.contract,
        )
        run = _started(before, problem, rng, log)
        yield from _replan(run, before, problem, log, last.iteration)
        planner = kernel_planner(as_planned(self.manifest, problem.world)[-1])
        run.switch_settings(planner.kernel(problem, stop), last.seed)
        yield from run.finish(stop)
