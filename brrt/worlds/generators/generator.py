"""Base classes of world generators: size, default start and goal, and connected worlds."""

import math
from abc import abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from typing import Any, ClassVar, NamedTuple

import numpy as np

from brrt.digits import against_limits
from brrt.errors import BrrtError
from brrt.settings import Settings, param
from brrt.worlds.arrays import GREATEST, Floats, check_lengths, read_numbers
from brrt.worlds.free_space import connected
from brrt.worlds.generators.clearing import clear_ends
from brrt.worlds.world import World

CLEARANCE = 0.01
"""Distance between obstacles and start or goal, as a fraction of the world's size."""
_MARGIN = 0.05
"""Distance of start and goal from the bounds, as a fraction of the world's size."""


class ObstacleSet(NamedTuple):
    """The obstacles of a world, and notes for the user; see `World`."""

    balls: Floats = np.empty((0, 0))
    boxes: Floats = np.empty((0, 0))
    polygons: tuple[Floats, ...] = ()
    notes: tuple[str, ...] = ()


class Length:
    """A length that a parameter states or that is, by default, a fraction of another length.

    Args:
        param: Name of the parameter, which is None by default.
        fraction: The default, as a fraction.
        of: Attribute that it is a fraction of.
    """

    def __init__(self, param: str, fraction: float, of: str = "size") -> None:
        self._param, self._fraction, self._of = param, fraction, of

    def __get__(self, generator: Any, _: Any = None) -> float:
        stated: float | None = getattr(generator, self._param)
        return self._fraction * getattr(generator, self._of) if stated is None else stated


@dataclass(frozen=True, slots=True)
class Generator(Settings):
    """A world from 0 to `size` along each axis, unless a subclass says otherwise.

    Its parameters alone decide where the obstacles are. Around a query they are left out, if at
    all, and never placed elsewhere.

    Attributes:
        dim: 2 or 3.
        draws: Draws of a random world before it is considered not to be connectable.
        clears: Whether obstacles close to start or goal are left out; others are structures.
    """

    greatest_number: ClassVar[float] = GREATEST
    dim: ClassVar[int]
    draws: ClassVar[int] = 1
    clears: ClassVar[bool] = False

    size: float = param(100.0, "side of the map", above=0)
    connected: bool = param(False, "guarantee a path from start to goal for a point")

    def __post_init__(self) -> None:
        """Check the lengths, which are above 0, before others follow from them."""
        Settings.__post_init__(self)
        for f in fields(self):
            value = getattr(self, f.name)
            if f.metadata.get("above") == 0 and value is not None:
                check_lengths(f.name, read_numbers(f.name, value, "a number", ()))

    @abstractmethod
    def candidates(self) -> Iterator[ObstacleSet]:
        """Yield sets of obstacles; the first is used unless the world is to be connected."""

    def upper(self) -> Floats:
        """Return the greatest corner of the bounds, shape (d,)."""
        return np.full(self.dim, self.size)

    def ends(self, room: float) -> tuple[Floats, Floats]:
        """Return the default start and goal, shape (d,) each.

        Args:
            room: Distance to keep free around them.
        """
        return self.opposite_corners(room)

    def opposite_corners(self, room: float, most: float = 0.5) -> tuple[Floats, Floats]:
        """Return points in opposite corners, 5 % of the size from each wall.

        Args:
            room: Distance to keep from the walls if that is more.
            most: Maximum distance from the walls, as a fraction of the size.
        """
        clearance = CLEARANCE * self.size + room
        part = max(_MARGIN, min(clearance / self.size, most) if room else 0.0)
        return np.full(self.dim, part * self.size), np.full(self.dim, (1 - part) * self.size)

    def check_fits(self, *limits: tuple[str, float, float]) -> None:
        """Check lengths against their limits.

        Args:
            limits: Parameter, its value, and the largest value that fits.

        Raises:
            BrrtError: A length is above its limit.
        """
        for name, value, most in limits:
            if value > most:
                text, _, limit = against_limits(value, -np.inf, most)
                raise BrrtError(f"{name} {text} does not fit the map; it is at most {limit}")

    def make(
        self,
        name: str,
        start: Floats | None = None,
        goal: Floats | None = None,
        room: float = 0.0,
    ) -> World:
        """Make the world.

        Args:
            name: Its name.
            start: Where the query starts, shape (d,). A point of another shape is ignored: the
                query refuses it later.
            goal: Where the query ends.
            room: Distance to keep free around both, in addition to the generator's clearance.

        Raises:
            BrrtError: The obstacles leave no room for start and goal, or the world is to be
                connected and no draw is.
        """
        start, goal = (
            default
            if given is None or len(given) != self.dim or not np.isfinite(given).all()
            else np.asarray(given, np.float64)
            for given, default in zip((start, goal), self.ends(room), strict=True)
        )
        try:
            world = replace(self._drawn(name), start=start, goal=goal)
            if self.clears:
                world = clear_ends(world, CLEARANCE * self.size + room)
            if self.connected:
                found = connected(world, start, goal)
                if not found.connected:
                    raise _no_path(found.reason)
        except BrrtError as error:
            raise BrrtError(f"world {name}: {error}") from None
        return world

    def _drawn(self, name: str) -> World:
        """Return the world of the parameters: a connected one has a path for its own query."""
        lower, upper, (start, goal) = np.zeros(self.dim), self.upper(), self.ends(0.0)
        reason = ""
        for draw, obstacles in enumerate(self.candidates(), 1):
            world = World(name, lower, upper, start=start, goal=goal, **obstacles._asdict())
            if not self.connected or self.draws == 1:
                return world
            found = connected(world, start, goal)
            if found.connected:
                note = f"connected: draw {draw} is the first with a path"
                return replace(world, notes=(*world.notes, note) if draw > 1 else world.notes)
            reason = f"{found.reason} in the last of {draw} draws"
        raise _no_path(reason)


def _no_path(reason: str) -> BrrtError:
    return BrrtError(
        f"no path from start to goal was found ({reason}); ask for fewer or smaller obstacles, "
        f"wider openings, or another seed, start or goal"
    )


@dataclass(frozen=True, slots=True)
class Seeded(Generator):
    """A world that is drawn at random from a seed."""

    draws: ClassVar[int] = 100

    seed: int = param(0, "seed of the random draws", low=0, high=math.inf)

    @abstractmethod
    def obstacles(self, rng: np.random.Generator) -> ObstacleSet:
        """Draw the obstacles."""

    def candidates(self) -> Iterator[ObstacleSet]:
        """Draw from the seed itself, then from seeds derived from it."""
        yield self.obstacles(np.random.default_rng(self.seed))
        for derived in np.random.SeedSequence(self.seed).spawn(self.draws - 1):
            yield self.obstacles(np.random.default_rng(derived))


@dataclass(frozen=True, slots=True)
class Fixed(Generator):
    """A world without random draws."""

    @abstractmethod
    def obstacles(self) -> ObstacleSet:
        """Return the obstacles."""

    def candidates(self) -> Iterator[ObstacleSet]:
        """Yield the only candidate."""
        yield self.obstacles()
