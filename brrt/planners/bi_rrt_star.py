"""Bidirectional RRT*: two trees that both choose parents and rewire."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from brrt.planners import _rrt_star
from brrt.planners.base.kernel_planner import Kernel
from brrt.planners.base.problem import Problem
from brrt.planners.base.stop import Stop
from brrt.planners.rrt_star import StarPlanner, make_kernel
from brrt.scenario.query import Query
from brrt.settings import param


@dataclass(frozen=True, slots=True)
class BiRRTStar(StarPlanner):
    """Bidirectional RRT* (Jordan and Perez 2013): RRT* from the start and from the goal.

    The trees take turns: one grows towards a sample, the other towards the new node, and both
    choose parents and rewire. They are linked where their newest nodes are within
    `connect_distance` and the motion between them is free. Each better path is recorded.
    """

    first_path: ClassVar[str | None] = "rrt-connect"

    connect_distance: float | None = param(
        None, "longest link between the trees; by default the step", above=0
    )

    def options(self, query: Query) -> _rrt_star.RRTStarOptions:
        """See `StarPlanner.options`."""
        options = StarPlanner.options(self, query)
        return options._replace(link=self.connect_distance or options.step)

    def kernel(self, problem: Problem, stop: Stop) -> Kernel[Any]:
        """See `KernelPlanner.kernel`."""
        roots = np.array([problem.start, problem.goal])
        return make_kernel(self.options(problem), roots, problem, stop)
