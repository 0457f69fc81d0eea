"""The coordinates that a world is drawn in: Rerun's are float32, with 7 digits."""

import math
from copy import copy
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrt.robots import Robot
from brrt.worlds.occupancy import Grid
from brrt.worlds.world import World

_FAR = 16
"""How many extents a world may be away from the origin: places are then right to 1e-6 of it."""
_LEAST, _GREATEST = 0.1, 1e6
"""Extents that are drawn without a scale. A viewer's camera has least distances, and it multiplies
lengths."""


@dataclass(frozen=True)
class Frame:
    """Where and how large a world is drawn: as it is, unless it is far away, tiny or huge.

    Attributes:
        world: The world.
        origin: The place that is drawn at 0, shape (dim,).
        scale: How many times larger lengths are drawn.
    """

    world: World
    origin: NDArray[np.float64]
    scale: float

    @classmethod
    def of(cls, world: World) -> "Frame":
        """Return the frame of a world; equal worlds have equal frames."""
        extent, far = world.extent, max(np.abs(world.lower).max(), np.abs(world.upper).max())
        origin = world.lower if far > _FAR * extent else np.zeros(world.dim)
        fits = _LEAST <= extent <= _GREATEST
        return cls(world, origin, 1.0 if fits else 10.0 ** -math.floor(math.log10(extent)))

    def points(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return where points, shape (..., dim), are drawn."""
        return points if self._as_is else (points - self.origin) * self.scale

    @cached_property
    def _as_is(self) -> bool:
        return self.scale == 1 and not self.origin.any()

    def places(self, values: Any, robot: Robot) -> NDArray[np.float32]:
        """Return where configurations, shape (n, dof), are drawn, shape (n, dim)."""
        points = self.points(robot.places(np.asarray(values, np.float64)))
        return np.ascontiguousarray(points, np.float32)

    @cached_property
    def drawn(self) -> World:
        """The world as it is drawn."""
        world, scale = self.world, self.scale
        if self._as_is:
            return world
        values: dict[str, Any] = {
            name: None if point is None else self.points(point)
            for name in ("lower", "upper", "start", "goal")
            for point in [getattr(world, name)]
        }
        corners = world.boxes.reshape(len(world.boxes), 2, world.dim)
        values["boxes"] = self.points(corners).reshape(world.boxes.shape)
        balls = world.balls * scale
        balls[:, : world.dim] = self.points(world.balls[:, : world.dim])
        values["balls"] = balls
        values["polygons"] = tuple(map(self.points, world.polygons))
        if (grid := world.grid) is not None:
            origin = self.points(grid.origin)
            values["grid"] = Grid(grid.cells, origin, grid.resolution * scale, grid.yaw)
        drawn = copy(world)  # unchecked: rounding may make two corners one, which does not matter
        for name, value in values.items():
            object.__setattr__(drawn, name, value)
        return drawn

    @property
    def text(self) -> str:
        """What 0 and 1 stand for; empty if the world is drawn as it is."""
        parts = []
        if self.origin.any():
            zero = ", ".join("0" * self.world.dim)
            parts.append(f"{zero} here is {', '.join(f'{x:.15g}' for x in self.origin)}")
        if self.scale != 1:
            parts.append(f"1 here is {1 / self.scale:g}")
        return "; ".join(parts)
