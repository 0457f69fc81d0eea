"""Where extensions were rejected, what was reached, and how close two trees came."""

from collections import Counter
from dataclasses import dataclass

import numpy as np

from brrt.collision.motions import Obstacles, first_hits
from brrt.digits import digits_within, join_numbers
from brrt.explanation.summary import RunSummary
from brrt.robots import Robot
from brrt.worlds.arrays import Floats, Ints
from brrt.worlds.free_space import occupied
from brrt.worlds.rasterize import Raster
from brrt.worlds.world import World

_CELLS = {2: 256, 3: 512}
"""Coarse cells, in 2D and 3D: 16 x 16, 8 x 8 x 8."""

_POINTS = 8
"""Random points that are tested for a free one in each coarse cell."""

_THIN = 1024
"""Nodes of each tree that are compared with those of the other."""

_SHOWN = 3

PLACE_DIGITS = 4
"""Significant digits of coordinates, as `brrt.digits.digits_within` counts them."""


@dataclass(frozen=True, slots=True)
class Blocker:
    """An obstacle that blocked extensions.

    Attributes:
        name: Its kind and number in the world, and its corners.
        share: Its share of the blocked extensions.
    """

    name: str
    share: float


@dataclass(frozen=True, slots=True)
class Spot:
    """The coarse cell with the most rejections.

    Attributes:
        q: Its middle.
        sides: Its size along each axis.
        share: Its share of the rejections.
    """

    q: list[float]
    sides: list[float]
    share: float


@dataclass(frozen=True, slots=True)
class Coverage:
    """How much of the free space was reached, in coarse cells.

    Attributes:
        cells: Cells that are free in part.
        share: Share of these with a node, or an expanded cell, in them.
        late: Share of the reached ones that were first reached in the run's last third.
        drought: Share of the run in the longest period without a newly reached cell.
        single: Share of the reached ones with a single node in them. A run of twice the length
            reaches about as many new cells (Good and Toulmin 1956).
    """

    cells: int
    share: float
    late: float
    drought: float
    single: float


@dataclass(frozen=True, slots=True)
class Gap:
    """Two close nodes, one of each tree.

    Attributes:
        far: Their distance.
        q: Configuration of the node of tree 0.
        other: Configuration of the node of tree 1.
        hit: The obstacle on the straight motion between them; None if it is free.
    """

    far: float
    q: list[float]
    other: list[float]
    hit: str | None


class Places:
    """Finds places in the world of a run."""

    def __init__(self, world: World, robot: Robot, summary: RunSummary) -> None:
        self._world, self._robot, self._summary = world, robot, summary
        self._obstacles = Obstacles(world)
        # The configurations of an arm are angles, without a position in the world.
        self._has_position = robot.configuration(world.lower) is not None

    def blockers(self, a: Floats, b: Floats) -> list[Blocker]:
        """Name the obstacles that motions hit first, most frequent first.

        Args:
            a: Where the motions begin, shape (n, dof).
            b: Where they end, shape (n, dof).
        """
        hits = first_hits(self._obstacles, self._robot, a, b)
        found = Counter(hits[hits >= 0].tolist())
        most = found.most_common(_SHOWN)
        return [Blocker(self._name(hit), n / found.total()) for hit, n in most]

    def hit(self, a: Floats, b: Floats) -> str | None:
        """Name the first obstacle on the motion between two configurations, shape (dof,)."""
        hit = int(first_hits(self._obstacles, self._robot, a[None], b[None])[0])
        return self._name(hit) if hit >= 0 else None

    def _name(self, j: int) -> str:
        name = self._obstacles.name(j)
        if j >= len(self._obstacles):
            return name
        digits = digits_within(self._world.lower, self._world.upper, PLACE_DIGITS)
        corners = (self._obstacles.lower[j], self._obstacles.upper[j])
        return "{} ({} to {})".format(name, *(join_numbers(q, digits, ",") for q in corners))

    def spot(self, a: Floats, b: Floats) -> Spot | None:
        """Return the coarse cell with most of the middles of motions; see `blockers`."""
        if not len(a) or self._robot.opaque:
            return None
        middles = (self._robot.places(a) + self._robot.places(b)) / 2
        lattice = coarse(self._world)
        cell = np.ravel_multi_index(tuple(lattice.index(middles).T), lattice.shape)
        counts = np.bincount(cell, minlength=int(np.prod(lattice.shape)))
        most = np.array(np.unravel_index(int(counts.argmax()), lattice.shape))
        middle = np.mean(lattice.corners(most), axis=0)
        return Spot(middle.tolist(), lattice.cell.tolist(), float(counts.max() / len(cell)))

    def coverage(self, q: Floats, iteration: Ints, last: int) -> Coverage | None:
        """Measure what part of the free space was reached; None for robots without a position.

        Args:
            q: Configurations that were reached, shape (n, dof).
            iteration: In which iteration each was, shape (n,).
            last: The run's last iteration.
        """
        if not self._has_position or not len(q):
            return None
        lattice = coarse(self._world)
        n = int(np.prod(lattice.shape))
        cell = np.ravel_multi_index(tuple(lattice.index(self._robot.places(q)).T), lattice.shape)
        first = np.full(n, np.iinfo(np.int64).max)
        np.minimum.at(first, cell, iteration)
        nodes = np.bincount(cell, minlength=n)
        reached = nodes > 0
        index = np.stack(np.unravel_index(np.arange(n), lattice.shape), axis=1)
        rng = np.random.default_rng(0)
        inside = index[:, None] + rng.random((n, _POINTS, index.shape[1]))
        points = (lattice.lower + inside * lattice.cell).reshape(-1, index.shape[1])
        free = ~occupied(self._world, points).reshape(n, _POINTS).all(axis=1) | reached
        news = np.sort(first[reached])
        late = float((news > last * 2 / 3).mean())
        drought = float(np.diff(news, prepend=0, append=last).max() / max(last, 1))
        single = float((nodes[reached] == 1).mean())
        return Coverage(int(free.sum()), float(reached.sum() / free.sum()), late, drought, single)

    def gap(self) -> Gap | None:
        """Find two close nodes of two trees; None for fewer trees.

        About a thousand nodes of each tree are compared. From the closest two, the node closest to
        the other one is searched for in each tree in turn until the distance no longer falls.
        """
        if len(self._summary.trees) < 2:
            return None
        one, other = (self._summary.nodes(tree) for tree in self._summary.trees[:2])
        thin = one[:: len(one) // _THIN + 1], other[:: len(other) // _THIN + 1]
        rows = [self._robot.distance(thin[1], q) for q in thin[0]]
        best = int(np.argmin([row.min() for row in rows]))
        a, b, far = thin[0][best], thin[1][int(rows[best].argmin())], np.inf
        while (now := float(self._robot.distance(a, b))) < far:
            far = now
            b = other[int(self._robot.distance(other, a).argmin())]
            a = one[int(self._robot.distance(one, b).argmin())]
        return Gap(far, a.tolist(), b.tolist(), self.hit(a, b))


def coarse(world: World) -> Raster:
    """Return the coarse cells that shares of the free space are counted in."""
    return Raster.over(world.lower, world.upper, _CELLS[world.dim])
