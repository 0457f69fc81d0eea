"""A body of convex polygons that moves and turns in the plane: (x, y, theta)."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar, Self

import numpy as np

from brrt.errors import BrrtError
from brrt.robots.angles import angle_differences, angle_distances, rotation, wrap_angles
from brrt.robots.robot import Floats, Robot, blocked, check_fields, plane_only
from brrt.settings import param
from brrt.worlds.arrays import check_lengths
from brrt.worlds.convex import convex_polygon
from brrt.worlds.world import World

_MOST_PARTS, _MOST_VERTICES = 10_000, 1000
"""Of a body, and of each part: planning, and judging a plan, would take minutes with more."""


@dataclass(frozen=True, slots=True, eq=False)
class Polygon(Robot):
    """A body of convex polygons in the plane; its configuration is x, y and the angle theta.

    The metric is hypot(dx, dy) + radius |dtheta|, where radius is the largest distance of a vertex
    from the reference point: no point of the body moves farther. theta wraps at +-pi. Without a
    file the body is a rectangle centred on its reference point.

    Attributes:
        parts: The body at pose (0, 0, 0), vertices counter-clockwise, shape (k, 2) each.
    """

    kind: ClassVar[str] = "polygon"

    length: float = param(4.0, "side of the rectangle along x", above=0)
    width: float = param(2.0, "side of the rectangle along y", above=0)
    parts: tuple[Floats, ...] = field(default=(), repr=False)

    def __post_init__(self) -> None:
        """Check the parts; if there are none, make the rectangle.

        Raises:
            BrrtError: A part is not a convex polygon.
        """
        Robot.__post_init__(self)
        check_lengths("robot: length and width", np.array([self.length, self.width]))
        x, y = self.length / 2, self.width / 2
        parts = self.parts or ([[-x, -y], [x, -y], [x, y], [-x, y]],)
        checked = tuple(convex_polygon(f"robot: polygons[{i}]", p) for i, p in enumerate(parts))
        for i, part in enumerate(checked):
            if len(part) > _MOST_VERTICES:
                raise BrrtError(
                    f"robot: polygons[{i}] has {len(part):,} vertices, and may have at most "
                    f"{_MOST_VERTICES:,}; leave some out"
                )
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
        if len(data["polygons"]) > _MOST_PARTS:
            raise BrrtError(
                f"robot: polygons has {len(data['polygons']):,} parts, and may have at most "
                f"{_MOST_PARTS:,}; make the body of fewer convex polygons"
            )
        return cls(parts=tuple(data["polygons"]))

    @property
    def radius(self) -> float:
        """Largest distance of a vertex from the reference point."""
        return float(self.reaches.max())

    @property
    def reaches(self) -> Floats:
        """Distance of each part's farthest vertex from the reference point, shape (parts,)."""
        return np.array([np.hypot(*part.T).max() for part in self.parts])

    def resolved(self, world: World) -> Self:
        """See `Robot.resolved`."""
        plane_only(self.kind, world)
        return self

    def coordinates(self, world: World) -> tuple[str, ...]:  # noqa: ARG002
        """Position of the reference point, and the angle."""
        return ("x", "y", "theta")

    def bounds(self, world: World) -> tuple[Floats, Floats]:
        """See `Robot.bounds`."""
        return np.append(world.lower, -math.pi), np.append(world.upper, math.pi)

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
        return np.asarray(straight + self.radius * angle_distances(a[..., 2], b[..., 2]))

    def interpolate(self, a: Floats, b: Floats, part: Floats | float) -> Floats:
        """See `Robot.interpolate`."""
        part = np.asarray(part)[..., None]
        step = np.concatenate([b[:2] - a[:2], angle_differences(a[2:], b[2:])])
        q = a + step * part
        q[..., 2] = wrap_angles(q[..., 2])
        return q

    def unit_ball_volume(self, world: World) -> float:  # noqa: ARG002
        """Two cones on a disc of radius 1, each 1 / radius high."""
        return 2 * math.pi / (3 * self.radius)

    def places(self, Q: Floats) -> Floats:
        """The reference point."""
        return Q[:, :2]

    def outline(self, q: Floats) -> list[Floats]:
        """See `Robot.outline`."""
        matrix = rotation(q[2])
        return [part @ matrix + q[:2] for part in self.parts]

    def configuration(self, position: Floats) -> Floats:
        """The reference point at the position, with theta 0."""
        return np.array([*position, 0.0])

    def position(self, q: Floats) -> Floats:
        """The reference point."""
        return q[:2]

    @property
    def reach(self) -> float:
        """See `Robot.reach`."""
        return self.radius

    def canonical(self, q: Floats) -> Floats:
        """See `Robot.canonical`."""
        return np.concatenate([q[:2], wrap_angles(q[2:])])
