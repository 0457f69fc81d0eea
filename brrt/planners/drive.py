"""What tree planners share in Python: a compiled loop is called until the run has come to its end.

A loop is a kernel `advance(state, space, rng, log, options, limit, draw_limit)`, where `state` is
a NamedTuple with the field `counts`. It returns one of the codes below, and goes on where it was
when it is called again.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from brrt.events import Events, Kind, Phase, Stage, Status
from brrt.kernels.emit import EventLog
from brrt.kernels.jit import prepared
from brrt.planners.stop import Stop
from brrt.problem import Problem

BATCH_FULL, STATE_FULL, LIMIT, SOLVED, IMPROVED = range(5)
"""Why a loop returned: the log or its own arrays are full, it has made the iterations that it was
given, it has found the path that ends the run, or a path after which the run goes on."""

DRAWS, COUNTED, NEEDED = range(3)
"""First places of `counts`: draws made, iterations that count, and the room in the log that the
loop needs to go on, if it has to be more than usual. A loop adds its own from `OWN` on."""
OWN = 3

Floats = NDArray[np.float64]
State = TypeVar("State", bound=Any)


@dataclass(slots=True)
class Loop(Generic[State]):
    """A compiled loop with all that it needs.

    Attributes:
        advance: The kernel.
        state: Its trees, and its place in the run.
        options: Its settings, a NamedTuple.
        grown: Returns a state with more room.
        path: Returns the waypoints of the path that was found, and its cost.
        most_events: Events that one of its steps emits at most.
        draw_limit: Draws after which the run ends in any case.
    """

    advance: Callable[..., int]
    state: State
    options: Any
    grown: Callable[[State], State]
    path: Callable[[State], tuple[Floats, float]]
    most_events: int
    draw_limit: int


def drive(
    loop: Loop[Any],
    roots: Floats,
    problem: Problem,
    rng: np.random.Generator,
    log: EventLog,
    stop: Stop,
) -> Iterator[Events]:
    """Yield the run's events in batches, from the beginning of planning to its end.

    Args:
        loop: What plans.
        roots: The roots of its trees, shape (trees, dof); they become the first edges.
        problem: Robot, world, start and goal.
        rng: Every random draw comes from here.
        log: Numbers and times the events.
        stop: Budget and interruption.
    """
    log.reserve(loop.most_events + len(roots) + 4)
    space, options, counts = problem.space, loop.options, loop.state.counts
    draw_limit = loop.draw_limit if stop.draws is None else min(loop.draw_limit, stop.draws)
    advance = prepared(loop.advance, loop.state, space, rng, log.buffer, options, 0, 0)
    log.emit(Kind.PHASE, 0, name=Phase.PLAN, status=Status.BEGIN)
    for tree, root in enumerate(roots):
        log.emit(Kind.EDGE, 0, tree=tree, node=0, parent=-1, cost=0.0, q=root)
    began = log.elapsed_s
    stage, status = Stage.RAW, None
    while status is None:
        counted = int(counts[COUNTED])
        due = stop.reached(counted, log.elapsed_s - began)
        # Even where the end is due, a loop still tests its newest node for the goal.
        limit = counted if due is not None else counted + stop.share(counted)
        log.tick()
        result = advance(loop.state, space, rng, log.buffer, options, limit, draw_limit)
        if result == BATCH_FULL:
            yield log.drain()
            log.reserve(int(counts[NEEDED]))
        elif result == STATE_FULL:
            loop.state = loop.grown(loop.state)
        elif result in (SOLVED, IMPROVED):
            if log.room < 2:
                yield log.drain()
            waypoints, cost = loop.path(loop.state)
            iteration = int(counts[DRAWS])
            log.emit(Kind.PATH, iteration, stage=stage, cost=cost, waypoints=waypoints)
            stage = Stage.IMPROVED
            if result == SOLVED:
                status = Status.SOLVED
        elif due is None and counts[DRAWS] >= draw_limit:
            status = Status.ITERATION_LIMIT
        else:
            status = due
    if log.room < 1:
        yield log.drain()
    log.emit(Kind.PHASE, int(counts[DRAWS]), name=Phase.PLAN, status=status)
    yield log.drain()
