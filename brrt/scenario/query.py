"""A query: a robot in a world, with a start and a goal."""

from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from brrt.digits import against_limits, digits_within, join_numbers
from brrt.errors import BrrtError
from brrt.robots import Robot
from brrt.scenario.manifest import Manifest
from brrt.scenario.scenario import Scenario
from brrt.worlds import World, make_world

Floats = NDArray[np.float64]

_UNKNOWN = np.full(3, np.nan)
"""A configuration that is not drawn yet; robots with a fixed base have a position all the same."""

_DRAWS = 10_000
"""Draws of a random configuration before the world counts as too full for the robot."""


@dataclass(frozen=True, slots=True, eq=False)
class Query:
    """A start and a goal that are free in a world.

    Attributes:
        world: Bounds and obstacles.
        robot: What moves, resolved in the world.
        start: First configuration, shape (dof,).
        goal: Last configuration, shape (dof,).
        lower: Least value of each coordinate, shape (dof,).
        upper: Greatest value of each coordinate, shape (dof,).

    Raises:
        BrrtError: The robot does not fit this kind of world, or start or goal has the wrong size,
            is not finite, out of bounds or in collision.
    """

    world: World
    robot: Robot
    start: Floats
    goal: Floats
    lower: Floats = field(init=False)
    upper: Floats = field(init=False)

    def __post_init__(self) -> None:
        """Resolve the robot; check that it fits, and start and goal."""
        object.__setattr__(self, "robot", self.robot.resolved(self.world))
        _check_fits(self.robot, self.world)
        lower, upper = self.robot.bounds(self.world)
        object.__setattr__(self, "lower", lower)
        object.__setattr__(self, "upper", upper)
        for name in ("start", "goal"):
            q = np.array(getattr(self, name), dtype=np.float64).reshape(-1)
            object.__setattr__(self, name, self._checked(name, q))

    def _checked(self, name: str, q: Floats) -> Floats:
        if len(q) != self.dof:
            names = ",".join(self.robot.coordinates(self.world))
            raise BrrtError(
                f"{name} {join_numbers(q, separator=',')}: {len(q)} given; a configuration here "
                f"has {self.dof} numbers: {names}"
            )
        if not np.isfinite(q).all():
            raise BrrtError(f"{name} {join_numbers(q, separator=',')} must be finite numbers")
        q = self.robot.canonical(q)
        why = self.robot.collision(self.world, q)
        if why is not None:
            # In a map, what is unknown and how it counts is often the reason.
            known = self.world.notes[:1] if self.world.grid is not None else ()
            notes = "".join(f" (note: {note})" for note in known)
            digits = digits_within(self.lower, self.upper)
            columns = (q.tolist(), self.lower.tolist(), self.upper.tolist(), digits)
            texts = [against_limits(*row) for row in zip(*columns, strict=True)]
            text, low, high = (",".join(row) for row in zip(*texts, strict=True))
            raise BrrtError(
                f"{name} {text} {why}; choose a free one between {low} and {high}{notes}"
            )
        return q

    @classmethod
    def of(cls, scenario: Scenario, world: World | None = None, robot: Robot | None = None) -> Self:
        """Make a scenario's world and robot, unless they are given, and its start and goal.

        A random start or goal is drawn after the world is made: a generator keeps given ends free,
        and not those that are drawn later, so that each seed has its query in the same world.

        Raises:
            BrrtError: World or robot cannot be made, or start or goal is missing or not free.
        """
        robot = scenario.make_robot() if robot is None else robot
        given = (scenario.start, scenario.goal)
        ends = [q if q is None else _UNKNOWN if isinstance(q, str) else np.array(q) for q in given]
        if world is None:
            first, last = (None if q is None else robot.position(q) for q in ends)
            world = make_world(scenario.world, first, last, robot.reach)
        for place, name in enumerate(("start", "goal")):
            own = (world.start, world.goal)[place]
            if isinstance(given[place], str):
                rng = np.random.Generator(np.random.PCG64([scenario.seed, place + 1]))
                resolved = robot.resolved(world)
                _check_fits(resolved, world)
                ends[place] = random_configuration(name, resolved, world, rng)
            elif ends[place] is None and own is not None:
                ends[place] = robot.configuration(own)
        start, goal = ends
        if start is None or goal is None:
            name = "start" if start is None else "goal"
            raise BrrtError(
                f"world {scenario.world} has no {name} of its own for the robot {scenario.robot}; "
                f"give --{name} {','.join(robot.coordinates(world))}"
            )
        return cls(world, robot, start, goal)

    @classmethod
    def recorded(cls, manifest: Manifest, world: World) -> Self:
        """Put the recorded robot, start and goal into the recorded world.

        Raises:
            BrrtError: Start or goal is not free there, or the robot's definition is damaged.
        """
        ends = replace(manifest.scenario, start=manifest.start, goal=manifest.goal)
        robot = manifest.make_robot()
        try:
            return cls.of(ends, world, robot)
        except BrrtError as error:
            what, _, _ = str(error).partition(";")
            raise BrrtError(f"the manifest or the world is damaged: {what}") from None

    @property
    def dof(self) -> int:
        """Numbers in a configuration."""
        return self.robot.dof(self.world)


def _check_fits(robot: Robot, world: World) -> None:
    """Check that nothing is known that makes every configuration of a resolved robot collide.

    Raises:
        BrrtError: No configuration is free.
    """
    why = robot.misfit(world)
    if why is not None:
        raise BrrtError(f"robot {robot.kind}: {why}")


def random_configuration(name: str, robot: Robot, world: World, rng: np.random.Generator) -> Floats:
    """Draw a free configuration uniformly, shape (dof,).

    Args:
        name: What it is for, for the message.
        robot: What moves, resolved in the world.
        world: Bounds and obstacles.
        rng: Source of the draws.

    Raises:
        BrrtError: None of 10,000 draws is free.
    """
    lower, upper = robot.bounds(world)
    for _ in range(_DRAWS):
        q = robot.canonical(rng.uniform(lower, upper))
        if robot.collision(world, q) is None:
            return q
    raise BrrtError(
        f"none of {_DRAWS:,} random configurations for the {name} is free in world {world.name}; "
        f"give --{name}, or make robot or obstacles smaller or the obstacles fewer"
    )
