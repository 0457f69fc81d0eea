"""Follows an OMPL planner while it plans, by its checks of motions and its stop condition.

Three hooks of ompl 2.0.1 work in Python: a `MotionValidator`, which sees each motion that is
checked; a `PlannerTerminationCondition`, which is asked in each iteration; and `getPlannerData`
within it.
"""

import gc
import math
from collections.abc import Callable
from time import perf_counter_ns
from typing import Any

import numpy as np
from numpy.typing import NDArray
from ompl import base

from brrt.errors import BrrtError
from brrt.events import Status
from brrt.ompl.batch import Moment
from brrt.ompl.changes import Changes
from brrt.ompl.checks import Checks
from brrt.ompl.hooks import hooked
from brrt.ompl.planner_data import GRAPHS, ONE_TREE, PlannerGraph, read_graph
from brrt.ompl.problem import Problem
from brrt.recorder.recorder import Recorder

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_WAIT_NS = 250_000_000
"""How long the planner's data are not read, at most."""

_SHARE = 20
"""Reading takes at most one part in so many of the time, whatever the size of the tree."""

_SAME_COST = 1e-9
"""Relative difference up to which two paths cost the same."""

_FEWEST = 64
"""Iterations between two reads, at least, as long as it takes less than `_WAIT_NS`."""


class Tracker:
    """Records what a planner does.

    Args:
        problem: The planner and its problem.
        open_recorder: Opens the recording, given the start configuration and a clock.
        exact: Whether to read the planner's data in each iteration.
        must_record: Whether planning ends where the recorder fails.

    Attributes:
        iteration: How often the planner has asked whether to stop; for PRM, its checks.
        read: Returns the numbers of one or two states.
        checks: What was checked since the planner's data were read; see `Checks.of`.
        by_checks: Whether checks of motions are followed instead of the stop condition.
        error: What went wrong in the recorder: nothing is recorded any more then.
    """

    def __init__(
        self,
        problem: Problem,
        open_recorder: Callable[[Floats, Callable[[], int]], Recorder],
        *,
        exact: bool,
        must_record: bool,
    ) -> None:
        self._problem, self._space, self._exact = problem, problem.space, exact
        self._open = open_recorder
        self._recorder: Recorder | None = None
        self.read = problem.space.read
        self._changes: Changes
        self.iteration = 0
        self.error: Exception | None = None
        self.checks: list[float] = []
        self._origin = perf_counter_ns()
        self._held: int | None = None
        self._end: int | None = None
        self._due, self._due_iteration = 0, 0
        self._must_record, self._failed = must_record, False
        self._best = math.inf
        # PRM asks its condition on a thread of its own, while `solve` holds Python's lock: a
        # condition in Python would wait forever. There checks of motions are followed alone.
        self.by_checks = problem.name in GRAPHS
        self._stop = base.plannerNonTerminatingCondition()
        self._raised: BaseException | None = None

    def now(self) -> int:
        """Return the time in ns since planning began, that of the recorder left out."""
        return perf_counter_ns() - self._origin if self._held is None else self._held

    def solve(self, solve: Callable[[Any], Any], request: Any) -> Any:
        """Plan and record; return what `solve` returns.

        Args:
            solve: Plans, given a stop condition.
            request: How long to plan in s, or an `ompl.base.PlannerTerminationCondition`.
        """
        self._origin = perf_counter_ns()
        try:
            with hooked(self._problem.planner, self):
                status = solve(self._condition(request))
            self._raise_kept()
        except BaseException:
            self._close(Status.INTERRUPTED)
            raise
        self._finish()
        return status

    def _raise_kept(self) -> None:
        if self._raised is not None:
            raise self._raised

    def _finish(self) -> None:
        """Record the rest and close the recording."""
        late = self._end is not None and self.now() >= self._end
        self.look()
        states = self._problem.solution()
        if self._recorder is None and self.error is None:
            self._begin_late(states)
        if states is not None:
            self._record_path(states)
            self._close(Status.SOLVED)
        else:
            self._close(Status.TIME_LIMIT if late else Status.ITERATION_LIMIT)

    def _begin_late(self, states: list[Any] | None) -> None:
        """Open the recording of a planner that has shown no vertex: there is a path at most."""
        if states is None:
            why = "the planner has no vertex, and found no path"
            self.error = BrrtError(f"nothing to record of {self._problem.name}: {why}")
            return
        self._held = 0
        try:
            start = np.array(self.read(states[0])) + 0.0
            self._recorder = self._open(start, self.now)
        except BrrtError as error:
            self.error = error
        self._held = None

    def _close(self, status: Status) -> None:
        if self._recorder is not None:
            try:
                self._recorder.close(status)
            except Exception as error:  # noqa: BLE001 - see `error`
                self.error = self.error or error

    def _condition(self, request: Any) -> Any:
        """Return a stop condition that also follows the planner."""
        seconds = request if isinstance(request, int | float) else None
        if self.by_checks:
            if seconds is not None:
                request = base.timedPlannerTerminationCondition(float(seconds))
            return base.plannerOrTerminationCondition(request, self._stop)
        if seconds is not None:
            self._end = int(1e9 * seconds)
            return base.PlannerTerminationCondition(self.asked)
        return base.PlannerTerminationCondition(lambda: self.asked() or request())

    def asked(self) -> bool:
        """Count an iteration; return whether time is up."""
        self.iteration += 1
        now = perf_counter_ns() - self._origin
        if now >= self._due or self.iteration >= self._due_iteration:
            self.look()
        return self._failed or (self._end is not None and now >= self._end)

    def stop(self, raised: BaseException) -> None:
        """Stop PRM, and keep an exception until its `solve` has ended.

        It must not pass through PRM, whose other thread would then end the process.
        """
        self._raised = raised
        self._stop.terminate()

    def look(self) -> None:
        """Read the planner's data and record what has changed; the clock stands still."""
        begin = perf_counter_ns()
        if self.error is None:
            collects = gc.isenabled()
            gc.disable()  # of many small lists that go at once
            try:
                self._update(Moment(begin - self._origin, self.iteration))
            except Exception as error:  # noqa: BLE001 - the planner goes on, see `error`
                self.error = error
                self._fail()
            if collects:
                gc.enable()
        self._held = None
        paused = perf_counter_ns() - begin
        self._origin += paused
        self._due = begin + paused - self._origin + max(_WAIT_NS, _SHARE * paused)
        if self._exact or (self._recorder is None and self.error is None):
            self._due = 0

    def _fail(self) -> None:
        """End planning if it must be recorded."""
        if self._must_record:
            self._failed = True
            self._stop.terminate()

    def _update(self, now: Moment) -> None:
        space = self._space
        graph = read_graph(self._problem.planner, space)
        self._due_iteration = self.iteration + max(len(graph.q), _FEWEST)
        if self._recorder is None:
            if not graph.starts:
                return
            start = graph.q[graph.starts[0]]
            self._held = 0
            self._recorder = self._open(start, self.now)
            self._changes = Changes(space.dof, start)
        checks = Checks.of(self.checks, space.dof, self._origin)
        self.checks.clear()
        self._held = now.t
        columns = self._changes.update(graph, checks, now, lambda i, j: self._lengths(graph, i, j))
        self._recorder.put(columns)
        self._recorder.iteration = now.iteration
        self._improve(graph)

    def _improve(self, graph: PlannerGraph) -> None:
        """Record the best path so far of a planner that goes on after the first."""
        planner = self._problem.planner
        if self._problem.name not in ONE_TREE or not hasattr(planner, "bestCost"):
            return
        if planner.bestCost().value() < self._best * (1 - _SAME_COST):
            for goal in filter(lambda i: self._problem.reaches(graph.states[i]), graph.goals):
                path = graph.path_to(goal)
                if path[0] in graph.starts:
                    self._record_path([graph.states[i] for i in path])

    def _record_path(self, states: list[Any]) -> None:
        """Record a path, unless a better one or the same was recorded."""
        if self._recorder is None or self.error is not None:
            return
        rows = np.array([self.read(state) for state in states]) + 0.0
        cost = self._problem.path_cost(states)
        if cost is None:
            cost = float(np.sqrt((np.diff(rows, axis=0) ** 2).sum(axis=1)).sum())
        if cost < self._best * (1 - _SAME_COST):
            self._best = cost
            self._recorder.path(rows, cost=cost)

    def _lengths(self, graph: PlannerGraph, i: Ints, j: Ints) -> Floats:
        """Return the costs of motions between vertices, shape (n,)."""
        cost = self._problem.cost
        if cost is None:
            return np.asarray(np.sqrt(((graph.q[i] - graph.q[j]) ** 2).sum(axis=1)))
        pairs = zip(i.tolist(), j.tolist(), strict=True)
        return np.array([cost(graph.states[a], graph.states[b]) for a, b in pairs])
