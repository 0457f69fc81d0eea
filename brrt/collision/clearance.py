"""Along motions: where they first hit something, and how near they come to what they miss.

Both follow from the checks of `brrt.collision.motions` and `brrt.collision.sweep`.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brrt.collision.bodies import Body, towards
from brrt.collision.convex import from_point
from brrt.collision.motions import first_hits, has_parts
from brrt.collision.obstacles import Obstacles, near_pairs
from brrt.collision.sweep import HALVINGS, STEPS, Pieces, Place, whole_motions

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

CLOSE = 1e-3
"""A body may come nearer than the distance that is found by this part of it."""

_CONTACT, _NEAREST = 30, 50
"""Bisections: until something is hit, and of a point's motion past an obstacle."""

_MOTIONS = 256
_REACH = 1 / 128
"""Obstacles are first searched within this part of the map's longest side, then in twice that."""


class Contacts(NamedTuple):
    """What motions touch first, or come nearest to; shapes (n,).

    Attributes:
        part: Where along the motion, from 0 at its begin to 1 at its end.
        other: Number of the obstacle, `Obstacles.bounds` or `Obstacles.itself`; -1 for nothing.
        distance: Distance from it, infinite if there is nothing.
    """

    part: Floats
    other: Ints
    distance: Floats


def first_contacts(obstacles: Obstacles, robot: Any, a: Floats, b: Floats, hits: Ints) -> Contacts:
    """Return where blocked motions begin to hit, and what they hit there.

    Args:
        obstacles: The obstacles.
        robot: The robot.
        a: Where the motions begin, shape (n, dof).
        b: Where they end.
        hits: What `first_hits` says that they hit.
    """
    step, other = towards(robot, a, b), hits.copy()
    at_begin = first_hits(obstacles, robot, a, a)
    other = np.where(at_begin >= 0, at_begin, other)
    # The motion up to `low` is free, that up to `high` is not.
    low, high = np.zeros(len(a)), np.where(at_begin >= 0, 0.0, 1.0)
    for _ in range(_CONTACT):
        middle = (low + high) / 2
        there = a + middle[:, None] * step
        found = first_hits(obstacles, robot, a, there)
        # The sweep of a body looks at middles of pieces, not at the end.
        found = np.where(found < 0, first_hits(obstacles, robot, there, there), found)
        blocked = (found >= 0) & (at_begin < 0)
        high, other = np.where(blocked, middle, high), np.where(blocked, found, other)
        low = np.where(blocked, low, middle)
    return Contacts(high, other, np.zeros(len(a)))


def clearances(obstacles: Obstacles, robot: Any, a: Floats, b: Floats) -> Contacts:
    """Return how near free motions come to an obstacle, bodies also to the bounds.

    For a point that is exact but for rounding, for a body but for `CLOSE`. The distance between
    the parts of a body is not considered.

    Args:
        obstacles: The obstacles.
        robot: The robot.
        a: Where the motions begin, shape (n, dof).
        b: Where they end.
    """
    found = Contacts(np.zeros(len(a)), np.full(len(a), -1), np.full(len(a), np.inf))
    body = Body(robot, a.shape[1]) if len(a) and has_parts(robot, a.shape[1]) else None
    step = towards(robot, a, b)
    for first in range(0, len(a), _MOTIONS):
        rows, reach = np.arange(first, min(first + _MOTIONS, len(a))), _REACH * obstacles.extent
        span = np.ptp(np.concatenate([a[rows], b[rows]]), axis=0).max() + np.abs(a[rows]).max()
        most = 2 * obstacles.extent + float(span + np.abs(np.stack(obstacles.walls)).max())
        while len(rows):
            some = (a[rows], b[rows], step[rows])
            if body is None:
                near = _points_within(obstacles, some[0], some[2], reach)
            else:
                near = _bodies_within(obstacles, body, *some, reach)
            for mine, new in zip(found, near, strict=True):
                mine[rows] = new
            if reach > most:
                break
            rows, reach = rows[near.distance > reach], 2 * reach
    return found._replace(distance=np.maximum(found.distance, 0.0))


def _nearest(n: int, motion: Ints, part: Floats, other: Ints, distance: Floats) -> Contacts:
    """Return the nearest of some places for each of n motions."""
    found = Contacts(np.zeros(n), np.full(n, -1), np.full(n, np.inf))
    order = np.lexsort((other, part, distance, motion))
    which, rows = np.unique(motion[order], return_index=True)
    for mine, new in zip(found, (part, other, distance), strict=True):
        mine[which] = new[order[rows]]
    return found


def _points_within(obstacles: Obstacles, a: Floats, step: Floats, reach: float) -> Contacts:
    """Search obstacles near motions of a point; along each the distance is convex."""
    nothing = (np.empty(0, np.int64), np.empty(0), np.empty(0, np.int64), np.empty(0))
    if not len(obstacles):
        return _nearest(len(a), *nothing)
    ends, length, bound = np.stack([a, a + step]), np.linalg.norm(step, axis=1), np.inf
    best, all_found = np.full(len(a), bound), [nothing]
    for i, j in near_pairs(ends.min(axis=0) - reach, ends.max(axis=0) + reach, obstacles):
        middle, _ = _from_points(obstacles, a[i] + step[i] / 2, j)
        np.minimum.at(best, i, middle)
        left = middle - length[i] / 2 <= best[i]
        motion, other = i[left], j[left]
        low, high = np.zeros(len(motion)), np.ones(len(motion))
        for _ in range(_NEAREST):
            part = (low + high) / 2
            _, away = _from_points(obstacles, a[motion] + part[:, None] * step[motion], other)
            leaves = (away * step[motion]).sum(axis=1) > 0
            low, high = np.where(leaves, low, part), np.where(leaves, part, high)
        part = np.where(low > 0, np.where(high < 1, low, 1.0), 0.0)
        gap, _ = _from_points(obstacles, a[motion] + part[:, None] * step[motion], other)
        np.minimum.at(best, motion, gap)
        all_found.append((motion, part, other, gap))
    return _nearest(len(a), *map(np.concatenate, zip(*all_found, strict=True)))


def _from_points(obstacles: Obstacles, q: Floats, j: Ints) -> tuple[Floats, Floats]:
    """Return distances of points from obstacles, (n,), and the directions from these, (n, d)."""
    if q.shape[1] == 2:
        shapes = obstacles.shapes
        z = q[:, 0] + 1j * q[:, 1]
        gap, way = from_point(shapes.vertices[:, j], shapes.axes[:, j], z)
        # A point has no normals that would tell inside from outside.
        gap = np.where(obstacles.round[j], np.abs(z - shapes.vertices[0, j]), gap)
        return gap - shapes.radius[j], np.stack([way.real, way.imag], axis=1)
    low, high = obstacles.lower[j], obstacles.upper[j]
    ball = j >= len(obstacles.boxes)
    radius = np.zeros(len(j))
    radius[ball] = obstacles.balls[j[ball] - len(obstacles.boxes), -1]
    away = q - np.where(ball[:, None], (low + high) / 2, np.clip(q, low, high))
    return np.linalg.norm(away, axis=1) - radius, away


def _bodies_within(
    obstacles: Obstacles, body: Body, a: Floats, b: Floats, step: Floats, reach: float
) -> Contacts:
    """Search what is near motions of a body, by bisection as in `brrt.collision.sweep`."""
    whole = whole_motions(obstacles, body, a, b, step, reach)
    whole = whole[whole.other != obstacles.itself]
    pieces, level = whole, 0
    places = [_measured(obstacles, body, a, step, whole, part) for part in (0, 1)]
    best = np.full(len(a), np.inf)
    for motion, _, _, gap in places:
        np.minimum.at(best, motion, gap)
    while len(pieces) and level <= HALVINGS:
        apart, least = Place(obstacles, body, a, step, pieces, exact=True).gaps(0.5 ** (level + 1))
        places.append((pieces.motion, pieces.middle / STEPS, pieces.other, apart))
        np.minimum.at(best, pieces.motion, apart)
        pieces = pieces[least < (1 - CLOSE) * best[pieces.motion]]
        pieces = pieces.halves(level) if level < HALVINGS else pieces
        level += 1
    return _nearest(len(a), *map(np.concatenate, zip(*places, strict=True)))


def _measured(
    obstacles: Obstacles, body: Body, a: Floats, step: Floats, whole: Pieces, part: int
) -> tuple[Ints, Floats, Ints, Floats]:
    """Return motions, parts, obstacles and distances at the begin or the end of whole motions."""
    there = whole[np.arange(len(whole))]
    there.middle = np.zeros(len(whole), np.int64)
    apart, _ = Place(obstacles, body, a + part * step, step, there, exact=True).gaps(0.0)
    return there.motion, np.full(len(whole), float(part)), there.other, apart
