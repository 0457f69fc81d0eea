"""What planners share in Python: a compiled loop is called until the run has come to its end.

A loop is a kernel `advance(state, space, draws, log, options, limit, draw_limit)`, where `state` is
a NamedTuple with the field `counts`. It returns one of the codes below, and goes on where it was
when it is called again.
"""

from abc import abstractmethod
from collections.abc import Callable, Generator, Iterator
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Generic, Self, TypeVar

import numpy as np

from brrt.events import Events, Kind, Phase, Status
from brrt.kernels.emit import EventLog
from brrt.kernels.jit import prepared
from brrt.kernels.random import borrow, give_back
from brrt.planners.base.planner import Planner
from brrt.planners.base.problem import Problem
from brrt.planners.base.stop import Stop

BATCH_FULL, STATE_FULL, LIMIT, ENDED = range(4)
"""Why a loop returned: the log or its own arrays are full, it has made the iterations that it was
given, or it has said that planning has ended."""

DRAWS, COUNTED, EVENTS, POINTS = range(4)
"""First places of `counts`: draws made, iterations that count, and the events and waypoints that
the log must have room for before a loop can go on, where that is more than usual."""
OWN = 4
"""From here on a loop has places of its own."""

UNLIMITED = 10**15
"""Iterations that no run ever makes."""

State = TypeVar("State", bound=Any)


@dataclass(slots=True)
class Kernel(Generic[State]):
    """A compiled loop with all that it needs.

    Attributes:
        advance: The kernel.
        state: Its trees, and its place in the run.
        options: Its settings, a NamedTuple.
        grown: Returns a state with more room.
        most_events: Events that one of its steps emits at most.
        draw_limit: Draws after which the run ends in any case.
    """

    advance: Callable[..., int]
    state: State
    options: Any
    grown: Callable[[State], State]
    most_events: int
    draw_limit: int


class KernelRun:
    """A loop on its way: it goes on to the end of a budget, and from there with other settings.

    Args:
        loop: What plans.
        problem: Robot, world, start and goal.
        rng: Every random draw comes from here.
        log: Numbers and times the events.
    """

    def __init__(
        self, loop: Kernel[Any], problem: Problem, rng: np.random.Generator, log: EventLog
    ) -> None:
        log.reserve(loop.most_events + 4)
        self._loop, self._space, self._rng, self._log = loop, problem.space, rng, log
        self._draws = borrow(rng)
        self._advance = prepared(
            loop.advance, loop.state, self._space, self._draws, log.buffer, loop.options, 0, 0
        )
        log.emit(Kind.PHASE, 0, name=Phase.PLAN, status=Status.BEGIN)
        self._began = log.elapsed_s
        self._ended = False

    @property
    def counted(self) -> int:
        """Iterations so far, those that count."""
        return int(self._loop.state.counts[COUNTED])

    @property
    def drawn(self) -> int:
        """Draws so far, whether they count or not."""
        return int(self._loop.state.counts[DRAWS])

    def go_on(self, stop: Stop) -> Generator[Events, None, Status | None]:
        """Yield batches of events up to the end of a budget.

        Returns:
            Why it ended, which nobody has said yet; None where the loop has said itself that
            planning has ended.
        """
        loop, log, counts = self._loop, self._log, self._loop.state.counts
        draw_limit = loop.draw_limit if stop.draws is None else min(loop.draw_limit, stop.draws)
        while not self._ended:
            if log.overdue:
                yield log.drain()
            due = stop.reached(self.counted, log.elapsed_s - self._began)
            # Even where the end is due, a loop still says what it has found.
            limit = self.counted if due is not None else self.counted + stop.share(self.counted)
            log.tick()
            result = self._advance(
                loop.state, self._space, self._draws, log.buffer, loop.options, limit, draw_limit
            )
            if result == ENDED:
                self._ended = True
            elif result == BATCH_FULL:
                yield log.drain()
                log.reserve(int(counts[EVENTS]), int(counts[POINTS]))
            elif result == STATE_FULL:
                loop.state = loop.grown(loop.state)
            elif due is None and counts[DRAWS] >= draw_limit:
                return Status.ITERATION_LIMIT
            elif due is not None:
                return due
        return None

    def switch_settings(self, loop: Kernel[Any], seed: int | None) -> None:
        """Take the settings of another loop of the same planner, between two iterations.

        Args:
            loop: Whose settings; its state is left alone.
            seed: Where the draws come from now; None to go on with those at hand.
        """
        self._loop = replace(loop, state=self._loop.state)
        if self._log.room < loop.most_events + 4:
            self._log.reserve(len(self._log) + loop.most_events + 4)
        if seed is not None:
            self._rng.bit_generator.state = np.random.PCG64(seed).state
            self._draws = borrow(self._rng)

    def finish(self, stop: Stop) -> Iterator[Events]:
        """Yield batches of events to the end of the run, which a budget or a path brings."""
        status = yield from self.go_on(stop)
        give_back(self._draws, self._rng)
        if status is not None:
            if self._log.room < 1:
                yield self._log.drain()
            self._log.emit(Kind.PHASE, self.drawn, name=Phase.PLAN, status=status)
        yield self._log.drain()


@dataclass(frozen=True, slots=True)
class KernelPlanner(Planner):
    """What plans by a compiled loop.

    Attributes:
        resume_hint: How a run that ended with a path can go on; empty where none can.
    """

    resume_hint: ClassVar[str] = ""

    @abstractmethod
    def loop(self, problem: Problem, stop: Stop) -> Kernel[Any]:
        """Make the loop at its beginning.

        Args:
            problem: Robot, world, start and goal.
            stop: The budget, which decides how much room is made.
        """

    def retracing(self, problem: Problem) -> Kernel[Any]:
        """Make the loop that retraces a run: it is ended by draws alone.

        Where a run that ended with a path can go on, it does not say that planning has ended.
        """
        return self.loop(problem, Stop(iterations=UNLIMITED))

    def ends_where(self, other: Self) -> bool:  # noqa: ARG002
        """Whether it has ended with its path where another of its kind has."""
        return True

    def solve(
        self, problem: Problem, rng: np.random.Generator, log: EventLog, stop: Stop
    ) -> Iterator[Events]:
        """See `Planner.solve`."""
        yield from KernelRun(self.loop(problem, stop), problem, rng, log).finish(stop)
