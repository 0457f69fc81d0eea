"""A chain of links in the plane, each turning about a joint of the one before: n angles."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
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
from brrt.robots.robot import Robot, blocked, check_fields, numbers_of, plane_only
from brrt.settings import param
from brrt.worlds.convex import convex_polygon, touching_pair
from brrt.worlds.world import World

Floats = NDArray[np.float64]

_SAFE = 1.0 + 1e-12
"""Makes up for the rounding of a bound on a movement."""

_MOST_LINKS = 64
_AUTO_REACH, _AUTO_WIDTH = 0.4, 0.1
"""Reach of a chain without a length, as a part of the map's shortest side; a link's width where
none is given, as a part of its length."""

_QUARTER_TURN = math.pi / 2


class Joint(NamedTuple):
    """A joint and the link that it turns.

    Attributes:
        offset: Where it is, in the frame of the link before (the first: from the base).
        link: Vertices of the link in its own frame, whose origin is the joint, shape (k, 2).
        limits: Least and greatest angle; None for a joint that turns without end, and wraps.
    """

    offset: tuple[float, ...]
    link: Floats
    limits: tuple[float, ...] | None


class ChainSpace(NamedTuple):
    """Angles of a chain; see `brrt.kernels.spaces.space` for what the kernels mean.

    Attributes:
        lower: Least angles.
        upper: Greatest angles.
        endless: Which joints wrap, shape (n,).
        reach: How far anything beyond a joint gets from it, shape (n,).
        reaches: How far link j gets from joint i, at [i, j], shape (n, n).
        base: Where the chain begins, x and y.
        offsets: Each joint in the frame of the link before, shape (n, 2).
        parts: Links in their own frames.
        scenery: What is in the way.
        body: Scratch of the motion check.
    """

    lower: tuple[float, ...]
    upper: tuple[float, ...]
    endless: NDArray[np.bool_]
    reach: Floats
    reaches: Floats
    base: tuple[float, float]
    offsets: Floats
    parts: Shapes
    scenery: Scenery
    body: Body

    @staticmethod
    @inline_helper
    def measure(space: "ChainSpace", A: Floats, i: int, B: Floats, j: int) -> float:
        """Greatest over the joints of angle times reach."""
        most = 0.0
        for k in range(len(space.lower)):
            angle = abs(B[j, k] - A[i, k])
            if space.endless[k]:
                angle = angle_apart(A[i, k], B[j, k])
            most = max(most, angle * space.reach[k])
        return most

    @staticmethod
    @inline_helper
    def length(space: "ChainSpace", measured: float) -> float:  # noqa: ARG004
        """It is a distance already."""
        return measured

    @staticmethod
    @inline_helper
    def box_measure(space: "ChainSpace", boxes: Floats, b: int, Q: Floats, i: int) -> float:
        """Greatest over the joints of the angle to the box, either way round, times reach."""
        d, most = len(space.lower), 0.0
        for k in range(d):
            low, high = boxes[b, k], boxes[b, d + k]
            angle = max(0.0, low - Q[i, k], Q[i, k] - high)
            if space.endless[k]:
                angle = angle_to_range(low, high, Q[i, k])
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
            if space.endless[k]:
                out[row, k] = wrapped(A[i, k] + turn_between(A[i, k], B[j, k]) * part)
            else:
                q = A[i, k] + (B[j, k] - A[i, k]) * part
                out[row, k] = min(max(q, space.lower[k]), space.upper[k])

    @staticmethod
    @inline_helper
    def segment_free(space: "ChainSpace", A: Floats, i: int, B: Floats, j: int) -> bool:
        """Free everywhere on the way: see `brrt.kernels.convex`."""
        return motion_free(space, A, i, B, j)

    @staticmethod
    @inline_helper
    def place(space: "ChainSpace", A: Floats, i: int, B: Floats, j: int, part: float) -> None:
        """Put the links in place from the base outwards."""
        x, y = space.base
        theta, cos, sin = 0.0, 1.0, 0.0
        for k in range(len(space.lower)):
            ox, oy = space.offsets[k, 0], space.offsets[k, 1]
            x, y = x + (cos * ox - sin * oy), y + (sin * ox + cos * oy)
            turn = B[j, k] - A[i, k]
            if space.endless[k]:
                turn = turn_between(A[i, k], B[j, k])
            theta += A[i, k] + turn * part
            cos, sin = math.cos(theta), math.sin(theta)
            place_shape(space.parts, space.body.placed, k, x, y, cos, sin)

    @staticmethod
    @inline_helper
    def bound_moves(space: "ChainSpace", A: Floats, i: int, B: Floats, j: int) -> None:
        """Sum what each joint on the way from the base, or from another link, adds."""
        body, n, pair = space.body, len(space.lower), 0
        for link in range(n):
            way = 0.0
            for k in range(link, -1, -1):
                angle = abs(B[j, k] - A[i, k])
                if space.endless[k]:
                    angle = angle_apart(A[i, k], B[j, k])
                way += angle * space.reaches[k, link]
                # Of the joints that lie between two links, k is the first: this is how far the
                # link moves as the one before joint k sees it.
                if 0 < k < link and pair < len(body.pair_moves):
                    body.pair_moves[pair] = way * _SAFE
                    pair += 1
            body.moves[link] = way * _SAFE


@dataclass(frozen=True, slots=True, eq=False)
class Chain(Robot):
    """A chain of links with joints in the plane; its configuration is one angle a joint.

    With all angles 0 the links point right. The metric is the greatest over the joints of
    |dtheta| x reach beyond the joint. Without a file all links are alike: `length` long, with
    the joints in their ends, in the middle of the map.

    Attributes:
        joints: Joints and links from the base outwards; empty until the robot is `resolved` in a
            world, where no file gave them.
    """

    kind: ClassVar[str] = "chain"

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
        """See `Robot.definition`; the robot must be settled."""
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
        half = (_AUTO_WIDTH * length if self.width is None else self.width) / 2
        outline = [[0, -half], [length, -half], [length, half], [0, half]]
        link = convex_polygon("robot: link", outline if half else [[0, 0], [length, 0]])
        limits = None if self.wrap else (-self.limit, self.limit)
        return tuple(Joint((length if i else 0.0, 0.0), link, limits) for i in range(self.links))

    def coordinates(self, world: World) -> tuple[str, ...]:  # noqa: ARG002
        """One angle a joint."""
        return tuple(f"theta{i + 1}" for i in range(self.links))

    def space(self, world: World) -> ChainSpace:
        """See `Robot.space`."""
        reaches, n = self._reaches(), len(self.joints)
        far = float(np.abs(self._base).max()) + math.hypot(*self.joints[0].offset)
        far += float(reaches[0].max())
        scenery = build_scenery(world, far, n)
        links = [joint.link for joint in self.joints]
        pairs = [(i, j) for j in range(n) for i in range(j - 2, -1, -1)]
        parts, body = build_body(links, scenery, pairs if self.self_collision else None)
        limits = np.array([joint.limits or (-math.pi, math.pi) for joint in self.joints])
        return ChainSpace(
            lower=tuple(limits[:, 0].tolist()),
            upper=tuple(limits[:, 1].tolist()),
            endless=self._endless,
            reach=reaches.max(axis=1),
            reaches=reaches,
            base=(float(self._base[0]), float(self._base[1])),
            offsets=np.array([joint.offset for joint in self.joints]),
            parts=parts,
            scenery=scenery,
            body=body,
        )

    @property
    def _base(self) -> Floats:
        return np.array([self.base_x, self.base_y], np.float64)

    @property
    def _endless(self) -> NDArray[np.bool_]:
        return np.array([joint.limits is None for joint in self.joints])

    def _reaches(self) -> Floats:
        """How far link j gets from joint i, at [i, j]: 0 where it lies before it."""
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
                low, high = joint.limits
                return f"has joint {i + 1} at {q[i]:g}, beyond its limits {low:g} to {high:g}"
        parts = self.outline(q)
        pair = touching_pair(parts, 2) if self.self_collision else None
        if pair is not None:
            return f"has links {pair[0] + 1} and {pair[1] + 1} touch each other"
        return blocked(world, parts)

    def distance(self, a: Floats, b: Floats) -> Floats:
        """See `Robot.distance`."""
        a, b = np.asarray(a), np.asarray(b)
        angles = np.where(self._endless, angles_apart(a, b), np.abs(b - a))
        return np.asarray((angles * self._reaches().max(axis=1)).max(axis=-1))

    def interpolate(self, a: Floats, b: Floats, part: Floats | float) -> Floats:
        """See `Robot.interpolate`."""
        step = np.where(self._endless, turns_between(a, b), b - a)
        q = a + step * np.asarray(part)[..., None]
        return np.where(self._endless, all_wrapped(q), q)

    def unit_ball_volume(self, world: World) -> float:  # noqa: ARG002
        """A box: 2 / reach along each joint."""
        return float(np.prod(2 / self._reaches().max(axis=1)))

    def places(self, Q: Floats) -> Floats:
        """Where the tip is: the middle of the farthest edge of the last link."""
        position, theta = np.tile(self._base, (len(Q), 1)), np.zeros(len(Q))
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
        position, theta, parts = self._base, 0.0, []
        for joint, angle in zip(self.joints, q, strict=True):
            position = position + np.array(joint.offset) @ rotation(theta)
            theta += angle
            parts.append(joint.link @ rotation(theta) + position)
        return parts

    def configuration(self, position: Floats) -> None:  # noqa: ARG002
        """None: many or no angles put the tip there."""
        return

    def position(self, q: Floats) -> Floats | None:  # noqa: ARG002
        """Where the chain begins, if the settings or a file say so."""
        return None if self.base_x is None or self.base_y is None else self._base

    def canonical(self, q: Floats) -> Floats:
        """See `Robot.canonical`."""
        return np.where(self._endless, all_wrapped(q), q)


def _joint(name: str, data: Any) -> Joint:
    """Read a joint of a file."""
    check_fields(data, name, ("offset", "link"), "limits")
    offset = numbers_of(f"{name} offset", data["offset"], 2)
    link = convex_polygon(f"robot: {name} link", data["link"])
    limits = data.get("limits", (-_QUARTER_TURN, _QUARTER_TURN))
    if limits is not None:
        limits = numbers_of(f"{name} limits (null for none)", limits, 2)
        if limits[0] >= limits[1]:
            raise BrrtError(f"robot: {name} limits {limits[0]:g}, {limits[1]:g} must rise")
    return Joint(offset, link, limits)
