"""Forests: trees at random places that keep a distance from each other (a Poisson disc)."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from brrt.errors import BrrtError
from brrt.settings import param
from brrt.worlds.generators.generator import CLEARANCE, Floats, ObstacleSet, Query, Seeded, no_fit

_CANDIDATES = 30
"""Places that are tried around a tree before it is taken to be surrounded; Bridson's k."""
_MOST = 40_000
"""Squares as wide as the distance of trees that the map may have."""


def poisson_disc(
    rng: np.random.Generator,
    side: float,
    apart: float,
    allowed: Callable[[Floats], NDArray[np.bool_]],
) -> Floats:
    """Fill a square with points that keep a distance until hardly another one fits.

    R. Bridson: Fast Poisson disk sampling in arbitrary dimensions. SIGGRAPH sketches, 2007. All
    points that are not known to be surrounded take turns to try a place at one to two distances.

    Args:
        rng: Where the draws come from.
        side: Side of the square, whose least corner is the origin.
        apart: The distance.
        allowed: Whether points, shape (n, 2), may be at their places.

    Returns:
        Shape (n, 2); empty where none of many places was allowed.
    """
    accepted = _Accepted(side, apart)
    first = side * rng.random((1000, 2))
    accepted.add(first[allowed(first)][:1])
    active, failures = np.arange(accepted.count), np.zeros(accepted.count, np.int64)
    while len(active):
        distance = apart * np.sqrt(rng.uniform(1, 4, len(active)))
        angle = rng.uniform(0, 2 * np.pi, len(active))
        aside = np.stack([distance * np.cos(angle), distance * np.sin(angle)], axis=1)
        tried = accepted.points[active] + aside
        good = np.asarray(((tried >= 0) & (tried <= side)).all(axis=1))
        good[good] = allowed(tried[good])
        before = accepted.count
        good[good] = accepted.add(tried[good])
        failures = np.where(good, 0, failures + 1)
        left = failures < _CANDIDATES
        active = np.append(active[left], np.arange(before, accepted.count))
        failures = np.append(failures[left], np.zeros(accepted.count - before, np.int64))
    return accepted.points[: accepted.count]


class _Accepted:
    """Points that keep a distance, and a grid whose cells hold one of them at most."""

    def __init__(self, side: float, apart: float) -> None:
        self._apart = apart
        self._cell = apart / np.sqrt(2)
        cells = int(side / self._cell) + 1
        # Two more on each side, so that there are five by five around every cell.
        self._grid = np.full((cells + 4, cells + 4, 2), np.inf)
        self.points = np.empty((cells**2, 2))
        self.count = 0

    def add(self, tried: Floats) -> NDArray[np.bool_]:
        """Add those of some points, shape (n, 2), that keep the distance; return which."""
        cells = (tried / self._cell).astype(np.int64)
        i, j = cells.T[:, :, None, None]
        steps = np.arange(5)
        free = self._free(self._grid[i + steps[:, None], j + steps], tried[:, None, None])
        for k in np.flatnonzero(free).tolist():
            i, j = cells[k]
            # One that was added just now may be too near.
            free[k] = self._free(self._grid[None, i : i + 5, j : j + 5], tried[k])[0]
            if free[k]:
                self._grid[i + 2, j + 2] = self.points[self.count] = tried[k]
                self.count += 1
        return free

    def _free(self, near: Floats, points: Floats) -> NDArray[np.bool_]:
        distances = ((near - points) ** 2).sum(axis=3)
        return np.asarray((distances >= self._apart**2).all(axis=(1, 2)))


@dataclass(frozen=True, slots=True)
class PoissonForest(Seeded):
    """Trees at random places that keep a distance; start and goal stand in opposite corners."""

    radius: float | None = param(None, "radius of the trunks; auto: 0.015 of the size", above=0)
    gap: float | None = param(
        None, "least free distance from trunk to trunk; auto: 0.05 of the size", above=0
    )

    def __post_init__(self) -> None:
        """Check that trunks fit the map, and that there are not too many."""
        Seeded.__post_init__(self)
        if self.trunk > self.size / 2:
            raise no_fit("radius", self.trunk, self.size / 2)
        if ((self.size - 2 * self.trunk) / self.apart) ** 2 > _MOST:
            least = self.size / np.sqrt(_MOST)
            raise BrrtError(
                f"trees {self.apart:g} apart are too many for the map; make twice the radius and "
                f"the gap {least:g} at least"
            )

    @property
    def trunk(self) -> float:
        """Radius of the trunks."""
        return 0.015 * self.size if self.radius is None else self.radius

    @property
    def apart(self) -> float:
        """Distance from the middle of a trunk to that of another."""
        return 2 * self.trunk + (0.05 * self.size if self.gap is None else self.gap)

    def trees(self, rng: np.random.Generator, ends: Query) -> Floats:
        """Draw where the middles of the trunks are, shape (n, 2)."""
        reach = self.trunk + CLEARANCE * self.size + ends.room
        kept = np.stack([ends.start[:2], ends.goal[:2]])

        def allowed(points: Floats) -> NDArray[np.bool_]:
            distances = np.linalg.norm(points[:, None] + self.trunk - kept, axis=2)
            return np.asarray((distances > reach).all(axis=1))

        trees = poisson_disc(rng, self.size - 2 * self.trunk, self.apart, allowed) + self.trunk
        if not len(trees):
            raise BrrtError(
                f"trunks of radius {self.trunk:g} leave no room for start and goal; make them "
                f"smaller or the map larger"
            )
        return trees


@dataclass(frozen=True, slots=True)
class Forest2D(PoissonForest):
    """Trunks, round, at random places of a square map that keep a distance (Poisson disc)."""

    dim: ClassVar[int] = 2

    def scenery(self, rng: np.random.Generator, ends: Query, /) -> ObstacleSet:
        """Draw the trees."""
        trees = self.trees(rng, ends)
        return ObstacleSet(balls=np.column_stack([trees, np.full(len(trees), self.trunk)]))


@dataclass(frozen=True, slots=True)
class Forest3D(PoissonForest):
    """Upright trunks, square in section, of random heights, that keep a distance (Poisson disc).

    Worlds have no cylinders: a trunk is a box whose edges are on the circle of its radius, so that
    the gap holds.
    """

    dim: ClassVar[int] = 3

    min_height: float = param(0.5, "least height of the trees", low=0, high=1, unit="of size")
    max_height: float = param(1.0, "greatest height of the trees", low=0, high=1, unit="of size")

    def __post_init__(self) -> None:
        """Check the heights as well."""
        PoissonForest.__post_init__(self)
        if self.min_height > self.max_height:
            raise BrrtError(
                f"min_height {self.min_height:g} is above max_height {self.max_height:g}; swap them"
            )

    def scenery(self, rng: np.random.Generator, ends: Query, /) -> ObstacleSet:
        """Draw the trees, then their heights."""
        trees = self.trees(rng, ends)
        heights = self.size * rng.uniform(self.min_height, self.max_height, len(trees))
        half = self.trunk / np.sqrt(2)
        return ObstacleSet(
            boxes=np.column_stack([trees - half, np.zeros(len(trees)), trees + half, heights])
        )
