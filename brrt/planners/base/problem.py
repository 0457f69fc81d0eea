"""What a planner is given: a query, and the configuration space that kernels see."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

from brrt.kernels.spaces import make_space
from brrt.scenario.query import Query


@dataclass(frozen=True, eq=False)
class Problem(Query):
    """A query with the robot's configuration space; see `Query` for its fields and checks."""

    @cached_property
    def space(self) -> Any:
        """The robot's configuration space in this world, as kernels see it."""
        return make_space(self.robot, self.world)
