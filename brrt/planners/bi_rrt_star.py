"""Bidirectional RRT*: two trees that both choose parents and rewire."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from brrt.events import Events
from brrt.kernels.emit import EventLog
from brrt.planners import _star
from brrt.planners.bi_rrt import step_length
from brrt.planners.contract import Contract, Near
from brrt.planners.planner import Planner
from brrt.planners.rrt_star import DEFAULT_STEP, proven_gamma, solve
from brrt.planners.stop import Stop
from brrt.problem import Problem
from brrt.settings import param


@dataclass(frozen=True, slots=True)
class BiRRTStar(Planner):
    """Bidirectional RRT* (Jordan and Perez 2013): RRT* from the start and from the goal at once.

    The trees take turns: one grows towards a sample, the other towards the new node, and both
    choose parents and rewire. They are joined where their newest nodes are within
    `connect_distance` and the motion between them is free. Each better path is recorded.
    """

    default_iterations: ClassVar[int] = 20_000

    step: float | None = param(
        None, "longest edge; 20 % of the map's longest side by default", above=0
    )
    connect_distance: float | None = param(
        None, "longest link between the trees; the step by default", above=0
    )
    gamma: float | None = param(
        None,
        "nodes are near within min(step, gamma (log n / n)^(1/d)); by default 10 % above the "
        "proven bound, with the volume of the bounds for that of free space",
        above=0,
    )
    informed: bool = param(
        False, "once there is a path, draw only where a better one may lead (Gammell 2014)"
    )
    stop_at_first: bool = param(False, "stop at the first path")

    def contract(self, problem: Problem) -> Contract:
        """See `Planner.contract`."""
        step = step_length(self.step, problem, DEFAULT_STEP)
        gamma = self.gamma or proven_gamma(problem)
        link = self.connect_distance or step
        return Contract(step=step, link=link, near=Near(gamma, step, problem.dof))

    def solve(
        self, problem: Problem, rng: np.random.Generator, log: EventLog, stop: Stop
    ) -> Iterator[Events]:
        """See `Planner.solve`."""
        step = step_length(self.step, problem, DEFAULT_STEP)
        options = _star.Options(
            step=step,
            goal_bias=0.0,
            gamma=self.gamma or proven_gamma(problem),
            informed=self.informed,
            stop_at_first=self.stop_at_first,
            link=self.connect_distance or step,
        )
        roots = np.array([problem.start, problem.goal])
        return solve(options, roots, problem, rng, log, stop)
