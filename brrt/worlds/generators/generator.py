"""What every generator of worlds has in common: a size, a query, and that there is a way."""

from abc import abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brrt.errors import BrrtError
from brrt.settings import Settings, param
from brrt.worlds.free_space import connected
from brrt.worlds.world import World

Floats = NDArray[np.float64]
CLEARANCE = 0.01
"""Distance kept between obstacles and start or goal, as a fraction of the map's size."""
_MARGIN = 0.05
"""Distance of start and goal from the walls of the map, as a fraction of its size."""
_DRAWS = 100
"""Draws of a random world before it is said to have no way."""


class Query(NamedTuple):
    """Where a query starts and ends, shape (d,) each, and the room that a body needs there."""

    start: Floats
    goal: Floats
    room: float


class ObstacleSet(NamedTuple):
    """What stands in a world, and what the user should know of it; see `World`."""

    balls: Floats = np.empty((0, 0))
    boxes: Floats = np.empty((0, 0))
    polygons: tuple[Floats, ...] = ()
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Generator(Settings):
    """A world that reaches from 0 to `size`, a square or a cube unless it says otherwise."""

    dim: ClassVar[int]

    size: float = param(100.0, "side of the map", above=0)
    connected: bool = param(False, "make sure that a way leads from start to goal, for a point")

    @abstractmethod
    def sceneries(self, ends: Query, /) -> Iterator[ObstacleSet]:
        """Draw scenery after scenery, as many as there may be."""

    def upper(self) -> Floats:
        """Greatest corner of the bounds, shape (d,)."""
        return np.full(self.dim, self.size)

    def ends(self, room: float) -> tuple[Floats, Floats]:
        """Return where start and goal are when nobody asks for another place.

        Args:
            room: How far a robot's body reaches.
        """
        return self.corners(room)

    def corners(self, room: float, most: float = 0.5) -> tuple[Floats, Floats]:
        """Return points in opposite corners, 5 % of the size from each wall.

        Args:
            room: Distance to keep from the walls, when that is more.
            most: The distance is never more than this, as a fraction of the size.
        """
        clearance = CLEARANCE * self.size + room
        part = max(_MARGIN, min(clearance / self.size, most) if room else 0.0)
        return np.full(self.dim, part * self.size), np.full(self.dim, (1 - part) * self.size)

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
            start: Where the query starts, shape (d,); scattered obstacles keep off it.
            goal: Where it ends. One that is of no use, also in a wall, is the query's to refuse.
            room: Distance to keep free around them, beyond a clearance, for a robot's body.

        Raises:
            BrrtError: The obstacles leave no room for start and goal, or no way where there is to
                be one.
        """
        own = self.ends(room)
        start, goal = (
            mine
            if given is None or len(given) != self.dim or not np.isfinite(given).all()
            else np.asarray(given, np.float64)
            for given, mine in zip((start, goal), own, strict=True)
        )
        lower, upper = np.zeros(self.dim), self.upper()
        draws, reason = 0, ""
        try:
            for scenery in self.sceneries(Query(start, goal, room)):
                world = World(name, lower, upper, start=start, goal=goal, **scenery._asdict())
                if not self.connected:
                    return world
                found = connected(world, start, goal)
                if found.connected and draws:
                    note = f"connected asked for: draw {draws + 1} is the first with a way"
                    return replace(world, notes=(*world.notes, note))
                if found.connected:
                    return world
                draws, reason = draws + 1, found.reason
        except BrrtError as error:
            raise BrrtError(f"world {name}: {error}") from None
        where = f" in the last of {draws} draws" if draws > 1 else ""
        raise BrrtError(
            f"world {name}: not known to be connected ({reason}{where}); ask for fewer or smaller "
            f"obstacles or wider openings, or give other ends"
        )


@dataclass(frozen=True, slots=True)
class Seeded(Generator):
    """A world that is drawn from a seed."""

    seed: int = param(0, "seed of what is random", low=0)

    @abstractmethod
    def scenery(self, rng: np.random.Generator, ends: Query, /) -> ObstacleSet:
        """Draw what stands in the world."""

    def sceneries(self, ends: Query, /) -> Iterator[ObstacleSet]:
        """Draw from the seed itself, then from seeds derived from it."""
        yield self.scenery(np.random.default_rng(self.seed), ends)
        for derived in np.random.SeedSequence(self.seed).spawn(_DRAWS - 1):
            yield self.scenery(np.random.default_rng(derived), ends)


@dataclass(frozen=True, slots=True)
class Fixed(Generator):
    """A world in which nothing is random."""

    @abstractmethod
    def layout(self) -> ObstacleSet:
        """Say what stands in the world."""

    def sceneries(self, _ends: Query, /) -> Iterator[ObstacleSet]:
        """There is but one."""
        yield self.layout()


def no_fit(name: str, value: float, most: float) -> BrrtError:
    """Return the error for a length that is too large for the map."""
    return BrrtError(f"{name} {value:g} does not fit the map; it is at most {most:g}")
