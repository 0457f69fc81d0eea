"""A point in the plane or in space; the metric is Euclidean."""

import math
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brrt.kernels.broad_phase import Obstacles, build_obstacles, segment_hits
from brrt.kernels.jit import inline_helper
from brrt.kernels.random import Random, uniform
from brrt.robots.robot import Robot
from brrt.worlds.world import World

Floats = NDArray[np.float64]

_INFORMED_DRAWS = 1000
"""Draws from an ellipsoid, most of which lies outside the bounds, before one is moved inside."""


class PointSpace(NamedTuple):
    """Positions of a point; see `brrt.kernels.spaces.space` for what the kernels mean.

    Attributes:
        lower: Least coordinates, one number an axis.
        upper: Greatest coordinates.
        obstacles: What is in the way.
    """

    lower: tuple[float, ...]
    upper: tuple[float, ...]
    obstacles: Obstacles

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
            q = A[i, k] + (B[j, k] - A[i, k]) * part
            out[row, k] = min(max(q, space.lower[k]), space.upper[k])

    @staticmethod
    @inline_helper
    def segment_free(space: "PointSpace", A: Floats, i: int, B: Floats, j: int) -> bool:
        """Exact against every shape; bounds are convex, so the ends decide about them."""
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
        """Draw from the ellipsoid with its foci at start and goal, not by rejection.

        A point of the unit ball is stretched to the ellipsoid's half axes, turned by the
        reflection that takes the first axis to the line from start to goal, and moved there.
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
                turned = out[row, k]
                if mirror > 0.0:
                    turned -= 2.0 * dot / mirror * _mirror(ends, start, goal, focal, k)
                turned += 0.5 * (ends[start, k] + ends[goal, k])
                inside = inside and space.lower[k] <= turned <= space.upper[k]
                out[row, k] = min(max(turned, space.lower[k]), space.upper[k])
            if inside:
                return


@inline_helper
def _mirror(ends: Floats, start: int, goal: int, focal: float, k: int) -> float:
    """Component of the first axis less the direction from start to goal; 0 where these coincide."""
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


@dataclass(frozen=True, slots=True)
class Point(Robot):
    """A point in the plane or in space; its configuration is its position."""

    kind: ClassVar[str] = "point"

    def coordinates(self, world: World) -> tuple[str, ...]:
        """As many as the world has dimensions."""
        return ("x", "y", "z")[: world.dim]

    def space(self, world: World) -> PointSpace:
        """See `Robot.space`."""
        lower, upper = tuple(world.lower.tolist()), tuple(world.upper.tolist())
        return PointSpace(lower, upper, build_obstacles(world))

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
        """Where it is."""
        return Q

    def outline(self, q: Floats) -> list[Floats]:  # noqa: ARG002
        """Nothing: a point has no parts."""
        return []

    def configuration(self, position: Floats) -> Floats:
        """Return the position."""
        return position

    def position(self, q: Floats) -> Floats:
        """Return the configuration."""
        return q
