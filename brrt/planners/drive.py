"""What tree planners share in Python: a compiled loop is called until the run has come to its end.

A loop is a kernel `advance(state, space, draws, log, options, limit, draw_limit)`, where `state` is
a NamedTuple with the field `counts`. It returns one of the codes below, and goes on where it was
when it is called again.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import numpy as np

from brrt.events import Events, Kind, Phase, Status
from brrt.kernels.emit import EventLog
from brrt.kernels.jit import prepared
from brrt.kernels.random import borrow, give_back
from brrt.planners.stop import Stop
from brrt.problem import Problem

BATCH_FULL, STATE_FULL, LIMIT, SOLVED = range(4)
"""Why a loop returned: the log or its own arrays are full, it has made the iterations that it was
given, or it has said that planning has ended with a path."""

DRAWS, COUNTED, EVENTS, POINTS = range(4)
"""First places of `counts`: draws made, iterations that count, and the events and waypoints that
the log must have room for before a loop can go on, where that is more than usual."""
OWN = 4
"""From here on a loop has places of its own."""

State = TypeVar("State", bound=Any)


@dataclass(slots=True)
class Loop(Generic[State]):
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


def drive(
    loop: Loop[Any], problem: Problem, rng: np.random.Generator, log: EventLog, stop: Stop
) -> Iterator[Events]:
    """Yield the run's events in batches, from the beginning of planning to its end.

    Args:
        loop: What plans.
        problem: Robot, world, start and goal.
        rng: Every random draw comes from here.
        log: Numbers and times the events.
        stop: Budget and interruption.
    """
    log.reserve(loop.most_events + 4)
    space, options, counts, draws = problem.space, loop.options, loop.state.counts, borrow(rng)
    draw_limit = loop.draw_limit if stop.draws is None else min(loop.draw_limit, stop.draws)
    advance = prepared(loop.advance, loop.state, space, draws, log.buffer, options, 0, 0)
    log.emit(Kind.PHASE, 0, name=Phase.PLAN, status=Status.BEGIN)
    began = log.elapsed_s
    status, solved = None, False
    while status is None and not solved:
        counted = int(counts[COUNTED])
        due = stop.reached(counted, log.elapsed_s - began)
        # Even where the end is due, a loop still says what it has found.
        limit = counted if due is not None else counted + stop.share(counted)
        log.tick()
        result = advance(loop.state, space, draws, log.buffer, options, limit, draw_limit)
        if result == SOLVED:
            solved = True
        elif result == BATCH_FULL:
            yield log.drain()
            log.reserve(int(counts[EVENTS]), int(counts[POINTS]))
        elif result == STATE_FULL:
            loop.state = loop.grown(loop.state)
        elif due is None and counts[DRAWS] >= draw_limit:
            status = Status.ITERATION_LIMIT
        else:
            status = due
    give_back(draws, rng)
    if status is not None:
        if log.room < 1:
            yield log.drain()
        log.emit(Kind.PHASE, int(counts[DRAWS]), name=Phase.PLAN, status=status)
    yield log.drain()
