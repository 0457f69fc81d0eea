"""Obstacles all over the map: circles, boxes and polygons in 2D, spheres and boxes in 3D."""

from abc import abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from brrt.errors import BrrtError
from brrt.settings import param
from brrt.worlds.generators.density import fewest
from brrt.worlds.generators.generator import (
    CLEARANCE,
    Floats,
    ObstacleSet,
    Query,
    Seeded,
    no_fit,
)
from brrt.worlds.obstacle_arrays import ObstacleArray, obstacle_arrays
from brrt.worlds.world import World

_REDRAWS = 1000
_USUAL, _MOST = 50, 10_000_000
_BATCHES = [256 << i for i in range(13)]
"""Obstacles that are drawn at a time, the last number again and again, where a share of the map is
asked for: the sequence does not depend on the share."""


@dataclass(frozen=True, slots=True)
class Scattered(Seeded):
    """Obstacles spread evenly over a square or cube that reaches from 0 to `size`.

    Start and goal stand in opposite corners, 5 % of the size from each wall, unless asked for
    elsewhere. An obstacle that would cover one of them is drawn anew.
    """

    n: int = param(_USUAL, "number of obstacles", low=0, high=_MOST)
    density: float | None = param(
        None, "share of the map to cover, instead of a number; auto: as n says", low=0, high=1
    )

    def __post_init__(self) -> None:
        """Check that one thing alone says how many obstacles there are."""
        Seeded.__post_init__(self)
        if self.density is not None and self.n != _USUAL:
            raise BrrtError(f"n {self.n} and density {self.density:g} contradict; give one of them")

    @abstractmethod
    def draw(self, rng: np.random.Generator, n: int) -> tuple[Floats, Floats]:
        """Draw n obstacles: centres, shape (n, d), and half extents, or whatever is their shape."""

    @abstractmethod
    def covers(
        self, centres: Floats, halves: Floats, point: Floats, clearance: float
    ) -> NDArray[np.bool_]:
        """Whether each obstacle comes closer to a point than the clearance."""

    @abstractmethod
    def place(self, centres: Floats, halves: Floats) -> ObstacleSet:
        """Make obstacles of what was drawn."""

    def scenery(self, rng: np.random.Generator, ends: Query, /) -> ObstacleSet:
        """Draw the obstacles: as many as asked for, or as it takes."""
        if self.density is None:
            return self.place(*self._apart(rng, self.n, ends))
        drawn: list[tuple[Floats, Floats]] = []

        def batches() -> Iterator[ObstacleArray]:
            count = 0
            while count < _MOST:
                n = min(_BATCHES[min(len(drawn), len(_BATCHES) - 1)], _MOST - count)
                count += n
                drawn.append(self._apart(rng, n, ends))
                scenery = self.place(*drawn[-1])._asdict()
                yield from obstacle_arrays(World("", np.zeros(self.dim), self.upper(), **scenery))

        count, share = fewest(self.density, self.upper(), batches(), _MOST)
        centres, halves = (np.concatenate(parts)[:count] for parts in zip(*drawn, strict=True))
        note = f"density {self.density:g} asked for: {count} obstacles cover {share:.4f} of the map"
        return self.place(centres, halves)._replace(notes=(note,))

    def _apart(self, rng: np.random.Generator, n: int, ends: Query) -> tuple[Floats, Floats]:
        """Draw n obstacles that keep off start and goal."""
        clearance = CLEARANCE * self.size + ends.room
        centres, halves = self.draw(rng, n)
        for _ in range(_REDRAWS):
            bad = np.zeros(n, bool)
            for end in (ends.start, ends.goal):
                bad |= self.covers(centres, halves, end, clearance)
            count = int(bad.sum())
            if count == 0:
                return centres, halves
            centres[bad], halves[bad] = self.draw(rng, count)
        raise BrrtError(
            f"{count} obstacles of this size leave no room for start and goal; "
            f"make them smaller or the map larger"
        )

    def _centres(self, rng: np.random.Generator, halves: Floats) -> Floats:
        return halves + (self.size - 2 * halves) * rng.random(halves.shape)


@dataclass(frozen=True, slots=True)
class ScatteredBalls(Scattered):
    """Circles or spheres with radii spread evenly over a range."""

    min_radius: float = param(1.0, "least radius", above=0)
    max_radius: float = param(8.0, "greatest radius", above=0)

    def __post_init__(self) -> None:
        """Check the range."""
        Scattered.__post_init__(self)
        _check_sizes("radius", self.min_radius, self.max_radius, self.size / 2)

    def draw(self, rng: np.random.Generator, n: int) -> tuple[Floats, Floats]:
        """Draw radii, then centres that keep the balls inside the map."""
        radii = rng.uniform(self.min_radius, self.max_radius, n)
        halves = np.repeat(radii[:, None], self.dim, axis=1)
        return self._centres(rng, halves), halves

    def covers(
        self, centres: Floats, halves: Floats, point: Floats, clearance: float
    ) -> NDArray[np.bool_]:
        """Compare the distance to the centre with radius and clearance."""
        reach = halves[:, 0] + clearance
        return np.asarray(((centres - point) ** 2).sum(axis=1) <= reach**2)

    def place(self, centres: Floats, halves: Floats) -> ObstacleSet:
        """Write each ball as centre and radius."""
        balls = np.concatenate([centres, halves[:, :1]], axis=1)
        return ObstacleSet(balls=balls)


@dataclass(frozen=True, slots=True)
class ScatteredBoxes(Scattered):
    """Axis-aligned boxes with sides spread evenly over a range."""

    cubes: ClassVar[bool] = False

    min_side: float = param(2.0, "least side", above=0)
    max_side: float = param(15.0, "greatest side", above=0)

    def __post_init__(self) -> None:
        """Check the range."""
        Scattered.__post_init__(self)
        _check_sizes("side", self.min_side, self.max_side, self.size)

    def draw(self, rng: np.random.Generator, n: int) -> tuple[Floats, Floats]:
        """Draw sides, then centres that keep the boxes inside the map."""
        shape = (n, 1 if self.cubes else self.dim)
        sides = rng.uniform(self.min_side, self.max_side, shape)
        halves = np.array(np.broadcast_to(sides / 2, (n, self.dim)))
        return self._centres(rng, halves), halves

    def covers(
        self, centres: Floats, halves: Floats, point: Floats, clearance: float
    ) -> NDArray[np.bool_]:
        """Compare the offset along each axis with half side and clearance."""
        near = np.abs(centres - point) <= halves + clearance
        return np.asarray(near.all(axis=1))

    def place(self, centres: Floats, halves: Floats) -> ObstacleSet:
        """Write each box as its least and greatest corner."""
        boxes = np.concatenate([centres - halves, centres + halves], axis=1)
        return ObstacleSet(boxes=boxes)


def _check_sizes(what: str, least: float, greatest: float, limit: float) -> None:
    if least > greatest:
        raise BrrtError(f"min_{what} {least:g} is above max_{what} {greatest:g}; swap them")
    if greatest > limit:
        raise no_fit(f"max_{what}", greatest, limit)


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

    The corners are spread around the circle by 1 part each, give or take 0.3 parts.
    """

    dim: ClassVar[int] = 2

    min_radius: float = param(1.0, "least circumscribed radius", above=0)
    max_radius: float = param(8.0, "greatest circumscribed radius", above=0)
    min_corners: int = param(3, "least number of corners", low=3, high=1000)
    max_corners: int = param(7, "greatest number of corners", low=3, high=1000)

    def __post_init__(self) -> None:
        """Check the ranges."""
        Scattered.__post_init__(self)
        _check_sizes("radius", self.min_radius, self.max_radius, self.size / 2)
        _check_sizes("corners", self.min_corners, self.max_corners, np.inf)

    def draw(self, rng: np.random.Generator, n: int) -> tuple[Floats, Floats]:
        """Draw for each a row: radius, number of corners, angle of each corner."""
        radii = rng.uniform(self.min_radius, self.max_radius, (n, 1))
        corners = rng.integers(self.min_corners, self.max_corners + 1, (n, 1))
        steps = np.arange(self.max_corners) + rng.uniform(-0.3, 0.3, (n, self.max_corners))
        angles = 2 * np.pi * (rng.random((n, 1)) + steps / corners)
        centres = self._centres(rng, np.repeat(radii, 2, axis=1))
        return centres, np.concatenate([radii, corners, angles], axis=1)

    def covers(
        self, centres: Floats, halves: Floats, point: Floats, clearance: float
    ) -> NDArray[np.bool_]:
        """Compare the distance to the centre with radius and clearance."""
        reach = halves[:, 0] + clearance
        return np.asarray(((centres - point) ** 2).sum(axis=1) <= reach**2)

    def place(self, centres: Floats, halves: Floats) -> ObstacleSet:
        """Put the corners of each polygon on its circle."""
        polygons = []
        for centre, (radius, corners, *angles) in zip(centres, halves, strict=True):
            around = np.array(angles[: int(corners)])
            polygons.append(centre + radius * np.stack([np.cos(around), np.sin(around)], axis=1))
        return ObstacleSet(polygons=tuple(polygons))
