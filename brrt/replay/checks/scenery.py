"""What is in the way, as the checks see it, and which motions come near it."""

from collections.abc import Iterator
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from brrt.worlds.world import World

if TYPE_CHECKING:
    from brrt.replay.checks.bodies import Shapes

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]

_GROUP, _GROUPS, _PAIRS, _CELLS = 64, 1024, 8192, 64


class Obstacles:
    """Boxes, balls and convex polygons under one numbering, with the boxes around them.

    The blocked cells of an occupancy grid are among the boxes, or the polygons if it is turned.
    """

    def __init__(self, world: World) -> None:
        d, self._own = world.dim, (len(world.boxes), len(world.balls), len(world.polygons))
        world = world.solid()
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
        from brrt.replay.checks.bodies import shapes_of  # noqa: PLC0415 - stands above this file

        hulls = [_corners(box) for box in self.boxes] + list(self.balls[:, None, :2])
        radius = np.zeros(len(self))
        radius[len(self.boxes) : self.ends[1]] = self.balls[:, 2]
        return shapes_of([*hulls, *self.polygons], radius)

    @cached_property
    def round(self) -> Flags:
        """Which obstacles are balls or points, shape (n,)."""
        vertices = self.shapes.vertices
        return np.asarray((vertices == vertices[:, :1]).all(axis=1))

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
        obstacles: m of them; those far from a whole group of boxes cost one comparison.
    """
    order = np.argsort(_keys((low + high) / 2), kind="stable")
    starts = np.arange(0, len(order), _GROUP)
    group_low = np.minimum.reduceat(low[order], starts)
    group_high = np.maximum.reduceat(high[order], starts)
    for first in range(0, len(starts), _GROUPS):
        some = slice(first, first + _GROUPS)
        group, j = np.nonzero(
            _meet(group_low[some, None], group_high[some, None], obstacles.lower, obstacles.upper)
        )
        for at in range(0, len(group), _PAIRS):
            rows = (group[at : at + _PAIRS, None] + first) * _GROUP + np.arange(_GROUP)
            others = np.broadcast_to(j[at : at + _PAIRS, None], rows.shape)
            inside = rows < len(order)
            i, k = order[rows[inside]], others[inside]
            close = _meet(low[i], high[i], obstacles.lower[k], obstacles.upper[k])
            yield i[close], k[close]


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
