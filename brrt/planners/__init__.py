"""Planners: one file and one line here adds one."""

from collections.abc import Mapping

from brrt.planners.planner import Planner
from brrt.planners.rrt import RRT

PLANNERS: Mapping[str, type[Planner]] = {"rrt": RRT}

__all__ = ["PLANNERS", "RRT", "Planner"]
