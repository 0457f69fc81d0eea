"""What a planner is given: a query, and the configuration space that kernels see."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Self

from brrt.kernels.spaces import check_plannable, make_space
from brrt.robots import Robot
from brrt.scenario.query import Query
from brrt.scenario.scenario import Scenario
from brrt.worlds.world import World


@dataclass(frozen=True, eq=False)
class Problem(Query):
    """A query with the robot's configuration space; see `Query` for its fields and checks."""

    @classmethod
    def of(cls, scenario: Scenario, world: World | None = None, robot: Robot | None = None) -> Self:
        """See `Query.of`.

        Raises:
            BrrtError: It is not known what the robot hits, so that nothing can be planned.
        """
        robot = scenario.make_robot() if robot is None else robot
        check_plannable(robot)
        return super().of(scenario, world, robot)

    @cached_property
    def space(self) -> Any:
        """The robot's configuration space in this world, as kernels see it."""
        return make_space(self.robot, self.world)
