"""A serial arm: joints from a base to a tip, read from a URDF; see `brrt.robots.urdf`."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from brrt.digits import against_limits, tell_apart
from brrt.errors import BrrtError
from brrt.robots.angles import angle_differences, angle_distances, wrap_angles
from brrt.robots.opaque import MOST_NUMBERS
from brrt.robots.robot import Floats, Robot, check_fields, numbers_of
from brrt.settings import param
from brrt.worlds.world import World

FIXED, CONTINUOUS, PRISMATIC, REVOLUTE = "fixed", "continuous", "prismatic", "revolute"
TYPES = (FIXED, CONTINUOUS, PRISMATIC, REVOLUTE)

_MOST_JOINTS, _LONGEST_NAME = 256, 200


class ArmJoint(NamedTuple):
    """A joint as a URDF defines it.

    Attributes:
        name: Its name.
        type: One of `TYPES`.
        xyz: Its position in the frame of the link before, shape (3,).
        rpy: Its orientation there: angles about the fixed axes x, y, z, in this order.
        axis: Unit vector in its own frame that it turns about or slides along.
        limits: Least and greatest value; None for a fixed and a continuous joint.
    """

    name: str
    type: str
    xyz: tuple[float, ...]
    rpy: tuple[float, ...]
    axis: tuple[float, ...]
    limits: tuple[float, ...] | None


@dataclass(frozen=True, slots=True)
class Arm(Robot):
    """A serial arm; its configuration is one value for each joint that is not fixed.

    What it hits is not known, but its limits are. The metric is Euclidean, in radians and meters,
    the short way round where a joint is continuous. The base's frame is that of the world.

    Attributes:
        base: Name of the link that stands still.
        tip: Name of the link whose origin is drawn as the place of a configuration.
        joints: The joints from base to tip.
    """

    kind: ClassVar[str] = "arm"
    opaque: ClassVar[bool] = True
    limited: ClassVar[bool] = True
    curved: ClassVar[bool] = True

    drawn: int = param(3, "dimensions of the world that it is drawn in", low=2, high=3)
    base: str = "base"
    tip: str = "tip"
    joints: tuple[ArmJoint, ...] = field(default=(), repr=False)

    def definition(self) -> dict[str, Any]:
        """See `Robot.definition`."""
        joints = [joint._asdict() for joint in self.joints]
        return {"drawn": self.drawn, "base": self.base, "tip": self.tip, "joints": joints}

    @classmethod
    def from_definition(cls, data: Mapping[str, Any]) -> Self:
        """See `Robot.from_definition`."""
        check_fields(data, "the robot", ("base", "tip", "joints"), "drawn")
        joints = data["joints"]
        if not isinstance(joints, list) or not 0 < len(joints) <= _MOST_JOINTS:
            raise BrrtError(f"robot: joints must be a list of 1 to {_MOST_JOINTS} joints")
        found = [_joint(f"joints[{i}]", joint) for i, joint in enumerate(joints)]
        base, tip = (name_of(end, data[end]) for end in ("base", "tip"))
        arm = cls(data.get("drawn", 3), base, tip)
        return arm.with_joints(found)

    def with_joints(self, joints: list[ArmJoint]) -> Self:
        """Return the arm with checked joints.

        Raises:
            BrrtError: There are none that move, or too many, or a name is repeated.
        """
        names = [joint.name for joint in joints]
        twice = next((name for name in names if names.count(name) > 1), None)
        moving = sum(joint.type != FIXED for joint in joints)
        if twice is not None:
            raise BrrtError(f"joint {twice!r} is there twice; give each joint a name of its own")
        if not 1 <= moving <= MOST_NUMBERS or len(joints) > _MOST_JOINTS:
            raise BrrtError(
                f"{moving} of {len(joints)} joints from {self.base!r} to {self.tip!r} move; "
                f"1 to {MOST_NUMBERS} may, of {_MOST_JOINTS}; choose another base or tip"
            )
        return replace(self, joints=tuple(joints))

    @property
    def moving(self) -> list[ArmJoint]:
        """The joints that are not fixed."""
        return [joint for joint in self.joints if joint.type != FIXED]

    @property
    def wraps(self) -> NDArray[np.bool_]:
        """Whether each number of a configuration is an angle without limits, shape (dof,)."""
        return np.array([joint.type == CONTINUOUS for joint in self.moving])

    def resolved(self, world: World) -> Self:
        """See `Robot.resolved`.

        Raises:
            BrrtError: It has no joints: it was not made from a file.
        """
        if not self.joints:
            raise BrrtError("robot arm has no joints; name its URDF, such as --robot arm.urdf")
        return replace(self, drawn=world.dim)

    def coordinates(self, world: World | None) -> tuple[str, ...]:  # noqa: ARG002
        """The names of the joints."""
        return tuple(joint.name for joint in self.moving)

    def bounds(self, world: World | None = None) -> tuple[Floats, Floats]:  # noqa: ARG002
        """Return the limits of the joints; -pi and pi for a continuous joint."""
        limits = np.array([joint.limits or (-math.pi, math.pi) for joint in self.moving])
        return limits[:, 0], limits[:, 1]

    def collision(self, world: World, q: Floats) -> str | None:  # noqa: ARG002
        """Say which joint is beyond its limits; nothing else is known."""
        for joint, value in zip(self.moving, q.tolist(), strict=True):
            if joint.limits is not None and not joint.limits[0] <= value <= joint.limits[1]:
                at, low, high = against_limits(value, joint.limits[0], joint.limits[1])
                return f"has joint {joint.name} at {at}, beyond its limits {low} to {high}"
        return None

    def distance(self, a: Floats, b: Floats) -> Floats:
        """See `Robot.distance`."""
        a, b = np.asarray(a), np.asarray(b)
        steps = np.where(self.wraps, angle_distances(a, b), np.abs(b - a))
        return np.asarray(np.sqrt((steps**2).sum(axis=-1)))

    def interpolate(self, a: Floats, b: Floats, part: Floats | float) -> Floats:
        """See `Robot.interpolate`."""
        a, b, wraps = np.asarray(a), np.asarray(b), self.wraps
        step = np.where(wraps, angle_differences(a, b), b - a)
        q = a + step * np.asarray(part)[..., None]
        return np.where(wraps, wrap_angles(q), q)

    def canonical(self, q: Floats) -> Floats:
        """See `Robot.canonical`."""
        return np.where(self.wraps, wrap_angles(q), q)

    def unit_ball_volume(self, world: World) -> float:  # noqa: ARG002
        """See `Robot.unit_ball_volume`."""
        n = len(self.moving)
        return float(math.pi ** (n / 2)) / math.gamma(n / 2 + 1)

    def forward(self, Q: Floats) -> tuple[Floats, Floats]:
        """Compute the frames of all links at configurations, shape (n, dof).

        Returns:
            Origins, shape (n, k, 3), and rotations, shape (n, k, 3, 3), in the base's frame, of
            the base and of the link behind each joint; the last one is the tip.
        """
        Q = np.asarray(Q, np.float64)
        at, turn = np.zeros((len(Q), 3)), np.broadcast_to(np.eye(3), (len(Q), 3, 3))
        origins, rotations, values = [at], [turn], iter(Q.T)
        for joint in self.joints:
            at, turn = at + turn @ np.array(joint.xyz), turn @ _fixed_axes(*joint.rpy)
            if joint.type == PRISMATIC:
                at = at + turn @ np.array(joint.axis) * next(values)[:, None]
            elif joint.type != FIXED:
                turn = turn @ _about(np.array(joint.axis), next(values))
            origins.append(at)
            rotations.append(turn)
        return np.stack(origins, axis=1), np.stack(rotations, axis=1)

    def places(self, Q: Floats) -> Floats:
        """The tip; in the plane its x and y."""
        return self.skeleton(Q)[:, -1]

    def skeleton(self, Q: Floats) -> Floats:
        """The base, the joints and the tip; see `Robot.skeleton`."""
        return self.forward(Q)[0][..., : self.drawn]

    def outline(self, q: Floats) -> list[Floats]:  # noqa: ARG002
        """Empty: it is not known."""
        return []

    def configuration(self, position: Floats) -> None:
        """Return None: a position does not determine one."""

    def position(self, q: Floats) -> None:
        """Return None: a generated world leaves no room for an arm."""


def joint_of(
    name: str, kind: str, xyz: Any, rpy: Any, axis: Any, limits: Any, where: str = "joint"
) -> ArmJoint:
    """Check the values of a joint.

    Raises:
        BrrtError: One is wrong.
    """
    if kind not in TYPES:
        raise BrrtError(f"{where} type must be one of {', '.join(TYPES)}, not {kind!r:.60}")
    xyz, rpy, axis = (
        numbers_of(f"{where} {what}", values, 3)
        for what, values in (("xyz", xyz), ("rpy", rpy), ("axis", axis))
    )
    length = math.hypot(*axis)
    if kind != FIXED and not length > 0:
        raise BrrtError(f"{where} axis must not be 0 0 0")
    # A unit vector keeps its bits, so that the definition is read as it was written.
    if length > 0 and not math.isclose(length, 1, rel_tol=1e-12):
        axis = tuple(value / length for value in axis)
    if kind in (FIXED, CONTINUOUS):
        return ArmJoint(name, kind, xyz, rpy, axis, None)
    limits = numbers_of(f"{where} limits", limits, 2)
    if limits[0] >= limits[1]:
        texts = " and ".join(tell_apart(*limits))
        raise BrrtError(f"{where} limits {texts} must rise; state lower and upper, or fix it")
    return ArmJoint(name, kind, xyz, rpy, axis, limits)


def name_of(what: str, value: Any) -> str:
    """Check a name.

    Raises:
        BrrtError: It is no text, or empty, or too long.
    """
    if not isinstance(value, str) or not 0 < len(value) <= _LONGEST_NAME:
        raise BrrtError(f"robot: {what} must be a name, not {value!r:.60}")
    return value


def _joint(where: str, data: Any) -> ArmJoint:
    """Read a joint from a definition."""
    check_fields(data, where, ArmJoint._fields)
    name = name_of(f"{where} name", data["name"])
    xyz, rpy, axis, limits = (data[field] for field in ArmJoint._fields[2:])
    return joint_of(name, data["type"], xyz, rpy, axis, limits, where)


def _fixed_axes(roll: float, pitch: float, yaw: float) -> Floats:
    """Return the rotation by angles about the fixed axes x, y and z, shape (3, 3)."""
    angles = zip(np.eye(3), (roll, pitch, yaw), strict=True)
    x, y, z = (_about(axis, np.array([angle]))[0] for axis, angle in angles)
    return np.asarray(z @ y @ x)


def _about(axis: Floats, angles: Floats) -> Floats:
    """Return rotations about a unit vector, shape (n, 3, 3); Rodrigues' formula."""
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    sin, cos = np.sin(angles)[:, None, None], np.cos(angles)[:, None, None]
    return np.asarray(np.eye(3) + sin * cross + (1 - cos) * (cross @ cross))
