"""RRT* (Karaman and Frazzoli 2011), with informed sampling as an option."""

import math
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self

import numpy as np

from brrt.kernels.arrays import enlarged
from brrt.kernels.forest import enlarged_forest, rooted_forest
from brrt.planners import _rrt_star
from brrt.planners.base.kernel_planner import Kernel, KernelPlanner
from brrt.planners.base.problem import Problem
from brrt.planners.base.stop import Stop
from brrt.scenario.contract import Contract, Draws, Growth, Near
from brrt.scenario.query import Query
from brrt.scenario.scenario import UNLIMITED
from brrt.settings import param
from brrt.worlds.mean_chord import mean_chord

_PART = 0.2
"""Default step in open worlds, as a part of the longest side: four times RRT's, because the step
also bounds the distance of parents, and a tree with few candidates improves slowly."""

_CHORDS = 2.0
"""Default step in dense worlds, in mean chords of the free space: of longer motions hardly any is
free. `benchmarks/star_step.py` compares it with the above."""


def default_step(query: Query) -> float:
    """Return the step of the star planners in a world."""
    return min(_PART * query.world.extent, _CHORDS * mean_chord(query.world))


@dataclass(frozen=True, slots=True)
class StarPlanner(KernelPlanner):
    """Base of RRT* with one tree and with two."""

    default_iterations: ClassVar[int] = 20_000
    resume_hint: ClassVar[str] = "let it improve the path: --param stop_at_first=false"

    step: float | None = param(
        None,
        "longest edge; by default 20 % of the world's longest side, and at most twice the mean "
        "length of lines in free space",
        above=0,
    )
    gamma: float | None = param(
        None,
        "the radius of near nodes is min(step, gamma (log n / n)^(1/d)); by default 10 % above the "
        "proven bound, for free space as large as the bounds",
        above=0,
    )
    informed: bool = param(
        False, "once there is a path, draw only where a better one may lead (Gammell 2014)"
    )
    stop_at_first: bool = param(False, "stop at the first path")

    def contract(self, query: Query) -> Contract:
        """See `Planner.contract`."""
        options = self.options(query)
        return Contract(
            step=options.step,
            link=options.link or None,
            near=Near(options.gamma, options.step, query.dof),
            draws=Draws(options.goal_bias, not options.link, informed=options.informed),
            growth=Growth(
                turn="alternate" if options.link else None,
                links="extend" if options.link else None,
            ),
            stops=options.stop_at_first,
        )

    def replan_kernel(self, problem: Problem) -> Kernel[Any]:
        """See `KernelPlanner.replan_kernel`."""
        return replace(self, stop_at_first=False).kernel(problem, Stop(iterations=UNLIMITED))

    def ends_like(self, other: Self) -> bool:  # noqa: ARG002
        """See `KernelPlanner.ends_like`."""
        return self.stop_at_first

    def options(self, query: Query) -> _rrt_star.RRTStarOptions:
        """Return what the loop needs, with lengths resolved for a query."""
        return _rrt_star.RRTStarOptions(
            step=self.step or default_step(query),
            goal_bias=0.0,
            gamma=self.gamma or proven_gamma(query),
            informed=self.informed,
            stop_at_first=self.stop_at_first,
            link=0.0,
        )


@dataclass(frozen=True, slots=True)
class RRTStar(StarPlanner):
    """RRT* (Karaman and Frazzoli 2011): a tree whose paths converge to the optimum.

    Each new node chooses its parent from the nodes near it by the least cost, and then becomes the
    parent of those whose cost this lowers. It runs until the budget ends; each better path is
    recorded.
    """

    bidirectional: ClassVar[str | None] = "bi-rrt-star"
    first_path: ClassVar[str | None] = "rrt"

    goal_bias: float = param(
        0.05, "probability of drawing the goal until there is a path", low=0, high=1
    )

    def options(self, query: Query) -> _rrt_star.RRTStarOptions:
        """See `StarPlanner.options`."""
        return StarPlanner.options(self, query)._replace(goal_bias=self.goal_bias)

    def kernel(self, problem: Problem, stop: Stop) -> Kernel[Any]:
        """See `KernelPlanner.kernel`."""
        return make_kernel(self.options(problem), problem.start[None], problem, stop)


def proven_gamma(query: Query) -> float:
    """Return 1.1 times the factor above which RRT* converges to the optimum.

    Karaman and Frazzoli 2011, theorem 38: (2 (1 + 1/d) V / B)^(1/d), where V is the volume of free
    space, here that of the bounds as its upper limit, and B that of the robot's unit ball.
    """
    d = query.dof
    volume = math.prod((query.upper - query.lower).tolist())
    ball = query.robot.unit_ball_volume(query.world)
    return float(1.1 * (2 * (1 + 1 / d) * volume / ball) ** (1 / d))


def make_kernel(
    options: _rrt_star.RRTStarOptions, roots: np.ndarray, problem: Problem, stop: Stop
) -> Kernel[_rrt_star.RRTStarState]:
    """Make the loop for one tree or two, by their roots, shape (trees, dof)."""
    forest = rooted_forest(roots, len(roots) + 1 + len(roots) * (stop.iterations + 1))
    n = len(forest.parent)
    counts = np.zeros(_rrt_star.COUNTS, np.int64)
    counts[[_rrt_star.GOAL_NODE, _rrt_star.BEST]] = -1
    counts[_rrt_star.NEWEST + 1] = len(roots) - 1
    if len(roots) == 1:
        far = float(problem.robot.distance(problem.start, problem.goal))
        counts[_rrt_star.GOAL_NEAR] = 0 < far <= options.step
        counts[_rrt_star.GOAL_NODE] = -int(far > 0)
    state = _rrt_star.RRTStarState(
        forest=forest,
        edge=np.zeros(n),
        child=np.empty(n, np.int32),
        sibling=np.empty((n, 2), np.int32),
        near=np.empty(n, np.int32),
        far=np.empty(n),
        known=np.empty(n, np.uint8),
        stack=np.empty(n, np.int32),
        links=np.empty((n if len(roots) > 1 else 0, 4), np.int32),
        link_far=np.empty(n if len(roots) > 1 else 0),
        linked=np.empty(n if len(roots) > 1 else 0, np.int32),
        counts=counts,
        best=np.array([np.inf, np.inf, 0.0]),
        scratch=np.array([problem.start, problem.start, problem.goal, problem.start]),
    )
    state.child[: len(roots)] = -1
    state.sibling[: len(roots)] = -1
    state.linked[: len(roots)] = -1
    return Kernel(_rrt_star.advance, state, options, _enlarged, 8, stop.iterations)


def _enlarged(state: _rrt_star.RRTStarState) -> _rrt_star.RRTStarState:
    n, forest = int(state.forest.nodes[0]), enlarged_forest(state.forest)
    names = ["edge", "child", "sibling", "near", "far", "known", "stack"]
    # There are no more links than nodes.
    names += ["links", "link_far", "linked"] if len(state.links) else []
    larger = {name: enlarged(getattr(state, name), n, len(forest.parent)) for name in names}
    return state._replace(forest=forest, **larger)
