"""Where things happened: what is in the way, what was reached, how near trees came."""

from collections import Counter
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brrt.explanation.gather import Gather
from brrt.robots import Robot
from brrt.verification.collision.motions import Obstacles, first_hits
from brrt.worlds.free_space import occupied
from brrt.worlds.rasterize import Raster
from brrt.worlds.world import World

Floats = NDArray[np.float64]

_CELLS = {2: 256, 3: 512}
"""Cells of the coarse lattice, in 2D and 3D: 16 x 16, 8 x 8 x 8."""

_POINTS = 8
"""Random points by which a coarse cell is found free."""

_THIN = 1024
"""Nodes of a tree that are compared with as many of the other one."""

_SHOWN = 3


@dataclass(frozen=True, slots=True)
class Blocker:
    """An obstacle that turned extensions down.

    Attributes:
        name: As the world numbers it, and where it is.
        share: Its share of those that something turned down.
    """

    name: str
    share: float


@dataclass(frozen=True, slots=True)
class Spot:
    """The cell of a coarse lattice with most rejections.

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
    """How much of the free space was reached, in cells of a coarse lattice.

    Attributes:
        cells: Cells with anything free in them.
        share: Share of these with a node, or an expand_counts cell, in them.
        late: Share of the reached ones that were first reached in the run's last third.
        drought: Share of the run in the longest stretch in which none was reached first.
        single: Share of the reached ones with a single node in them. As long again, a run reaches
            about as many new ones as these (Good and Toulmin 1956): few, where it is done.
    """

    cells: int
    share: float
    late: float
    drought: float
    single: float


@dataclass(frozen=True, slots=True)
class Gap:
    """Two nodes, one of each tree, with little between them: the trees are no farther apart.

    Attributes:
        far: How far they are from each other.
        q: Where the one of tree 0 is.
        other: Where the one of tree 1 is.
        hit: What is on the straight way between them; None where nothing is.
    """

    far: float
    q: list[float]
    other: list[float]
    hit: str | None


class Places:
    """A run's world, and what to ask of it.

    Args:
        world: The world.
        robot: What moves, settled in it.
        gather: What the log says.
    """

    def __init__(self, world: World, robot: Robot, gather: Gather) -> None:
        self._world, self._robot, self._gather = world, robot, gather
        self._obstacles = Obstacles(world)
        # An arm has no place of its own in the world: its configurations are all angles.
        self.has_position = robot.configuration(world.lower) is not None

    def blockers(self, a: Floats, b: Floats) -> list[Blocker]:
        """Name what motions run into, most frequent first; shapes (n, dof)."""
        there = np.isfinite(a).all(axis=1)
        if not there.any():
            return []
        hits = first_hits(self._obstacles, self._robot, a[there], b[there])
        found = Counter(hits[hits >= 0].tolist())
        most = found.most_common(_SHOWN)
        return [Blocker(self._name(hit), n / found.total()) for hit, n in most]

    def in_the_way(self, a: Floats, b: Floats) -> str | None:
        """Name what is on the straight motion between two configurations, shape (dof,)."""
        hit = int(first_hits(self._obstacles, self._robot, a[None], b[None])[0])
        return self._name(hit) if hit >= 0 else None

    def _name(self, j: int) -> str:
        name = self._obstacles.name(j)
        if j >= len(self._obstacles) or name.startswith("the"):
            return name
        low, high = self._obstacles.lower[j], self._obstacles.upper[j]
        return f"{name} ({_numbers(low)} to {_numbers(high)})"

    def spot(self, a: Floats, b: Floats) -> Spot | None:
        """Find where most of some motions are, by their middles; shapes (n, dof)."""
        there = np.isfinite(a).all(axis=1)
        if not there.any():
            return None
        middles = (self._robot.places(a[there]) + self._robot.places(b[there])) / 2
        lattice = coarse(self._world)
        cell = np.ravel_multi_index(tuple(lattice.index(middles).T), lattice.shape)
        counts = np.bincount(cell, minlength=int(np.prod(lattice.shape)))
        most = np.array(np.unravel_index(int(counts.argmax()), lattice.shape))
        middle = np.mean(lattice.corners(most), axis=0)
        return Spot(middle.tolist(), lattice.cell.tolist(), float(counts.max() / len(cell)))

    def coverage(self, q: Floats, iteration: NDArray[np.int64], last: int) -> Coverage | None:
        """Measure what part of the free space was reached; None for robots without a place.

        Args:
            q: Configurations that were reached, shape (n, dof).
            iteration: When, shape (n,).
            last: The run's last iteration.
        """
        if not self.has_position or not len(q):
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
        """Find two nodes of two trees that are close; None where there are no two trees.

        Of each tree about a thousand nodes are compared; from the closest two of these, the node
        closest to the other's is looked up in turn until that changes nothing.
        """
        if len(self._gather.trees) < 2:
            return None
        one, other = (self._gather.nodes(tree) for tree in self._gather.trees[:2])
        thin = one[:: len(one) // _THIN + 1], other[:: len(other) // _THIN + 1]
        rows = [self._robot.distance(thin[1], q) for q in thin[0]]
        best = int(np.argmin([row.min() for row in rows]))
        a, b, far = thin[0][best], thin[1][int(rows[best].argmin())], np.inf
        while (now := float(self._robot.distance(a, b))) < far:
            far = now
            b = other[int(self._robot.distance(other, a).argmin())]
            a = one[int(self._robot.distance(one, b).argmin())]
        return Gap(far, a.tolist(), b.tolist(), self.in_the_way(a, b))


def coarse(world: World) -> Raster:
    """Return the coarse cells in which shares of the free space are counted."""
    return Raster.over(world.lower, world.upper, _CELLS[world.dim])


def _numbers(values: Floats) -> str:
    return ",".join(f"{x:.4g}" for x in values)
