"""Planners: one file and one line here adds one."""

from collections.abc import Mapping

from brrt.planners.a_star import AStar
from brrt.planners.base.planner import Planner
from brrt.planners.bi_rrt import BiRRT
from brrt.planners.bi_rrt_star import BiRRTStar
from brrt.planners.lrta_star import LRTAStar
from brrt.planners.rrt import RRT
from brrt.planners.rrt_connect import RRTConnect
from brrt.planners.rrt_star import RRTStar
from brrt.scenario.contract import Contract

PLANNERS: Mapping[str, type[Planner]] = {
    "rrt": RRT,
    "rrt-connect": RRTConnect,
    "bi-rrt": BiRRT,
    "rrt-star": RRTStar,
    "bi-rrt-star": BiRRTStar,
    "lrta-star": LRTAStar,
    "a-star": AStar,
}

__all__ = [
    "PLANNERS",
    "RRT",
    "AStar",
    "BiRRT",
    "BiRRTStar",
    "Contract",
    "LRTAStar",
    "Planner",
    "RRTConnect",
    "RRTStar",
]
