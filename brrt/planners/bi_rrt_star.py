"""Bidirectional RRT*: two trees that both choose parents and rewire."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from brrt.events import Events
from brrt.kernels.emit import EventLog
from brrt.planners import _star
from brrt.planners.rrt_star import StarPlanner, solve
from brrt.planners.stop import Stop
from brrt.problem import Problem
from brrt.settings import param


@dataclass(frozen=True, slots=True)
class BiRRTStar(StarPlanner):
    """Bidirectional RRT* (Jordan and Perez 2013): RRT* from the start and from the goal at once.

    The trees take turns: one grows towards a sample, the other towards the new node, and both
    choose parents and rewire. They are joined where their newest nodes are within
    `connect_distance` and the motion between them is free. Each better path is recorded.
    """

    connect_distance: float | None = param(
        None, "longest link between the trees; the step by default", above=0
    )

    def options(self, problem: Problem) -> _star.Options:
        """See `StarPlanner.options`."""
        options = StarPlanner.options(self, problem)
        return options._replace(link=self.connect_distance or options.step)

    def solve(
        self, problem: Problem, rng: np.random.Generator, log: EventLog, stop: Stop
    ) -> Iterator[Events]:
        """See `Planner.solve`."""
        roots = np.array([problem.start, problem.goal])
        return solve(self.options(problem), roots, problem, rng, log, stop)
