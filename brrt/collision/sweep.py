"""Motions of bodies made of convex parts.

A motion is bisected (Schwarzer, Saha and Latombe 2005), for each part of the body and each thing
that it may hit: an obstacle, the bounds, another part. In the middle of a piece the two are apart
along some axis. The piece is free if no point crosses that gap: if none moves as far in half of the
piece, or none does along the axis, by its velocity in the middle and a bound of its acceleration. A
piece in whose middle the two touch is blocked. After `HALVINGS` bisections, which is 1024 pieces
of a motion, a piece that is neither counts as free where a motion is said to be free, and as
blocked where it is said to be blocked.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrt.collision.bodies import Body, Placed, towards
from brrt.collision.convex import Complex, along, distances, from_point, separation
from brrt.collision.obstacles import Obstacles, near_pairs
from brrt.robots import Chain, Polygon

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]

HALVINGS = 10
DEPTH = 1e-9
"""Bodies hit if they overlap by more than this part of the map's longest side."""

MARGIN = 2e-6
"""A motion may be rejected if it comes closer than this part of the map's longest side."""

FARTHEST = 1e6
"""Motions farther from the origin than so many sizes of the map are not bisected."""

_MOTIONS, _PIECES = 2048, 30_000

STEPS = 1 << (HALVINGS + 1)
"""Middles of pieces are multiples of one part in so many."""


def swept_hits(obstacles: Obstacles, robot: Any, a: Floats, b: Floats) -> Ints:
    """Return what each motion hits, an obstacle, the bounds or itself, or -1, shape (n,)."""
    return _sweep(obstacles, robot, a, b, -DEPTH * obstacles.extent, 0.0)[0]


def swept_clear(obstacles: Obstacles, robot: Any, a: Floats, b: Floats) -> Flags:
    """Return which motions are proved to stay farther from everything than `MARGIN`, shape (n,)."""
    margin = MARGIN * obstacles.extent
    hit, open_ = _sweep(obstacles, robot, a, b, margin, margin)
    return (hit < 0) & ~open_


@dataclass(slots=True)
class Pieces:
    """Pieces of motions, each with a part of the body and what that may hit; shapes (n,).

    Attributes:
        motion: Number of the motion.
        middle: Middle of the piece, from 0 at the motion's begin to `STEPS` at its end.
        part: Part of the body.
        other: An obstacle, `Obstacles.bounds`, or `Obstacles.itself`.
        mate: The part that it may hit, if that is the body itself.
        move: By how much a point of the one may move, seen from the other, in the whole motion.
        bend: Bound of its acceleration.
    """

    motion: Ints
    middle: Ints
    part: Ints
    other: Ints
    mate: Ints
    move: Floats
    bend: Floats

    def __getitem__(self, rows: Any) -> "Pieces":
        return Pieces(*(getattr(self, name)[rows] for name in self.__slots__))

    def __len__(self) -> int:
        return len(self.motion)

    def halves(self, level: int) -> "Pieces":
        """Return the halves of pieces of a level."""
        both = self[np.tile(np.arange(len(self)), 2)]
        quarter = STEPS >> (level + 2)
        both.middle += np.repeat([-quarter, quarter], len(self))
        return both


def _sweep(
    obstacles: Obstacles, robot: Any, a: Floats, b: Floats, touch: float, clear: float
) -> tuple[Ints, Flags]:
    """Return for each motion what it hits, or -1, and whether a piece was left undecided.

    Args:
        obstacles: The obstacles.
        robot: The robot.
        a: Where the motions begin, shape (n, dof).
        b: Where they end.
        touch: Distances below this are hits.
        clear: Distances above this are free.
    """
    hit, undecided = np.full(len(a), -1), np.zeros(len(a), bool)
    body, step = Body(robot, a.shape[1]), towards(robot, a, b)
    # The rule on bounds finds what is not a number, or so far away that bisection has no end.
    sane = np.isfinite(step).all(axis=1) & np.isfinite(a).all(axis=1)
    sane &= (np.abs(a) < FARTHEST * (1 + obstacles.extent)).all(axis=1)
    rows = np.flatnonzero(sane)
    for first in range(0, len(rows), _MOTIONS):
        some = rows[first : first + _MOTIONS]
        whole = whole_motions(obstacles, body, a[some], b[some], step[some], clear)
        whole.motion = some[whole.motion]
        stack = [(0, whole)]
        while stack:
            level, pieces = stack.pop()
            pieces = pieces[hit[pieces.motion] < 0]
            if len(pieces) > _PIECES:
                stack += [(level, pieces[_PIECES:]), (level, pieces[:_PIECES])]
                continue
            if not len(pieces):
                continue
            apart, least = Place(obstacles, body, a, step, pieces).gaps(0.5 ** (level + 1))
            met = apart < touch
            hit[pieces.motion[met]] = pieces.other[met]
            left = pieces[~met & ~(least > clear)]
            if level == HALVINGS:
                undecided[left.motion] = True
            elif len(left):
                stack.append((level + 1, left.halves(level)))
    return hit, undecided


def whole_motions(
    obstacles: Obstacles, body: Body, a: Floats, b: Floats, step: Floats, clear: float
) -> Pieces:
    """Return whole motions, each with every part and all that the part may hit."""
    n, parts, bounds = len(a), len(body.hulls), body.bounds(a, b, step)
    motion, part = (x.reshape(-1) for x in np.mgrid[:n, :parts])
    all_parts = _pieces(motion, part, 0, 0, bounds.move, bounds.bend)
    low, high = Place(obstacles, body, a, step, all_parts).boxes(clear)
    found = list(near_pairs(low, high, obstacles)) if len(obstacles) else []
    wall = np.flatnonzero(
        (low < obstacles.walls[0]).any(axis=1) | (high > obstacles.walls[1]).any(axis=1)
    )
    rows = np.concatenate([*(i for i, _ in found), wall]).astype(np.int64)
    pieces = all_parts[rows]
    pieces.other = np.concatenate([*(j for _, j in found), np.full(len(wall), obstacles.bounds)])
    if not len(body.pairs):
        return pieces
    seen = body.pair_bounds(step)
    motion, pair = (x.reshape(-1) for x in np.mgrid[:n, : len(body.pairs)])
    one, two = body.pairs[pair].T
    own = _pieces(motion, one, obstacles.itself, two, seen.move, seen.bend)
    own = own[Place(obstacles, body, a, step, own).close(clear)]
    both = zip(*([getattr(x, name) for name in x.__slots__] for x in (pieces, own)), strict=True)
    return Pieces(*map(np.concatenate, both))


def _pieces(
    motion: Ints, part: Ints, other: int, mate: Ints | int, move: Floats, bend: Floats
) -> Pieces:
    """Return whole motions as pieces."""
    n = len(motion)
    middle, others = np.full(n, STEPS // 2), np.full(n, other)
    mates = np.broadcast_to(mate, n).astype(np.int64)
    return Pieces(
        motion, middle, part, others, mates, move.reshape(-1),
        np.broadcast_to(bend, move.shape).reshape(-1),
    )  # fmt: skip


class Place:
    """The body in the middle of each piece.

    Args:
        obstacles: The obstacles.
        body: The body.
        a: Where all motions begin.
        step: How far they lead.
        pieces: The pieces.
        exact: Whether distances from polygons are exact, and not lower bounds that take less time.
    """

    def __init__(
        self, obstacles: Obstacles, body: Body, a: Floats, step: Floats, pieces: Pieces,
        *, exact: bool = False,
    ) -> None:  # fmt: skip
        self.obstacles, self.body, self.pieces = obstacles, body, pieces
        self._apart = distances if exact else separation
        # Many pieces share a place, and so the poses of the body there.
        places, self.rows = np.unique(pieces.motion * STEPS + pieces.middle, return_inverse=True)
        motion, middle = places // STEPS, places % STEPS
        self.Q = a[motion] + (middle / STEPS)[:, None] * step[motion]
        self.known = isinstance(body.robot, Chain | Polygon)
        if self.known:
            self.poses = body.poses(self.Q, step[motion])

    def placed(self, which: Ints, part: Ints) -> Placed:
        """Return a part of the body in the middle of these pieces."""
        rows = self.rows[which]
        if self.known:
            return self.body.placed(self.poses, rows, part)
        return self.body.outlined(self.Q[rows], part)

    def boxes(self, clear: float) -> tuple[Floats, Floats]:
        """Return boxes around the parts in whole motions, wider by `clear`, shapes (n, 2)."""
        p = self.pieces
        vertices, _, velocity = self.placed(np.arange(len(p)), p.part)
        low, high = np.empty((2, len(p), 2))
        for k, (x, v) in enumerate(
            [(vertices.real, velocity.real), (vertices.imag, velocity.imag)]
        ):
            room = np.minimum(p.move / 2, np.abs(v) / 2 + p.bend / 8) + clear
            low[:, k], high[:, k] = (x - room).min(axis=0), (x + room).max(axis=0)
        return low, high

    def close(self, clear: float) -> Flags:
        """Return which pairs of parts may come closer than `clear` in whole motions."""
        p, shapes = self.pieces, self.body.shapes
        centre = shapes.vertices.mean(axis=0)
        radius = np.abs(shapes.vertices - centre).max(axis=0)
        at = self.poses.at + self.poses.turn * centre
        apart = np.abs(at[self.rows, p.part] - at[self.rows, p.mate])
        return np.asarray(apart - radius[p.part] - radius[p.mate] <= p.move / 2 + clear)

    def gaps(self, half: float) -> tuple[Floats, Floats]:
        """Return lower bounds of the distances, below 0 for overlap, shapes (n,).

        Args:
            half: Half the length of a piece, as a part of the motion.

        Returns:
            The bounds in the middle of the pieces, and those for all of each piece.
        """
        other, apart = self.pieces.other, np.empty(len(self.pieces))
        least, ball = np.empty_like(apart), np.zeros(len(apart), bool)
        walls, own = other == self.obstacles.bounds, other == self.obstacles.itself
        rest = np.flatnonzero(~(walls | own))
        ball[rest] = self.obstacles.round[other[rest]]
        for which, gaps in (
            (walls, self._from_walls),
            (own, self._from_itself),
            (ball, self._from_balls),
            (~(walls | own | ball), self._from_polygons),
        ):
            rows = np.flatnonzero(which)
            if len(rows):
                apart[rows], least[rows] = gaps(rows, half)
        return apart, np.maximum(least, apart - self.pieces.move * half)

    def _from_polygons(self, rows: Ints, half: float) -> tuple[Floats, Floats]:
        j, shapes = self.pieces.other[rows], self.obstacles.shapes
        part = self.placed(rows, self.pieces.part[rows])
        other = shapes.vertices[:, j], shapes.axes[:, j]
        gap, axis = self._apart(part.vertices, part.axes, *other)
        return gap, self._least(rows, half, part.vertices, part.velocity, gap, axis)

    def _from_balls(self, rows: Ints, half: float) -> tuple[Floats, Floats]:
        j, shapes = self.pieces.other[rows], self.obstacles.shapes
        part = self.placed(rows, self.pieces.part[rows])
        gap, axis = from_point(part.vertices, part.axes, shapes.vertices[0, j])
        least = self._least(rows, half, part.vertices, part.velocity, gap, axis)
        return gap - shapes.radius[j], least - shapes.radius[j]

    def _from_walls(self, rows: Ints, half: float) -> tuple[Floats, Floats]:
        part = self.placed(rows, self.pieces.part[rows])
        (x0, y0), (x1, y1) = self.obstacles.walls
        x, y = part.vertices.real, part.vertices.imag
        vx, vy = (np.abs(v) * half for v in (part.velocity.real, part.velocity.imag))
        apart = np.min([x - x0, y - y0, x1 - x, y1 - y], axis=(0, 1))
        least = np.min([x - x0 - vx, y - y0 - vy, x1 - x - vx, y1 - y - vy], axis=(0, 1))
        return apart, least - self.pieces.bend[rows] * (half * half / 2)

    def _from_itself(self, rows: Ints, half: float) -> tuple[Floats, Floats]:
        p, at = self.pieces, (self.rows[rows], self.pieces.part[rows])
        one, two = self.placed(rows, p.part[rows]), self.placed(rows, p.mate[rows])
        gap, axis = separation(two.vertices, two.axes, one.vertices, one.axes)
        # As seen from the first part, which turns.
        turning = 1j * self.poses.rate[at] * (two.vertices - self.poses.at[at])
        velocity = two.velocity - self.poses.velocity[at] - turning
        return gap, self._least(rows, half, two.vertices, velocity, gap, axis)

    def _least(
        self, rows: Ints, half: float, z: Complex, velocity: Complex, gap: Floats, axis: Complex
    ) -> Floats:
        """Return the least gap along an axis while the points z move for half a piece."""
        ahead = along(axis, z - z[0])
        rest = gap + ahead.max(axis=0) - ahead - np.abs(along(axis, velocity)) * half
        return np.asarray(rest.min(axis=0) - self.pieces.bend[rows] * (half * half / 2))
