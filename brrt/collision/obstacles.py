"""What is in the way, as the checks see it, and which motions come near it."""

from collections.abc import Iterator
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from brrt.worlds.world import World

if TYPE_CHECKING:
    from brrt.collision.bodies import Shapes

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]

_GROUP, _CANDIDATES, _PAIRS, _CELLS = 64, 1 << 16, 8192, 64
_WIDTHS = 12
"""Obstacles are told apart by width down to this many halvings of the map's."""


class Obstacles:
    """Boxes, balls and convex polygons under one numbering, with the boxes around them.

    The blocked cells of an occupancy grid are among the boxes, or the polygons if it is turned.
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
        """The number of the bounds, which are solid for bodies."""
        return len(self)

    @property
    def itself(self) -> int:
        """The number of the body itself, whose parts may have to keep apart."""
        return len(self) + 1

    @cached_property
    def shapes(self) -> "Shapes":
        """All obstacles in the plane as convex shapes; balls are points with a radius."""
        from brrt.collision.bodies import shapes_of  # noqa: PLC0415 - stands above this file

        hulls = [_corners(box) for box in self.boxes] + list(self.balls[:, None, :2])
        radius = np.zeros(len(self))
        radius[len(self.boxes) : self.ends[1]] = self.balls[:, 2]
        return shapes_of([*hulls, *self.polygons], radius)

    @cached_property
    def round(self) -> Flags:
        """Which obstacles are balls or points, shape (n,)."""
        vertices = self.shapes.vertices
        return np.asarray((vertices == vertices[:, :1]).all(axis=1))

    @cached_property
    def strips(self) -> tuple[int, list[tuple[Ints, Floats, Floats]]]:
        """Obstacles of about one width, sorted along the map's longest axis.

        Returns:
            The axis, and for each width: the obstacles' numbers, where each begins, and how far
            it and those before it reach at most.
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
        """Name an obstacle as the world numbers it."""
        if j >= len(self):
            return "the bounds" if j == self.bounds else "the robot itself"
        kind = int(np.searchsorted(self.ends, j, side="right"))
        number = j - (0 if kind == 0 else int(self.ends[kind - 1]))
        if number >= self._own[kind]:
            return "the map's blocked cells"
        return f"{('box', 'ball', 'polygon')[kind]} {number}"

    def parts(self, i: Ints, j: Ints) -> Iterator[tuple[int, Ints, Ints]]:
        """Part pairs by the kind of their obstacle: 0 boxes, 1 balls, 2 polygons."""
        kinds = np.searchsorted(self.ends, j, side="right")
        for kind in np.unique(kinds).tolist():
            first = 0 if kind == 0 else self.ends[kind - 1]
            yield kind, i[kinds == kind], j[kinds == kind] - first

    def total(self, kind: int, j: Ints) -> Ints:
        """Return the common number of obstacles that are numbered within their kind."""
        return j + (0 if kind == 0 else self.ends[kind - 1])


def near(low: Floats, high: Floats, obstacles: Obstacles) -> Iterator[tuple[Ints, Ints]]:
    """Yield pairs of a box and an obstacle that may meet; boxes that lie together go together.

    Args:
        low: Least corners, shape (n, d).
        high: Greatest corners, shape (n, d).
        obstacles: What is in the way; what is far from a group along an axis costs nothing.
    """
    order = np.argsort(_keys((low + high) / 2), kind="stable")
    starts = np.arange(0, len(order), _GROUP)
    ends = np.stack([low[order], high[order]])
    groups = np.minimum.reduceat(ends[0], starts), np.maximum.reduceat(ends[1], starts)
    # Places left in the last group meet nothing: no comparison with them is true.
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
    """Yield pairs of a box and an obstacle that meet, sorted by box, then obstacle."""
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
    """Whether boxes overlap or touch, shapes (..., d)."""
    meets = np.asarray(True)
    for k in range(low.shape[-1]):  # an axis at a time: numpy is slow along a short last one
        meets = meets & (low[..., k] <= other_high[..., k]) & (other_low[..., k] <= high[..., k])
    return meets


def _keys(places: Floats) -> Ints:
    """Number cells of a grid, so that places in one cell have one key, shape (n,)."""
    low, high = places.min(axis=0), places.max(axis=0)
    cells = ((places - low) / np.where(high > low, high - low, 1) * (_CELLS - 1)).astype(np.int64)
    keys = np.zeros(len(places), np.int64)
    for k in range(places.shape[1]):
        keys = keys * _CELLS + cells[:, k]
    return keys


def _corners(box: Floats) -> Floats:
    """A box in the plane as a polygon; a flat one as a line segment or a point."""
    corners = box[[[0, 1], [2, 1], [2, 3], [0, 3]]]
    return corners if (box[:2] < box[2:]).all() else np.unique(corners, axis=0)
