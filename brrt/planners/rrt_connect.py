"""RRT-Connect (Kuffner and LaValle 2000)."""

from dataclasses import dataclass
from typing import Any

from brrt.planners.base.kernel_planner import Kernel, KernelPlanner
from brrt.planners.base.problem import Problem
from brrt.planners.base.stop import Stop
from brrt.planners.bi_rrt import BiRRT
from brrt.scenario.contract import Contract
from brrt.scenario.query import Query
from brrt.settings import param


@dataclass(frozen=True, slots=True)
class RRTConnect(KernelPlanner):
    """RRT-Connect (Kuffner and LaValle 2000): two trees, joined greedily.

    One tree makes a step towards a sample, and the other one makes steps towards the new node until
    it reaches that or is blocked; then they swap roles. It stops at the first path.
    """

    step: float | None = param(
        None, "longest edge; by default 5 % of the world's longest side", above=0
    )

    def contract(self, query: Query) -> Contract:
        """See `Planner.contract`."""
        return self._variant.contract(query)

    def kernel(self, problem: Problem, stop: Stop) -> Kernel[Any]:
        """See `KernelPlanner.kernel`."""
        return self._variant.kernel(problem, stop)

    @property
    def _variant(self) -> BiRRT:
        return BiRRT(step=self.step, grow="extend", link="connect", turn="alternate")
