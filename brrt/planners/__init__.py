"""Planners: one file and one line here adds one."""

from collections.abc import Mapping

from brrt.planners.a_star import AStar
from brrt.planners.lrta_star import LRTAStar
from brrt.planners.planner import Planner
from brrt.planners.rrt import RRT

PLANNERS: Mapping[str, type[Planner]] = {
    "a-star": AStar,
    "lrta-star": LRTAStar,
    "rrt": RRT,
}

__all__ = ["PLANNERS", "RRT", "AStar", "LRTAStar", "Planner"]
