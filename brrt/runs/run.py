"""Drive a planner: plan, smooth, and hand every event to the sinks."""

import platform
import sys
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from functools import cache
from importlib.metadata import version
from typing import Any, Protocol

import numpy as np

from brrt.errors import BrrtError
from brrt.events import Events, Kind
from brrt.kernels.emit import EventLog
from brrt.planners import PLANNERS, check_params, make_planner, make_stop, state_contract
from brrt.planners.base.problem import Problem
from brrt.planners.base.stop import Stop
from brrt.planners.postprocessing.execute import Execute
from brrt.planners.postprocessing.shortcut import Shortcut
from brrt.recording import Memory, Recording, Result, Sink
from brrt.replay.metrics import Metrics
from brrt.scenario.manifest import Manifest
from brrt.scenario.scenario import Scenario
from brrt.settings import Settings
from brrt.validate import check_possible
from brrt.worlds.world import World

_SWITCH_S = 0.0005


class Solver(Protocol):
    """What a planner has to have; `Planner` is a base class that checks settings too."""

    def solve(
        self, problem: Problem, rng: np.random.Generator, log: EventLog, stop: Stop
    ) -> Iterator[Events]:
        """See `Planner.solve`."""


class Run:
    """A scenario that has been found sound, ready to go once.

    Args:
        scenario: What to run.
        world: A world at hand, as one made by hand; the scenario's `world` is then its name in the
            log. By default the scenario makes its own.
        planner: A planner of your own, any object with `Planner.solve`; the scenario's `planner`
            is then its name in the log. By default the registered one of that name.
        batch: Events in a batch at most; the log does not depend on it.

    Raises:
        BrrtError: The scenario is of no use; nothing has been written anywhere.
    """

    _stranger = False  # whose events are looked at, since somebody else's code emits them

    def __init__(
        self,
        scenario: Scenario,
        *,
        world: World | None = None,
        planner: Solver | None = None,
        batch: int = 8192,
    ) -> None:
        if world is not None:
            scenario = replace(scenario, world=world.name)
        if planner is not None:
            scenario = _named(scenario, planner)
            self._stranger = type(planner) not in PLANNERS.values()
        solver = make_planner(scenario) if planner is None else planner
        self._set_up(scenario, Problem.of(scenario, world), solver, batch)

    def _set_up(self, scenario: Scenario, problem: Problem, planner: Solver, batch: int) -> None:
        """Make ready all that `events` needs."""
        scenario = check_params(scenario)
        self._planner, self.problem = planner, problem
        self._smoother = Shortcut(attempts=scenario.shortcuts) if scenario.smooth else None
        self._execute = Execute(max_move=scenario.max_move) if scenario.execute else None
        self._compile()
        self._log = EventLog(problem.dof, batch, logical_clock=scenario.clock == "logical")
        self._rng = np.random.Generator(np.random.PCG64(scenario.seed))
        self._gone = False
        self.stop = make_stop(scenario)
        self.manifest = Manifest(
            scenario=scenario,
            start=tuple(problem.start.tolist()),
            goal=tuple(problem.goal.tolist()),
            dim=problem.world.dim,
            dof=problem.dof,
            epoch_ns=self._log.epoch_ns,
            made_by=made_by(),
            robot=problem.robot.to_json(),
            contract=state_contract(planner, problem),
        )

    def _compile(self) -> None:
        """Load the kernels, or compile them: one iteration, before the run's clock starts."""
        problem, stop = self.problem, Stop(iterations=1)
        rng, log = np.random.Generator(np.random.PCG64(0)), EventLog(problem.dof, 4096)
        for _ in self._planner.solve(problem, rng, log, stop):
            pass
        if self._smoother is not None:
            path = np.array([problem.start, problem.goal])
            for _ in self._smoother.smooth(path, problem.space, rng, log, stop, 0):
                pass
        if self._execute is not None:
            for _ in self._execute.drive(problem.start[None], problem.space, log, stop, 0):
                pass

    def events(self) -> Iterator[Events]:
        """Plan, smooth, drive; yield what happens, in batches.

        Raises:
            BrrtError: The run has gone already, or a planner of your own emits what no event can
                say, as a phase of its own.
        """
        if self._gone:
            raise BrrtError("a run goes once; make another brrt.Run(scenario) to run it again")
        self._gone = True
        path, moved, iteration, count = None, False, 0, 0
        for batch in self._planner.solve(self.problem, self._rng, self._log, self.stop):
            count += len(batch)
            if self._stranger:
                check_possible(batch, count)
            path = _last_path(batch, path)
            moved = moved or Kind.MOVE in batch.counts
            # A planner may have gone on after its path; the count never falls.
            iteration = max(iteration, batch.last.iteration)
            yield batch
        if path is None:
            return
        waypoints, space = path["waypoints"], self.problem.space
        if self._smoother is not None and not self.stop.interrupted:
            for batch in self._smoother.smooth(
                waypoints, space, self._rng, self._log, self.stop, iteration
            ):
                waypoints = _last_path(batch, path)["waypoints"]
                yield batch
        # A planner that moves as it plans has driven its path by now.
        if self._execute is not None and not moved and not self.stop.interrupted:
            yield from self._execute.drive(waypoints, space, self._log, self.stop, iteration)

    def execute(
        self, sinks: Iterable[Sink] = (), watch: Callable[[Metrics], None] | None = None
    ) -> Metrics:
        """Run to the end, feeding the sinks; they are closed whatever happens.

        Args:
            sinks: Where the events go.
            watch: Called with the figures so far after each batch.
        """
        sinks = list(sinks)
        metrics = Metrics(self.manifest)
        result: Result | None = None
        patience = sys.getswitchinterval()
        try:
            # Between two batches the planner must not wait 5 ms for a recorder to let go.
            sys.setswitchinterval(_SWITCH_S)
            for batch in self.events():
                for sink in sinks:
                    sink.write(batch)
                metrics.write(batch)
                if watch is not None:
                    watch(metrics)
            result = metrics.as_dict()
        finally:
            sys.setswitchinterval(patience)
            _close_all(sinks, result)
        return metrics

    def record(self) -> Recording:
        """Run to the end and return the recording, in memory."""
        memory = Memory()
        self.execute([memory])
        return memory.recording(self.manifest, self.problem.world)


def _named(scenario: Scenario, planner: Solver) -> Scenario:
    """Return the scenario as the log of somebody's own planner states it.

    Raises:
        BrrtError: The name is that of a registered planner, which would be blamed for this one.
    """
    own = PLANNERS.get(scenario.planner)
    if own is not None and not isinstance(planner, own):
        raise BrrtError(
            f"planner {scenario.planner} is brrt's own; name yours: Scenario(planner='my-planner')"
        )
    settings = planner.as_dict() if isinstance(planner, Settings) else scenario.params
    return replace(scenario, params=settings)


def _last_path(batch: Events, before: Any) -> Any:
    """Return the batch's last event of kind path, or the one before where it has none."""
    return batch[Kind.PATH][-1] if Kind.PATH in batch.counts else before


def _close_all(sinks: list[Sink], result: Result | None) -> None:
    """Close every sink, even if one of them fails."""
    if sinks:
        try:
            sinks[0].close(result)
        finally:
            _close_all(sinks[1:], result)


@cache
def made_by() -> dict[str, str]:
    """Versions of brrt and of what decides its numbers, and the platform."""
    names = {name: version(name) for name in ("brrt", "numpy", "numba", "llvmlite")}
    return {
        **names,
        "python": platform.python_version(),
        "platform": f"{platform.system()} {platform.machine()}",
    }
