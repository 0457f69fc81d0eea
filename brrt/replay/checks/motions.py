"""Whether motions are free, by numpy and formulas of its own: none of the planners' code.

A motion counts as blocked where it enters an obstacle by more than `DEPTH` of the lengths at
hand. So rounding never blames a planner, and whatever really goes through something is found.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrt.worlds.world import World

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]

DEPTH = 1e-9
HALVINGS = 7
"""A robot with an outline is looked at in 2^7 places of each motion that comes near something."""

_GROUP, _GROUPS, _PAIRS, _CELLS = 64, 1024, 8192, 64


def first_hits(obstacles: "Obstacles", robot: Any, a: Floats, b: Floats) -> Ints:
    """For each motion the number of the first obstacle that it runs into, or -1; shape (n,).

    Args:
        obstacles: What is in the way.
        robot: What moves: a body with an outline in the plane, or a point, which has none.
        a: Where the motions begin, shape (n, dof).
        b: Where they end, shape (n, dof).
    """
    hit = np.full(len(a), len(obstacles))
    if len(a) and len(obstacles):
        has_body = len(a) > 0 and len(robot.outline(a[0])) > 0
        find = _swept if has_body else _straight
        for i, j in find(obstacles, robot, a, b):
            np.minimum.at(hit, i, j)
    return np.asarray(np.where(hit < len(obstacles), hit, -1))


class Obstacles:
    """Boxes, balls and convex polygons under one numbering, with the boxes around them."""

    def __init__(self, world: World) -> None:
        d = world.dim
        self.boxes, self.balls = world.boxes, world.balls
        self.polygons = [np.asarray(p, np.float64) for p in getattr(world, "polygons", None) or ()]
        self.ends = np.cumsum([len(self.boxes), len(self.balls), len(self.polygons)])
        centre, radius = self.balls[:, :d], self.balls[:, d:]
        lower = [self.boxes[:, :d], centre - radius, *(p.min(axis=0)[None] for p in self.polygons)]
        upper = [self.boxes[:, d:], centre + radius, *(p.max(axis=0)[None] for p in self.polygons)]
        self.lower, self.upper = np.concatenate(lower), np.concatenate(upper)

    def __len__(self) -> int:
        return int(self.ends[-1])

    def name(self, j: int) -> str:
        """Name an obstacle as the world numbers it."""
        kind = int(np.searchsorted(self.ends, j, side="right"))
        first = 0 if kind == 0 else int(self.ends[kind - 1])
        return f"{('box', 'ball', 'polygon')[kind]} {j - first}"

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


def _straight(
    obstacles: Obstacles,
    robot: Any,  # noqa: ARG001 - has no size
    a: Floats,
    b: Floats,
) -> Iterator[tuple[Ints, Ints]]:
    """Yield motions of a point and what they run into."""
    low, high = np.minimum(a, b), np.maximum(a, b)
    for i, j in near(low, high, obstacles):
        for kind, m, k in obstacles.parts(i, j):
            if kind == 0:
                hit = _enters_box(a[m], b[m], obstacles.boxes[k])
            elif kind == 1:
                hit = _enters_ball(a[m], b[m], obstacles.balls[k])
            else:
                ends = np.stack([a[m], b[m]], axis=1)
                hit = _by_polygon(obstacles, k, ends)
            yield m[hit], obstacles.total(kind, k[hit])


def _enters_box(a: Floats, b: Floats, boxes: Floats) -> Flags:
    """Clip each segment to the slabs of its box, less `DEPTH`; shapes (n, d), (n, 2 d)."""
    d = a.shape[1]
    corners = boxes[:, :d], boxes[:, d:]
    size = _size(a, b, *corners)[:, None]
    # A box may be thinner than that; through its middle is through it all the same.
    inset = np.minimum(DEPTH * size, (corners[1] - corners[0]) / 2)
    low, high = corners[0] + inset, corners[1] - inset
    step = b - a
    still, inside = step == 0, (low <= a) & (a <= high)
    with np.errstate(divide="ignore", invalid="ignore"):  # where it stands still
        one, two = (low - a) / step, (high - a) / step
    enter = np.where(still, np.where(inside, -np.inf, np.inf), np.minimum(one, two)).max(axis=1)
    leave = np.where(still, np.where(inside, np.inf, -np.inf), np.maximum(one, two)).min(axis=1)
    return np.asarray(np.maximum(enter, DEPTH) <= np.minimum(leave, 1 - DEPTH))


def _enters_ball(a: Floats, b: Floats, balls: Floats) -> Flags:
    """Compare each segment's closest point with the radius less `DEPTH`."""
    d = a.shape[1]
    centre, radius = balls[:, :d], balls[:, d]
    size = _size(a, b, centre - radius[:, None], centre + radius[:, None])
    step, offset = b - a, centre - a
    square = (step * step).sum(axis=1)
    part = (step * offset).sum(axis=1) / np.where(square > 0, square, 1)
    gap = offset - np.clip(part, 0, 1)[:, None] * step
    return np.asarray(np.sqrt((gap * gap).sum(axis=1)) < radius - DEPTH * size)


def _size(*corners: Floats) -> Floats:
    """Longest side of the box around points, shape (n,)."""
    low, high = corners[0], corners[0]
    for corner in corners[1:]:
        low, high = np.minimum(low, corner), np.maximum(high, corner)
    return np.asarray((high - low).max(axis=1))


def _by_polygon(obstacles: Obstacles, which: Ints, shapes: Floats) -> Flags:
    """Whether convex shapes, (n, k, 2), go into the polygons of these numbers, shape (n,)."""
    hit = np.zeros(len(which), bool)
    for j in np.unique(which).tolist():
        rows = np.flatnonzero(which == j)
        hit[rows] = _overlap(shapes[rows], obstacles.polygons[j])
    return hit


def _overlap(shapes: Floats, polygon: Floats) -> Flags:
    """Whether convex shapes, (n, k, 2), overlap a convex polygon, (m, 2), by more than `DEPTH`.

    Two convex shapes are apart exactly where the normal of an edge of one of them parts them.
    """
    corners = np.broadcast_to(polygon, (len(shapes), *polygon.shape))
    size = np.maximum(shapes.max(axis=1), polygon.max(axis=0)) - np.minimum(
        shapes.min(axis=1), polygon.min(axis=0)
    )
    axes = np.concatenate([_normals(corners), _normals(shapes)], axis=1)
    ours, theirs = shapes @ axes.swapaxes(1, 2), corners @ axes.swapaxes(1, 2)
    depth = np.minimum(ours.max(axis=1) - theirs.min(axis=1), theirs.max(axis=1) - ours.min(axis=1))
    none = ~axes.any(axis=2)  # a side without a length has no normal
    return np.asarray(((depth > DEPTH * size.max(axis=1)[:, None]) | none).all(axis=1))


def _normals(shapes: Floats) -> Floats:
    """Unit normals of the sides, zero for sides without a length, shape (n, k, 2)."""
    sides = np.roll(shapes, -1, axis=1) - shapes
    normals = np.stack([sides[..., 1], -sides[..., 0]], axis=2)
    length = np.sqrt((normals * normals).sum(axis=2, keepdims=True))
    return np.asarray(normals / np.where(length > 0, length, 1))


def _swept(obstacles: Obstacles, robot: Any, a: Floats, b: Floats) -> Iterator[tuple[Ints, Ints]]:
    """Yield motions of a robot with an outline, and what they run into.

    Each motion is halved again and again where it may come near an obstacle: no point of the
    robot moves farther than dof times the metric.
    """
    step = towards(robot, a, b)
    reach = a.shape[1] * np.asarray(robot.distance(a, b))
    which, middle = np.arange(len(a)), np.full(len(a), 0.5)
    for level in range(HALVINGS + 1):
        half = 0.5 ** (level + 1)
        shapes = outlines(robot, a[which] + middle[:, None] * step[which])
        margin = (reach[which] * half)[:, None]
        if level == HALVINGS:
            margin = np.zeros_like(margin)
        low = np.min([part.min(axis=1) for part in shapes], axis=0) - margin
        high = np.max([part.max(axis=1) for part in shapes], axis=0) + margin
        close = np.zeros(len(which), bool)
        for i, j in near(low, high, obstacles):
            close[i] = True
            for part in shapes:
                hit = _shape_hits(obstacles, part, i, j)
                yield which[i[hit]], j[hit]
        which, middle = which[close], middle[close]
        which = np.concatenate([which, which])
        middle = np.concatenate([middle - half / 2, middle + half / 2])
        if not len(which):
            return


def _shape_hits(obstacles: Obstacles, shapes: Floats, i: Ints, j: Ints) -> Flags:
    """Whether shapes[i], each (k, 2), overlap the obstacles j, shape (n,)."""
    hit = np.zeros(len(i), bool)
    rows = np.arange(len(i))
    for kind, m, k in obstacles.parts(rows, j):
        some = shapes[i[m]]
        if kind == 0:
            for box in np.unique(k).tolist():
                mine = k == box
                hit[m[mine]] = _overlap(some[mine], _corners(obstacles.boxes[box]))
        elif kind == 1:
            hit[m] = _shape_enters_ball(some, obstacles.balls[k])
        else:
            hit[m] = _by_polygon(obstacles, k, some)
    return hit


def _corners(box: Floats) -> Floats:
    """A box in the plane as a polygon."""
    return box[[[0, 1], [2, 1], [2, 3], [0, 3]]]


def _shape_enters_ball(shapes: Floats, balls: Floats) -> Flags:
    """Whether convex shapes, (n, k, 2), overlap their balls, (n, 3)."""
    ends = np.roll(shapes, -1, axis=1)
    hit = np.zeros(len(shapes), bool)
    for k in range(shapes.shape[1]):
        hit |= _enters_ball(shapes[:, k], ends[:, k], balls)
    # Or the ball lies within: to one and the same side of all its edges.
    sides, offset = ends - shapes, balls[:, None, :2] - shapes
    turn = sides[..., 0] * offset[..., 1] - sides[..., 1] * offset[..., 0]
    return hit | (turn > 0).all(axis=1) | (turn < 0).all(axis=1)


def outlines(robot: Any, q: Floats) -> list[Floats]:
    """Outlines of a robot at each configuration: for each of its parts, shape (n, k, 2)."""
    shapes = [robot.outline(row) for row in q]
    return [np.array(part, np.float64) for part in zip(*shapes, strict=True)]


def towards(robot: Any, a: Floats, b: Floats) -> Floats:
    """Differences b - a, shape (n, dof), the short way round where an angle wraps.

    Which numbers are angles that wrap is learnt from the metric: a full turn changes nothing.
    """
    step = b - a
    if not len(a):
        return step
    turn, origin = 2 * np.pi, a[:1]
    for k in range(a.shape[1]):
        ahead = origin + turn * np.eye(a.shape[1])[k]
        if np.asarray(robot.distance(origin, ahead))[0] < 1e-6:
            step[:, k] -= turn * np.round(step[:, k] / turn)
    return step
