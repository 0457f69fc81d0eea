"""A chain of links in the plane, each turning about a joint of the one before: n angles."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from brrt.digits import against_limits, tell_apart
from brrt.errors import BrrtError
from brrt.robots.angles import angle_differences, angle_distances, rotation, wrap_angles
from brrt.robots.robot import Floats, Robot, blocked, check_fields, numbers_of, plane_only
from brrt.settings import param
from brrt.worlds.arrays import check_lengths
from brrt.worlds.convex import convex_polygon, gap, touching_pair
from brrt.worlds.world import World

_MOST_LINKS = 64
_AUTO_REACH, _AUTO_WIDTH = 0.4, 0.1
"""Defaults: length of the whole chain as a part of the map's shortest side, and width of a link as
a part of its length."""

_QUARTER_TURN = math.pi / 2
_LIMITS = (-_QUARTER_TURN, _QUARTER_TURN)
"""Limits of a joint for which a file states none; `null` in the file is no limits."""


class Joint(NamedTuple):
    """A joint and the link that it turns.

    Attributes:
        offset: Position in the frame of the link before (of the first joint: from the base).
        link: Vertices of the link in its own frame, whose origin is the joint, shape (k, 2).
        limits: Least and greatest angle; None for a joint that turns without limits and wraps.
    """

    offset: tuple[float, ...]
    link: Floats
    limits: tuple[float, ...] | None


@dataclass(frozen=True, slots=True, eq=False)
class Chain(Robot):
    """A chain of links with joints in the plane; its configuration is one angle a joint.

    With all angles 0 the links point right. The metric is the greatest product of |dtheta| and
    reach over the joints, where a joint's reach is the farthest distance of the links beyond it.
    Without a file all links are equal: `length` long, with the joints in their ends, and the chain
    begins in the middle of the map.

    Attributes:
        joints: Joints and links from the base outwards; without a file empty until the robot is
            `resolved` in a world.
    """

    kind: ClassVar[str] = "chain"
    curved: ClassVar[bool] = True

    links: int = param(3, "number of links", low=1, high=_MOST_LINKS)
    length: float | None = param(
        None, "length of a link; by default all together are 0.4 of the map's side", above=0
    )
    width: float | None = param(
        None, "width of a link, 0 for a line; a tenth of its length by default", low=0
    )
    limit: float = param(
        _QUARTER_TURN, "greatest angle of a joint, either way", above=0, high=math.pi, unit="rad"
    )
    wrap: bool = param(False, "joints turn without limits")
    self_collision: bool = param(False, "links that are not neighbours must not touch")
    base_x: float | None = param(None, "where the chain begins; the middle of the map by default")
    base_y: float | None = param(None, "where the chain begins; the middle of the map by default")
    joints: tuple[Joint, ...] = field(default=(), repr=False)

    def definition(self) -> dict[str, Any]:
        """See `Robot.definition`; the robot must be resolved."""
        joints = [
            {"offset": list(j.offset), "link": j.link.tolist(), "limits": j.limits}
            for j in self.joints
        ]
        return {
            "base": [self.base_x, self.base_y],
            "joints": joints,
            "self_collision": self.self_collision,
        }

    @classmethod
    def from_definition(cls, data: Mapping[str, Any]) -> Self:
        """See `Robot.from_definition`."""
        check_fields(data, "the robot", ("base", "joints"), "self_collision")
        x, y = numbers_of("base", data["base"], 2)
        if not isinstance(data["joints"], list) or not 1 <= len(data["joints"]) <= _MOST_LINKS:
            raise BrrtError(f"robot: joints must be a list of 1 to {_MOST_LINKS} joints")
        joints = tuple(_joint(f"joints[{i}]", joint) for i, joint in enumerate(data["joints"]))
        touching = data.get("self_collision", False)
        if not isinstance(touching, bool):
            raise BrrtError(f"robot: self_collision must be true or false, not {touching!r}")
        return cls(len(joints), self_collision=touching, base_x=x, base_y=y, joints=joints)

    def resolved(self, world: World) -> Self:
        """See `Robot.resolved`."""
        plane_only(self.kind, world)
        x, y = ((world.lower + world.upper) / 2).tolist()
        x, y = (m if own is None else own for own, m in ((self.base_x, x), (self.base_y, y)))
        joints = self.joints or self._equal_joints(float((world.upper - world.lower).min()))
        return replace(self, base_x=x, base_y=y, joints=joints)

    def _equal_joints(self, side: float) -> tuple[Joint, ...]:
        length = self.length or _AUTO_REACH * side / self.links
        width = _AUTO_WIDTH * length if self.width is None else self.width
        check_lengths("robot: length and width of links", np.array([length, width]))
        half = width / 2
        outline = [[0, -half], [length, -half], [length, half], [0, half]]
        link = convex_polygon("robot: link", outline if half else [[0, 0], [length, 0]])
        limits = None if self.wrap else (-self.limit, self.limit)
        return tuple(Joint((length if i else 0.0, 0.0), link, limits) for i in range(self.links))

    def coordinates(self, world: World) -> tuple[str, ...]:  # noqa: ARG002
        """One angle a joint."""
        return tuple(f"theta{i + 1}" for i in range(self.links))

    def bounds(self, world: World) -> tuple[Floats, Floats]:  # noqa: ARG002
        """See `Robot.bounds`."""
        limits = np.array([joint.limits or (-math.pi, math.pi) for joint in self.joints])
        return limits[:, 0], limits[:, 1]

    @property
    def base(self) -> Floats:
        """Where the chain begins, shape (2,)."""
        return np.array([self.base_x, self.base_y], np.float64)

    @property
    def wraps(self) -> NDArray[np.bool_]:
        """Whether each joint turns without limits, shape (n,)."""
        return np.array([joint.limits is None for joint in self.joints])

    @property
    def reaches(self) -> Floats:
        """Farthest distance of link j from joint i, at [i, j]; 0 for j < i; shape (n, n)."""
        n = len(self.joints)
        reaches = np.zeros((n, n))
        for j, joint in enumerate(self.joints):
            far = float(np.hypot(*joint.link.T).max())
            for i in range(j, -1, -1):
                reaches[i, j] = far
                far += math.hypot(*self.joints[i].offset)
        return reaches

    def collision(self, world: World, q: Floats) -> str | None:
        """See `Robot.collision`."""
        for i, joint in enumerate(self.joints):
            if joint.limits is not None and not joint.limits[0] <= q[i] <= joint.limits[1]:
                at, low, high = against_limits(float(q[i]), joint.limits[0], joint.limits[1])
                own = "" if joint.limits != _LIMITS else " (the default)"
                return f"has joint {i + 1} at {at}, beyond its limits {low} to {high}{own}"
        parts = self.outline(q)
        pair = touching_pair(parts, 2) if self.self_collision else None
        if pair is not None:
            return f"has links {pair[0] + 1} and {pair[1] + 1} touch each other"
        return blocked(world, parts)

    def misfit(self, world: World) -> str | None:
        """See `Robot.misfit`; a link that contains its joint keeps the base where it is."""
        first, base = self.joints[0], self.base + np.array(self.joints[0].offset)
        if gap(np.zeros((1, 2)), first.link) > 0:
            return Robot.misfit(self, world)
        why = blocked(world, [base[None]])
        if why is None:
            return Robot.misfit(self, world)
        return (
            f"its base ({world.text(base)}) {why}, so "
            f"no configuration is free; move it by base_x and base_y, or base in the robot's file"
        )

    def distance(self, a: Floats, b: Floats) -> Floats:
        """See `Robot.distance`."""
        a, b = np.asarray(a), np.asarray(b)
        angles = np.where(self.wraps, angle_distances(a, b), np.abs(b - a))
        return np.asarray((angles * self.reaches.max(axis=1)).max(axis=-1))

    def interpolate(self, a: Floats, b: Floats, part: Floats | float) -> Floats:
        """See `Robot.interpolate`."""
        step = np.where(self.wraps, angle_differences(a, b), b - a)
        q = a + step * np.asarray(part)[..., None]
        return np.where(self.wraps, wrap_angles(q), q)

    def unit_ball_volume(self, world: World) -> float:  # noqa: ARG002
        """A box: 2 / reach along each joint."""
        return float(np.prod(2 / self.reaches.max(axis=1)))

    def places(self, Q: Floats) -> Floats:
        """The tip: the middle of the farthest edge of the last link."""
        position, theta = np.tile(self.base, (len(Q), 1)), np.zeros(len(Q))
        link = self.joints[-1].link
        tip = link[np.isclose(link[:, 0], link[:, 0].max())].mean(axis=0)
        for k, offset in enumerate([*(joint.offset for joint in self.joints), tip]):
            cos, sin = np.cos(theta), np.sin(theta)
            position[:, 0] += cos * offset[0] - sin * offset[1]
            position[:, 1] += sin * offset[0] + cos * offset[1]
            if k < len(self.joints):
                theta = theta + Q[:, k]
        return position

    def outline(self, q: Floats) -> list[Floats]:
        """See `Robot.outline`."""
        position, theta, parts = self.base, 0.0, []
        for joint, angle in zip(self.joints, q, strict=True):
            position = position + np.array(joint.offset) @ rotation(theta)
            theta += angle
            parts.append(joint.link @ rotation(theta) + position)
        return parts

    def configuration(self, position: Floats) -> None:  # noqa: ARG002
        """None: many configurations, or none, have the tip at a position."""
        return

    def position(self, q: Floats) -> Floats | None:  # noqa: ARG002
        """Where the chain begins, if the settings or a file give it."""
        return None if self.base_x is None or self.base_y is None else self.base

    def canonical(self, q: Floats) -> Floats:
        """See `Robot.canonical`."""
        return np.where(self.wraps, wrap_angles(q), q)


def _joint(name: str, data: Any) -> Joint:
    """Read a joint from a file."""
    check_fields(data, name, ("offset", "link"), "limits")
    offset = numbers_of(f"{name} offset", data["offset"], 2)
    link = convex_polygon(f"robot: {name} link", data["link"])
    limits = data.get("limits", _LIMITS)
    if limits is not None:
        limits = numbers_of(f"{name} limits (null for none)", limits, 2)
        if limits[0] >= limits[1]:
            texts = ", ".join(tell_apart(*limits))
            raise BrrtError(f"robot: {name} limits {texts} must rise")
    return Joint(offset, link, limits)
