"""Worlds drawn from a seed: circles, squares and boxes in 2D, spheres and boxes in 3D."""

from abc import abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from brrt.errors import BrrtError
from brrt.settings import Settings, param
from brrt.worlds.world import World

Floats = NDArray[np.float64]
_CLEARANCE = 0.01
"""Distance kept between obstacles and start or goal, as a fraction of the map's size."""
_REDRAWS = 1000


@dataclass(frozen=True, slots=True)
class Generator(Settings):
    """Obstacles spread evenly over a square or cube that reaches from 0 to `size`.

    Start and goal stand in opposite corners, 5 % of the size from each wall, unless asked for
    elsewhere. An obstacle that would cover one of them is drawn anew.
    """

    dim: ClassVar[int]

    n: int = param(50, "number of obstacles", low=0, high=10_000_000)
    size: float = param(100.0, "side of the map", above=0)
    seed: int = param(0, "seed of the obstacles", low=0)

    @abstractmethod
    def draw(self, rng: np.random.Generator, n: int) -> tuple[Floats, Floats]:
        """Draw n obstacles: centres, shape (n, d), and half extents along each axis."""

    @abstractmethod
    def covers(self, centres: Floats, halves: Floats, point: Floats) -> NDArray[np.bool_]:
        """Whether each obstacle comes closer to a point than the clearance."""

    @abstractmethod
    def place(self, name: str, centres: Floats, halves: Floats, ends: list[Floats]) -> World:
        """Make the world of the obstacles; `ends` are start and goal."""

    def make(self, name: str, start: Floats | None = None, goal: Floats | None = None) -> World:
        """Make the world.

        Args:
            name: Its name.
            start: Point to keep free, shape (d,); 5 % of the size in each coordinate by default.
            goal: Another; 95 % by default.

        Raises:
            BrrtError: The obstacles are so large that they leave no room for start and goal.
        """
        ends = [self._end(given, part) for given, part in ((start, 0.05), (goal, 0.95))]
        rng = np.random.default_rng(self.seed)
        centres, halves = self.draw(rng, self.n)
        for _ in range(_REDRAWS):
            bad = np.zeros(self.n, bool)
            for end in ends:
                bad |= self.covers(centres, halves, end)
            count = int(bad.sum())
            if count == 0:
                return self.place(name, centres, halves, ends)
            centres[bad], halves[bad] = self.draw(rng, count)
        raise BrrtError(
            f"world {name}: {count} obstacles of this size leave no room for start and goal; "
            f"make them smaller or the map larger"
        )

    def _end(self, given: Floats | None, part: float) -> Floats:
        """Return the point to keep free; one that is of no use is the query's to refuse."""
        if given is not None and len(given) == self.dim and np.isfinite(given).all():
            return np.asarray(given, np.float64)
        return np.full(self.dim, part * self.size)

    def _centres(self, rng: np.random.Generator, halves: Floats) -> Floats:
        return halves + (self.size - 2 * halves) * rng.random(halves.shape)

    def _world(self, name: str, ends: list[Floats], *, balls: Floats, boxes: Floats) -> World:
        lower, upper = np.zeros(self.dim), np.full(self.dim, self.size)
        start, goal = ends
        return World(name, lower, upper, balls, boxes, start, goal)


@dataclass(frozen=True, slots=True)
class Balls(Generator):
    """Circles or spheres with radii spread evenly over a range."""

    min_radius: float = param(1.0, "least radius", above=0)
    max_radius: float = param(8.0, "greatest radius", above=0)

    def __post_init__(self) -> None:
        """Check the range."""
        Generator.__post_init__(self)
        _check_sizes("radius", self.min_radius, self.max_radius, self.size / 2)

    def draw(self, rng: np.random.Generator, n: int) -> tuple[Floats, Floats]:
        """Draw radii, then centres that keep the balls inside the map."""
        radii = rng.uniform(self.min_radius, self.max_radius, n)
        halves = np.repeat(radii[:, None], self.dim, axis=1)
        return self._centres(rng, halves), halves

    def covers(self, centres: Floats, halves: Floats, point: Floats) -> NDArray[np.bool_]:
        """Compare the distance to the centre with radius and clearance."""
        reach = halves[:, 0] + _CLEARANCE * self.size
        return np.asarray(((centres - point) ** 2).sum(axis=1) <= reach**2)

    def place(self, name: str, centres: Floats, halves: Floats, ends: list[Floats]) -> World:
        """Write each ball as centre and radius."""
        balls = np.concatenate([centres, halves[:, :1]], axis=1)
        return self._world(name, ends, balls=balls, boxes=np.empty((0, 2 * self.dim)))


@dataclass(frozen=True, slots=True)
class Boxes(Generator):
    """Axis-aligned boxes with sides spread evenly over a range."""

    cubes: ClassVar[bool] = False

    min_side: float = param(2.0, "least side", above=0)
    max_side: float = param(15.0, "greatest side", above=0)

    def __post_init__(self) -> None:
        """Check the range."""
        Generator.__post_init__(self)
        _check_sizes("side", self.min_side, self.max_side, self.size)

    def draw(self, rng: np.random.Generator, n: int) -> tuple[Floats, Floats]:
        """Draw sides, then centres that keep the boxes inside the map."""
        shape = (n, 1 if self.cubes else self.dim)
        sides = rng.uniform(self.min_side, self.max_side, shape)
        halves = np.array(np.broadcast_to(sides / 2, (n, self.dim)))
        return self._centres(rng, halves), halves

    def covers(self, centres: Floats, halves: Floats, point: Floats) -> NDArray[np.bool_]:
        """Compare the offset along each axis with half side and clearance."""
        near = np.abs(centres - point) <= halves + _CLEARANCE * self.size
        return np.asarray(near.all(axis=1))

    def place(self, name: str, centres: Floats, halves: Floats, ends: list[Floats]) -> World:
        """Write each box as its least and greatest corner."""
        boxes = np.concatenate([centres - halves, centres + halves], axis=1)
        return self._world(name, ends, balls=np.empty((0, self.dim + 1)), boxes=boxes)


def _check_sizes(what: str, least: float, greatest: float, limit: float) -> None:
    if least > greatest:
        raise BrrtError(f"min_{what} {least:g} is above max_{what} {greatest:g}; swap them")
    if greatest > limit:
        raise BrrtError(f"max_{what} {greatest:g} does not fit the map; it is at most {limit:g}")


@dataclass(frozen=True, slots=True)
class Circles2D(Balls):
    """Circles on a square map."""

    dim: ClassVar[int] = 2


@dataclass(frozen=True, slots=True)
class Squares2D(Boxes):
    """Axis-aligned squares on a square map."""

    dim: ClassVar[int] = 2
    cubes: ClassVar[bool] = True


@dataclass(frozen=True, slots=True)
class Boxes2D(Boxes):
    """Axis-aligned rectangles on a square map."""

    dim: ClassVar[int] = 2


@dataclass(frozen=True, slots=True)
class Boxes3D(Boxes):
    """Axis-aligned boxes in a cube."""

    dim: ClassVar[int] = 3


@dataclass(frozen=True, slots=True)
class Spheres3D(Balls):
    """Spheres in a cube."""

    dim: ClassVar[int] = 3
