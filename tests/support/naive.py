"""Slow twins: exact, brute force, simple to verify; the other tests compare brrt with them.

Floats are rational numbers, so `Fraction` decides every question about them without rounding.
"""

from collections.abc import Iterator, Sequence
from fractions import Fraction
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from brrt.events import Events
from brrt.robots import Chain, Polygon, Robot
from brrt.worlds import World

Floats = NDArray[np.float64]
Point = Sequence[float] | Floats

NEAR = 1e-9
"""A hit that is none must be a miss by less than this part of the lengths at hand."""
TINY = 1e-150
"""The squares of lengths below this are lost to underflow."""


def exact(values: Point) -> list[Fraction]:
    """The same numbers, as fractions."""
    return [Fraction(float(value)) for value in values]


def segment_hits_box(a: Point, b: Point, box: Point, margin: float = 0.0) -> bool:
    """Whether the closed segment a b touches a closed box, widened by a margin on every side."""
    d = len(a)
    p, q, corners, more = exact(a), exact(b), exact(box), Fraction(margin)
    enter, leave = Fraction(0), Fraction(1)
    for x, y, low, high in zip(p, q, corners[:d], corners[d:], strict=True):
        if x == y:
            if not low - more <= x <= high + more:
                return False
        else:
            u, v = (low - more - x) / (y - x), (high + more - x) / (y - x)
            enter, leave = max(enter, min(u, v)), min(leave, max(u, v))
    return enter <= leave


def segment_hits_ball(a: Point, b: Point, ball: Point, margin: float = 0.0) -> bool:
    """Whether the closed segment a b touches a closed ball, its radius increased by a margin."""
    d = len(a)
    p, q, (*centre, radius) = exact(a), exact(b), exact(ball)
    along = [q[k] - p[k] for k in range(d)]
    offset = [centre[k] - p[k] for k in range(d)]
    length_squared = sum(x * x for x in along)
    part = Fraction(0)
    if length_squared:
        part = sum(x * y for x, y in zip(along, offset, strict=True)) / length_squared
    part = min(max(part, Fraction(0)), Fraction(1))
    gap = [offset[k] - part * along[k] for k in range(d)]
    return sum(x * x for x in gap) <= (radius + Fraction(margin)) ** 2


def segment_hits_polygon(a: Point, b: Point, polygon: Floats) -> bool:
    """Whether the closed segment a b touches a closed polygon: an edge, or from within."""
    p, q, corners = exact(a), exact(b), [exact(corner) for corner in polygon]
    edges = list(zip(corners, corners[1:] + corners[:1], strict=True))
    if any(_segments_meet(p, q, u, v) for u, v in edges):
        return True
    return len(corners) > 2 and all(_left_of(u, v, p) >= 0 for u, v in edges)


def _left_of(u: list[Fraction], v: list[Fraction], p: list[Fraction]) -> Fraction:
    return (v[0] - u[0]) * (p[1] - u[1]) - (v[1] - u[1]) * (p[0] - u[0])


def _segments_meet(
    p: list[Fraction], q: list[Fraction], u: list[Fraction], v: list[Fraction]
) -> bool:
    """Whether the boxes around two segments meet, and each has the other's ends on both sides."""
    for k in range(2):
        if max(p[k], q[k]) < min(u[k], v[k]) or max(u[k], v[k]) < min(p[k], q[k]):
            return False
    across = _left_of(p, q, u) * _left_of(p, q, v) <= 0
    return across and _left_of(u, v, p) * _left_of(u, v, q) <= 0


def hits(world: World, a: Point, b: Point) -> bool:
    """Whether the closed segment a b touches an obstacle."""
    boxes, balls = _close_to(world, a, b)
    return (
        any(segment_hits_box(a, b, box) for box in boxes)
        or any(segment_hits_ball(a, b, ball) for ball in balls)
        or any(segment_hits_polygon(a, b, polygon) for polygon in world.polygons)
    )


def nearly_hits(world: World, a: Point, b: Point) -> bool:
    """Whether the segment a b touches an obstacle that is widened by `NEAR` of the lengths at hand.

    For each obstacle that is the longest side of the box around the obstacle and the segment.
    """
    d, ends = world.dim, np.array([a, b], dtype=np.float64)
    for box in world.boxes:
        margin = NEAR * np.ptp([*ends, box[:d], box[d:]], axis=0).max() + TINY
        if segment_hits_box(a, b, box, margin):
            return True
    for ball in world.balls:
        around = [*ends, ball[:d] - ball[d], ball[:d] + ball[d]]
        if segment_hits_ball(a, b, ball, NEAR * np.ptp(around, axis=0).max() + TINY):
            return True
    for polygon in world.polygons:
        near = NEAR * np.ptp([*ends, *polygon], axis=0).max()
        if hull_distance(ends[None], polygon[None])[0] <= near:
            return True
    return False


def hull_distance(one: Floats, other: Floats) -> Floats:
    """Distances of moving convex shapes from another, 0 where they touch or overlap.

    The least of all distances between a vertex of one and an edge of the other; 0 where edges
    cross or a vertex lies inside.

    Args:
        one: Vertices counter-clockwise at each of t times, shape (t, k, 2).
        other: Vertices of the other, at each time or constant, shape (t or 1, m, 2).
    """
    one, other = one[:, :, None, :], other[:, None, :, :]
    p, q = (one, np.roll(one, -1, axis=1)), (other, np.roll(other, -1, axis=2))
    far = np.minimum(_to_segment(one, *q).min(axis=(1, 2)), _to_segment(other, *p).min(axis=(1, 2)))
    sides = [_side(*p, other), _side(*p, q[1]), _side(*q, one), _side(*q, p[1])]
    crossing = (sides[0] * sides[1] < 0) & (sides[2] * sides[3] < 0)
    meet = np.asarray(crossing.any(axis=(1, 2)))
    if one.shape[1] > 2:
        meet |= np.asarray(np.all(sides[0] >= 0, axis=1)).any(axis=1)
    if other.shape[2] > 2:
        meet |= np.asarray(np.all(sides[2] >= 0, axis=2)).any(axis=1)
    return np.where(meet, 0.0, far)


def _to_segment(point: Floats, a: Floats, b: Floats) -> Floats:
    """Distances of points from segments a b; arrays of (x, y) that broadcast."""
    along, offset = b - a, point - a
    square = (along * along).sum(axis=-1)
    part = (along * offset).sum(axis=-1) / np.where(square > 0, square, 1.0)
    gap = offset - np.clip(part, 0, 1)[..., None] * along
    return np.asarray(np.hypot(gap[..., 0], gap[..., 1]))


def _side(a: Floats, b: Floats, point: Floats) -> Floats:
    """Above 0 where points lie left of the line from a to b."""
    along, offset = b - a, point - a
    return np.asarray(along[..., 0] * offset[..., 1] - along[..., 1] * offset[..., 0])


def moving_body(robot: Robot, Q: Floats) -> list[Floats]:
    """Vertices of each part at each of t configurations, shape (t, k, 2), by complex numbers."""
    if isinstance(robot, Polygon):
        z, turn = Q[:, 0] + 1j * Q[:, 1], np.exp(1j * Q[:, 2])
        frames = [(z, turn)] * len(robot.parts)
        parts = list(robot.parts)
    else:
        assert isinstance(robot, Chain)
        assert robot.base_x is not None
        assert robot.base_y is not None
        z, turn = np.full(len(Q), robot.base_x + 1j * robot.base_y), np.ones(len(Q), complex)
        frames, parts = [], [joint.link for joint in robot.joints]
        for k, joint in enumerate(robot.joints):
            z = z + complex(*joint.offset) * turn
            turn = turn * np.exp(1j * Q[:, k])
            frames.append((z, turn))
    placed = [
        z[:, None] + turn[:, None] * (part[:, 0] + 1j * part[:, 1])
        for part, (z, turn) in zip(parts, frames, strict=True)
    ]
    return [np.stack([part.real, part.imag], axis=-1) for part in placed]


def clearance(world: World, robot: Robot, Q: Floats) -> Floats:
    """Distances of a body from what it must not touch at t configurations; 0 where it does."""
    parts = moving_body(robot, Q)
    far = np.full(len(Q), np.inf)
    for part in parts:
        walls = np.minimum(part - world.lower, world.upper - part).min(axis=(1, 2))
        far = np.minimum(far, np.maximum(walls, 0.0))
        for x, y, radius in world.balls:
            gaps = hull_distance(part, np.array([[[x, y]]])) - radius
            far = np.minimum(far, np.maximum(gaps, 0.0))
        for a, b, c, d in world.boxes:
            corners = np.array([[a, b], [c, b], [c, d], [a, d]], float)
            if a == c or b == d:
                corners = np.unique(corners, axis=0)
            far = np.minimum(far, hull_distance(part, corners[None]))
        for polygon in world.polygons:
            far = np.minimum(far, hull_distance(part, polygon[None]))
    if isinstance(robot, Chain) and robot.self_collision:
        for i in range(len(parts)):
            for j in range(i + 2, len(parts)):
                far = np.minimum(far, hull_distance(parts[i], parts[j]))
    return far


def densified(robot: Robot, a: Floats, b: Floats, n: int) -> Floats:
    """Configurations at n + 1 even steps of a motion, angles that wrap the short way round."""
    step = b - a
    endless = np.zeros(len(a), bool)
    if isinstance(robot, Polygon):
        endless[2] = True
    elif isinstance(robot, Chain):
        endless = np.array([joint.limits is None for joint in robot.joints])
    step = np.where(endless & (np.abs(step) > np.pi), step - np.sign(step) * 2 * np.pi, step)
    return np.asarray(a + step * np.linspace(0, 1, n + 1)[:, None])


def _close_to(world: World, a: Point, b: Point) -> tuple[Floats, Floats]:
    """Boxes and balls whose bounding box meets the segment's: the others cannot touch it.

    Comparisons do not round; the bounding box of a ball does, so it is made an ulp too large.
    """
    d, (low, high) = world.dim, np.sort([a, b], axis=0)
    boxes, balls = world.boxes, world.balls
    least = np.nextafter(balls[:, :d] - balls[:, d:], -np.inf)
    most = np.nextafter(balls[:, :d] + balls[:, d:], np.inf)
    return (
        boxes[((boxes[:, :d] <= high) & (low <= boxes[:, d:])).all(axis=1)],
        balls[((least <= high) & (low <= most)).all(axis=1)],
    )


def motions(waypoints: Sequence[Point] | Floats) -> Iterator[tuple[Point, Point]]:
    """Each waypoint with its successor; a lone waypoint with itself."""
    return zip(waypoints, waypoints[1:] if len(waypoints) > 1 else waypoints, strict=False)


def path_is_free(world: World, waypoints: Sequence[Point] | Floats) -> bool:
    """Whether a path has waypoints, stays within the bounds and touches no obstacle."""
    return (
        len(waypoints) > 0
        and all(map(world.inside, waypoints))
        and not any(hits(world, a, b) for a, b in motions(waypoints))
    )


def squared_distances(points: Floats, q: Floats) -> Floats:
    """Squares of the distances from each point, shape (n, d), to q, summed axis by axis."""
    total = np.zeros(len(points))
    for k in range(len(q)):
        total = total + (points[:, k] - q[k]) ** 2
    return total


def path_length(waypoints: Floats) -> float:
    """Sum of the Euclidean lengths of a path's motions, from the start on."""
    total = 0.0
    for a, b in pairwise(waypoints):
        total += float(np.sqrt(squared_distances(a[None], b)[0]))
    return total


def assert_same(one: Events, other: Events) -> None:
    """Two logs are equal bit by bit, field by field: padding between the fields does not count."""
    assert one.tables.keys() == other.tables.keys()
    for kind, table in one.tables.items():
        twin = other.tables[kind]
        assert table.dtype == twin.dtype
        assert len(table) == len(twin), kind
        for name in table.dtype.names or ():
            if not table.dtype[name].hasobject:
                assert table[name].tobytes() == twin[name].tobytes(), (kind, name)
            else:
                for x, y in zip(table[name], twin[name], strict=True):
                    assert np.shape(x) == np.shape(y), (kind, name)
                    assert np.asarray(x).tobytes() == np.asarray(y).tobytes(), (kind, name)
