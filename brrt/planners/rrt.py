"""Rapidly-exploring random tree (LaValle 1998)."""

from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np

from brrt.kernels.forest import enlarged_forest, rooted_forest
from brrt.planners import _rrt
from brrt.planners.base.kernel_planner import MOST_DRAWS, Kernel, KernelPlanner
from brrt.planners.base.problem import Problem
from brrt.planners.base.stop import Stop
from brrt.scenario.contract import Contract, Draws, Growth
from brrt.scenario.query import Query
from brrt.settings import param

_DRAWS_PER_ITERATION = 1000
"""If failed draws do not count, a run ends after this many draws for each allowed iteration."""


@dataclass(frozen=True, slots=True)
class RRT(KernelPlanner):
    """Rapidly-exploring random tree (LaValle 1998): one tree, rooted at the start.

    Each iteration draws a configuration, steers towards it from the nearest node by at most
    `step`, and adds the new node if the motion is free. It stops at the first path.
    """

    bidirectional: ClassVar[str | None] = "rrt-connect"

    step: float | None = param(
        None, "longest edge; by default 5 % of the world's longest side", above=0
    )
    goal_bias: float = param(0.05, "probability of drawing the goal", low=0, high=1)
    goal_test: Literal["step", "line-of-sight"] = param(
        "step", "the goal is reached from the newest node within one step, or from any distance"
    )
    keep_intermediate: bool = param(False, "add every interpolated point of an extension as a node")
    slices: int = param(10, "points of an extension, with keep_intermediate", low=1, high=1000)
    count_failed: bool = param(True, "draws that add no node count as iterations")

    def contract(self, query: Query) -> Contract:
        """See `Planner.contract`."""
        return Contract(
            step=self._step(query),
            line_of_sight=self.goal_test == "line-of-sight",
            draws=Draws(goal_bias=self.goal_bias),
            growth=Growth(
                slices=self.slices if self.keep_intermediate else 1,
                goal_test=True,
                counts_failed=self.count_failed,
            ),
            stops=True,
        )

    def _step(self, query: Query) -> float:
        return self.step or 0.05 * query.world.extent

    def kernel(self, problem: Problem, stop: Stop) -> Kernel[Any]:
        """See `KernelPlanner.kernel`."""
        options = _rrt.RRTOptions(
            step=self._step(problem),
            goal_bias=self.goal_bias,
            line_of_sight=self.goal_test == "line-of-sight",
            slices=self.slices if self.keep_intermediate else 1,
            count_failed=self.count_failed,
        )
        roots = problem.start[None]
        state = _rrt.RRTState(
            forest=rooted_forest(roots, 2 + (stop.iterations + 1) * options.slices),
            counts=np.zeros(_rrt.COUNTS, np.int64),
            scratch=np.array([problem.start, problem.start, problem.goal]),
        )
        state.counts[_rrt.GOAL_NODE] = -1
        draws = MOST_DRAWS if self.count_failed else _DRAWS_PER_ITERATION * stop.iterations
        return Kernel(_rrt.advance, state, options, _enlarged, options.slices + 4, draws)


def _enlarged(state: _rrt.RRTState) -> _rrt.RRTState:
    return state._replace(forest=enlarged_forest(state.forest))
