"""A generator of worlds."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from brrt.settings import param
from brrt.worlds.generators.generator import Fixed, ObstacleSet


@dataclass(frozen=True, slots=True)
class Colonnade2D(Fixed):
    """A square map with pillars in rows, each row moved by half a gap."""

    dim: ClassVar[int] = 2

    gap: float = param(6.0, "between two pillars", above=0)
    radius: float = param(3.0, "of a pillar", above=0)

    def obstacles(self) -> ObstacleSet:
        """Return the pillars, except for those at the corners of start and goal."""
        pitch = self.gap + 2 * self.radius
        rows = np.arange(pitch, self.size - pitch / 2, pitch)
        pillars = [
            (x, y, self.radius)
            for i, y in enumerate(rows)
            for x in np.arange(pitch * (1 - i % 2 / 2), self.size - self.radius, pitch)
        ]
        return ObstacleSet(balls=np.array(pillars).reshape(-1, 3))
