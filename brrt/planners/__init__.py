"""Planners: one file and one line here adds one."""

from collections.abc import Mapping

from brrt.planners.bi_rrt import BiRRT
from brrt.planners.contract import Contract
from brrt.planners.planner import Planner
from brrt.planners.rrt import RRT
from brrt.planners.rrt_connect import RRTConnect

PLANNERS: Mapping[str, type[Planner]] = {
    "rrt": RRT,
    "rrt-connect": RRTConnect,
    "bi-rrt": BiRRT,
}

__all__ = ["PLANNERS", "RRT", "BiRRT", "Contract", "Planner", "RRTConnect"]
