"""A body of convex polygons that moves and turns in the plane: (x, y, theta)."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from brrt.errors import BrrtError
from brrt.kernels.convex import Body, Scenery, Shapes, build_body, build_scenery, motion_free
from brrt.kernels.convex import place_part as place_shape
from brrt.kernels.jit import inline_helper
from brrt.robots.angles import (
    all_wrapped,
    angle_apart,
    angle_to_range,
    angles_apart,
    rotation,
    turn_between,
    turns_between,
    wrapped,
)
from brrt.robots.robot import Robot, blocked, check_fields, plane_only
from brrt.settings import param
from brrt.worlds.convex import convex_polygon
from brrt.worlds.world import World

Floats = NDArray[np.float64]

_SAFE = 1.0 + 1e-12
"""Makes up for the rounding of a bound on a movement."""


class PolygonSpace(NamedTuple):
    """Poses of a polygon; see `brrt.kernels.spaces.space` for what the kernels mean.

    Attributes:
        lower: Least x, y, theta.
        upper: Greatest x, y, theta.
        radius: Farthest vertex from the reference point.
        parts: The body at pose (0, 0, 0).
        reach: Farthest vertex of each part from the reference point, shape (parts,).
        scenery: What is in the way.
        body: Scratch of the motion check.
    """

    lower: tuple[float, float, float]
    upper: tuple[float, float, float]
    radius: float
    parts: Shapes
    reach: Floats
    scenery: Scenery
    body: Body

    @staticmethod
    @inline_helper
    def measure(space: "PolygonSpace", A: Floats, i: int, B: Floats, j: int) -> float:
        """Distance of the reference points, and the way of the farthest vertex about its own."""
        dx, dy = B[j, 0] - A[i, 0], B[j, 1] - A[i, 1]
        return math.sqrt(dx * dx + dy * dy) + space.radius * angle_apart(A[i, 2], B[j, 2])

    @staticmethod
    @inline_helper
    def length(space: "PolygonSpace", measured: float) -> float:  # noqa: ARG004
        """It is a distance already."""
        return measured

    @staticmethod
    @inline_helper
    def box_measure(space: "PolygonSpace", boxes: Floats, b: int, Q: Floats, i: int) -> float:
        """Distance to the box in the plane, and to its range of angles either way round."""
        dx = max(0.0, boxes[b, 0] - Q[i, 0], Q[i, 0] - boxes[b, 3])
        dy = max(0.0, boxes[b, 1] - Q[i, 1], Q[i, 1] - boxes[b, 4])
        turn = angle_to_range(boxes[b, 2], boxes[b, 5], Q[i, 2])
        return math.sqrt(dx * dx + dy * dy) + space.radius * turn

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
        """Move straight, and turn evenly the short way round."""
        theta = wrapped(A[i, 2] + turn_between(A[i, 2], B[j, 2]) * part)
        for k in range(2):
            q = A[i, k] + (B[j, k] - A[i, k]) * part
            out[row, k] = min(max(q, space.lower[k]), space.upper[k])
        out[row, 2] = theta

    @staticmethod
    @inline_helper
    def segment_free(space: "PolygonSpace", A: Floats, i: int, B: Floats, j: int) -> bool:
        """Free everywhere on the way: see `brrt.kernels.convex`."""
        return motion_free(space, A, i, B, j)

    @staticmethod
    @inline_helper
    def place(space: "PolygonSpace", A: Floats, i: int, B: Floats, j: int, part: float) -> None:
        """Turn all parts about the reference point."""
        x = A[i, 0] + (B[j, 0] - A[i, 0]) * part
        y = A[i, 1] + (B[j, 1] - A[i, 1]) * part
        theta = A[i, 2] + turn_between(A[i, 2], B[j, 2]) * part
        cos, sin = math.cos(theta), math.sin(theta)
        for shape in range(len(space.reach)):
            place_shape(space.parts, space.body.placed, shape, x, y, cos, sin)

    @staticmethod
    @inline_helper
    def bound_moves(space: "PolygonSpace", A: Floats, i: int, B: Floats, j: int) -> None:
        """As the metric, with each part's own radius."""
        dx, dy = B[j, 0] - A[i, 0], B[j, 1] - A[i, 1]
        straight, turn = math.sqrt(dx * dx + dy * dy), angle_apart(A[i, 2], B[j, 2])
        for part in range(len(space.reach)):
            space.body.moves[part] = (straight + space.reach[part] * turn) * _SAFE


@dataclass(frozen=True, slots=True, eq=False)
class Polygon(Robot):
    """A body of convex polygons in the plane; its configuration is x, y and the angle theta.

    The metric is hypot(dx, dy) + radius |dtheta|, radius being the largest distance of a vertex
    from the reference point: no point of the body moves farther. theta wraps at +-pi. Without a
    file it is a rectangle about its reference point.

    Attributes:
        parts: The body at pose (0, 0, 0), vertices counter-clockwise, shape (k, 2) each.
    """

    kind: ClassVar[str] = "polygon"

    length: float = param(4.0, "side of the rectangle along x", above=0)
    width: float = param(2.0, "side of the rectangle along y", above=0)
    parts: tuple[Floats, ...] = field(default=(), repr=False)

    def __post_init__(self) -> None:
        """Check the parts; without any, make the rectangle.

        Raises:
            BrrtError: A part is not a convex polygon.
        """
        Robot.__post_init__(self)
        x, y = self.length / 2, self.width / 2
        parts = self.parts or ([[-x, -y], [x, -y], [x, y], [-x, y]],)
        checked = tuple(convex_polygon(f"robot: polygons[{i}]", p) for i, p in enumerate(parts))
        object.__setattr__(self, "parts", checked)

    def definition(self) -> dict[str, Any]:
        """See `Robot.definition`."""
        return {"polygons": [part.tolist() for part in self.parts]}

    @classmethod
    def from_definition(cls, data: Mapping[str, Any]) -> Self:
        """See `Robot.from_definition`."""
        check_fields(data, "the robot", ("polygons",))
        if not isinstance(data["polygons"], list) or not data["polygons"]:
            raise BrrtError("robot: polygons must be a list of one or more polygons")
        return cls(parts=tuple(data["polygons"]))

    @property
    def radius(self) -> float:
        """Largest distance of a vertex from the reference point."""
        return float(self._reaches().max())

    def _reaches(self) -> Floats:
        return np.array([np.hypot(*part.T).max() for part in self.parts])

    def resolved(self, world: World) -> Self:
        """See `Robot.resolved`."""
        plane_only(self.kind, world)
        return self

    def coordinates(self, world: World) -> tuple[str, ...]:  # noqa: ARG002
        """Where the reference point is, and the angle."""
        return ("x", "y", "theta")

    def space(self, world: World) -> PolygonSpace:
        """See `Robot.space`."""
        plane_only(self.kind, world)
        scenery = build_scenery(world, self.radius)
        parts, body = build_body(list(self.parts), scenery)
        (x0, y0), (x1, y1) = world.lower.tolist(), world.upper.tolist()
        lower, upper = (x0, y0, -math.pi), (x1, y1, math.pi)
        return PolygonSpace(lower, upper, self.radius, parts, self._reaches(), scenery, body)

    def collision(self, world: World, q: Floats) -> str | None:
        """See `Robot.collision`."""
        if not world.inside(q[:2]):
            return "is outside the bounds"
        return blocked(world, self.outline(q))

    def distance(self, a: Floats, b: Floats) -> Floats:
        """See `Robot.distance`."""
        a, b = np.asarray(a), np.asarray(b)
        step = b[..., :2] - a[..., :2]
        straight = np.sqrt(step[..., 0] * step[..., 0] + step[..., 1] * step[..., 1])
        return np.asarray(straight + self.radius * angles_apart(a[..., 2], b[..., 2]))

    def interpolate(self, a: Floats, b: Floats, part: Floats | float) -> Floats:
        """See `Robot.interpolate`."""
        part = np.asarray(part)[..., None]
        step = np.concatenate([b[:2] - a[:2], turns_between(a[2:], b[2:])])
        q = a + step * part
        q[..., 2] = all_wrapped(q[..., 2])
        return q

    def unit_ball_volume(self, world: World) -> float:  # noqa: ARG002
        """Two cones on a disc of radius 1, each 1 / radius high."""
        return 2 * math.pi / (3 * self.radius)

    def places(self, Q: Floats) -> Floats:
        """Where the reference point is."""
        return Q[:, :2]

    def outline(self, q: Floats) -> list[Floats]:
        """See `Robot.outline`."""
        turn = rotation(q[2])
        return [part @ turn + q[:2] for part in self.parts]

    def configuration(self, position: Floats) -> Floats:
        """Upright at the position."""
        return np.array([*position, 0.0])

    def position(self, q: Floats) -> Floats:
        """Where the reference point is."""
        return q[:2]

    @property
    def room(self) -> float:
        """See `Robot.room`."""
        return self.radius

    def canonical(self, q: Floats) -> Floats:
        """See `Robot.canonical`."""
        return np.concatenate([q[:2], all_wrapped(q[2:])])
