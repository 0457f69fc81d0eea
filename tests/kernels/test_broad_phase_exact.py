"""A million segments for each shape against exact twins, touching and degenerate ones included.

Worlds and segments lie on a lattice of whole numbers, segments within a map of side L, at most
`LARGEST`. There the twins decide in int64 without rounding, and the kernel has to agree with them
exactly, because on a lattice a miss is far larger than the kernel's slack. Where a
segment meets the faces of a box are fractions with its components below the line: two that differ
do so by 1 / L^2, slack is 1e-15. The square of a distance from a ball's centre has the square of
the length below the line, so it differs from that of the radius by 1 / (3 L^2), slack is 1e-13 L^2.
Cross products are whole, slack is 1e-13 L^2.
"""

from collections.abc import Callable
from functools import reduce
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from brrt.kernels.broad_phase import ObstacleGrid, build_obstacle_grid, segment_hits
from brrt.kernels.jit import config, kernel
from brrt.worlds import Grid, World
from tests.support import naive

Array = NDArray[Any]
Floats = NDArray[np.float64]

WORLDS, SEGMENTS = 100, 500 if config.DISABLE_JIT else 10_000
SIDES = (2, 5, 8, 16, LARGEST := 200)
"""Sides of the maps: the cells' borders lie on the lattice, or between its points."""

SIXTHS, SIXTH = 60, 1 / 6
"""A side and a unit of length for the test in floats: nearly all coordinates round."""

NEAR = 1e-8
"""Gaps beyond this are no rounding error of the twins in floats, in maps of side 10."""


@kernel
def check_all(obstacles: ObstacleGrid, A: Floats, B: Floats, hits: NDArray[np.bool_]) -> None:
    """Whether the segment from each row of A to the same row of B touches an obstacle."""
    for i in range(len(A)):
        hits[i] = segment_hits(obstacles, A, i, B, i)


def compiled_hits(world: World, A: Array, B: Array) -> NDArray[np.bool_]:
    """Results of the kernel for all segments."""
    a, b = (np.ascontiguousarray(P, np.float64) for P in (A, B))
    hits = np.zeros(len(A), np.bool_)
    check_all(build_obstacle_grid(world), a, b, hits)
    return hits


def example(world: World, A: Array, B: Array, wrong: NDArray[np.bool_]) -> str:
    """Name the first segment that is wrong, and how many there are."""
    i = int(wrong.argmax())
    return f"{wrong.sum()}, as from {A[i].tolist()} to {B[i].tolist()} in {world.to_json()}"


# The twins return for each segment a number above 0 if it is apart from the obstacle, 0 if it
# touches no more than its border, and below 0 otherwise: the greatest gap along the axes that may
# separate the two. Whole numbers in, whole numbers out.


def box_gap(a: Array, b: Array, box: Array) -> Array:
    """Separating axes of a segment and a box: the box's, and each one's cross product with d.

    Twice the offset of the middles is compared with the sum of both extents.
    """
    d = a.shape[1]
    middle, along, extent = (a + b - box[:d] - box[d:]).T, (b - a).T, box[d:] - box[:d]
    gaps = [abs(middle[k]) - extent[k] - abs(along[k]) for k in range(d)]
    for i, j in ((0, 1), (1, 2), (2, 0))[: 1 if d == 2 else 3]:
        across = abs(middle[i] * along[j] - middle[j] * along[i])
        gap = across - extent[i] * abs(along[j]) - extent[j] * abs(along[i])
        gaps.append(np.where((along[i] == 0) & (along[j] == 0), gaps[0], gap))
    return reduce(np.maximum, gaps)


def ball_gap(a: Array, b: Array, ball: Array) -> Array:
    """Square of the distance of the closest point less that of the radius, times the length's."""
    p, along = (ball[:-1] - a).T, (b - a).T
    forward, square = sum(p * along), sum(along * along)
    here, there = sum(p * p), sum((p - along) ** 2)
    beside = here * square - forward * forward - ball[-1] ** 2 * square
    gap = np.where(forward >= square, there - ball[-1] ** 2, beside)
    return np.asarray(np.where(forward <= 0, here - ball[-1] ** 2, gap))


def polygon_gap(a: Array, b: Array, polygon: Array) -> Array:
    """Separating axes of a segment and a polygon: normals, and a line segment's direction."""
    along, edges = b - a, np.roll(polygon, -1, axis=0) - polygon
    axes = [np.array([-y, x]) for x, y in edges]
    if len(polygon) == 2:
        axes.append(edges[0])
    gaps = []
    for axis in axes:
        p, q, corners = a @ axis, b @ axis, polygon @ axis
        gaps += [corners.min() - np.maximum(p, q), np.minimum(p, q) - corners.max()]
    across = [along[:, 0] * (y - a[:, 1]) - along[:, 1] * (x - a[:, 0]) for x, y in polygon]
    gap = np.maximum(reduce(np.minimum, across), -reduce(np.maximum, across))
    return reduce(np.maximum, [*gaps, np.where((along == 0).all(axis=1), gaps[0], gap)])


def world_gap(world: World, a: Array, b: Array) -> Array:
    """Least gap of each segment to an obstacle, in the segments' type of number."""
    gaps = [
        gap(a, b, shape.astype(a.dtype))
        for gap, shapes in (
            (box_gap, world.boxes),
            (ball_gap, world.balls),
            (polygon_gap, world.polygons),
        )
        for shape in shapes
    ]
    return reduce(np.minimum, gaps)


def world_of(dim: int, side: int, **obstacles: Any) -> World:
    """Make a square or cubic world that reaches from 0 to a side."""
    return World("lattice", np.zeros(dim), np.full(dim, float(side)), **obstacles)


def some(rng: np.random.Generator) -> int:
    """Draw a number of obstacles: mostly few, that cells are large."""
    return int(rng.choice([1, 2, 3, 5, 8, 20]))


def balls(rng: np.random.Generator, dim: int, side: int) -> World:
    """Balls with centres in and around the map; some are points, some reach across half of it."""
    n = some(rng)
    radii = rng.integers(0, 2 + side // 2, (n, 1)) // rng.integers(1, 5, (n, 1))
    return world_of(dim, side, balls=np.hstack([rng.integers(-1, side + 2, (n, dim)), radii]))


def boxes(rng: np.random.Generator, dim: int, side: int) -> World:
    """Boxes in and around the map; some are plates, wires or points."""
    n = some(rng)
    lower = rng.integers(-1, side + 1, (n, dim))
    sides = rng.integers(0, 3 + side // 2, (n, dim)) // rng.integers(1, 4, (n, 1))
    sides *= rng.random((n, dim)) > 1 / 10
    return world_of(dim, side, boxes=np.hstack([lower, lower + sides]))


def polygons(rng: np.random.Generator, dim: int, side: int) -> World:
    """Convex polygons and line segments, in and around the map."""
    n, hulls = some(rng), list[Array]()
    while len(hulls) < n:
        reach = rng.integers(1, 2 + side // 2)
        offsets = rng.integers(-reach, reach + 1, (rng.integers(2, 8), dim))
        corners = hull(rng.integers(-1, side + 2, dim) + offsets)
        hulls += [corners] if len(corners) > 1 else []
    return world_of(dim, side, polygons=hulls)


def cells(rng: np.random.Generator, dim: int, side: int) -> World:
    """Blocked cells as boxes: any on small maps, else rectangles; around the map too, and one."""
    edge = int(rng.choice([edge for edge in (1, 2, 4) if side % edge == 0]))
    n = side // edge
    if n <= 8:
        lower = np.argwhere(rng.random((n + 2, n + 2)) < rng.choice([0.1, 0.3, 0.6])) - 1
        upper = lower + 1
    else:
        lower = rng.integers(-1, n + 1, (some(rng), dim))
        upper = np.minimum(lower + rng.integers(1, 2 + n // 4, lower.shape), n + 1)
    blocked = np.hstack([lower, upper])
    return world_of(dim, side, boxes=edge * np.vstack([blocked, [-1, -1, 0, 0]]))


def painted(world: World, unit: float) -> World:
    """The world as `scaled` returns it, a grid in place of boxes; cells as large as may be."""
    borders = world.boxes.astype(np.int64)
    edge = np.gcd.reduce(borders, axis=None)
    n = int(world.extent) // edge + 2
    taken = np.zeros((n, n), np.bool_)
    for x0, y0, x1, y1 in borders // edge + 1:
        taken[y0:y1, x0:x1] = True
    grid = Grid(taken, np.full(2, -edge * unit), edge * unit)
    return World("painted", world.lower, world.upper * unit, grid=grid)


def scaled(world: World, unit: float) -> World:
    """The world in another unit of length."""
    hulls = tuple(corners * unit for corners in world.polygons)
    balls, boxes = world.balls * unit, world.boxes * unit
    return World("scaled", world.lower, world.upper * unit, balls, boxes, polygons=hulls)


def hull(points: Array) -> Array:
    """Convex hull of points of a lattice: from left to right below, and back above."""
    rows = sorted({(int(x), int(y)) for x, y in points})
    corners: list[tuple[int, int]] = []
    for way in (rows, rows[::-1]):
        first = len(corners)
        for x, y in way:
            while len(corners) > first + 1:
                (ux, uy), (vx, vy) = corners[-2:]
                if (vx - ux) * (y - uy) - (vy - uy) * (x - ux) > 0:
                    break
                corners.pop()
            corners.append((x, y))
        corners.pop()
    return np.array(corners)


def landmarks(world: World) -> Array:
    """Points where obstacles end: corners, and centres and outermost points of balls."""
    d = world.dim
    found = [world.balls[:, :d] + world.balls[:, d:] * axis for axis in (*np.eye(d), *-np.eye(d))]
    found += [world.balls[:, :d], *world.polygons]
    sides = world.boxes.reshape(-1, 2, d)
    found += [sides[:, which, np.arange(d)] for which in np.ndindex(*[2] * d)]
    return np.concatenate(found)


def segments(rng: np.random.Generator, world: World, n: int) -> tuple[Array, Array]:
    """Draw segments between points of the lattice, of six kinds in equal parts.

    Between any two points; of no length; along an axis or in a plane of axes; of length one or
    so; through or up to a landmark; between two landmarks.
    """
    side, d = int(world.extent), world.dim
    marks = np.array([*landmarks(world), world.upper]).astype(np.int64)
    marks = marks[((marks >= 0) & (marks <= side)).all(axis=1)]
    a, b = rng.integers(0, side + 1, (2, n, d))
    at, other = marks[rng.integers(0, len(marks), (2, n))]
    beyond = 2 * at - a
    ends = [
        (a, b),
        (np.where(rng.random((n, 1)) < 0.5, a, at),) * 2,
        (a, np.where(rng.random((n, d)) < 0.6, a, b)),
        (a, np.clip(a + rng.integers(-1, 2, (n, d)), 0, side)),
        (a, np.where(((beyond >= 0) & (beyond <= side)).all(axis=1)[:, None], beyond, at)),
        (at, other),
    ]
    kinds = np.arange(n) % len(ends)
    A, B = np.stack(ends)[kinds, :, np.arange(n)].transpose(1, 0, 2)
    return A, B


def floats(rng: np.random.Generator, lattice: World, n: int) -> tuple[Floats, Floats]:
    """Draw segments of all lengths in a map of a sixth; one in 50 is a sixth of the lattice's."""
    a, b = rng.uniform(0, lattice.extent * SIXTH, (2, n, lattice.dim))
    b = a + (b - a) * 10 ** -rng.uniform(0, 4, (n, 1))
    c, d = segments(rng, lattice, max(20, n // 50))
    return np.concatenate([a, c * SIXTH]), np.concatenate([b, d * SIXTH])


SHAPES = pytest.mark.parametrize(
    ("draw", "dim", "built"),
    [
        (balls, 2, scaled),
        (balls, 3, scaled),
        (boxes, 2, scaled),
        (boxes, 3, scaled),
        (polygons, 2, scaled),
        (cells, 2, painted),
    ],
    ids=["balls2d", "balls3d", "boxes2d", "boxes3d", "polygons2d", "cells2d"],
)
Draw = Callable[[np.random.Generator, int, int], World]
Built = Callable[[World, float], World]


@SHAPES
def test_a_million_segments_on_a_lattice(draw: Draw, dim: int, built: Built) -> None:
    """The kernel agrees exactly, both ways round; the million has enough grazing segments."""
    rng = np.random.default_rng(dim)
    seen = np.zeros(3)
    for k in range(WORLDS):
        world = draw(rng, dim, SIDES[k % len(SIDES)])
        a, b = segments(rng, world, SEGMENTS)
        gap = world_gap(world, a, b)
        for p, q in ((a, b), (b, a)):
            wrong = compiled_hits(built(world, 1.0), p, q) != (gap <= 0)
            assert not wrong.any(), f"wrong: {example(world, p, q, wrong)}"
        seen += np.bincount(np.sign(gap) + 1, minlength=3)
    within, grazing, free = seen / (WORLDS * SEGMENTS)
    assert min(within, grazing, free) > 0.05


@SHAPES
def test_segments_in_floats(draw: Draw, dim: int, built: Built) -> None:
    """Twins in floats decide, except where the gap may be a rounding error; there fractions do.

    A segment that touches is never free, and a hit at least nearly touches.
    """
    rng = np.random.default_rng(10 + dim)
    close = 0
    for _ in range(WORLDS // 4):
        lattice = draw(rng, dim, SIXTHS)
        world, (a, b) = scaled(lattice, SIXTH), floats(rng, lattice, SEGMENTS)
        gap, hit = world_gap(world, a, b), compiled_hits(built(lattice, SIXTH), a, b)
        wrong = (hit != (gap < 0)) & (abs(gap) > NEAR)
        assert not wrong.any(), f"wrong: {example(world, a, b, wrong)}"
        for i in np.flatnonzero(abs(gap) <= NEAR):
            touches = naive.hits(world, a[i], b[i])
            right = touches if hit[i] else not touches
            nearly = hit[i] and naive.nearly_hits(world, a[i], b[i])
            assert right or nearly, f"{hit[i]} from {a[i].tolist()} to {b[i].tolist()}: {world}"
            close += 1
    assert close > 50


@SHAPES
def test_twins_against_fractions(draw: Draw, dim: int, built: Built) -> None:
    """The twins, which use other formulas, agree with fractions."""
    rng = np.random.default_rng(20 + dim)
    for side in SIDES:
        for _ in range(4):
            world = draw(rng, dim, side)
            a, b = segments(rng, world, 60)
            solid = built(world, 1.0).without_grid()
            touches = [naive.hits(solid, p, q) for p, q in zip(a, b, strict=True)]
            assert ((world_gap(world, a, b) <= 0) == touches).all()
