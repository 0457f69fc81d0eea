"""Plan a recorded run again up to an instant, and go on from there.

Planning is deterministic, so the state after an iteration is made by planning again up to there,
and it is proved to be the recorded one by holding every event on the way against the recording.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from brrt.comparison.events import first_difference
from brrt.errors import BrrtError
from brrt.events import Events
from brrt.kernels.emit import EventLog
from brrt.planners.base.kernel_planner import UNLIMITED, Kernel, KernelRun
from brrt.planners.base.problem import Problem
from brrt.planners.base.stop import Stop
from brrt.runs.branch import Shared, called, loop_planner
from brrt.scenario.manifest import Manifest
from brrt.scenario.scenario import Scenario


def _at_start(
    manifest: Manifest, problem: Problem, rng: np.random.Generator, log: EventLog
) -> KernelRun:
    """Begin to plan what a manifest says."""
    return KernelRun(_retracing(manifest.stretches[0][1], problem), problem, rng, log)


def _retracing(scenario: Scenario, problem: Problem) -> Kernel[Any]:
    return loop_planner(scenario).retracing(problem)


def _retrace(
    drive: KernelRun, manifest: Manifest, problem: Problem, log: EventLog, iteration: int
) -> Iterator[Events]:
    """Plan from the start of a run to the end of an iteration; yield what happens on the way."""
    for branch, (_, after) in zip(manifest.branches, manifest.stretches[1:], strict=True):
        yield from drive.go_on(Stop(iterations=UNLIMITED, draws=branch.iteration))
        drive.switch_settings(_retracing(after, problem), branch.seed)
    yield from drive.go_on(Stop(iterations=UNLIMITED, draws=iteration))
    yield log.drain()


def proved(
    shared: Shared,
    before: Manifest,
    problem: Problem,
    rng: np.random.Generator,
    log: EventLog,
    made_by: Mapping[str, str],
) -> KernelRun:
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
    drive = _at_start(before, problem, rng, log)
    again = _retrace(drive, before, problem, log, shared.iteration)
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

    drive: KernelRun
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
        drive = _at_start(before, problem, rng, log)
        yield from _retrace(drive, before, problem, log, last.iteration)
        drive.switch_settings(loop_planner(self.manifest.scenario).loop(problem, stop), last.seed)
        yield from drive.finish(stop)
