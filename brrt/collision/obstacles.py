"""The obstacles of a world under one numbering, and which boxes are near them."""

from collections.abc import Iterator
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from brrt.collision.convex import ConvexShapes, convex_shapes
from brrt.worlds.world import World

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]

_GROUP, _CANDIDATES, _PAIRS, _CELLS = 64, 1 << 16, 8192, 64
_WIDTHS = 12
"""Obstacles are grouped by width, down to this many halvings of that of the map."""


class Obstacles:
    """Boxes, balls and convex polygons under one numbering, with their bounding boxes.

    The blocked cells of an occupancy grid are among the boxes, or the polygons if it is rotated.

    Args:
        world: The world.
    """

    def __init__(self, world: World) -> None:
        d, self._own = world.dim, (len(world.boxes), len(world.balls), len(world.polygons))
        world = world.without_grid()
        self.boxes, self.balls = world.boxes, world.balls
        self.polygons = [np.asarray(p, np.float64) for p in world.polygons]
        self.ends = np.cumsum([len(self.boxes), len(self.balls), len(self.polygons)])
        centre, radius = self.balls[:, :d], self.balls[:, d:]
        lower = [self.boxes[:, :d], centre - radius, *(p.min(axis=0)[None] for p in self.polygons)]
        upper = [self.boxes[:, d:], centre + radius, *(p.max(axis=0)[None] for p in self.polygons)]
        self.lower, self.upper = np.concatenate(lower), np.concatenate(upper)
        self.walls, self.extent = (world.lower, world.upper), world.extent

    def __len__(self) -> int:
        return int(self.ends[-1])

    @property
    def bounds(self) -> int:
        """The number of the bounds, which bodies must not cross."""
        return len(self)

    @property
    def itself(self) -> int:
        """The number of the body itself, whose parts must not touch if the robot says so."""
        return len(self) + 1

    @cached_property
    def shapes(self) -> ConvexShapes:
        """All obstacles in the plane as convex shapes; balls are points with a radius."""
        hulls = [_corners(box) for box in self.boxes] + list(self.balls[:, None, :2])
        radius = np.zeros(len(self))
        radius[len(self.boxes) : self.ends[1]] = self.balls[:, 2]
        return convex_shapes([*hulls, *self.polygons], radius)

    @cached_property
    def round(self) -> Flags:
        """Which obstacles are balls or points, shape (n,)."""
        vertices = self.shapes.vertices
        return np.asarray((vertices == vertices[0]).all(axis=0))

    @cached_property
    def strips(self) -> tuple[int, list[tuple[Ints, Floats, Floats]]]:
        """Obstacles grouped by width and sorted along the map's longest axis.

        Returns:
            The axis, and for each width: the numbers of the obstacles, where each begins, and the
            farthest end of it and those before it.
        """
        axis = int((self.walls[1] - self.walls[0]).argmax())
        lower, upper = self.lower[:, axis], self.upper[:, axis]
        _, widths = np.frexp(np.maximum(upper - lower, self.extent * 0.5**_WIDTHS))
        strips = []
        for width in np.unique(widths):
            some = np.flatnonzero(widths == width)
            some = some[np.argsort(lower[some], kind="stable")]
            strips.append((some, lower[some], np.maximum.accumulate(upper[some])))
        return axis, strips

    def name(self, j: int) -> str:
        """Return the name of an obstacle, by its number in the world."""
        if j >= len(self):
            return "the bounds" if j == self.bounds else "the robot itself"
        kind = int(np.searchsorted(self.ends, j, side="right"))
        number = j - (0 if kind == 0 else int(self.ends[kind - 1]))
        if number >= self._own[kind]:
            return "the map's blocked cells"
        return f"{('box', 'ball', 'polygon')[kind]} {number}"

    def parts(self, i: Ints, j: Ints) -> Iterator[tuple[int, Ints, Ints]]:
        """Split pairs by the kind of their obstacle: 0 boxes, 1 balls, 2 polygons."""
        kinds = np.searchsorted(self.ends, j, side="right")
        for kind in np.unique(kinds).tolist():
            first = 0 if kind == 0 else self.ends[kind - 1]
            yield kind, i[kinds == kind], j[kinds == kind] - first

    def number(self, kind: int, j: Ints) -> Ints:
        """Return the numbers of obstacles that are numbered within their kind."""
        return j + (0 if kind == 0 else self.ends[kind - 1])


def near_pairs(low: Floats, high: Floats, obstacles: Obstacles) -> Iterator[tuple[Ints, Ints]]:
    """Yield pairs of a box and an obstacle whose bounding boxes meet.

    Boxes that are close together are compared as a group first.

    Args:
        low: Least corners, shape (n, d).
        high: Greatest corners, shape (n, d).
        obstacles: The obstacles; those far from a group along an axis cost nothing.
    """
    order = np.argsort(_keys((low + high) / 2), kind="stable")
    starts = np.arange(0, len(order), _GROUP)
    ends = np.stack([low[order], high[order]])
    groups = np.minimum.reduceat(ends[0], starts), np.maximum.reduceat(ends[1], starts)
    # Comparisons with nan are false, so unused places of the last group meet nothing.
    places = np.full((low.shape[1], 2, len(starts) * _GROUP), np.nan)
    places[:, :, : len(order)] = ends.transpose(2, 0, 1)
    members = places.reshape(low.shape[1], 2, len(starts), _GROUP)
    for group, j in _near_groups(*groups, obstacles):
        for at in range(0, len(group), _PAIRS):
            some, k = group[at : at + _PAIRS], j[at : at + _PAIRS]
            close = np.ones((len(some), _GROUP), bool)
            for axis, (least, most) in enumerate(members):
                close &= least[some] <= obstacles.upper[k, axis, None]
                close &= obstacles.lower[k, axis, None] <= most[some]
            pair, member = np.nonzero(close)
            yield order[some[pair] * _GROUP + member], k[pair]


def _near_groups(low: Floats, high: Floats, obstacles: Obstacles) -> Iterator[tuple[Ints, Ints]]:
    """Yield pairs of a box and an obstacle that meet, by box, then obstacle."""
    axis, strips = obstacles.strips
    firsts = [np.searchsorted(reach, low[:, axis], side="left") for _, _, reach in strips]
    lasts = [np.searchsorted(begin, high[:, axis], side="right") for _, begin, _ in strips]
    counts = [np.maximum(b - a, 0) for a, b in zip(firsts, lasts, strict=True)]
    batch = np.cumsum(sum(counts)) // _CANDIDATES
    for rows in np.split(np.arange(len(low)), np.flatnonzero(np.diff(batch)) + 1):
        pairs = []
        for (numbers, _, _), first, count in zip(strips, firsts, counts, strict=True):
            n = count[rows]
            offset = first[rows] - (np.cumsum(n) - n)
            pairs.append((np.repeat(rows, n), numbers[np.repeat(offset, n) + np.arange(n.sum())]))
        box, j = (np.concatenate(side) for side in zip(*pairs, strict=True))
        meet = _meet(low[box], high[box], obstacles.lower[j], obstacles.upper[j])
        box, j = box[meet], j[meet]
        order = np.lexsort((j, box))
        yield box[order], j[order]


def _meet(low: Floats, high: Floats, other_low: Floats, other_high: Floats) -> Flags:
    """Return which boxes overlap or touch, shapes (..., d)."""
    meets = np.asarray(True)
    for k in range(low.shape[-1]):  # axis by axis: numpy is slow along a short last axis
        meets = meets & (low[..., k] <= other_high[..., k]) & (other_low[..., k] <= high[..., k])
    return meets


def _keys(places: Floats) -> Ints:
    """Return the numbers of the cells of a grid that places are in, shape (n,)."""
    low, high = places.min(axis=0), places.max(axis=0)
    cells = ((places - low) / np.where(high > low, high - low, 1) * (_CELLS - 1)).astype(np.int64)
    keys = np.zeros(len(places), np.int64)
    for k in range(places.shape[1]):
        keys = keys * _CELLS + cells[:, k]
    return keys


def _corners(box: Floats) -> Floats:
    """Return a box in the plane as a polygon, a flat one as a line segment or a point."""
    corners = box[[[0, 1], [2, 1], [2, 3], [0, 3]]]
    return corners if (box[:2] < box[2:]).all() else np.unique(corners, axis=0)
