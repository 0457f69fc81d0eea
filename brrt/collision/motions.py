"""Whether motions are free: numpy geometry that shares no code with the planners.

A motion of a point is blocked if it enters an obstacle by more than `DEPTH` of the lengths
involved, which is above all rounding. For bodies, see `brrt.collision.sweep`.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrt.collision.bodies import towards
from brrt.collision.obstacles import Obstacles, near_pairs
from brrt.collision.sweep import swept_clear, swept_hits

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]

DEPTH = 1e-9


def first_hits(obstacles: Obstacles, robot: Any, a: Floats, b: Floats) -> Ints:
    """Return for each motion the number of something that it hits, or -1, shape (n,).

    It is -1 for a robot that is not known.

    Args:
        obstacles: The obstacles.
        robot: The robot: a body with an outline in the plane, or a point, which has none.
        a: Where the motions begin, shape (n, dof).
        b: Where they end, shape (n, dof).
    """
    if not len(a) or robot.opaque:
        return np.full(len(a), -1, np.int64)
    if has_parts(robot, a.shape[1]):
        return swept_hits(obstacles, robot, a, b)
    hit = np.full(len(a), len(obstacles))
    for i, j in _straight(obstacles, a, b, DEPTH):
        np.minimum.at(hit, i, j)
    return np.asarray(np.where(hit < len(obstacles), hit, -1))


def all_clear(obstacles: Obstacles, robot: Any, a: Floats, b: Floats) -> Flags:
    """Return which motions have more clearance than a planner may reject, shape (n,).

    For a point that is `DEPTH` of the lengths involved, for a body `sweep.MARGIN` of the map.
    """
    if not len(a):
        return np.empty(0, bool)
    if has_parts(robot, a.shape[1]):
        return swept_clear(obstacles, robot, a, b)
    clear = np.ones(len(a), bool)
    for i, _ in _straight(obstacles, a, b, -DEPTH):
        clear[i] = False
    return clear


def has_parts(robot: Any, dof: int) -> bool:
    """Return whether a robot is a body; otherwise it is a point."""
    return hasattr(robot, "outline") and bool(len(robot.outline(np.zeros(dof))))


def _straight(
    obstacles: Obstacles, a: Floats, b: Floats, depth: float
) -> Iterator[tuple[Ints, Ints]]:
    """Yield motions of a point and what they enter by `depth`, or pass within -`depth`."""
    if not len(obstacles):
        return
    wider = max(0.0, -2 * depth * obstacles.extent)
    low, high = np.minimum(a, b) - wider, np.maximum(a, b) + wider
    for i, j in near_pairs(low, high, obstacles):
        for kind, m, k in obstacles.parts(i, j):
            if kind == 0:
                hit = _enters_box(a[m], b[m], obstacles.boxes[k], depth)
            elif kind == 1:
                hit = _enters_ball(a[m], b[m], obstacles.balls[k], depth)
            else:
                ends = np.stack([a[m], b[m]], axis=1)
                hit = _by_polygon(obstacles, k, ends, depth)
            yield m[hit], obstacles.number(kind, k[hit])


def _enters_box(a: Floats, b: Floats, boxes: Floats, depth: float) -> Flags:
    """Clip each segment to the slabs of its box, shrunk by `depth`; shapes (n, d), (n, 2 d)."""
    d = a.shape[1]
    corners = boxes[:, :d], boxes[:, d:]
    size = _size(a, b, *corners)[:, None]
    # A box may be thinner than that; then its middle is what counts.
    inset = np.minimum(depth * size, (corners[1] - corners[0]) / 2)
    low, high = corners[0] + inset, corners[1] - inset
    step = b - a
    still, inside = step == 0, (low <= a) & (a <= high)
    with np.errstate(divide="ignore", invalid="ignore"):  # along axes without motion
        one, two = (low - a) / step, (high - a) / step
    enter = np.where(still, np.where(inside, -np.inf, np.inf), np.minimum(one, two)).max(axis=1)
    leave = np.where(still, np.where(inside, np.inf, -np.inf), np.maximum(one, two)).min(axis=1)
    return np.asarray(np.maximum(enter, depth) <= np.minimum(leave, 1 - depth))


def _enters_ball(a: Floats, b: Floats, balls: Floats, depth: float) -> Flags:
    """Compare the distance of each segment with the radius, shrunk by `depth`."""
    d = a.shape[1]
    centre, radius = balls[:, :d], balls[:, d]
    size = _size(a, b, centre - radius[:, None], centre + radius[:, None])
    step, offset = b - a, centre - a
    square = (step * step).sum(axis=1)
    part = (step * offset).sum(axis=1) / np.where(square > 0, square, 1)
    gap = offset - np.clip(part, 0, 1)[:, None] * step
    return np.asarray(np.sqrt((gap * gap).sum(axis=1)) < radius - depth * size)


def _size(*corners: Floats) -> Floats:
    """Return the longest side of the box around points, shape (n,)."""
    low, high = corners[0], corners[0]
    for corner in corners[1:]:
        low, high = np.minimum(low, corner), np.maximum(high, corner)
    return np.asarray((high - low).max(axis=1))


def _by_polygon(obstacles: Obstacles, which: Ints, shapes: Floats, depth: float) -> Flags:
    """Return which convex shapes, (n, k, 2), enter the polygons of these numbers, shape (n,)."""
    hit = np.zeros(len(which), bool)
    for j in np.unique(which).tolist():
        rows = np.flatnonzero(which == j)
        hit[rows] = _overlap(shapes[rows], obstacles.polygons[j], depth)
    return hit


def _overlap(shapes: Floats, polygon: Floats, least: float) -> Flags:
    """Return which convex shapes, (n, k, 2), overlap a polygon, (m, 2), by more than `least`.

    Two convex shapes are disjoint exactly if the normal of an edge of one of them separates them.
    """
    corners = np.broadcast_to(polygon, (len(shapes), *polygon.shape))
    size = np.maximum(shapes.max(axis=1), polygon.max(axis=0)) - np.minimum(
        shapes.min(axis=1), polygon.min(axis=0)
    )
    axes = np.concatenate([_normals(corners), _normals(shapes)], axis=1)
    ours, theirs = shapes @ axes.swapaxes(1, 2), corners @ axes.swapaxes(1, 2)
    depth = np.minimum(ours.max(axis=1) - theirs.min(axis=1), theirs.max(axis=1) - ours.min(axis=1))
    none = ~axes.any(axis=2)  # a side of length 0 has no normal
    return np.asarray(((depth > least * size.max(axis=1)[:, None]) | none).all(axis=1))


def _normals(shapes: Floats) -> Floats:
    """Return the unit normals of the sides, zero for sides of length 0, shape (n, k, 2)."""
    sides = np.roll(shapes, -1, axis=1) - shapes
    normals = np.stack([sides[..., 1], -sides[..., 0]], axis=2)
    length = np.sqrt((normals * normals).sum(axis=2, keepdims=True))
    return np.asarray(normals / np.where(length > 0, length, 1))


__all__ = ["DEPTH", "Obstacles", "all_clear", "first_hits", "has_parts", "near_pairs", "towards"]
