"""Cells over a world: which of them an obstacle touches, and which of them hang together."""

import itertools
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Self

import numpy as np

from brrt.worlds.obstacle_arrays import (
    ROUNDING,
    Bools,
    Floats,
    Ints,
    ObstacleArray,
    chunks,
    expand_counts,
)

_SLACK = 1e-9
"""Part of a cell by which cells are taken to be larger than they are: more than rounding loses."""
_PORTION = 1 << 20
_LONGEST = 1e100
"""How many times longer than another a side is taken to be, at most."""


@dataclass(frozen=True, slots=True)
class Raster:
    """Equal cells that fill a box; `row` means all cells along the last axis.

    Attributes:
        lower: Least corner of the box, shape (d,).
        cell: Sides of a cell, shape (d,).
        shape: Cells along each axis.
    """

    lower: Floats
    cell: Floats
    shape: tuple[int, ...]

    @classmethod
    def over(cls, lower: Floats, upper: Floats, cells: int) -> Self:
        """Fill a box by about so many cells that are cubes, as nearly as can be."""
        size, left = upper - lower, float(cells)
        sides = np.ones(len(size), np.int64)
        # Short axes first: where one cell is wider than the box, the others share what is left.
        order = np.argsort(size)
        for done, axis in enumerate(order.tolist()):
            if size[axis] > 0:
                others = np.minimum(size[order[done:]] / size[axis], _LONGEST)
                sides[axis] = max(1, round((left / np.prod(others)) ** (1 / len(others))))
                left /= float(sides[axis])
        return cls(lower, np.where(size > 0, size / sides, 1.0), tuple(sides.tolist()))

    def index(self, points: Floats) -> Ints:
        """Return the cell that holds each point, or the one nearest to it, shape (n, d)."""
        at = np.floor((points - self.lower) / self.cell)
        return np.clip(at, 0, np.array(self.shape) - 1).astype(np.int64)

    def corners(self, index: Ints) -> tuple[Floats, Floats]:
        """Return the least and the greatest corner of cells, shape (..., d) each."""
        return self.lower + index * self.cell, self.lower + (index + 1) * self.cell

    def spans(self, shapes: ObstacleArray, which: Ints) -> Iterator[tuple[Ints, Ints, Ints, Ints]]:
        """Find the cells that obstacles touch, row by row; a few that they nearly touch as well.

        Yields:
            Obstacles, numbers of rows, and the first and last cell touched in each of these.
        """
        upper = self.lower + self.cell * self.shape
        slack = self.slack()
        near = (shapes.low[which] <= upper + slack) & (shapes.high[which] >= self.lower - slack)
        which = which[near.all(axis=1)]
        first = self.index(shapes.low[which] - slack)[:, :-1]
        count = self.index(shapes.high[which] + slack)[:, :-1] - first + 1
        rows = count.prod(axis=1)
        for part in chunks(rows * shapes.weights[which], _PORTION):
            owner, offset = expand_counts(rows[part])
            at = first[part][owner]
            if at.shape[1] == 1:
                at[:, 0] += offset
            else:
                across, along = np.divmod(offset, count[part][owner, 1])
                at += np.stack([across, along], axis=1)
            low = self.lower[:-1] + at * self.cell[:-1] - slack[:-1]
            high = self.lower[:-1] + (at + 1) * self.cell[:-1] + slack[:-1]
            least, most = shapes.reach(which[part][owner], low, high)
            least, most = least - slack[-1], most + slack[-1]
            hit = (least <= most) & (least <= upper[-1]) & (most >= self.lower[-1])
            ends = np.stack([least[hit], most[hit]])
            cells = np.floor((ends - self.lower[-1]) / self.cell[-1])
            begin, end = np.clip(cells, 0, self.shape[-1] - 1).astype(np.int64)
            row = np.ravel_multi_index(tuple(at[hit].T), self.shape[:-1])
            yield which[part][owner][hit], row, begin, end

    def slack(self) -> Floats:
        """By how much cells are taken to be larger than they are, shape (d,)."""
        upper = self.lower + self.cell * self.shape
        return _SLACK * self.cell + ROUNDING * np.maximum(np.abs(self.lower), np.abs(upper))

    def blocked(self, obstacles: list[ObstacleArray]) -> Bools:
        """Whether any obstacle touches, or nearly touches, each closed cell; shape `shape`."""
        length = self.shape[-1] + 1
        steps = np.zeros(int(np.prod(self.shape[:-1])) * length, np.int64)
        for shapes in obstacles:
            for _, row, begin, end in self.spans(shapes, np.arange(len(shapes.low))):
                steps += np.bincount(row * length + begin, minlength=len(steps))
                steps -= np.bincount(row * length + end + 1, minlength=len(steps))
        depth = np.cumsum(steps.reshape(-1, length), axis=1)[:, :-1]
        return np.asarray((depth > 0).reshape(self.shape))

    def filled(self, obstacles: list[ObstacleArray]) -> Bools:
        """Whether one obstacle fills each closed cell; shape `shape`.

        Obstacles are convex: one that touches all corners of a cell, which is taken to be a little
        larger than it is, holds it.
        """
        found = np.zeros(int(np.prod(self.shape)), np.bool_)
        corners = np.array(list(itertools.product((0, 1), repeat=len(self.shape))))
        for shapes in obstacles:
            large = np.flatnonzero((shapes.high - shapes.low >= self.cell).all(axis=1))
            for which, row, begin, end in self.spans(shapes, large):
                for part in chunks(end - begin + 1, _PORTION):
                    owner, offset = expand_counts((end - begin + 1)[part])
                    cell = row[part][owner] * self.shape[-1] + begin[part][owner] + offset
                    index = np.stack(np.unravel_index(cell, self.shape), axis=1)
                    inside = np.ones(len(cell), np.bool_)
                    for corner in corners:
                        slack = (2 * corner - 1) * self.slack()
                        points = self.lower + (index + corner) * self.cell + slack
                        left = np.flatnonzero(inside)
                        inside[left] = shapes.touch(which[part][owner][left], points[left])
                    found[cell[inside]] = True
        return found.reshape(self.shape)


def touches_box(obstacles: list[ObstacleArray], low: Floats, high: Floats) -> bool:
    """Whether any obstacle touches, or nearly touches, a closed box; corners of shape (d,)."""
    slack = ROUNDING * np.maximum(np.abs(low), np.abs(high)).max()
    low, high = low - slack, high + slack
    for shapes in obstacles:
        near = np.flatnonzero(((shapes.low <= high) & (low <= shapes.high)).all(axis=1))
        if not len(near):
            continue
        slab = np.tile(low[:-1], (len(near), 1)), np.tile(high[:-1], (len(near), 1))
        least, most = shapes.reach(near, *slab)
        if ((least <= high[-1]) & (low[-1] <= most)).any():
            return True
    return False


def components(free: Bools) -> Ints:
    """Number the sets of free cells that hang together through their faces.

    Runs of free cells along the last axis are the nodes of a graph, so that the work is a few
    passes over the cells, however long a way leads through them.

    Args:
        free: Whether each cell is free; 2 or 3 axes.

    Returns:
        Equal numbers for cells that hang together, -1 for the others; same shape.
    """
    begins = free.copy()
    begins[..., 1:] &= ~free[..., :-1]
    run = (np.cumsum(begins.ravel()) - 1).reshape(free.shape)
    one, other = [], []
    for axis in range(free.ndim - 1):
        here, there = (
            (slice(None),) * axis + (part,) for part in (slice(None, -1), slice(1, None))
        )
        # Two runs side by side meet first where one of them begins.
        meet = free[here] & free[there] & (begins[here] | begins[there])
        one.append(run[here][meet])
        other.append(run[there][meet])
    roots = _roots(int(begins.sum()), np.concatenate(one), np.concatenate(other))
    return np.where(free, roots[run] if len(roots) else -1, -1)


def _roots(count: int, one: Ints, other: Ints) -> Ints:
    """Return for each node of a graph the number of its component's root, shape (count,).

    At least half of the roots that still have neighbours vanish in each round, and pointer jumping
    halves the height of their trees (Shiloach and Vishkin 1982), so there are few rounds.
    """
    root = np.arange(count)
    while len(one):
        least, most = np.minimum(one, other), np.maximum(one, other)
        # A root cannot be the least and the greatest among its neighbours: one way half must go.
        upwards = _distinct(least, count) > _distinct(most, count)
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


def _distinct(values: Ints, count: int) -> int:
    seen = np.zeros(count, np.bool_)
    seen[values] = True
    return int(seen.sum())


__all__ = ["Raster", "components", "touches_box"]
