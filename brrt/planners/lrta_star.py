"""Learning real-time A* (Korf 1990)."""

from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self

import numpy as np

from brrt.kernels.lattice import empty_search, enlarged_lattice, enlarged_search
from brrt.planners import _lrta_star
from brrt.planners.a_star import LatticePlanner
from brrt.planners.base.kernel_planner import MOST_DRAWS, Kernel
from brrt.planners.base.problem import Problem
from brrt.planners.base.stop import Stop
from brrt.scenario import contract
from brrt.scenario.query import Query
from brrt.scenario.scenario import UNLIMITED
from brrt.settings import param

_MOST_AHEAD = 10_000
_FIRST_MOVES = 1 << 12


@dataclass(frozen=True, slots=True)
class LRTAStar(LatticePlanner):
    """Learning real-time A* (Korf 1990): look ahead, learn, move, without a path.

    Before each move A* expands cells from the robot's; their estimates of the cost-to-go are raised
    to what their neighbours allow, and the robot moves to the best of those. With a lookahead of
    one cell that is Korf's rule; with more it is LSS-LRTA* (Koenig and Sun 2009). Ties go to the
    cell closer to the goal by its current estimate, then to the oldest; neighbours are visited in
    the order +x, -x, +y, -y, +z, -z.
    """

    resume_hint: ClassVar[str] = "let it start over with what it has learned: --param trials=10"

    lookahead: int = param(1, "cells to expand before a move", low=1, high=_MOST_AHEAD)
    trials: int = param(1, "runs from the start, each with what the ones before learned", low=1)

    def contract(self, query: Query) -> contract.Contract:
        """See `Planner.contract`."""
        grid = replace(
            self.resolved(query), lookahead=self.lookahead, ordered=True, trials=self.trials
        )
        return contract.Contract(lattice=grid)

    def replan_kernel(self, problem: Problem) -> Kernel[Any]:
        """See `KernelPlanner.replan_kernel`."""
        kernel = self.kernel(problem, Stop(iterations=UNLIMITED))
        return replace(kernel, options=kernel.options._replace(open_ended=True))

    def ends_like(self, other: Self) -> bool:
        """See `KernelPlanner.ends_like`."""
        return self.trials <= other.trials

    def kernel(self, problem: Problem, stop: Stop) -> Kernel[Any]:  # noqa: ARG002
        """See `KernelPlanner.kernel`."""
        lattice = self._lattice(problem)
        state = _lrta_star.LRTAStarState(
            lattice=lattice,
            search=empty_search(len(lattice.keys)),
            trace=np.zeros(_FIRST_MOVES, np.int32),
            closed=np.empty(_MOST_AHEAD, np.int32),
            plan=np.empty(_MOST_AHEAD + 2, np.int32),
            learned=np.empty(len(lattice.keys)),
            length=np.zeros(1),
            counts=np.zeros(_lrta_star.COUNTS, np.int64),
        )
        options = _lrta_star.LRTAStarOptions(self.lookahead, self.trials, open_ended=False)
        most = max(len(lattice.deltas), self.lookahead) + 4
        return Kernel(_lrta_star.advance, state, options, _enlarged, most, MOST_DRAWS)


def _enlarged(state: _lrta_star.LRTAStarState) -> _lrta_star.LRTAStarState:
    if state.counts[_lrta_star.STEP] + 1 >= len(state.trace):
        return state._replace(trace=np.resize(state.trace, 2 * len(state.trace)))
    lattice = enlarged_lattice(state.lattice)
    learned = np.empty(len(lattice.keys))
    return state._replace(lattice=lattice, search=enlarged_search(state.search), learned=learned)
