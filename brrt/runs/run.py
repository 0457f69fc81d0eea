"""Run a scenario: plan, smooth, execute, and pass every event to the sinks."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from typing import Any, Protocol

import numpy as np

from brrt.errors import BrrtError
from brrt.events import Events, Kind
from brrt.formats.validate import check_possible
from brrt.kernels.event_log import EventLog
from brrt.planners import PLANNERS, check_params, make_planner, make_stop, state_contract
from brrt.planners.base.planner import Planner
from brrt.planners.base.problem import Problem
from brrt.planners.base.stop import Stop
from brrt.planners.postprocessing.execute import Execute
from brrt.planners.postprocessing.shortcut import Shortcut
from brrt.recording import Memory, Recording, Result, Sink
from brrt.replay.metrics import Metrics
from brrt.runs.switch_interval import short_switch_interval
from brrt.scenario.manifest import Manifest, made_by
from brrt.scenario.scenario import Scenario
from brrt.settings import Settings
from brrt.worlds.world import World

_LONG_PATH = 10
"""Length of a long path, in longest sides of its world."""

_REHEARSAL_S = 0.01
"""Planning time of the rehearsal: an iteration may take long."""


class Solver(Protocol):
    """What every planner has; the base class `Planner` adds settings that check themselves."""

    def solve(
        self, problem: Problem, rng: np.random.Generator, log: EventLog, stop: Stop
    ) -> Iterator[Events]:
        """See `Planner.solve`."""


class Run:
    """A checked scenario, ready to run once.

    Args:
        scenario: What to run.
        world: The world, instead of the one that the scenario names.
        planner: Any object with the method `Planner.solve`, and optionally `Planner.contract`,
            instead of the registered planner; the scenario's `planner` is its name.
        batch: Events in a batch at most; the log does not depend on it.

    Raises:
        BrrtError: The scenario cannot be run; nothing has been written.
    """

    _foreign = False  # whether the planner is not registered, so that its events are checked

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
            self._foreign = not PLANNERS.has_imported(type(planner))
        solver = make_planner(scenario) if planner is None else planner
        problem = Problem.of(scenario, world)
        if isinstance(solver, Planner):
            solver.check(problem)
        self._set_up(scenario, problem, solver, batch)

    def _set_up(self, scenario: Scenario, problem: Problem, planner: Solver, batch: int) -> None:
        """Prepare everything that `events` needs."""
        scenario = check_params(scenario)
        self._planner, self.problem = planner, problem
        self._smoother = Shortcut(attempts=scenario.shortcuts) if scenario.smooth else None
        self._execute = Execute(max_move=scenario.max_move) if scenario.execute else None
        if self._execute is not None:
            self._execute.check(_LONG_PATH * problem.world.extent, "this world")
        self._compile()
        self._log = EventLog(problem.dof, batch, logical_clock=scenario.clock == "logical")
        self._rng = np.random.Generator(np.random.PCG64(scenario.seed))
        self._ran = False
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
        """Load or compile the kernels by an iteration or a part of one, before the clock starts."""
        problem, stop = self.problem, Stop(iterations=1, time_s=_REHEARSAL_S)
        rng, log = np.random.Generator(np.random.PCG64(0)), EventLog(problem.dof, 4096)
        for _ in _solved(self._planner, problem, rng, log, stop):
            pass
        if self._smoother is not None:
            path = np.array([problem.start, problem.goal])
            for _ in self._smoother.smooth(path, problem.space, rng, log, stop, 0):
                pass
        if self._execute is not None:
            for _ in self._execute.follow(problem.start[None], problem.space, log, stop, 0):
                pass

    def events(self) -> Iterator[Events]:
        """Plan, smooth and execute; yield the events in batches.

        Raises:
            BrrtError: The run was made before, or a planner that is not registered emits an
                impossible event, such as an unknown phase.
        """
        if self._ran:
            raise BrrtError("a run is made once; make another brrt.Run(scenario) to repeat it")
        self._ran = True
        path, moved, iteration, count = None, False, 0, 0
        for batch in _solved(self._planner, self.problem, self._rng, self._log, self.stop):
            count += len(batch)
            if self._foreign:
                check_possible(batch, count)
            path = _last_path(batch, path)
            moved = moved or Kind.MOVE in batch.counts
            # A planner may continue after its path; iterations never decrease.
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
        # A planner that moves while it plans has reached the goal by now.
        if self._execute is not None and not moved and not self.stop.interrupted:
            motions = self.problem.robot.distance(waypoints[:-1], waypoints[1:])
            self._execute.check(float(np.sum(motions)), "this path")
            yield from self._execute.follow(waypoints, space, self._log, self.stop, iteration)

    def execute(
        self, sinks: Iterable[Sink] = (), watch: Callable[[Metrics], None] | None = None
    ) -> Metrics:
        """Run to the end and pass the events to the sinks, which are closed in any case.

        Args:
            sinks: Where the events go.
            watch: Called with the metrics so far after each batch.
        """
        sinks = list(sinks)
        metrics = Metrics(self.manifest)
        result: Result | None = None
        try:
            with short_switch_interval():
                for batch in self.events():
                    for sink in sinks:
                        sink.write(batch)
                    metrics.write(batch)
                    if watch is not None:
                        watch(metrics)
            result = metrics.as_dict() if sinks else None  # long paths take milliseconds
        finally:
            _close_all(sinks, result)
        return metrics

    def record(self) -> Recording:
        """Run to the end and return the recording, in memory."""
        memory = Memory()
        self.execute([memory])
        return memory.recording(self.manifest, self.problem.world)


def _solved(
    planner: Solver, problem: Problem, rng: np.random.Generator, log: EventLog, stop: Stop
) -> Iterable[Events]:
    """Call a planner's `solve`.

    Raises:
        BrrtError: It is missing, or returns no batches.
    """
    solve: Any = getattr(planner, "solve", None)
    batches = solve(problem, rng, log, stop) if callable(solve) else None
    if not isinstance(batches, Iterable):
        raise BrrtError(
            f"planner {type(planner).__name__} needs a method solve that yields batches of events, "
            "as by log.drain()"
        )
    return batches


def _named(scenario: Scenario, planner: Solver) -> Scenario:
    """Return the scenario with the settings of a given planner.

    Raises:
        BrrtError: The name is that of another, registered planner.
    """
    own = PLANNERS.get(scenario.planner)
    if own is not None and not isinstance(planner, own):
        raise BrrtError(
            f"planner {scenario.planner} is brrt's own; name yours: Scenario(planner='my-planner')"
        )
    settings = planner.as_dict() if isinstance(planner, Settings) else scenario.params
    return replace(scenario, params=settings)


def _last_path(batch: Events, before: Any) -> Any:
    """Return the last path of a batch, or the one before if the batch has none."""
    return batch[Kind.PATH][-1] if Kind.PATH in batch.counts else before


def _close_all(sinks: list[Sink], result: Result | None) -> None:
    """Close every sink, even if one fails."""
    if sinks:
        try:
            sinks[0].close(result)
        finally:
            _close_all(sinks[1:], result)
