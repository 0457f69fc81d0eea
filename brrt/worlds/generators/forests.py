"""Forests: trees at random places with a minimum distance (Poisson disc sampling)."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from brrt.digits import against_limits, tell_apart
from brrt.errors import BrrtError
from brrt.settings import param
from brrt.worlds.arrays import Bools, Floats
from brrt.worlds.generators.generator import CLEARANCE, Length, ObstacleSet, Seeded

_CANDIDATES = 30
"""Places that are tried around a tree before it is considered surrounded; Bridson's k."""
_MOST = 40_000
"""Maximum area of the map, in squares of the trees' minimum distance."""


def poisson_disc(
    rng: np.random.Generator, side: float, apart: float, allowed: Callable[[Floats], Bools]
) -> Floats:
    """Fill a square with random points that keep a minimum distance.

    R. Bridson: Fast Poisson disk sampling in arbitrary dimensions. SIGGRAPH sketches, 2007. In each
    round, every active point tries one place at one to two distances from it.

    Args:
        rng: Random number generator.
        side: Side of the square, whose least corner is the origin.
        apart: The minimum distance.
        allowed: Function of points, shape (n, 2), that returns which of them may be used.

    Returns:
        Shape (n, 2); empty if none of 1000 first points is allowed.
    """
    accepted = _PointGrid(side, apart)
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


class _PointGrid:
    """Points that keep a minimum distance, in a grid whose cells hold at most one of them."""

    def __init__(self, side: float, apart: float) -> None:
        self._apart = apart
        self._cell = apart / np.sqrt(2)
        cells = int(side / self._cell) + 1
        # Two more on each side, so that there are five by five around every cell.
        self._grid = np.full((cells + 4, cells + 4, 2), np.inf)
        self.points = np.empty((cells**2, 2))
        self.count = 0

    def add(self, tried: Floats) -> Bools:
        """Add those of some points, shape (n, 2), that keep the distance; return which."""
        cells = (tried / self._cell).astype(np.int64)
        i, j = cells.T[:, :, None, None]
        steps = np.arange(5)
        free = self._free(self._grid[i + steps[:, None], j + steps], tried[:, None, None])
        for k in np.flatnonzero(free).tolist():
            i, j = cells[k]
            # A point added in this loop may be too near.
            free[k] = self._free(self._grid[None, i : i + 5, j : j + 5], tried[k])[0]
            if free[k]:
                self._grid[i + 2, j + 2] = self.points[self.count] = tried[k]
                self.count += 1
        return free

    def _free(self, near: Floats, points: Floats) -> Bools:
        distances = ((near - points) ** 2).sum(axis=3)
        return np.asarray((distances >= self._apart**2).all(axis=(1, 2)))


@dataclass(frozen=True, slots=True)
class PoissonForest(Seeded):
    """Trees at random places with a minimum distance; start and goal are in opposite corners.

    Trees closer than 1 % of the size to start or goal are left out.
    """

    clears: ClassVar[bool] = True

    radius: float | None = param(None, "radius of the trunks; auto: 0.015 of the size", above=0)
    gap: float | None = param(
        None, "least free distance from trunk to trunk; auto: 0.05 of the size", above=0
    )

    trunk = Length("radius", 0.015)
    free_gap = Length("gap", 0.05)

    def __post_init__(self) -> None:
        """Check that trunks fit the map, and that there are not too many."""
        Seeded.__post_init__(self)
        self.check_fits(("radius", self.trunk, self.size / 2))
        if ((self.size - 2 * self.trunk) / self.apart) ** 2 > _MOST:
            enough = float(self.size / np.sqrt(_MOST))
            text, least, _ = against_limits(self.apart, enough, np.inf)
            raise BrrtError(
                f"trees {text} apart are too many for the map; make twice the radius plus the gap "
                f"at least {least}"
            )

    @property
    def apart(self) -> float:
        """Minimum distance of the middles of two trunks."""
        return 2 * self.trunk + self.free_gap

    def trees(self, rng: np.random.Generator) -> Floats:
        """Draw the middles of the trunks, shape (n, 2)."""
        reach = self.trunk + CLEARANCE * self.size
        kept = np.stack(self.ends(0.0))[:, :2]

        def allowed(points: Floats) -> Bools:
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
    """Round trunks at random places of a square map with a minimum distance (Poisson disc)."""

    dim: ClassVar[int] = 2

    def obstacles(self, rng: np.random.Generator) -> ObstacleSet:
        """Draw the trees."""
        trees = self.trees(rng)
        return ObstacleSet(balls=np.column_stack([trees, np.full(len(trees), self.trunk)]))


@dataclass(frozen=True, slots=True)
class Forest3D(PoissonForest):
    """Upright square trunks of random heights with a minimum distance (Poisson disc).

    Worlds have no cylinders: a trunk is a box whose edges are on the circle of its radius, so that
    the gap holds.
    """

    dim: ClassVar[int] = 3

    min_height: float = param(0.5, "least height of the trees", low=0, high=1, unit="of size")
    max_height: float = param(1.0, "greatest height of the trees", above=0, high=1, unit="of size")

    def __post_init__(self) -> None:
        """Check the heights as well."""
        PoissonForest.__post_init__(self)
        if self.min_height > self.max_height:
            texts = tell_apart(self.min_height, self.max_height)
            raise BrrtError(f"min_height {texts[0]} is above max_height {texts[1]}; swap them")

    def obstacles(self, rng: np.random.Generator) -> ObstacleSet:
        """Draw the trees, then their heights."""
        trees = self.trees(rng)
        heights = self.size * rng.uniform(self.min_height, self.max_height, len(trees))
        half = self.trunk / np.sqrt(2)
        return ObstacleSet(
            boxes=np.column_stack([trees - half, np.zeros(len(trees)), trees + half, heights])
        )
