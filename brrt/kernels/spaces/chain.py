"""The configuration space of a chain of links: one angle a joint."""

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
from brrt.robots.chain import Chain
from brrt.worlds.world import World

Floats = NDArray[np.float64]


class ChainSpace(NamedTuple):
    """Angles of a chain; `brrt.kernels.space` and `brrt.kernels.convex` document the kernels.

    Attributes:
        lower: Least angles.
        upper: Greatest angles.
        wraps: Whether each joint turns without limits, shape (n,).
        reach: Farthest distance of the links beyond a joint from it, shape (n,).
        reaches: Farthest distance of link j from joint i, at [i, j], shape (n, n).
        base: Where the chain begins, x and y.
        offsets: Each joint in the frame of the link before, shape (n, 2).
        parts: Links in their own frames.
        obstacles: Obstacles of the world.
        scratch: Work space of the motion check.
    """

    lower: tuple[float, ...]
    upper: tuple[float, ...]
    wraps: NDArray[np.bool_]
    reach: Floats
    reaches: Floats
    base: tuple[float, float]
    offsets: Floats
    parts: ConvexShapes
    obstacles: ConvexObstacles
    scratch: MotionScratch

    @staticmethod
    @inline_helper
    def measure(space: "ChainSpace", A: Floats, i: int, B: Floats, j: int) -> float:
        """Greatest product of angle and reach of a joint."""
        most = 0.0
        for k in range(len(space.lower)):
            most = max(most, _joint_distance(space, A, i, B, j, k) * space.reach[k])
        return most

    @staticmethod
    @inline_helper
    def length(space: "ChainSpace", measured: float) -> float:  # noqa: ARG004
        """The measure is the distance."""
        return measured

    @staticmethod
    @inline_helper
    def box_measure(space: "ChainSpace", boxes: Floats, b: int, Q: Floats, i: int) -> float:
        """Greatest product of reach and angle to the box, either way round."""
        d, most = len(space.lower), 0.0
        for k in range(d):
            low, high = boxes[b, k], boxes[b, d + k]
            angle = max(0.0, low - Q[i, k], Q[i, k] - high)
            if space.wraps[k]:
                angle = angle_distance_to_range(low, high, Q[i, k])
            most = max(most, angle * space.reach[k])
        return most

    @staticmethod
    @inline_helper
    def interpolate(
        space: "ChainSpace",
        A: Floats,
        i: int,
        B: Floats,
        j: int,
        part: float,
        out: Floats,
        row: int,
    ) -> None:
        """Turn all joints evenly, those that wrap the short way round."""
        for k in range(len(space.lower)):
            if space.wraps[k]:
                out[row, k] = interpolate_angle(A[i, k], B[j, k], part)
            else:
                out[row, k] = interpolate_coordinate(space, A, i, B, j, k, part)

    @staticmethod
    @inline_helper
    def segment_free(space: "ChainSpace", A: Floats, i: int, B: Floats, j: int) -> bool:
        """See `brrt.kernels.convex`."""
        return motion_free(space, A, i, B, j)

    @staticmethod
    @inline_helper
    def place(space: "ChainSpace", A: Floats, i: int, B: Floats, j: int, part: float) -> None:
        """Place the links from the base outwards."""
        x, y = space.base
        theta, cos, sin = 0.0, 1.0, 0.0
        for k in range(len(space.lower)):
            ox, oy = space.offsets[k, 0], space.offsets[k, 1]
            x, y = x + (cos * ox - sin * oy), y + (sin * ox + cos * oy)
            angle = B[j, k] - A[i, k]
            if space.wraps[k]:
                angle = angle_difference(A[i, k], B[j, k])
            theta += A[i, k] + angle * part
            cos, sin = math.cos(theta), math.sin(theta)
            place_part(space.parts, space.scratch.placed, k, x, y, cos, sin)

    @staticmethod
    @inline_helper
    def bound_moves(space: "ChainSpace", A: Floats, i: int, B: Floats, j: int) -> None:
        """Sum what each joint between the base, or another link, and the link adds."""
        scratch, n, pair = space.scratch, len(space.lower), 0
        for link in range(n):
            move = 0.0
            for k in range(link, -1, -1):
                move += _joint_distance(space, A, i, B, j, k) * space.reaches[k, link]
                # If k is the first joint between two links, `move` bounds how far the one moves in
                # the frame of the other, which is the link before joint k.
                if 0 < k < link and pair < len(scratch.pair_moves):
                    scratch.pair_moves[pair] = move * ROUND_UP
                    pair += 1
            scratch.moves[link] = move * ROUND_UP


@inline_helper
def _joint_distance(space: ChainSpace, A: Floats, i: int, B: Floats, j: int, k: int) -> float:
    """Size of the angle by which joint k turns."""
    if space.wraps[k]:
        return angle_distance(A[i, k], B[j, k])
    return float(abs(B[j, k] - A[i, k]))


def chain_space(robot: Chain, world: World) -> ChainSpace:
    """Build the space of a chain in a world."""
    reaches, n = robot.reaches, len(robot.joints)
    far = float(np.abs(robot.base).max()) + math.hypot(*robot.joints[0].offset)
    obstacles = build_convex_obstacles(world, far + float(reaches[0].max()), n)
    pairs = [(i, j) for j in range(n) for i in range(j - 2, -1, -1)]
    links = [joint.link for joint in robot.joints]
    parts, scratch = build_body(links, obstacles, pairs if robot.self_collision else None)
    lower, upper = (tuple(bound.tolist()) for bound in robot.bounds(world))
    return ChainSpace(
        lower=lower,
        upper=upper,
        wraps=robot.wraps,
        reach=reaches.max(axis=1),
        reaches=reaches,
        base=(float(robot.base[0]), float(robot.base[1])),
        offsets=np.array([joint.offset for joint in robot.joints]),
        parts=parts,
        obstacles=obstacles,
        scratch=scratch,
    )
