"""Runs that go over a recorded one again: to branch off from it, or to repeat it."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from brrt.events import Status
from brrt.planners import make_planner, make_stop, state_contract
from brrt.planners.base.problem import Problem
from brrt.recording import check_limits
from brrt.runs import branch
from brrt.runs.branch import Recorded
from brrt.runs.resume import Anew, Onward, proved
from brrt.runs.run import Run, Solver, made_by
from brrt.scenario.manifest import Branch, Manifest
from brrt.scenario.scenario import Scenario
from brrt.worlds.world import World


class _Again(Run):
    """A run with the robot, the world and the query of a recorded one."""

    def _set_up_again(
        self, manifest: Manifest, scenario: Scenario, world: World, planner: Solver, batch: int
    ) -> None:
        self._set_up(scenario, Problem.recorded(manifest, world), planner, batch)
        # The first stretch's seed: a branch may have changed it since.
        first = manifest.stretches[0][1].seed
        self._rng = np.random.Generator(np.random.PCG64(first))


class BranchedRun(_Again):
    """Goes on from a recorded state with other settings; what is not given stays as it was.

    It plans again up to there and holds every event against the recording. What it then tells
    begins with the recorded events, times included, and goes on with its own.

    Args:
        recording: What `brrt.read` returns.
        params: Settings of the planner.
        seed: Where the draws come from after the branch; by default the generator goes on.
        settings: Of the scenario: iterations and time, both counted from the start of the run;
            smooth, shortcuts, execute, max_move and deadline.
        batch: Events in a batch at most; the log does not depend on it.
        until: The instant, as `Events.until` takes it: `iteration`, `seq` or `t`. The branch is
            behind the last iteration that was over by then; by default at planning's end.

    Raises:
        BrrtError: There is nothing to go on from, a setting is of no use, or planning again does
            not lead to what was recorded.
    """

    def __init__(
        self,
        recording: Recorded,
        *,
        params: Mapping[str, Any] | None = None,
        seed: int | None = None,
        settings: Mapping[str, Any] | None = None,
        batch: int = 8192,
        **until: int,
    ) -> None:
        branch.check_recording(recording)
        check_limits(until, "params", "seed", "settings", "batch")
        iteration, ended = branch.branching_point(recording, until)
        before = recording.manifest.ruling(iteration)
        scenario = branch.changed(before, params or {}, seed, settings or {})
        planner = branch.loop_planner(scenario)
        parent = branch.loop_planner(before.scenario)
        branch.check_settled(parent, planner)
        # Who changes only what follows planning wants planning to end once more as it did.
        later = ended is not None and seed is None and branch.plans_alike(before.scenario, scenario)
        if later and ended is Status.SOLVED and before.ruling(iteration - 1) == before:
            iteration -= 1
        else:
            branch.check_open(recording, iteration, ended, parent, planner)
        self._set_up_again(before, scenario, recording.world, planner, batch)
        shared = branch.Shared(recording, iteration)
        drive = proved(shared, before, self.problem, self._rng, self._log, made_by())
        if not later:
            branch.check_budget(recording, drive, shared.t, self.stop)
        drive.switch_settings(planner.loop(self.problem, self.stop), seed)
        self._planner = Onward(drive, shared)
        here = Branch(
            parent=recording.manifest.digest(),
            file=recording.name,
            iteration=iteration,
            events=shared.events,
            scenario=before.scenario,
            seed=seed,
            contract=before.contract or state_contract(parent, self.problem),
        )
        # The clock goes on from the branch, so it is this run's own that is right from there on.
        epoch = self.manifest.epoch_ns - (0 if scenario.clock == "logical" else shared.t)
        branches = (*before.branches, here)
        self.manifest = replace(self.manifest, branches=branches, epoch_ns=max(epoch, 0))


class RepeatedRun(_Again):
    """Runs once more what a recording's manifest says, its branches included.

    Args:
        manifest: The recording's.
        world: The recording's.
        draws: Where planning ends, for a run that the clock or a person cut.
        batch: Events in a batch at most; the log does not depend on it.

    Raises:
        BrrtError: The planner is not known here, or the manifest is damaged.
    """

    def __init__(
        self, manifest: Manifest, world: World, *, draws: int | None = None, batch: int = 8192
    ) -> None:
        own = manifest.scenario
        scenario = own if draws is None else with_stop_at(own, draws)
        self._set_up_again(manifest, scenario, world, make_planner(scenario), batch)
        if manifest.branches:
            self._planner = Anew(replace(manifest, scenario=scenario))
            self.manifest = replace(self.manifest, branches=manifest.branches)


def with_stop_at(scenario: Scenario, iteration: int) -> Scenario:
    """Return the scenario of a run that ends at an iteration, where the clock ended the first."""
    most = make_stop(scenario).iterations
    return replace(scenario, draws=max(1, iteration), iterations=most, time=None)
