"""Bidirectional RRT (Kuffner and LaValle 2000) in its common variants."""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from brrt.kernels.forest import RESERVED_NODES, enlarged_forest, rooted_forest
from brrt.planners import _bi_rrt
from brrt.planners.base.kernel_planner import Kernel, KernelPlanner
from brrt.planners.base.problem import Problem
from brrt.planners.base.stop import Stop
from brrt.scenario.contract import Contract, Draws, Growth
from brrt.scenario.query import Query
from brrt.settings import param

_TURNS = {"alternate": _bi_rrt.ALTERNATE, "smaller": _bi_rrt.SMALLER, "coin": _bi_rrt.COIN}


@dataclass(frozen=True, slots=True)
class BiRRT(KernelPlanner):
    """Bidirectional RRT (Kuffner and LaValle 2000): one tree from the start, one from the goal.

    In each iteration one tree grows towards a sample, and the other one then grows towards the
    newest node of the first. A free motion of at most `step` joins them. The defaults are
    RRT-Extend-Extend; `rrt-connect` is the variant that links by connecting.
    """

    step: float | None = param(
        None, "longest edge; by default 5 % of the world's longest side", above=0
    )
    grow: Literal["extend", "connect"] = param(
        "extend", "towards the sample: one step, or step by step until it is reached or blocked"
    )
    link: Literal["extend", "connect"] = param(
        "extend", "towards the other tree's newest node: one step, or step by step"
    )
    turn: Literal["alternate", "smaller", "coin"] = param(
        "alternate",
        "which tree grows: each in turn; the smaller one; or, with probability 0.5, it grows "
        "towards the other's newest node, and otherwise the roles swap",
    )
    always_link: bool = param(
        False, "grow towards the newest node of the other tree even if none was added to it"
    )

    def contract(self, query: Query) -> Contract:
        """See `Planner.contract`."""
        step = self._step(query)
        growth = Growth(
            turn=self.turn,
            connects=self.grow == "connect",
            links=self.link,
            always_links=self.always_link,
        )
        draws = Draws(coin=0.5 if self.turn == "coin" else 0.0)
        return Contract(step=step, link=step, draws=draws, growth=growth, stops=True)

    def kernel(self, problem: Problem, stop: Stop) -> Kernel[Any]:
        """See `KernelPlanner.kernel`."""
        step = self._step(problem)
        options = _bi_rrt.BiRRTOptions(
            step, self.grow == "connect", self.link == "connect", _TURNS[self.turn],
            self.always_link,
        )  # fmt: skip
        return make_kernel(options, problem, stop)

    def _step(self, query: Query) -> float:
        return self.step or 0.05 * query.world.extent


def make_kernel(
    options: _bi_rrt.BiRRTOptions, problem: Problem, stop: Stop
) -> Kernel[_bi_rrt.BiRRTState]:
    """Make the loop of any variant; see `KernelPlanner.kernel`."""
    roots = np.array([problem.start, problem.goal])
    counts = np.zeros(_bi_rrt.COUNTS, np.int64)
    counts[_bi_rrt.NEWEST + 1] = 1
    state = _bi_rrt.BiRRTState(
        rooted_forest(roots, RESERVED_NODES), counts, np.zeros(1), scratch=roots.copy()
    )
    return Kernel(_bi_rrt.advance, state, options, _enlarged, 4, stop.iterations)


def _enlarged(state: _bi_rrt.BiRRTState) -> _bi_rrt.BiRRTState:
    return state._replace(forest=enlarged_forest(state.forest))
