"""The base of planners with a compiled loop, which Python calls until the run has ended.

A loop is a kernel `advance(state, space, draws, log, options, limit, draw_limit)`, where `state` is
a NamedTuple with the field `counts`. It returns one of the codes below, and continues where it was
when it is called again.
"""

import math
from abc import abstractmethod
from collections.abc import Callable, Generator, Iterator
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Generic, Self, TypeVar

import numpy as np

from brrt.events import Events, Kind, Phase, Status
from brrt.kernels.event_log import EventLog
from brrt.kernels.jit import prepared
from brrt.kernels.random import copy_state, restore_state
from brrt.planners.base.planner import Planner
from brrt.planners.base.problem import Problem
from brrt.planners.base.stop import Stop
from brrt.scenario.scenario import UNLIMITED

BATCH_FULL, STATE_FULL, PAUSED, LIMIT, ENDED = range(5)
"""Why a loop returned: the log is full, its own arrays are full, it is to pause (see
`emit.paused`), perhaps within an iteration, its iterations or draws are used up, or it has emitted
the end of planning."""

DRAWS, COUNTED, POINTS = range(3)
"""First places of `counts`: draws made, iterations that count, and the waypoints that the log must
have room for before the loop can continue."""
OWN = 3
"""First place of `counts` that a loop may use for itself."""

MOST_DRAWS = 1 << 62
"""In place of a limit of draws: iterations limit the run."""

State = TypeVar("State", bound=Any)


@dataclass(slots=True)
class Kernel(Generic[State]):
    """A compiled loop with its arguments.

    Attributes:
        advance: The loop.
        state: Its trees and its state, a NamedTuple.
        options: Its settings, a NamedTuple.
        enlarged: Returns the same state with more room.
        max_events: Most events that it emits between two checks of the log's room.
        draw_limit: Draws after which the run ends in any case.
    """

    advance: Callable[..., int]
    state: State
    options: Any
    enlarged: Callable[[State], State]
    max_events: int
    draw_limit: int


class KernelRun:
    """A run of a compiled loop: to the end of a budget, and from there with other settings.

    Args:
        kernel: The loop, in its initial state.
        problem: Robot, world, start and goal.
        rng: Source of all random draws.
        log: Numbers and times the events.
    """

    def __init__(
        self, kernel: Kernel[Any], problem: Problem, rng: np.random.Generator, log: EventLog
    ) -> None:
        log.reserve(kernel.max_events + 4)
        self._kernel, self._space, self._rng, self._log = kernel, problem.space, rng, log
        self._draws = copy_state(rng)
        self._advance = prepared(
            kernel.advance, kernel.state, self._space, self._draws, log.buffer, kernel.options, 0, 0
        )
        log.emit(Kind.PHASE, 0, name=Phase.PLAN, status=Status.BEGIN)
        self._began = log.elapsed_s
        self._ended = False

    @property
    def counted(self) -> int:
        """Number of iterations so far that count."""
        return int(self._kernel.state.counts[COUNTED])

    @property
    def drawn(self) -> int:
        """Number of draws so far, whether they count or not."""
        return int(self._kernel.state.counts[DRAWS])

    def advance(self, stop: Stop) -> Generator[Events, None, Status | None]:
        """Yield batches of events up to the end of a budget.

        The clock, an interruption and a limit of events end it within an iteration too.

        Returns:
            Why it ended, which is not in the log yet; None if the loop has emitted the end of
            planning.
        """
        kernel, log, counts = self._kernel, self._log, self._kernel.state.counts
        draw_limit = kernel.draw_limit if stop.draws is None else min(kernel.draw_limit, stop.draws)
        while not self._ended:
            if log.overdue:
                yield log.drain()
            elapsed = log.elapsed_s - self._began
            due = stop.reached(self.counted, elapsed)
            # If a stop is due, the loop still emits what it has found; a count lets it finish the
            # iteration too.
            limit = stop.iterations if due is None else self.counted
            left = math.inf if stop.time_s is None else stop.time_s - elapsed
            at_once = due in (Status.TIME_LIMIT, Status.INTERRUPTED)
            log.allow(0.0 if at_once else left, stop.events)
            state, options, space = kernel.state, kernel.options, self._space
            result = self._advance(
                state, space, self._draws, log.buffer, options, limit, draw_limit
            )
            if result == ENDED:
                self._ended = True
            elif result == BATCH_FULL:
                yield log.drain()
                log.reserve(0, int(counts[POINTS]))
            elif result == STATE_FULL:
                kernel.state = kernel.enlarged(state)
            elif due is not None and (at_once or result == LIMIT):
                return due
            elif result == LIMIT:
                if counts[DRAWS] >= draw_limit:
                    return Status.ITERATION_LIMIT
            elif stop.events is not None and log.count >= stop.events:
                return Status.ITERATION_LIMIT
        return None

    def switch_settings(self, kernel: Kernel[Any], seed: int | None) -> None:
        """Switch to the settings of another loop of the same planner, between two iterations.

        Args:
            kernel: The loop with the new settings; its state is not used.
            seed: Seed of the draws from here on; None to continue with the same generator.
        """
        self._kernel = replace(kernel, state=self._kernel.state)
        if self._log.room < kernel.max_events + 4:
            self._log.reserve(len(self._log) + kernel.max_events + 4)
        if seed is not None:
            self._rng.bit_generator.state = np.random.PCG64(seed).state
            self._draws = copy_state(self._rng)

    def finish(self, stop: Stop) -> Iterator[Events]:
        """Yield batches of events to the end of planning, by the budget or by the planner."""
        status = yield from self.advance(stop)
        restore_state(self._draws, self._rng)
        if status is not None:
            if self._log.room < 1:
                yield self._log.drain()
            self._log.emit(Kind.PHASE, self.drawn, name=Phase.PLAN, status=status)
        yield self._log.drain()


@dataclass(frozen=True, slots=True)
class KernelPlanner(Planner):
    """A planner with a compiled loop.

    Attributes:
        resume_hint: How to continue a run that ended with a path; empty if that is impossible.
    """

    resume_hint: ClassVar[str] = ""

    @abstractmethod
    def kernel(self, problem: Problem, stop: Stop) -> Kernel[Any]:
        """Make the loop in its initial state.

        Args:
            problem: Robot, world, start and goal.
            stop: The budget, by which arrays are allocated.
        """

    def replan_kernel(self, problem: Problem) -> Kernel[Any]:
        """Make the loop that reproduces the beginning of a run, up to a number of draws.

        If a run that ended with a path can continue, it does not emit the end of planning.
        """
        return self.kernel(problem, Stop(iterations=UNLIMITED))

    def ends_like(self, other: Self) -> bool:  # noqa: ARG002
        """Whether these settings end the run at the path at which `other` settings ended it."""
        return True

    def solve(
        self, problem: Problem, rng: np.random.Generator, log: EventLog, stop: Stop
    ) -> Iterator[Events]:
        """See `Planner.solve`."""
        yield from KernelRun(self.kernel(problem, stop), problem, rng, log).finish(stop)
