"""An OMPL problem in brrt's terms: start, goal, robot, claims, parameters."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from ompl import base

from brrt.errors import BrrtError
from brrt.ompl.spaces import Space
from brrt.robots import Robot
from brrt.scenario.claims import Claims

Floats = NDArray[np.float64]

_IN_TIME = ("RRT", "RRTConnect")
"""Planners that never change an edge: each one has the time of its own check."""

_IN_ORDER = (*_IN_TIME, "RRTstar", "InformedRRTstar", "SORRTstar", "KPIECE1", "BKPIECE1")
"""Planners whose changes within an iteration are in the order of their checks."""

_EQUAL = 1e-12
"""Tolerance of a goal that is a single state."""

_LAZY = ("LBKPIECE1",)
"""Planners that make edges before they check them."""


class Problem:
    """A planner and its problem.

    The start is not here: reading `ProblemDefinition.getStartState` frees that state (ompl 2.0.1).
    The start is the first vertex of the planner's data instead.

    Args:
        planner: The planner, which has a problem definition.
        goal: A goal configuration for goals without one, shape (dof,).

    Attributes:
        name: The planner's class.
        space: Its space.
        goal: A goal configuration, shape (dof,).
        tolerance: How far from it paths may end, in the space's metric.
        cost: Returns the cost of a motion between two states; None for Euclidean lengths.

    Raises:
        BrrtError: There is no problem or goal configuration, or states cannot be read.
    """

    def __init__(self, planner: Any, goal: Any = None) -> None:
        self.planner, self.name = planner, type(planner).__name__
        self.definition = planner.getProblemDefinition()
        if self.definition is None or self.definition.getGoal() is None:
            raise BrrtError("the planner has no goal; set start and goal before solve")
        self.space = Space(planner.getSpaceInformation())
        self.goal, self.tolerance = self._goal(goal)
        objective = self.definition.getOptimizationObjective()
        self.is_length = objective is None or type(objective) is (
            base.PathLengthOptimizationObjective
        )
        self.cost: Callable[[Any, Any], float] | None = self.space.distance
        if not self.is_length:
            self.cost = lambda a, b: objective.motionCost(a, b).value()
        elif self.space.is_real:
            self.cost = None

    def _goal(self, given: Any) -> tuple[Floats, float]:
        """Return a goal configuration, and how far from it paths may end."""
        region = self.definition.getGoal()
        read, distance = self.space.read, self.space.distance
        if isinstance(region, base.GoalState):
            found = [region.getState()]
        elif isinstance(region, base.GoalStates) and region.getStateCount():
            found = [region.getState(i) for i in range(region.getStateCount())]
        elif given is None:
            raise BrrtError(
                f"goal must be given: a {type(region).__name__} has no configuration; for example "
                f"goal={[0.0] * self.space.dof}"
            )
        else:
            extent = self.planner.getSpaceInformation().getMaximumExtent()
            return np.array(given, np.float64), float(extent)
        apart = max(distance(found[0], other) for other in found)
        return np.array(read(found[0])) + 0.0, float(region.getThreshold() + apart)

    def solution(self) -> list[Any] | None:
        """Return the states of the path that leads to the goal; None if there is none."""
        if not self.definition.hasExactSolution():
            return None
        return list(self.definition.getSolutionPath().getStates())

    def reaches(self, state: Any) -> bool:
        """Return whether a state satisfies the goal."""
        return bool(self.definition.getGoal().isSatisfied(state))

    def path_cost(self, states: list[Any]) -> float | None:
        """Return the cost of a path, or None for its length in the robot's metric."""
        if self.cost is None:
            return None
        return float(sum(map(self.cost, states[:-1], states[1:])))

    def claims(self, robot: Robot | None, *, exact: bool) -> Claims:
        """Return how a log of this planner is made.

        Args:
            robot: What moves; None for a point, or a robot that is not known.
            exact: Whether the planner's data are read in each iteration.
        """
        is_length = self.is_length and self.space.is_real
        in_time = self.name in (_IN_ORDER if exact else _IN_TIME)
        return Claims(
            motions="straight" if self.space.is_straight else "own",
            costs="length" if is_length else "own",
            edges="assumed" if self.name in _LAZY else "checked",
            goal_tolerance=self._tolerance(robot),
            times="exact" if in_time else "snapshot",
            samples="none",
        )

    def _tolerance(self, robot: Robot | None) -> float:
        """Return how far from the goal paths may end, in the robot's metric."""
        if self.tolerance <= _EQUAL:
            return 0.0
        if self.space.is_real:
            return self.tolerance
        extent = self.planner.getSpaceInformation().getMaximumExtent()
        wraps = robot is not None and not robot.opaque
        spread = self.space.spread(self.goal, self.tolerance, extent, wraps=wraps)
        if robot is None:
            return float(np.sqrt(spread @ spread))
        return float(robot.distance(np.zeros(len(spread)), spread))

    @property
    def params(self) -> dict[str, Any]:
        """The planner's parameters, as it prints them."""
        lines = self.planner.printSettings().splitlines()
        pairs = [line.split(" = ", 1) for line in lines if " = " in line]
        return {name.strip(): _number(text.strip()) for name, text in pairs}


def _number(text: str) -> float | int | str:
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text
