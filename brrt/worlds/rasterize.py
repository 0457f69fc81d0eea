"""Rasters of cells over a world: cells that obstacles touch or fill, and connected components."""

import itertools
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Self

import numpy as np

from brrt.worlds.arrays import Bools, Floats, Ints
from brrt.worlds.obstacle_arrays import ROUNDING, ObstacleArray, chunks, expand_counts

_SLACK = 1e-9
"""Part of a cell by which cells are enlarged, so that rounding misses no obstacle."""
_CHUNK = 1 << 20
_LONGEST = 1e100
"""Largest ratio of two sides of the box, to keep the product of the ratios finite."""


@dataclass(frozen=True, slots=True)
class Raster:
    """Equal cells that fill a box; a row is all cells along the last axis.

    Attributes:
        lower: Least corner of the box, shape (d,).
        cell: Sides of a cell, shape (d,).
        shape: Number of cells along each axis.
    """

    lower: Floats
    cell: Floats
    shape: tuple[int, ...]

    @classmethod
    def over(cls, lower: Floats, upper: Floats, cells: int) -> Self:
        """Divide a box into about `cells` cells that are nearly cubes."""
        size, left = upper - lower, float(cells)
        sides = np.ones(len(size), np.int64)
        # Short axes first: where one cell is longer than the box, the other axes get more cells.
        order = np.argsort(size)
        for done, axis in enumerate(order.tolist()):
            if size[axis] > 0:
                others = np.minimum(size[order[done:]] / size[axis], _LONGEST)
                sides[axis] = max(1, round((left / np.prod(others)) ** (1 / len(others))))
                left /= float(sides[axis])
        return cls(lower, np.where(size > 0, size / sides, 1.0), tuple(sides.tolist()))

    def index(self, points: Floats) -> Ints:
        """Return the cell that contains each point, or the nearest one, shape (n, d)."""
        at = np.floor((points - self.lower) / self.cell)
        return np.clip(at, 0, np.array(self.shape) - 1).astype(np.int64)

    def corners(self, index: Ints) -> tuple[Floats, Floats]:
        """Return the least and the greatest corner of cells, shape (..., d) each."""
        return self.lower + index * self.cell, self.lower + (index + 1) * self.cell

    def spans(
        self, obstacles: ObstacleArray, which: Ints
    ) -> Iterator[tuple[Ints, Ints, Ints, Ints]]:
        """Find the cells that obstacles touch, or nearly touch, row by row.

        Yields:
            Obstacles, numbers of rows, and the first and the last cell touched in each row.
        """
        upper = self.lower + self.cell * self.shape
        slack = self.slack()
        near = (obstacles.low[which] <= upper + slack) & (
            obstacles.high[which] >= self.lower - slack
        )
        which = which[near.all(axis=1)]
        first = self.index(obstacles.low[which] - slack)[:, :-1]
        count = self.index(obstacles.high[which] + slack)[:, :-1] - first + 1
        rows = count.prod(axis=1)
        for part in chunks(rows * obstacles.weights[which], _CHUNK):
            owner, offset = expand_counts(rows[part])
            at = first[part][owner]
            if at.shape[1] == 1:
                at[:, 0] += offset
            else:
                across, along = np.divmod(offset, count[part][owner, 1])
                at += np.stack([across, along], axis=1)
            low = self.lower[:-1] + at * self.cell[:-1] - slack[:-1]
            high = self.lower[:-1] + (at + 1) * self.cell[:-1] + slack[:-1]
            least, most = obstacles.reach(which[part][owner], low, high)
            least, most = least - slack[-1], most + slack[-1]
            hit = (least <= most) & (least <= upper[-1]) & (most >= self.lower[-1])
            ends = np.stack([least[hit], most[hit]])
            cells = np.floor((ends - self.lower[-1]) / self.cell[-1])
            begin, end = np.clip(cells, 0, self.shape[-1] - 1).astype(np.int64)
            row = np.ravel_multi_index(tuple(at[hit].T), self.shape[:-1])
            yield which[part][owner][hit], row, begin, end

    def slack(self) -> Floats:
        """Return by how much cells are enlarged for tests, shape (d,)."""
        upper = self.lower + self.cell * self.shape
        return _SLACK * self.cell + ROUNDING * np.maximum(np.abs(self.lower), np.abs(upper))

    def blocked(self, obstacles: list[ObstacleArray]) -> Bools:
        """Whether any obstacle touches, or nearly touches, each closed cell; shape `shape`."""
        length = self.shape[-1] + 1
        steps = np.zeros(int(np.prod(self.shape[:-1])) * length, np.int64)
        for several in obstacles:
            for _, row, begin, end in self.spans(several, np.arange(len(several.low))):
                steps += np.bincount(row * length + begin, minlength=len(steps))
                steps -= np.bincount(row * length + end + 1, minlength=len(steps))
        depth = np.cumsum(steps.reshape(-1, length), axis=1)[:, :-1]
        return np.asarray((depth > 0).reshape(self.shape))

    def filled(self, obstacles: list[ObstacleArray]) -> Bools:
        """Whether a single obstacle contains each closed cell; shape `shape`.

        Obstacles are convex, so one that touches all corners of a slightly enlarged cell does.
        Cells are not enlarged beyond the raster, where nothing moves: obstacles may end there.
        """
        upper = self.lower + np.array(self.shape) * self.cell
        found = np.zeros(int(np.prod(self.shape)), np.bool_)
        corners = np.array(list(itertools.product((0, 1), repeat=len(self.shape))))
        for several in obstacles:
            large = np.flatnonzero((several.high - several.low >= self.cell).all(axis=1))
            for which, row, begin, end in self.spans(several, large):
                for part in chunks(end - begin + 1, _CHUNK):
                    owner, offset = expand_counts((end - begin + 1)[part])
                    cell = row[part][owner] * self.shape[-1] + begin[part][owner] + offset
                    index = np.stack(np.unravel_index(cell, self.shape), axis=1)
                    inside = np.ones(len(cell), np.bool_)
                    for corner in corners:
                        slack = (2 * corner - 1) * self.slack()
                        points = self.lower + (index + corner) * self.cell + slack
                        points = np.clip(points, self.lower, upper)
                        left = np.flatnonzero(inside)
                        inside[left] = several.touch(which[part][owner][left], points[left])
                    found[cell[inside]] = True
        return found.reshape(self.shape)


def touches_box(obstacles: list[ObstacleArray], low: Floats, high: Floats) -> bool:
    """Whether any obstacle touches, or nearly touches, a closed box; corners of shape (d,)."""
    slack = ROUNDING * np.maximum(np.abs(low), np.abs(high)).max()
    low, high = low - slack, high + slack
    for several in obstacles:
        near = np.flatnonzero(((several.low <= high) & (low <= several.high)).all(axis=1))
        if not len(near):
            continue
        slab = np.tile(low[:-1], (len(near), 1)), np.tile(high[:-1], (len(near), 1))
        least, most = several.reach(near, *slab)
        if ((least <= high[-1]) & (low[-1] <= most)).any():
            return True
    return False


def components(free: Bools) -> Ints:
    """Label the connected components of free cells; cells are connected through their faces.

    Runs of free cells along the last axis are the nodes of a graph, so the work is a few passes
    over the cells, however long and winding a component is.

    Args:
        free: Whether each cell is free; 2 or 3 axes.

    Returns:
        A label for each cell, equal within a component, -1 for cells that are not free.
    """
    begins = free.copy()
    begins[..., 1:] &= ~free[..., :-1]
    run = (np.cumsum(begins.ravel()) - 1).reshape(free.shape)
    one, other = [], []
    for axis in range(free.ndim - 1):
        here, there = (
            (slice(None),) * axis + (part,) for part in (slice(None, -1), slice(1, None))
        )
        # Two adjacent runs first meet where one of them begins.
        meet = free[here] & free[there] & (begins[here] | begins[there])
        one.append(run[here][meet])
        other.append(run[there][meet])
    roots = _roots(int(begins.sum()), np.concatenate(one), np.concatenate(other))
    return np.where(free, roots[run] if len(roots) else -1, -1)


def _roots(count: int, one: Ints, other: Ints) -> Ints:
    """Return the root of each node's component in a graph, shape (count,).

    Each round removes at least half of the roots that still have neighbours, and pointer jumping
    halves the height of their trees (Shiloach and Vishkin 1982), so there are few rounds.

    Args:
        count: Number of nodes.
        one: One end of each edge, shape (m,).
        other: The other end, shape (m,).
    """
    root = np.arange(count)
    while len(one):
        least, most = np.minimum(one, other), np.maximum(one, other)
        # No root is both least and greatest among its neighbours, so one direction removes half.
        upwards = _count_distinct(least, count) > _count_distinct(most, count)
        root[least if upwards else most] = most if upwards else least
        while True:
            above = root[root]
            if np.array_equal(above, root):
                break
            root = above
        one, other = root[one], root[other]
        apart = one != other
        one, other = one[apart], other[apart]
    return root


def _count_distinct(values: Ints, count: int) -> int:
    seen = np.zeros(count, np.bool_)
    seen[values] = True
    return int(seen.sum())
