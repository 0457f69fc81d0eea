"""What a planner is given: a robot in a world, and where it has to go."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrt.errors import BrrtError
from brrt.kernels.spaces import make_space
from brrt.robots import Robot
from brrt.worlds.world import World

Floats = NDArray[np.float64]

_DRAWS = 10_000
"""Draws of a random configuration before the world is called too full for the robot."""


@dataclass(frozen=True, eq=False)
class Problem:
    """A query that is known to make sense.

    Attributes:
        world: Bounds and obstacles.
        robot: What moves; settled in the world.
        start: First configuration, shape (dof,).
        goal: Last configuration, shape (dof,).

    Raises:
        BrrtError: The robot cannot be in this world, or start or goal has the wrong size, is not
            finite, out of bounds or in collision.
    """

    world: World
    robot: Robot
    start: Floats
    goal: Floats

    def __post_init__(self) -> None:
        """Check start and goal."""
        object.__setattr__(self, "robot", self.robot.resolved(self.world))
        for name in ("start", "goal"):
            q = np.array(getattr(self, name), dtype=np.float64).reshape(-1)
            text = ",".join(f"{x:g}" for x in q)
            if len(q) != self.dof:
                names = ",".join(self.robot.coordinates(self.world))
                raise BrrtError(
                    f"{name} {text}: {len(q)} given; a configuration here has {self.dof} numbers: "
                    f"{names}"
                )
            if not np.isfinite(q).all():
                raise BrrtError(f"{name} {text} must be finite numbers")
            q = self.robot.canonical(q)
            why = self.robot.collision(self.world, q)
            if why is not None:
                lower, upper = (
                    ",".join(f"{x:g}" for x in b) for b in self.robot.bounds(self.world)
                )
                # What of a map is unknown, and how it counts, is why many a start is not free.
                known = self.world.notes[:1] if self.world.grid is not None else ()
                notes = "".join(f" (note: {note})" for note in known)
                raise BrrtError(
                    f"{name} {text} {why}; choose a free one between {lower} and {upper}{notes}"
                )
            object.__setattr__(self, name, q)

    @property
    def dof(self) -> int:
        """Numbers in a configuration."""
        return self.robot.dof(self.world)

    @cached_property
    def space(self) -> Any:
        """The robot's configuration space in this world, as kernels see it."""
        return make_space(self.robot, self.world)


def random_configuration(name: str, robot: Robot, world: World, rng: np.random.Generator) -> Floats:
    """Draw a free configuration, evenly from all that are free, shape (dof,).

    Args:
        name: What it is for, for the message.
        robot: What moves; settled in the world.
        world: Bounds and obstacles.
        rng: Where the draws come from.

    Raises:
        BrrtError: Nothing free was found.
    """
    lower, upper = robot.bounds(world)
    for _ in range(_DRAWS):
        q = robot.canonical(rng.uniform(lower, upper))
        if robot.collision(world, q) is None:
            return q
    raise BrrtError(
        f"none of {_DRAWS:,} random configurations for the {name} is free in world {world.name}; "
        f"give --{name} or make the obstacles smaller or fewer"
    )
