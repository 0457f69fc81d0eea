"""The configuration space of a point."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brrt.kernels.broad_phase import ObstacleGrid, build_obstacle_grid, segment_hits
from brrt.kernels.jit import inline_helper
from brrt.kernels.random import Random, uniform
from brrt.kernels.space import interpolate_coordinate
from brrt.robots.point import Point
from brrt.worlds.world import World

Floats = NDArray[np.float64]

_INFORMED_DRAWS = 1000
"""Draws from an ellipsoid, most of which lies outside the bounds, before one is clipped to them."""


class PointSpace(NamedTuple):
    """Positions of a point; `brrt.kernels.space` documents the kernels.

    Attributes:
        lower: Least coordinates, one number an axis.
        upper: Greatest coordinates.
        obstacles: ObstacleGrid of the world.
    """

    lower: tuple[float, ...]
    upper: tuple[float, ...]
    obstacles: ObstacleGrid

    @staticmethod
    @inline_helper
    def measure(space: "PointSpace", A: Floats, i: int, B: Floats, j: int) -> float:
        """Square of the Euclidean distance."""
        total = 0.0
        for k in range(len(space.lower)):
            step = B[j, k] - A[i, k]
            total += step * step
        return total

    @staticmethod
    @inline_helper
    def length(space: "PointSpace", measured: float) -> float:  # noqa: ARG004
        """Root of the square."""
        return math.sqrt(measured)

    @staticmethod
    @inline_helper
    def box_measure(space: "PointSpace", boxes: Floats, b: int, Q: Floats, i: int) -> float:
        """Square of the distance to a box."""
        d, total = len(space.lower), 0.0
        for k in range(d):
            outside = max(0.0, boxes[b, k] - Q[i, k], Q[i, k] - boxes[b, d + k])
            total += outside * outside
        return total

    @staticmethod
    @inline_helper
    def interpolate(
        space: "PointSpace",
        A: Floats,
        i: int,
        B: Floats,
        j: int,
        part: float,
        out: Floats,
        row: int,
    ) -> None:
        """Straight line."""
        for k in range(len(space.lower)):
            out[row, k] = interpolate_coordinate(space, A, i, B, j, k, part)

    @staticmethod
    @inline_helper
    def segment_free(space: "PointSpace", A: Floats, i: int, B: Floats, j: int) -> bool:
        """Exact for every shape; the bounds are convex, so the ends decide about them."""
        return not segment_hits(space.obstacles, A, i, B, j)

    @staticmethod
    @inline_helper
    def sample_informed(
        space: "PointSpace",
        rng: Random,
        ends: Floats,
        start: int,
        goal: int,
        best: float,
        out: Floats,
        row: int,
    ) -> None:
        """Draw from the ellipsoid with its foci at start and goal, without rejection.

        A point of the unit ball is scaled to the ellipsoid's half axes, rotated by the reflection
        that takes the first axis to the line from start to goal, and moved there.
        """
        d, square, mirror = len(space.lower), 0.0, 0.0
        for k in range(d):
            square += (ends[goal, k] - ends[start, k]) ** 2
        focal = math.sqrt(square)
        for k in range(d):
            mirror += _mirror(ends, start, goal, focal, k) ** 2
        short = 0.5 * math.sqrt(max(0.0, best * best - square))
        for _ in range(_INFORMED_DRAWS):
            _sample_unit_ball(rng, d, out, row)
            dot, inside = 0.0, True
            for k in range(d):
                out[row, k] *= 0.5 * best if k == 0 else short
                dot += _mirror(ends, start, goal, focal, k) * out[row, k]
            for k in range(d):
                x = out[row, k]
                if mirror > 0.0:
                    x -= 2.0 * dot / mirror * _mirror(ends, start, goal, focal, k)
                x += 0.5 * (ends[start, k] + ends[goal, k])
                inside = inside and space.lower[k] <= x <= space.upper[k]
                out[row, k] = min(max(x, space.lower[k]), space.upper[k])
            if inside:
                return


@inline_helper
def _mirror(ends: Floats, start: int, goal: int, focal: float, k: int) -> float:
    """Component k of the first axis minus the direction from start to goal; 0 if they are equal."""
    if focal == 0.0:
        return 0.0
    return float((1.0 if k == 0 else 0.0) - (ends[goal, k] - ends[start, k]) / focal)


@inline_helper
def _sample_unit_ball(rng: Random, d: int, out: Floats, row: int) -> None:
    norm = 2.0
    while norm > 1.0:
        norm = 0.0
        for k in range(d):
            out[row, k] = 2.0 * uniform(rng) - 1.0
            norm += out[row, k] * out[row, k]


def point_space(robot: Point, world: World) -> PointSpace:
    """Build the space of a point in a world."""
    lower, upper = (tuple(bound.tolist()) for bound in robot.bounds(world))
    return PointSpace(lower, upper, build_obstacle_grid(world))
