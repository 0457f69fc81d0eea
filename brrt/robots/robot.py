"""What every robot is: a body, a metric, and a configuration space in any world that suits it."""

import json
from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from brrt.errors import BrrtError
from brrt.settings import Settings
from brrt.worlds.world import World

Floats = NDArray[np.float64]

SCHEMA, VERSION = "brrt.robot", 1


@dataclass(frozen=True, slots=True)
class Robot(Settings):
    """Base class: settings, and what they mean in a world.

    Attributes:
        kind: The robot's name in the registry and in files.
    """

    kind: ClassVar[str]

    def resolved(self, world: World) -> Self:  # noqa: ARG002
        """Return the robot with everything decided that its settings leave to the world.

        Raises:
            BrrtError: The robot cannot be in this world.
        """
        return self

    @abstractmethod
    def coordinates(self, world: World) -> tuple[str, ...]:
        """Names of the numbers in a configuration."""

    def dof(self, world: World) -> int:
        """Count the numbers in a configuration."""
        return len(self.coordinates(world))

    @abstractmethod
    def space(self, world: World) -> Any:
        """Put the robot into a world: its configuration space, as kernels see it.

        A space may hold scratch: it serves one thread at a time.
        """

    @abstractmethod
    def collision(self, world: World, q: Floats) -> str | None:
        """Say why a configuration, shape (dof,), is not free, or return None."""

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
        """Where configurations, shape (n, dof), are drawn, shape (n, d)."""

    @abstractmethod
    def outline(self, q: Floats) -> list[Floats]:
        """Return the parts of the body at a configuration, vertices counter-clockwise, (k, 2) each.

        Empty where the body is a point.
        """

    @abstractmethod
    def configuration(self, position: Floats) -> Floats | None:
        """Return the configuration at a position that a world suggests; None if there is none."""

    @abstractmethod
    def position(self, q: Floats) -> Floats | None:
        """Return the position that a world should keep free for a configuration, if there is one.

        Numbers that are of no use as a configuration are the query's to refuse.
        """

    @property
    def room(self) -> float:
        """How far the body reaches from such a position."""
        return 0.0

    def canonical(self, q: Floats) -> Floats:
        """Return the same configuration with its angles in range, shape (dof,)."""
        return q

    def along(self, path: Floats, count: int) -> Floats:
        """Return configurations on a path, evenly by the metric, between its ends.

        Args:
            path: Waypoints, shape (m, dof), m at least 1.
            count: How many.

        Returns:
            Shape (count, dof).
        """
        far = np.cumsum(np.concatenate([[0.0], self.distance(path[:-1], path[1:])]))
        if far[-1] <= 0:
            return np.repeat(path[:1], count, axis=0)
        ways = np.linspace(0, far[-1], count + 2)[1:-1]
        legs = np.clip(np.searchsorted(far, ways, "right") - 1, 0, len(path) - 2)
        parts = (ways - far[legs]) / np.maximum(far[legs + 1] - far[legs], np.finfo(float).tiny)
        on_way = [
            self.interpolate(path[leg], path[leg + 1], min(part, 1.0))
            for leg, part in zip(legs.tolist(), parts.tolist(), strict=True)
        ]
        return np.array(on_way)

    def definition(self) -> dict[str, Any]:
        """Return what a file says of the robot, beyond its kind; `from_definition` reads it."""
        return self.as_dict()

    @classmethod
    def from_definition(cls, data: Mapping[str, Any]) -> Self:
        """Make the robot that a file defines.

        Raises:
            BrrtError: A field is missing or of no use.
        """
        return cls.parse(f"robot {cls.kind}", data)

    def to_json(self) -> str:
        """Return the robot as text that `brrt.robots.robot_from_json` reads back."""
        data = {"schema": SCHEMA, "version": VERSION, "kind": self.kind, **self.definition()}
        return json.dumps(data)


def numbers_of(name: str, values: Any, count: int) -> tuple[float, ...]:
    """Read `count` finite numbers.

    Raises:
        BrrtError: They are something else.
    """
    what = "a finite number" if count == 1 else f"{count} finite numbers"
    try:
        array = np.array(values, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        array = np.array(np.nan)
    if array.shape != (count,) or not np.isfinite(array).all():
        raise BrrtError(f"robot: {name} must be {what}, not {_short(values)}")
    return tuple(array.tolist())


def check_fields(data: Mapping[str, Any], where: str, needed: tuple[str, ...], *more: str) -> None:
    """See that a part of a file has the fields it needs, and no others.

    Raises:
        BrrtError: It has not.
    """
    if not isinstance(data, Mapping):
        raise BrrtError(f"robot: {where} must be an object with {', '.join(needed)}")
    for name in needed:
        if name not in data:
            raise BrrtError(f'robot: the field "{name}" of {where} is missing')
    for name in data:
        if name not in (*needed, *more):
            known = ", ".join((*needed, *more))
            raise BrrtError(f"robot: unknown field {name!r} of {where}; there is: {known}")


def plane_only(kind: str, world: World) -> None:
    """Refuse worlds that are not 2D.

    Raises:
        BrrtError: The world is in 3D.
    """
    if world.dim != 2:
        raise BrrtError(
            f"robot {kind} moves in the plane, but world {world.name} is {world.dim}D; "
            f"choose a 2D world, or the robot point"
        )


def blocked(world: World, parts: list[Floats]) -> str | None:
    """Say what a body touches: a wall or an obstacle; None if it touches nothing."""
    for part in parts:
        if (part <= world.lower).any() or (part >= world.upper).any():
            return "reaches the bounds"
        hit = world.obstacle_touching(part)
        if hit is not None:
            return f"is in collision with {hit}"
    return None


def _short(values: Any) -> str:
    text = repr(values)
    return text if len(text) <= 60 else text[:57] + "..."
