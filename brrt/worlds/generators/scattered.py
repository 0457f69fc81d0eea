"""Obstacles scattered over the map: circles, boxes and polygons in 2D, spheres and boxes in 3D."""

from abc import abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from brrt.digits import tell_apart
from brrt.errors import BrrtError
from brrt.settings import param
from brrt.worlds.arrays import Bools, Floats
from brrt.worlds.generators.density import count_for_density
from brrt.worlds.generators.generator import CLEARANCE, ObstacleSet, Seeded
from brrt.worlds.obstacle_arrays import ObstacleArray, obstacle_arrays
from brrt.worlds.world import World

_REDRAWS = 1000
_DEFAULT, _MOST = 50, 10_000_000
_BATCHES = [256 << i for i in range(13)]
"""Sizes of the batches that are drawn for a density, the last again and again: the sequence of
obstacles must not depend on the density."""


@dataclass(frozen=True, slots=True)
class Scattered(Seeded):
    """Obstacles distributed uniformly over a square or cube.

    Start and goal are in opposite corners, 5 % of the size from each wall: obstacles closer than
    1 % of the size to one of them are drawn again. Where the query starts or ends elsewhere, or
    with a larger robot, such obstacles are left out and the others stay.

    An obstacle is drawn as a centre and a shape: a row whose first number is the radius of a circle
    around the obstacle, or its half extents.
    """

    clears: ClassVar[bool] = True

    n: int = param(_DEFAULT, "number of obstacles", low=0, high=_MOST)
    density: float | None = param(
        None, "share of the map to cover, instead of n; auto: n decides", low=0, high=1
    )

    def __post_init__(self) -> None:
        """Check that only one of n and density is given."""
        Seeded.__post_init__(self)
        if self.density is not None and self.n != _DEFAULT:
            raise BrrtError(f"n {self.n} and density {self.density:g} exclude each other; give one")

    @abstractmethod
    def draw(self, rng: np.random.Generator, n: int) -> tuple[Floats, Floats]:
        """Draw the centres, shape (n, d), and the shapes, shape (n, k), of n obstacles."""

    def covers(self, centres: Floats, shapes: Floats, point: Floats, clearance: float) -> Bools:
        """Whether each obstacle is closer to a point than the clearance, by its radius."""
        reach = shapes[:, 0] + clearance
        return np.asarray(((centres - point) ** 2).sum(axis=1) <= reach**2)

    @abstractmethod
    def place(self, centres: Floats, shapes: Floats) -> ObstacleSet:
        """Make obstacles from centres and shapes."""

    def obstacles(self, rng: np.random.Generator) -> ObstacleSet:
        """Draw n obstacles, or as many as the density takes."""
        if self.density is None:
            return self.place(*self._draw_apart(rng, self.n))
        drawn: list[tuple[Floats, Floats]] = []

        def batches() -> Iterator[ObstacleArray]:
            count = 0
            while count < _MOST:
                n = min(_BATCHES[min(len(drawn), len(_BATCHES) - 1)], _MOST - count)
                count += n
                drawn.append(self._draw_apart(rng, n))
                placed = self.place(*drawn[-1])._asdict()
                yield from obstacle_arrays(World("", np.zeros(self.dim), self.upper(), **placed))

        count, share = count_for_density(self.density, self.upper(), batches(), _MOST)
        centres, shapes = (np.concatenate(parts)[:count] for parts in zip(*drawn, strict=True))
        note = f"density {self.density:g}: {count} obstacles cover {share:.4f} of the map"
        return self.place(centres, shapes)._replace(notes=(note,))

    def _draw_apart(self, rng: np.random.Generator, n: int) -> tuple[Floats, Floats]:
        """Draw n obstacles that keep away from the world's own start and goal."""
        clearance, ends = CLEARANCE * self.size, self.ends(0.0)
        centres, shapes = self.draw(rng, n)
        for _ in range(_REDRAWS):
            bad = np.zeros(n, bool)
            for end in ends:
                bad |= self.covers(centres, shapes, end, clearance)
            count = int(bad.sum())
            if count == 0:
                return centres, shapes
            centres[bad], shapes[bad] = self.draw(rng, count)
        raise BrrtError(
            f"{count} obstacles of this size leave no room for start and goal; "
            f"make them smaller or the map larger"
        )

    def _draw_centres(self, rng: np.random.Generator, halves: Floats) -> Floats:
        return halves + (self.size - 2 * halves) * rng.random(halves.shape)

    def _check_range(self, what: str, low: float, high: float, limit: float) -> None:
        if low > high:
            texts = tell_apart(low, high)
            raise BrrtError(f"min_{what} {texts[0]} is above max_{what} {texts[1]}; swap them")
        self.check_fits((f"max_{what}", high, limit))


@dataclass(frozen=True, slots=True)
class ScatteredBalls(Scattered):
    """Circles or spheres with uniformly distributed radii."""

    min_radius: float = param(1.0, "least radius", above=0)
    max_radius: float = param(8.0, "greatest radius", above=0)

    def __post_init__(self) -> None:
        """Check the range."""
        Scattered.__post_init__(self)
        self._check_range("radius", self.min_radius, self.max_radius, self.size / 2)

    def draw(self, rng: np.random.Generator, n: int) -> tuple[Floats, Floats]:
        """Draw radii, then centres that keep the balls inside the map."""
        radii = rng.uniform(self.min_radius, self.max_radius, n)
        halves = np.repeat(radii[:, None], self.dim, axis=1)
        return self._draw_centres(rng, halves), halves

    def place(self, centres: Floats, shapes: Floats) -> ObstacleSet:
        """Make balls from centres and radii."""
        return ObstacleSet(balls=np.concatenate([centres, shapes[:, :1]], axis=1))


@dataclass(frozen=True, slots=True)
class ScatteredBoxes(Scattered):
    """Axis-aligned boxes with uniformly distributed sides."""

    cubes: ClassVar[bool] = False

    min_side: float = param(2.0, "least side", above=0)
    max_side: float = param(15.0, "greatest side", above=0)

    def __post_init__(self) -> None:
        """Check the range."""
        Scattered.__post_init__(self)
        self._check_range("side", self.min_side, self.max_side, self.size)

    def draw(self, rng: np.random.Generator, n: int) -> tuple[Floats, Floats]:
        """Draw sides, then centres that keep the boxes inside the map."""
        sides = rng.uniform(self.min_side, self.max_side, (n, 1 if self.cubes else self.dim))
        halves = np.array(np.broadcast_to(sides / 2, (n, self.dim)))
        return self._draw_centres(rng, halves), halves

    def covers(self, centres: Floats, shapes: Floats, point: Floats, clearance: float) -> Bools:
        """Whether each box is closer to a point than the clearance along every axis."""
        return np.asarray((np.abs(centres - point) <= shapes + clearance).all(axis=1))

    def place(self, centres: Floats, shapes: Floats) -> ObstacleSet:
        """Make boxes from centres and half sides."""
        return ObstacleSet(boxes=np.concatenate([centres - shapes, centres + shapes], axis=1))


@dataclass(frozen=True, slots=True)
class Circles2D(ScatteredBalls):
    """Circles on a square map."""

    dim: ClassVar[int] = 2


@dataclass(frozen=True, slots=True)
class Squares2D(ScatteredBoxes):
    """Axis-aligned squares on a square map."""

    dim: ClassVar[int] = 2
    cubes: ClassVar[bool] = True


@dataclass(frozen=True, slots=True)
class Boxes2D(ScatteredBoxes):
    """Axis-aligned rectangles on a square map."""

    dim: ClassVar[int] = 2


@dataclass(frozen=True, slots=True)
class Boxes3D(ScatteredBoxes):
    """Axis-aligned boxes in a cube."""

    dim: ClassVar[int] = 3


@dataclass(frozen=True, slots=True)
class Spheres3D(ScatteredBalls):
    """Spheres in a cube."""

    dim: ClassVar[int] = 3


@dataclass(frozen=True, slots=True)
class Polygons2D(Scattered):
    """Convex polygons with their corners on circles, on a square map.

    The angles between corners are equal, each corner shifted by up to 0.3 of them at random.
    """

    dim: ClassVar[int] = 2

    min_radius: float = param(1.0, "least circumscribed radius", above=0)
    max_radius: float = param(8.0, "greatest circumscribed radius", above=0)
    min_corners: int = param(3, "least number of corners", low=3, high=1000)
    max_corners: int = param(7, "greatest number of corners", low=3, high=1000)

    def __post_init__(self) -> None:
        """Check the ranges."""
        Scattered.__post_init__(self)
        self._check_range("radius", self.min_radius, self.max_radius, self.size / 2)
        self._check_range("corners", self.min_corners, self.max_corners, np.inf)

    def draw(self, rng: np.random.Generator, n: int) -> tuple[Floats, Floats]:
        """Draw centres, and for each polygon a row: radius, number of corners, their angles."""
        radii = rng.uniform(self.min_radius, self.max_radius, (n, 1))
        corners = rng.integers(self.min_corners, self.max_corners + 1, (n, 1))
        steps = np.arange(self.max_corners) + rng.uniform(-0.3, 0.3, (n, self.max_corners))
        angles = 2 * np.pi * (rng.random((n, 1)) + steps / corners)
        centres = self._draw_centres(rng, np.repeat(radii, 2, axis=1))
        return centres, np.concatenate([radii, corners, angles], axis=1)

    def place(self, centres: Floats, shapes: Floats) -> ObstacleSet:
        """Make polygons from centres, radii and angles."""
        polygons = []
        for centre, (radius, corners, *angles) in zip(centres, shapes, strict=True):
            around = np.array(angles[: int(corners)])
            polygons.append(centre + radius * np.stack([np.cos(around), np.sin(around)], axis=1))
        return ObstacleSet(polygons=tuple(polygons))
