"""The configuration space of a polygon that moves and turns in the plane: (x, y, theta)."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brrt.kernels.convex import (
    ROUND_UP,
    ConvexObstacles,
    ConvexShapes,
    MotionScratch,
    build_body,
    build_convex_obstacles,
    motion_free,
    place_part,
)
from brrt.kernels.jit import inline_helper
from brrt.kernels.space import interpolate_coordinate
from brrt.kernels.spaces.angles import (
    angle_difference,
    angle_distance,
    angle_distance_to_range,
    interpolate_angle,
)
from brrt.robots.polygon import Polygon
from brrt.worlds.world import World

Floats = NDArray[np.float64]


class PolygonSpace(NamedTuple):
    """Poses of a polygon; `brrt.kernels.space` and `brrt.kernels.convex` document the kernels.

    Attributes:
        lower: Least x, y, theta.
        upper: Greatest x, y, theta.
        radius: Distance of the farthest vertex from the reference point.
        parts: The parts at pose (0, 0, 0).
        reach: Distance of each part's farthest vertex from the reference point, shape (parts,).
        obstacles: Obstacles of the world.
        scratch: Work space of the motion check.
    """

    lower: tuple[float, ...]
    upper: tuple[float, ...]
    radius: float
    parts: ConvexShapes
    reach: Floats
    obstacles: ConvexObstacles
    scratch: MotionScratch

    @staticmethod
    @inline_helper
    def measure(space: "PolygonSpace", A: Floats, i: int, B: Floats, j: int) -> float:
        """Distance of the reference points plus radius times the angle."""
        dx, dy = B[j, 0] - A[i, 0], B[j, 1] - A[i, 1]
        return math.sqrt(dx * dx + dy * dy) + space.radius * angle_distance(A[i, 2], B[j, 2])

    @staticmethod
    @inline_helper
    def length(space: "PolygonSpace", measured: float) -> float:  # noqa: ARG004
        """The measure is the distance."""
        return measured

    @staticmethod
    @inline_helper
    def box_measure(space: "PolygonSpace", boxes: Floats, b: int, Q: Floats, i: int) -> float:
        """Distance to the box in the plane plus radius times the angle to its range of angles."""
        dx = max(0.0, boxes[b, 0] - Q[i, 0], Q[i, 0] - boxes[b, 3])
        dy = max(0.0, boxes[b, 1] - Q[i, 1], Q[i, 1] - boxes[b, 4])
        angle = angle_distance_to_range(boxes[b, 2], boxes[b, 5], Q[i, 2])
        return math.sqrt(dx * dx + dy * dy) + space.radius * angle

    @staticmethod
    @inline_helper
    def interpolate(
        space: "PolygonSpace",
        A: Floats,
        i: int,
        B: Floats,
        j: int,
        part: float,
        out: Floats,
        row: int,
    ) -> None:
        """Move straight and turn evenly, the short way round."""
        theta = interpolate_angle(A[i, 2], B[j, 2], part)
        for k in range(2):
            out[row, k] = interpolate_coordinate(space, A, i, B, j, k, part)
        out[row, 2] = theta

    @staticmethod
    @inline_helper
    def segment_free(space: "PolygonSpace", A: Floats, i: int, B: Floats, j: int) -> bool:
        """See `brrt.kernels.convex`."""
        return motion_free(space, A, i, B, j)

    @staticmethod
    @inline_helper
    def place(space: "PolygonSpace", A: Floats, i: int, B: Floats, j: int, part: float) -> None:
        """Turn all parts about the reference point."""
        x = A[i, 0] + (B[j, 0] - A[i, 0]) * part
        y = A[i, 1] + (B[j, 1] - A[i, 1]) * part
        theta = A[i, 2] + angle_difference(A[i, 2], B[j, 2]) * part
        cos, sin = math.cos(theta), math.sin(theta)
        for shape in range(len(space.reach)):
            place_part(space.parts, space.scratch.placed, shape, x, y, cos, sin)

    @staticmethod
    @inline_helper
    def bound_moves(space: "PolygonSpace", A: Floats, i: int, B: Floats, j: int) -> None:
        """The metric with each part's own radius."""
        dx, dy = B[j, 0] - A[i, 0], B[j, 1] - A[i, 1]
        straight, angle = math.sqrt(dx * dx + dy * dy), angle_distance(A[i, 2], B[j, 2])
        for part in range(len(space.reach)):
            space.scratch.moves[part] = (straight + space.reach[part] * angle) * ROUND_UP


def polygon_space(robot: Polygon, world: World) -> PolygonSpace:
    """Build the space of a polygon in a world."""
    obstacles = build_convex_obstacles(world, robot.radius)
    parts, scratch = build_body(list(robot.parts), obstacles)
    lower, upper = (tuple(bound.tolist()) for bound in robot.bounds(world))
    return PolygonSpace(lower, upper, robot.radius, parts, robot.reaches, obstacles, scratch)
