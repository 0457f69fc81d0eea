"""A point in the plane or in space; the metric is Euclidean."""

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from brrt.robots.robot import Floats, Robot
from brrt.worlds.world import World


@dataclass(frozen=True, slots=True)
class Point(Robot):
    """A point in the plane or in space; its configuration is its position."""

    kind: ClassVar[str] = "point"

    def coordinates(self, world: World) -> tuple[str, ...]:
        """One per dimension of the world."""
        return ("x", "y", "z")[: world.dim]

    def bounds(self, world: World) -> tuple[Floats, Floats]:
        """See `Robot.bounds`."""
        return world.lower, world.upper

    def collision(self, world: World, q: Floats) -> str | None:
        """See `Robot.collision`."""
        if not world.inside(q):
            return "is outside the bounds"
        hit = world.obstacle_at(q)
        return hit and f"is in collision with {hit}"

    def distance(self, a: Floats, b: Floats) -> Floats:
        """See `Robot.distance`."""
        squares = (np.asarray(b) - np.asarray(a)) ** 2
        total = squares[..., 0]
        for k in range(1, squares.shape[-1]):
            total = total + squares[..., k]
        return np.asarray(np.sqrt(total))

    def interpolate(self, a: Floats, b: Floats, part: Floats | float) -> Floats:
        """See `Robot.interpolate`."""
        return np.asarray(a + (b - a) * np.asarray(part)[..., None])

    def unit_ball_volume(self, world: World) -> float:
        """A disc or a ball."""
        return math.pi if world.dim == 2 else 4 / 3 * math.pi

    def places(self, Q: Floats) -> Floats:
        """The position."""
        return Q

    def outline(self, q: Floats) -> list[Floats]:  # noqa: ARG002
        """Empty: a point has no parts."""
        return []

    def configuration(self, position: Floats) -> Floats:
        """The position."""
        return position

    def position(self, q: Floats) -> Floats:
        """The configuration."""
        return q
