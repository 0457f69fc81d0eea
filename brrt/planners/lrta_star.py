"""Learning real-time A* (Korf 1990)."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from brrt.events import Events, Kind, Phase, Stage, Status
from brrt.kernels.emit import EventLog
from brrt.kernels.jit import prepared
from brrt.kernels.lattice import (
    BLOCKED,
    Lattice,
    empty_search,
    grown_lattice,
    grown_search,
)
from brrt.planners import _lrta_star, contract
from brrt.planners.a_star import LatticePlanner
from brrt.planners.stop import Stop
from brrt.problem import Problem
from brrt.settings import param

_FIRST_MOVES = 1 << 12


@dataclass(frozen=True, slots=True)
class LRTAStar(LatticePlanner):
    """Learning real-time A* (Korf 1990): look ahead, learn, move, with no path in mind.

    Before each move the best cells are expanded by A* from where the robot is; their estimates
    of the cost to the goal are raised to what the cells around them allow, and the robot goes to
    the best of those. With one cell of lookahead that is Korf's rule; with more it is LSS-LRTA*
    (Koenig and Sun 2009). Ties go to the cell closer to the goal, by what is known by then, and
    then to the one seen first; neighbours are looked at in the order +x, -x, +y, -y, +z, -z.
    """

    lookahead: int = param(1, "cells to expand before a move", low=1, high=10_000)
    trials: int = param(1, "times to start over with what was learnt", low=1)

    def contract(self, problem: Problem) -> contract.Contract:  # noqa: ARG002
        """See `Planner.contract`."""
        grid = contract.Lattice(
            self.epsilon, self.diagonals, self.max_move, self.lookahead, ordered=True
        )
        return contract.Contract(lattice=grid)

    def solve(
        self,
        problem: Problem,
        rng: np.random.Generator,  # noqa: ARG002
        log: EventLog,
        stop: Stop,
    ) -> Iterator[Events]:
        """See `Planner.solve`; an iteration is a move."""
        lattice = self._lattice(problem)
        search, walk = empty_search(len(lattice.keys)), self._walk(lattice)
        counts, space = walk.counts, problem.space
        most = stop.iterations if stop.draws is None else min(stop.iterations, stop.draws)

        log.reserve(max(len(lattice.deltas), self.lookahead) + 8)
        advance = prepared(
            _lrta_star.advance, walk, lattice, search, space, log.buffer, self.lookahead, 0
        )
        log.emit(Kind.PHASE, 0, name=Phase.PLAN, status=Status.BEGIN)
        began = log.elapsed_s
        status = None
        while status is None:
            if log.overdue:
                yield log.drain()
            done = int(counts[_lrta_star.MOVES])
            due = stop.reached(done, log.elapsed_s - began)
            limit = min(done + stop.share(done) if due is None else done, most)
            log.tick()
            result = advance(walk, lattice, search, space, log.buffer, self.lookahead, limit)
            if result == _lrta_star.BATCH_FULL:
                yield log.drain()
            elif result == _lrta_star.TABLE_FULL:
                lattice, search = grown_lattice(lattice), grown_search(search)
                walk = walk._replace(learnt=np.empty(len(lattice.keys)))
            elif result == _lrta_star.TRACE_FULL:
                walk = walk._replace(trace=np.resize(walk.trace, 2 * len(walk.trace)))
            elif result == _lrta_star.ARRIVED:
                _report_trial(walk, lattice, log)
                _return_to_start(walk)
                status = Status.SOLVED if counts[_lrta_star.TRIAL] == self.trials else None
            elif result == _lrta_star.NO_PATH:
                status = Status.NO_PATH
            elif due is None and counts[_lrta_star.MOVES] >= most:
                status = Status.ITERATION_LIMIT
            else:
                status = due
        log.emit(Kind.PHASE, int(counts[_lrta_star.MOVES]), name=Phase.PLAN, status=status)
        yield log.drain()

    def _walk(self, lattice: Lattice) -> _lrta_star.Walk:
        """Put the robot at the start."""
        return _lrta_star.Walk(
            trace=np.zeros(_FIRST_MOVES, np.int32),
            closed=np.empty(self.lookahead, np.int32),
            plan=np.empty(self.lookahead + 2, np.int32),
            learnt=np.empty(len(lattice.keys)),
            length=np.zeros(1),
            counts=np.zeros(9, np.int64),
        )


def _report_trial(walk: _lrta_star.Walk, lattice: Lattice, log: EventLog) -> None:
    """Say which way the robot went in the trial that just ended."""
    counts = walk.counts
    cells = walk.trace[: counts[_lrta_star.STEP] + 1]
    waypoints = lattice.q[cells]
    if cells[-1] == BLOCKED:
        waypoints[-1] = lattice.goal[0]
    log.emit(
        Kind.PATH,
        int(counts[_lrta_star.MOVES]),
        stage=Stage.RAW,
        cost=walk.length[0],
        waypoints=waypoints,
    )


def _return_to_start(walk: _lrta_star.Walk) -> None:
    """Begin the next trial."""
    walk.counts[_lrta_star.TRIAL] += 1
    walk.counts[[_lrta_star.CELL, _lrta_star.STEP, _lrta_star.LAST_LEG]] = 0
    walk.length[0] = 0.0
