"""A world's obstacles as arrays: their extents, and whether they touch points."""

from collections.abc import Iterator
from typing import Protocol

import numpy as np

from brrt.worlds.arrays import Bools, Floats, Ints
from brrt.worlds.world import World

ROUNDING = 1e-14
"""Bound of the relative rounding error of a few operations."""
_TOUCHING = 2e-15
"""A polygon touches what is nearer than this part of the lengths involved; see `convex.gap`."""


class ObstacleArray(Protocol):
    """Obstacles of one kind.

    Attributes:
        low: Least corner of each one's bounding box, shape (n, d).
        high: Greatest corner, shape (n, d).
        weights: Relative cost of a test against each, shape (n,).
    """

    low: Floats
    high: Floats
    weights: Ints

    def reach(self, i: Ints, low: Floats, high: Floats) -> tuple[Floats, Floats]:
        """Return the interval that obstacles cover along the last axis, each within a slab.

        The interval may be too long by rounding, never too short; it is (inf, -inf) where an
        obstacle does not touch its slab.

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
        self.low, self.high = self._centres - balls[:, -1:], self._centres + balls[:, -1:]
        self.weights = np.ones(len(balls), np.int64)

    def reach(self, i: Ints, low: Floats, high: Floats) -> tuple[Floats, Floats]:
        """See `ObstacleArray`."""
        centres = self._centres[i]
        across = centres[:, :-1]
        # The computed distance to the slab may be too large by rounding; a larger radius covers it.
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
    """Convex polygons and line segments in the plane.

    The vertices, edges and half planes of all polygons are stored one after the other; those of
    polygon i begin at first[i].
    """

    def __init__(self, polygons: tuple[Floats, ...]) -> None:
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
        self._set_half_planes(local, local[after] - local, owner)

    def _set_half_planes(self, local: Floats, along: Floats, owner: Ints) -> None:
        """Store normals and offsets of the half planes, in the order of `convex.axes_of`.

        Args:
            local: Vertices relative to their polygon's first one, shape (n, 2).
            along: Edge from each vertex to the next, shape (n, 2).
            owner: Polygon of each vertex, shape (n,).
        """
        along /= np.abs(along).max(axis=1, keepdims=True)
        along /= np.hypot(*along.T)[:, None]
        normals = np.stack([along[:, 1], -along[:, 0]], axis=1)
        # A line segment is also bounded at its two ends.
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
        # Within a slab, a convex shape has its extremes on its outline.
        owner, offset = expand_counts(self.weights[i])
        x, y = np.moveaxis(self._edges[self._first[i][owner] + offset], -1, 0)
        # The y at which a nearly vertical edge crosses the slab's side is uncertain by rounding. A
        # slab that is wider by the rounding contains all of that uncertainty.
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
        slack = _TOUCHING * np.maximum(np.abs(local).max(axis=1), self._sizes[i])
        return np.asarray(np.maximum.reduceat(beyond, np.flatnonzero(offset == 0)) <= slack)


def obstacle_arrays(world: World) -> list[ObstacleArray]:
    """Return a world's balls, boxes and polygons, as far as it has any; its grid is left out."""
    found: list[ObstacleArray] = []
    if len(world.balls):
        found.append(BallArray(world.balls))
    if len(world.boxes):
        found.append(BoxArray(world.boxes))
    if world.polygons:
        found.append(PolygonArray(world.polygons))
    return found


def expand_counts(counts: Ints) -> tuple[Ints, Ints]:
    """Number items that come in groups, counts[i] in group i.

    Returns:
        Group of each item, and its number within the group, shape (sum of counts,) each.
    """
    owner = np.repeat(np.arange(len(counts)), counts)
    return owner, np.arange(len(owner)) - np.repeat(np.cumsum(counts) - counts, counts)


def chunks(weights: Ints, limit: int) -> Iterator[slice]:
    """Divide items into slices with a total weight of at most `limit`, or of one heavier item."""
    ends, begin = np.cumsum(weights), 0
    while begin < len(weights):
        before = ends[begin] - weights[begin]
        end = max(begin + 1, int(np.searchsorted(ends, before + limit, "right")))
        yield slice(begin, end)
        begin = end
