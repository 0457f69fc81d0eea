"""Motions of bodies made of convex parts, in numpy and complex numbers.

A motion is bisected (Schwarzer, Saha and Latombe 2005), for each part of the body and each thing
that it may hit: an obstacle, the bounds, another part. A piece in whose middle the two are farther
apart than any point can move in half of it is free; one in whose middle they touch is blocked.
After `HALVINGS` bisections, which is 1024 pieces of a motion, a piece that is neither counts as
free where a motion is said to be free, and as blocked where it is said to be blocked.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brrt.collision.obstacles import Obstacles, near_pairs
from brrt.robots import Chain, Polygon

Floats = NDArray[np.float64]
Complex = NDArray[np.complex128]
Ints = NDArray[np.int64]

HALVINGS = 10
DEPTH = 1e-9
"""Bodies hit if they overlap by more than this part of the map's longest side."""

MARGIN = 2e-6
"""A motion may be rejected if it comes closer than this part of the map's longest side."""

_MOTIONS, _PIECES = 4096, 30_000


def swept_hits(obstacles: Obstacles, robot: Any, a: Floats, b: Floats) -> Ints:
    """Return what each motion hits, an obstacle, the bounds or itself, or -1, shape (n,)."""
    return _sweep(obstacles, robot, a, b, -DEPTH * obstacles.extent, 0.0)[0]


def swept_clear(obstacles: Obstacles, robot: Any, a: Floats, b: Floats) -> NDArray[np.bool_]:
    """Return which motions are proved to stay farther from everything than `MARGIN`, shape (n,)."""
    margin = MARGIN * obstacles.extent
    hit, open_ = _sweep(obstacles, robot, a, b, margin, margin)
    return (hit < 0) & ~open_


def wrapping_angles(robot: Any, dof: int) -> NDArray[np.bool_]:
    """Return which numbers of a configuration are angles that wrap, shape (dof,)."""
    if not hasattr(robot, "canonical"):
        return np.zeros(dof, bool)
    zero = np.zeros(dof)
    turned = [np.asarray(robot.canonical(zero + 2 * np.pi * axis)) for axis in np.eye(dof)]
    return np.array([abs(q[k]) < 1.0 for k, q in enumerate(turned)], bool)


def towards(robot: Any, a: Floats, b: Floats) -> Floats:
    """Return b - a, the short way round where an angle wraps, shape (n, dof)."""
    step, wraps = b - a, wrapping_angles(robot, a.shape[1])
    step[:, wraps] -= 2 * np.pi * np.round(step[:, wraps] / (2 * np.pi))
    return np.asarray(step)


class ConvexShapes(NamedTuple):
    """Convex shapes, padded to equal length by repeating their first vertex and axis.

    Attributes:
        vertices: Vertices as complex numbers, shape (n, k).
        axes: Outward normals of the sides, for a line segment also its directions, shape (n, m).
        radius: By how much each shape is inflated, shape (n,).
    """

    vertices: Complex
    axes: Complex
    radius: Floats


def convex_shapes(hulls: list[Floats], radius: Floats | None = None) -> ConvexShapes:
    """Convert convex polygons, line segments and points, shape (k, 2) each, counter-clockwise."""
    vertices, axes = [], []
    for hull in hulls:
        z = hull[:, 0] + 1j * hull[:, 1]
        sides = np.roll(z, -1) - z
        sides = sides[sides != 0]
        sides = sides / np.abs(sides)
        along = sides if len(sides) == 2 else sides[:0]
        vertices.append(z)
        axes.append(np.concatenate([-1j * sides, along]) if len(sides) else np.ones(1, complex))
    return ConvexShapes(
        _padded(vertices), _padded(axes), np.zeros(len(hulls)) if radius is None else radius
    )


def _padded(rows: list[Complex]) -> Complex:
    most = max((len(row) for row in rows), default=1)
    return np.array(
        [np.concatenate([row, np.full(most - len(row), row[0])]) for row in rows], complex
    ).reshape(-1, most)


class Body:
    """A robot's parts: their poses, and how far their points move.

    Args:
        robot: A polygon, a chain, or an object with `outline`, `distance`, and parts whose points
            move at most `dof` times the motion's length in the metric.
        dof: Numbers in a configuration.
    """

    def __init__(self, robot: Any, dof: int) -> None:
        self.robot, self.dof, self.hulls = robot, dof, _hulls(robot, dof)
        self.shapes = convex_shapes(self.hulls)
        self.pairs = np.empty((0, 2), np.int64)
        if isinstance(robot, Chain) and robot.self_collision:
            n = len(self.hulls)
            pairs = [(i, j) for i in range(n) for j in range(i + 2, n)]
            self.pairs = np.array(pairs, np.int64).reshape(-1, 2)

    def frames(self, Q: Floats) -> tuple[Complex, Complex]:
        """Return the origin and the rotation of each part, shapes (n, parts)."""
        if isinstance(self.robot, Chain):
            robot = self.robot
            assert robot.base_x is not None and robot.base_y is not None  # noqa: S101, PT018 - settled
            turn = np.exp(1j * np.cumsum(Q, axis=1))
            offset = np.array([complex(*joint.offset) for joint in robot.joints])
            before = np.concatenate([np.ones((len(Q), 1)), turn[:, :-1]], axis=1)
            at = complex(robot.base_x, robot.base_y) + np.cumsum(before * offset, axis=1)
            return at, turn
        shape = (len(Q), len(self.hulls))
        at = np.broadcast_to((Q[:, 0] + 1j * Q[:, 1])[:, None], shape)
        return at, np.broadcast_to(np.exp(1j * Q[:, 2])[:, None], shape)

    def placed(self, Q: Floats, part: Ints) -> tuple[Complex, Complex]:
        """Return vertices and axes of one part at each configuration, shapes (n, k) and (n, m)."""
        if not isinstance(self.robot, Chain | Polygon):
            hulls = [self.robot.outline(q)[p] for q, p in zip(Q, part, strict=True)]
            shapes = convex_shapes([np.asarray(hull, np.float64) for hull in hulls])
            return shapes.vertices, shapes.axes
        at, turn = self.frames(Q)
        rows = np.arange(len(Q))
        at, turn = at[rows, part][:, None], turn[rows, part][:, None]
        return at + turn * self.shapes.vertices[part], turn * self.shapes.axes[part]

    @cached_property
    def _reach(self) -> Floats:
        """The greatest distance of a point of part j from joint i, shape (joints, parts)."""
        far = np.array([np.hypot(*hull.T).max() for hull in self.hulls])
        if isinstance(self.robot, Polygon):
            return far[None]
        n, offset = len(far), [np.hypot(*joint.offset) for joint in self.robot.joints]
        reach = np.zeros((n, n))
        for i in range(n):
            for j in range(i, n):
                reach[i, j] = sum(offset[i + 1 : j + 1]) + far[j]
        return reach

    def moves(self, a: Floats, b: Floats, step: Floats) -> Floats:
        """Return an upper bound of how far any point of each part moves, shape (n, parts)."""
        turns = np.abs(step)
        if isinstance(self.robot, Chain):
            return np.asarray(turns @ self._reach) * (1 + 1e-9)
        if isinstance(self.robot, Polygon):
            straight = np.hypot(step[:, 0], step[:, 1])[:, None]
            return np.asarray(straight + turns[:, 2:3] * self._reach) * (1 + 1e-9)
        far = self.dof * np.asarray(self.robot.distance(a, b))
        return np.repeat(far[:, None], len(self.hulls), axis=1)


def _hulls(robot: Any, dof: int) -> list[Floats]:
    """Return the parts in their own frames, for robots of other kinds those at the origin."""
    if isinstance(robot, Polygon):
        return [np.asarray(part) for part in robot.parts]
    if isinstance(robot, Chain):
        return [np.asarray(joint.link) for joint in robot.joints]
    return [np.asarray(part, np.float64) for part in robot.outline(np.zeros(dof))]


@dataclass(slots=True)
class _Pieces:
    """Pieces of motions, each with a part of the body and what that may hit; shapes (n,).

    Attributes:
        motion: Number of the motion.
        middle: Middle of the piece, from 0 to 1 along the motion.
        part: Part of the body.
        other: An obstacle, `Obstacles.bounds`, or `Obstacles.itself`.
        mate: The other part, if it is the body itself.
        move: By how much the two may approach each other in the whole motion.
    """

    motion: Ints
    middle: Floats
    part: Ints
    other: Ints
    mate: Ints
    move: Floats

    def __getitem__(self, rows: Any) -> "_Pieces":
        return _Pieces(*(getattr(self, name)[rows] for name in self.__slots__))

    def __len__(self) -> int:
        return len(self.motion)


def _sweep(
    obstacles: Obstacles, robot: Any, a: Floats, b: Floats, touch: float, clear: float
) -> tuple[Ints, NDArray[np.bool_]]:
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
    body = Body(robot, a.shape[1])
    step = towards(robot, a, b)
    # The rule on bounds finds what is not a number, or so far away that bisection has no end.
    sane = np.isfinite(step).all(axis=1) & np.isfinite(a).all(axis=1)
    sane &= (np.abs(a) < 1e6 * (1 + obstacles.extent)).all(axis=1)
    rows = np.flatnonzero(sane)
    for first in range(0, len(rows), _MOTIONS):
        some = rows[first : first + _MOTIONS]
        pieces = _whole_motions(obstacles, body, a[some], b[some], step[some], clear)
        pieces.motion = some[pieces.motion]
        stack = [(0, pieces[i : i + _PIECES]) for i in range(0, len(pieces), _PIECES)]
        while stack:
            level, pieces = stack.pop()
            pieces = pieces[hit[pieces.motion] < 0]
            if not len(pieces):
                continue
            Q = a[pieces.motion] + pieces.middle[:, None] * step[pieces.motion]
            apart = _apart(obstacles, body, Q, pieces)
            met = apart < touch
            hit[pieces.motion[met]] = pieces.other[met]
            half = 0.5 ** (level + 1)
            left = pieces[~met & (apart <= pieces.move * half + clear)]
            if level == HALVINGS:
                undecided[left.motion] = True
                continue
            if len(left):
                before, after = left[:], left[:]
                before.middle = left.middle - half / 2
                after.middle = left.middle + half / 2
                stack += _halves(level + 1, before, after)
    return hit, undecided


def _halves(level: int, *pieces: _Pieces) -> Iterator[tuple[int, _Pieces]]:
    for some in pieces:
        for i in range(0, len(some), _PIECES):
            yield level, some[i : i + _PIECES]


def _whole_motions(
    obstacles: Obstacles, body: Body, a: Floats, b: Floats, step: Floats, clear: float
) -> _Pieces:
    """Return whole motions, each with every part and all that the part may hit."""
    n, parts = len(a), len(body.hulls)
    moves = body.moves(a, b, step)
    motion, part = (x.reshape(-1) for x in np.mgrid[:n, :parts])
    vertices, _ = body.placed((a + step / 2)[motion], part)
    room = (moves.reshape(-1) / 2 + clear)[:, None]
    low = np.stack([vertices.real.min(axis=1), vertices.imag.min(axis=1)], axis=1) - room
    high = np.stack([vertices.real.max(axis=1), vertices.imag.max(axis=1)], axis=1) + room
    found = list(near_pairs(low, high, obstacles)) if len(obstacles) else []
    wall = np.flatnonzero(
        (low < obstacles.walls[0]).any(axis=1) | (high > obstacles.walls[1]).any(axis=1)
    )
    rows = np.concatenate([*(i for i, _ in found), wall]).astype(np.int64)
    other = np.concatenate([*(j for _, j in found), np.full(len(wall), obstacles.bounds)])
    two = body.pairs
    return _Pieces(
        motion=np.concatenate([motion[rows], np.repeat(np.arange(n), len(two))]),
        middle=np.full(len(rows) + n * len(two), 0.5),
        part=np.concatenate([part[rows], np.tile(two[:, 0], n)]),
        other=np.concatenate([other, np.full(n * len(two), obstacles.itself)]).astype(np.int64),
        mate=np.concatenate([np.zeros(len(rows), np.int64), np.tile(two[:, 1], n)]),
        move=np.concatenate(
            [moves[motion[rows], part[rows]], moves[:, two].sum(axis=2).reshape(-1)]
        ),
    )


def _apart(obstacles: Obstacles, body: Body, Q: Floats, pieces: _Pieces) -> Floats:
    """Return lower bounds of the distances, below 0 for overlap, shape (n,)."""
    apart, shapes = np.empty(len(pieces)), obstacles.shapes
    vertices, axes = body.placed(Q, pieces.part)
    walls = pieces.other == obstacles.bounds
    if walls.any():
        (x0, y0), (x1, y1) = obstacles.walls
        x, y = vertices[walls].real, vertices[walls].imag
        apart[walls] = np.min([x - x0, y - y0, x1 - x, y1 - y], axis=(0, 2))
    own = pieces.other == obstacles.itself
    if own.any():
        mates = body.placed(Q[own], pieces.mate[own])
        apart[own] = _separation(vertices[own], axes[own], *mates)
    rest = np.flatnonzero(~(walls | own))
    which = pieces.other[rest]
    round_ = obstacles.round[which]
    flat, balls = rest[~round_], rest[round_]
    if len(flat):
        other = pieces.other[flat]
        apart[flat] = _separation(
            vertices[flat], axes[flat], shapes.vertices[other], shapes.axes[other]
        )
    if len(balls):
        other = pieces.other[balls]
        gaps = _from_point(vertices[balls], axes[balls], shapes.vertices[other, 0])
        apart[balls] = gaps - shapes.radius[other]
    return apart


def _along(axes: Complex, vertices: Complex) -> Floats:
    """Return the projection of each vertex on each axis, shape (n, axes, vertices)."""
    return np.asarray(
        axes.real[:, :, None] * vertices.real[:, None]
        + axes.imag[:, :, None] * vertices.imag[:, None]
    )


def _separation(one: Complex, normals: Complex, other: Complex, others: Complex) -> Floats:
    """Return the greatest separation along a normal of either, above 0 if they are disjoint."""
    # Relative to a vertex, so that shapes far from the origin are not rounded more.
    origin = one[:, :1]
    one, other = one - origin, other - origin
    ours = _along(normals, other).min(axis=2) - _along(normals, one).max(axis=2)
    theirs = _along(others, one).min(axis=2) - _along(others, other).max(axis=2)
    return np.asarray(np.maximum(ours.max(axis=1), theirs.max(axis=1)))


def _from_point(shape: Complex, normals: Complex, point: Complex) -> Floats:
    """Return distances of points from shapes, below 0 inside, shape (n,)."""
    offset, sides = point[:, None] - shape, np.roll(shape, -1, axis=1) - shape
    square = np.abs(sides) ** 2
    part = (offset * sides.conj()).real / np.where(square > 0, square, 1.0)
    gap = np.abs(offset - np.clip(part, 0, 1) * sides).min(axis=1)
    origin = shape[:, :1]
    within = _along(normals, (point[:, None] - origin))[:, :, 0] - _along(
        normals, shape - origin
    ).max(axis=2)
    deepest = within.max(axis=1)
    return np.asarray(np.where(deepest < 0, deepest, gap))
