"""The base of every robot: a body, a metric, and the checks of one configuration, in numpy."""

import json
from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from brrt.digits import tell_apart
from brrt.errors import BrrtError
from brrt.settings import Settings
from brrt.worlds.arrays import GREATEST
from brrt.worlds.world import World

Floats = NDArray[np.float64]

SCHEMA, VERSION = "brrt.robot", 1

_PIECES = 16
"""Lines that a curve between two configurations is drawn as."""


@dataclass(frozen=True, slots=True)
class Robot(Settings):
    """Base class: settings, and what they mean in a world.

    `brrt.kernels.spaces` has the compiled counterpart of each robot.

    Attributes:
        kind: The robot's name in the registry and in files.
        opaque: Whether its shape and limits are not known, so that nothing can be said of its
            collisions.
        limited: Whether its bounds are limits of its own, which hold in any world.
        curved: Whether its place follows a curve between two configurations.
    """

    greatest_number: ClassVar[float] = GREATEST
    kind: ClassVar[str]
    opaque: ClassVar[bool] = False
    limited: ClassVar[bool] = False
    curved: ClassVar[bool] = False

    def resolved(self, world: World) -> Self:  # noqa: ARG002
        """Return the robot with the settings filled in whose defaults depend on the world.

        Raises:
            BrrtError: The robot does not work in this world.
        """
        return self

    @abstractmethod
    def coordinates(self, world: World) -> tuple[str, ...]:
        """Names of the numbers in a configuration."""

    def dof(self, world: World) -> int:
        """Count the numbers in a configuration."""
        return len(self.coordinates(world))

    @abstractmethod
    def bounds(self, world: World) -> tuple[Floats, Floats]:
        """Least and greatest configuration, shape (dof,) each; samples are drawn between them."""

    @abstractmethod
    def collision(self, world: World, q: Floats) -> str | None:
        """Say why a configuration, shape (dof,), is not free, or return None if it is."""

    def misfit(self, world: World) -> str | None:
        """Say why no configuration of a resolved robot is free, as far as that is easy to see."""
        size = world.upper - world.lower
        diagonal = float(np.hypot.reduce(size))
        for part in self.outline(np.zeros(self.dof(world))):
            far = part[np.hypot(*(part - part[0]).T).argmax()]
            long = float(np.hypot(*(part - far).T).max())
            if long >= diagonal:
                texts = tell_apart(long, diagonal)
                return f"a part of it is {texts[0]} long, and the diagonal of the bounds {texts[1]}"
        return None

    @abstractmethod
    def distance(self, a: Floats, b: Floats) -> Floats:
        """Distances between configurations, shape (..., dof), as the kernels' `distance`."""

    @abstractmethod
    def interpolate(self, a: Floats, b: Floats, part: Floats | float) -> Floats:
        """Configurations at parts (0 to 1, shape (...)) of the motion from a to b, shape (dof,)."""

    @abstractmethod
    def unit_ball_volume(self, world: World) -> float:
        """Volume, in configuration coordinates, of a ball of radius 1 in the robot's metric."""

    @abstractmethod
    def places(self, Q: Floats) -> Floats:
        """Points at which configurations, shape (n, dof), are drawn, shape (n, d)."""

    @abstractmethod
    def outline(self, q: Floats) -> list[Floats]:
        """Parts of the body at a configuration, vertices counter-clockwise, shape (k, 2) each.

        Empty if the body is a point.
        """

    def skeleton(self, Q: Floats) -> Floats:
        """Lines that stand for a body without an outline, shape (n, k, d); k is 0 without any."""
        return np.empty((len(Q), 0, 2))

    def trail(self, path: Floats) -> Floats:
        """Return the places that a path, shape (m, dof), leads through, shape (k, d).

        They are those of the waypoints, and between them where they follow a curve.
        """
        if self.curved and len(path) > 1:
            parts = np.arange(_PIECES) / _PIECES
            legs = [self.interpolate(*pair, parts) for pair in pairwise(path)]
            path = np.concatenate([*legs, path[-1:]])
        return self.places(path)

    @abstractmethod
    def configuration(self, position: Floats) -> Floats | None:
        """Configuration at a position in the world; None if a position does not determine one."""

    @abstractmethod
    def position(self, q: Floats) -> Floats | None:
        """Position around which a generated world leaves room for a configuration, if there is one.

        `q` may be invalid; the query is checked later.
        """

    @property
    def reach(self) -> float:
        """Farthest distance of the body from `position`."""
        return 0.0

    def canonical(self, q: Floats) -> Floats:
        """Return the same configuration with its angles in range, shape (dof,)."""
        return q

    def along(self, path: Floats, count: int) -> Floats:
        """Return configurations on a path, evenly spaced by the metric, without its ends.

        Args:
            path: Waypoints, shape (m, dof), m at least 1.
            count: Number of configurations.

        Returns:
            Shape (count, dof).
        """
        far = np.cumsum(np.concatenate([[0.0], self.distance(path[:-1], path[1:])]))
        if far[-1] <= 0:
            return np.repeat(path[:1], count, axis=0)
        at = np.linspace(0, far[-1], count + 2)[1:-1]
        legs = np.clip(np.searchsorted(far, at, "right") - 1, 0, len(path) - 2)
        parts = (at - far[legs]) / np.maximum(far[legs + 1] - far[legs], np.finfo(float).tiny)
        return np.array(
            [
                self.interpolate(path[leg], path[leg + 1], min(part, 1.0))
                for leg, part in zip(legs.tolist(), parts.tolist(), strict=True)
            ]
        )

    def definition(self) -> dict[str, Any]:
        """Return the fields of the robot's file, without its kind; see `from_definition`."""
        return self.as_dict()

    @classmethod
    def from_definition(cls, data: Mapping[str, Any]) -> Self:
        """Make the robot from the fields that `definition` returned.

        Raises:
            BrrtError: A field is missing, unknown or invalid.
        """
        return cls.parse(f"robot {cls.kind}", data)

    def to_json(self) -> str:
        """Return the robot as text that `brrt.robots.robot_from_json` reads."""
        data = {"schema": SCHEMA, "version": VERSION, "kind": self.kind, **self.definition()}
        return json.dumps(data)


def numbers_of(name: str, values: Any, count: int) -> tuple[float, ...]:
    """Read `count` finite numbers up to `GREATEST`.

    Raises:
        BrrtError: The values are something else.
    """
    what = "a finite number" if count == 1 else f"{count} finite numbers"
    try:
        array = np.array(values, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        array = np.array(np.nan)
    if array.shape != (count,) or not (np.abs(array) <= GREATEST).all():
        text = repr(values)
        text = text if len(text) <= 60 else text[:57] + "..."
        raise BrrtError(f"robot: {name} must be {what}, not {text}")
    return tuple(array.tolist())


def check_fields(data: Mapping[str, Any], where: str, needed: tuple[str, ...], *more: str) -> None:
    """Check that an object of a file has the needed fields, and no others but `more`.

    Raises:
        BrrtError: A field is missing or unknown.
    """
    if not isinstance(data, Mapping):
        raise BrrtError(f"robot: {where} must be an object with {', '.join(needed)}")
    for name in needed:
        if name not in data:
            raise BrrtError(f'robot: the field "{name}" of {where} is missing')
    for name in data:
        if name not in (*needed, *more):
            known = ", ".join((*needed, *more))
            raise BrrtError(f"robot: unknown field {name!r} of {where}; known fields: {known}")


def plane_only(kind: str, world: World) -> None:
    """Check that a world is 2D.

    Raises:
        BrrtError: The world is 3D.
    """
    if world.dim != 2:
        raise BrrtError(
            f"robot {kind} moves in the plane, but world {world.name} is {world.dim}D; "
            f"choose a 2D world, or the robot point"
        )


def blocked(world: World, parts: list[Floats]) -> str | None:
    """Say what a body touches, a bound or an obstacle; None if it touches nothing."""
    for part in parts:
        if (part <= world.lower).any() or (part >= world.upper).any():
            return "reaches the bounds"
        hit = world.obstacle_touching(part)
        if hit is not None:
            return f"is in collision with {hit}"
    return None
