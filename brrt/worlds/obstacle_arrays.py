"""A world's obstacles for numpy, many at once: where they are, and whether they touch points."""

from collections.abc import Iterator
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from brrt.worlds.world import World

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

ROUNDING = 1e-14
"""Bounds what a few operations lose, as a part of the numbers at hand."""
_SAFE = 2e-15
"""A polygon touches what is nearer than this part of the lengths at hand; see `convex.gap`."""


class ObstacleArray(Protocol):
    """Obstacles of one kind.

    Attributes:
        low: Least corner of the box around each, shape (n, d).
        high: Greatest corner, shape (n, d).
        weights: What each costs to look at, shape (n,).
    """

    low: Floats
    high: Floats
    weights: Ints

    def reach(self, i: Ints, low: Floats, high: Floats) -> tuple[Floats, Floats]:
        """From where to where obstacles reach along the last axis, within a slab each.

        The interval is the least one, up to rounding, and errs on the long side; where an obstacle
        does not touch its slab it is (inf, -inf).

        Args:
            i: Which obstacles, shape (k,).
            low: Least corner of each slab in all axes but the last, shape (k, d - 1).
            high: Greatest corner.
        """

    def touch(self, i: Ints, points: Floats) -> Bools:
        """Whether obstacle i[j] touches point j; shapes (k,) and (k, d)."""


class BoxArray:
    """Axis-aligned boxes."""

    def __init__(self, boxes: Floats) -> None:
        self.low, self.high = np.split(boxes, 2, axis=1)
        self.weights = np.ones(len(boxes), np.int64)

    def reach(self, i: Ints, low: Floats, high: Floats) -> tuple[Floats, Floats]:
        """See `ObstacleArray`."""
        apart = ((self.high[i, :-1] < low) | (high < self.low[i, :-1])).any(axis=1)
        return (
            np.where(apart, np.inf, self.low[i, -1]),
            np.where(apart, -np.inf, self.high[i, -1]),
        )

    def touch(self, i: Ints, points: Floats) -> Bools:
        """See `ObstacleArray`."""
        return np.asarray(((self.low[i] <= points) & (points <= self.high[i])).all(axis=1))


class BallArray:
    """Circles or spheres."""

    def __init__(self, balls: Floats) -> None:
        self._centres, self._radii = balls[:, :-1], balls[:, -1]
        reach = self._radii[:, None]
        self.low, self.high = self._centres - reach, self._centres + reach
        self.weights = np.ones(len(balls), np.int64)

    def reach(self, i: Ints, low: Floats, high: Floats) -> tuple[Floats, Floats]:
        """See `ObstacleArray`."""
        centres = self._centres[i]
        across = centres[:, :-1]
        # Rounding may make the distance to the slab too large: the radius makes up for it.
        slack = ROUNDING * (np.abs(centres).max(axis=1) + self._radii[i])
        radii = self._radii[i] + slack
        distances = np.linalg.norm(np.clip(across, low, high) - across, axis=1)
        half = np.sqrt(np.maximum(radii - distances, 0)) * np.sqrt(radii + distances) + slack
        half[distances > radii] = -np.inf
        return centres[:, -1] - half, centres[:, -1] + half

    def touch(self, i: Ints, points: Floats) -> Bools:
        """See `ObstacleArray`."""
        return np.asarray(((points - self._centres[i]) ** 2).sum(axis=1) <= self._radii[i] ** 2)


class PolygonArray:
    """Convex polygons and line segments in the plane."""

    def __init__(self, polygons: tuple[Floats, ...]) -> None:
        # What belongs to polygon i stands from first[i] on, one beside the other.
        self.weights = np.array([len(polygon) for polygon in polygons])
        self._first = np.cumsum(self.weights) - self.weights
        owner, offset = expand_counts(self.weights)
        vertices = np.concatenate(polygons)
        self.low = np.minimum.reduceat(vertices, self._first)
        self.high = np.maximum.reduceat(vertices, self._first)
        after = self._first[owner] + (offset + 1) % self.weights[owner]
        self._edges = np.stack([vertices, vertices[after]], axis=1)
        backwards = self._edges[:, 0, 0] > self._edges[:, 1, 0]
        self._edges[backwards] = self._edges[backwards, ::-1]
        self._origins = vertices[self._first]
        local = vertices - self._origins[owner]
        self._sizes = np.maximum.reduceat(np.abs(local).max(axis=1), self._first)
        self._set_sides(local, local[after] - local, owner)

    def _set_sides(self, local: Floats, along: Floats, owner: Ints) -> None:
        """Keep the half planes that shapes are made of, as `convex.axes_of` has them."""
        along /= np.abs(along).max(axis=1, keepdims=True)
        along /= np.hypot(*along.T)[:, None]
        normals = np.stack([along[:, 1], -along[:, 0]], axis=1)
        # A line segment has its ends besides.
        segments = self.weights[owner] == 2
        owner = np.concatenate([owner, owner[segments]])
        order = np.argsort(owner, kind="stable")
        owner = owner[order]
        self._normals = np.concatenate([normals, along[segments]])[order]
        self._sides = np.bincount(owner)
        self._first_side = np.cumsum(self._sides) - self._sides
        side, offset = expand_counts(self.weights[owner])
        height = (local[self._first[owner[side]] + offset] * self._normals[side]).sum(axis=1)
        self._limits = np.maximum.reduceat(height, np.flatnonzero(offset == 0))

    def reach(self, i: Ints, low: Floats, high: Floats) -> tuple[Floats, Floats]:
        """See `ObstacleArray`."""
        # A shape within a slab is widest at its outline.
        owner, offset = expand_counts(self.weights[i])
        x, y = np.moveaxis(self._edges[self._first[i][owner] + offset], -1, 0)
        # A nearly upright edge crosses the slab's side somewhere along a stretch of y: all of it
        # is within a slab that is wider by the rounding.
        slack = ROUNDING * np.abs(x).max(axis=1)
        left, right = low[owner, 0] - slack, high[owner, 0] + slack
        apart = (x[:, 1] < left) | (right < x[:, 0])
        ends = np.clip(np.stack([left, right], axis=1), x[:, :1], x[:, 1:])
        width = x[:, 1:] - x[:, :1]
        part = np.divide(ends - x[:, :1], width, where=width > 0, out=np.zeros_like(ends))
        part[width[:, 0] <= 0] = 0, 1
        at = y[:, :1] + part * (y[:, 1:] - y[:, :1])
        slack = ROUNDING * np.abs(y).max(axis=1)
        least = np.where(apart, np.inf, at.min(axis=1) - slack)
        most = np.where(apart, -np.inf, at.max(axis=1) + slack)
        first = np.flatnonzero(offset == 0)
        return np.minimum.reduceat(least, first), np.maximum.reduceat(most, first)

    def touch(self, i: Ints, points: Floats) -> Bools:
        """See `ObstacleArray`."""
        owner, offset = expand_counts(self._sides[i])
        side = self._first_side[i][owner] + offset
        local = points - self._origins[i]
        beyond = (local[owner] * self._normals[side]).sum(axis=1) - self._limits[side]
        slack = _SAFE * np.maximum(np.abs(local).max(axis=1), self._sizes[i])
        return np.asarray(np.maximum.reduceat(beyond, np.flatnonzero(offset == 0)) <= slack)


def obstacle_arrays(world: World) -> list[ObstacleArray]:
    """Return a world's obstacles, kind by kind, as far as there are any."""
    found: list[ObstacleArray] = []
    if len(world.balls):
        found.append(BallArray(world.balls))
    if len(world.boxes):
        found.append(BoxArray(world.boxes))
    if world.polygons:
        found.append(PolygonArray(world.polygons))
    return found


def expand_counts(counts: Ints) -> tuple[Ints, Ints]:
    """Return for counts[i] items of each i, one after the other, i and the number within i."""
    owner = np.repeat(np.arange(len(counts)), counts)
    return owner, np.arange(len(owner)) - np.repeat(np.cumsum(counts) - counts, counts)


def chunks(weights: Ints, limit: int) -> Iterator[slice]:
    """Cut items into parts of that weight at most, or of one item that weighs more."""
    ends, begin = np.cumsum(weights), 0
    while begin < len(weights):
        before = ends[begin] - weights[begin]
        end = max(begin + 1, int(np.searchsorted(ends, before + limit, "right")))
        yield slice(begin, end)
        begin = end
