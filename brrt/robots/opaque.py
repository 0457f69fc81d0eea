"""A robot of which nothing is known but how many numbers a configuration has."""

import math
from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np

from brrt.robots.robot import Floats, Robot
from brrt.settings import param
from brrt.worlds.world import World

MOST_NUMBERS = 32


@dataclass(frozen=True, slots=True)
class Opaque(Robot):
    """A robot whose shape, limits and metric are not known; its metric is taken as Euclidean.

    Recordings of foreign planners have it. Where it is drawn, its first numbers are a position.
    """

    kind: ClassVar[str] = "opaque"
    opaque: ClassVar[bool] = True

    numbers: int = param(2, "numbers in a configuration", low=1, high=MOST_NUMBERS)
    drawn: int = param(2, "dimensions of the world that it is drawn in", low=2, high=3)

    def resolved(self, world: World) -> Self:
        """See `Robot.resolved`."""
        return replace(self, drawn=world.dim)

    def coordinates(self, world: World) -> tuple[str, ...]:  # noqa: ARG002
        """They are numbered from 1 on."""
        return tuple(f"q{i + 1}" for i in range(self.numbers))

    def bounds(self, world: World) -> tuple[Floats, Floats]:
        """Return the range of the world for each number: a scale, no limits."""
        shape = self.numbers
        return np.full(shape, world.lower.min()), np.full(shape, world.upper.max())

    def collision(self, world: World, q: Floats) -> None:
        """Return None: it is not known."""

    def distance(self, a: Floats, b: Floats) -> Floats:
        """See `Robot.distance`."""
        return np.asarray(np.sqrt(((np.asarray(b) - np.asarray(a)) ** 2).sum(axis=-1)))

    def interpolate(self, a: Floats, b: Floats, part: Floats | float) -> Floats:
        """See `Robot.interpolate`."""
        return np.asarray(a + (b - a) * np.asarray(part)[..., None])

    def unit_ball_volume(self, world: World) -> float:  # noqa: ARG002
        """See `Robot.unit_ball_volume`."""
        return float(math.pi ** (self.numbers / 2)) / math.gamma(self.numbers / 2 + 1)

    def places(self, Q: Floats) -> Floats:
        """The first numbers; 0 where there are fewer."""
        Q = np.asarray(Q, np.float64)
        first = Q[:, : self.drawn]
        return np.pad(first, ((0, 0), (0, self.drawn - first.shape[1])))

    def outline(self, q: Floats) -> list[Floats]:  # noqa: ARG002
        """Empty: it is not known."""
        return []

    def configuration(self, position: Floats) -> None:
        """Return None: a position does not determine one."""

    def position(self, q: Floats) -> None:
        """Return None: it is not known."""
