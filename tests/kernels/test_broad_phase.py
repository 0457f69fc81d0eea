"""The compiled collision test against exact arithmetic.

A segment that touches is never free, and a hit at least nearly touches.
"""

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from brrt.kernels.broad_phase import ObstacleGrid, build_obstacle_grid, segment_hits
from brrt.kernels.jit import kernel
from brrt.worlds import World
from tests.support import naive

Floats = NDArray[np.float64]
Segment = tuple[Floats, Floats]

DIMS = pytest.mark.parametrize("dim", [2, 3])
MANY = settings(max_examples=200, deadline=None)


def world_of(
    dim: int, *, low: float = 0.0, high: float = 10.0, balls: object = (), boxes: object = ()
) -> World:
    """A square or cubic world."""
    balls, boxes = (np.array(rows, dtype=np.float64) for rows in (balls, boxes))
    return World("test", np.full(dim, low), np.full(dim, high), balls, boxes)


@kernel
def first_to_second(obstacles: ObstacleGrid, ends: Floats) -> bool:
    """Whether the segment between two rows touches an obstacle."""
    return segment_hits(obstacles, ends, 0, ends, 1)


def compiled_hits(obstacles: ObstacleGrid, a: Floats, b: Floats) -> bool:
    """Result of the kernel for one segment."""
    return bool(first_to_second(obstacles, np.array([a, b])))


def check(world: World, segments: Iterator[Segment] | list[Segment]) -> None:
    """Compare the kernel with the exact test, for each segment in both directions."""
    obstacles = build_obstacle_grid(world)
    for a, b in segments:
        touches = naive.hits(world, a, b)
        for p, q in ((a, b), (b, a)):
            hit = compiled_hits(obstacles, p, q)
            where = f"from {p.tolist()} to {q.tolist()} in {world.to_json()}"
            assert hit or not touches, f"free, but touches: {where}"
            assert touches or not hit or naive.nearly_hits(world, p, q), f"no hit: {where}"


def check_exactly(world: World, segments: Iterator[Segment] | list[Segment]) -> None:
    """Compare the kernel with the exact test where rounding does not matter."""
    obstacles = build_obstacle_grid(world)
    for a, b in segments:
        hit, touches = compiled_hits(obstacles, a, b), naive.hits(world, a, b)
        assert hit == touches, f"from {a.tolist()} to {b.tolist()} in {world.to_json()}"


def random_world(rng: np.random.Generator, dim: int, n: int, largest: float = 3.0) -> World:
    """Up to n balls and n boxes in and around [0, 10]^d, of sizes from tiny to largest."""
    balls, boxes = (int(k) for k in rng.integers(0, n + 1, 2))
    sizes = largest * 10.0 ** -rng.uniform(0, 6, (balls, 1))
    corners = rng.uniform(-2, 12, (boxes, dim))
    sides = largest * 10.0 ** -rng.uniform(0, 6, (boxes, dim))
    return world_of(
        dim,
        balls=np.hstack([rng.uniform(-2, 12, (balls, dim)), sizes]),
        boxes=np.hstack([corners, corners + sides]),
    )


def random_segments(rng: np.random.Generator, dim: int, n: int) -> Iterator[Segment]:
    """Segments within [0, 10]^d, of lengths from tiny to the whole map; some follow an axis."""
    for _ in range(n):
        a = rng.uniform(0, 10, dim)
        b = np.clip(a + 10.0 ** rng.uniform(-4, 1) * rng.uniform(-1, 1, dim), 0, 10)
        still = rng.random(dim) < 0.2
        yield a, np.where(still, a, b)


def grazing_segments(rng: np.random.Generator, world: World, n: int) -> Iterator[Segment]:
    """Segments that touch an obstacle, or miss it by a rounding error or by a few."""
    dim, rows = world.dim, len(world.balls) + len(world.boxes)
    for row in rng.integers(0, rows, n) if rows else ():
        along = rng.normal(size=dim)
        if row < len(world.balls):
            ball = world.balls[row]
            outward = rng.normal(size=dim)
            outward /= np.linalg.norm(outward)
            along -= along @ outward * outward
            touched = ball[:dim] + ball[dim] * outward
        else:
            box = world.boxes[row - len(world.balls)].reshape(2, dim)
            touched = box[rng.integers(0, 2, dim), np.arange(dim)]
        along *= 10.0 ** rng.uniform(-3, 1)
        touched = touched + rng.integers(-3, 4, dim) * np.spacing(touched)
        before, after = rng.choice([0.0, 0.3, 1.0], 2)
        a, b = touched - before * along, touched + after * along
        if world.inside(a) and world.inside(b):
            yield a, b


@DIMS
def test_random_segments(dim: int) -> None:
    """Random segments among random obstacles."""
    rng = np.random.default_rng(dim)
    for n in (1, 3, 10, 30, 100):
        for _ in range(6):
            check(random_world(rng, dim, n), random_segments(rng, dim, 60))


@DIMS
def test_grazing_segments(dim: int) -> None:
    """Segments through corners and along tangents, where rounding decides."""
    rng = np.random.default_rng(10 + dim)
    for n in (1, 3, 30):
        for _ in range(8):
            world = random_world(rng, dim, n)
            check(world, grazing_segments(rng, world, 60))


@DIMS
@pytest.mark.parametrize("offset", [1e3, 5e6, 1e9, 1e12, -1e9])
def test_far_from_the_origin(dim: int, offset: float) -> None:
    """Maps in coordinates like UTM's, whose own digits are few."""
    rng = np.random.default_rng(20 + dim)
    for _ in range(6):
        near = random_world(rng, dim, 30)
        balls, boxes = near.balls.copy(), near.boxes + offset
        balls[:, :dim] += offset
        world = world_of(dim, low=offset, high=offset + 10, balls=balls, boxes=boxes)
        moved = [(a + offset, b + offset) for a, b in random_segments(rng, dim, 40)]
        inside = [(a, b) for a, b in moved if world.inside(a) and world.inside(b)]
        check(world, inside)
        check(world, grazing_segments(rng, world, 40))


@DIMS
@pytest.mark.parametrize("offset", [0.0, 1e6, 1e10, 1e12])
def test_corners_of_cells_far_from_the_origin(dim: int, offset: float) -> None:
    """Point obstacles near the corners of cells, each touched by segments of few digits."""
    rng = np.random.default_rng(80 + dim)
    ulp = np.spacing(max(offset, 10.0))
    filler = world_of(dim, low=offset, high=offset + 10, boxes=[[offset] * 2 * dim] * 2000)
    cells = build_obstacle_grid(filler)
    corners = offset + rng.integers(0, cells.shape, (2000, dim)) * cells.cell
    corners += rng.integers(-3, 4, corners.shape) * ulp
    world = world_of(dim, low=offset, high=offset + 10, boxes=np.hstack([corners, corners]))
    obstacles = build_obstacle_grid(world)
    for corner in corners[:1500]:
        along = np.round(rng.uniform(-1000, 1000, dim) * 10.0 ** rng.uniform(0, 3)) * ulp
        a, b = corner - along, corner + along
        exactly_half_way = (corner - a == b - corner).all()
        if exactly_half_way and world.inside(a) and world.inside(b):
            assert compiled_hits(obstacles, a, b), (a.tolist(), b.tolist(), corner.tolist())


@DIMS
@pytest.mark.parametrize("scale", [1e-90, 1e-30, 1e-6, 1e6, 1e30, 1e90])
def test_any_unit_of_length(dim: int, scale: float) -> None:
    """Nothing depends on the unit, down to where squares leave the range of floats."""
    rng = np.random.default_rng(30 + dim)
    for _ in range(3):
        unit = random_world(rng, dim, 20)
        world = world_of(dim, high=10 * scale, balls=unit.balls * scale, boxes=unit.boxes * scale)
        moved = [(a * scale, b * scale) for a, b in random_segments(rng, dim, 40)]
        check(world, [(a, b) for a, b in moved if world.inside(a) and world.inside(b)])
        check(world, grazing_segments(rng, world, 40))


@DIMS
@pytest.mark.parametrize("flat", [1e-30, 1e-3, 1e3, 1e30])
def test_long_or_flat_bounds(dim: int, flat: float) -> None:
    """Bounds that are much longer along one axis than along the others."""
    rng = np.random.default_rng(40 + dim)
    stretch = np.ones(dim)
    stretch[-1] = flat
    for _ in range(3):
        unit = random_world(rng, dim, 20)
        world = World(
            "flat", np.zeros(dim), 10 * stretch, unit.balls, unit.boxes * np.tile(stretch, 2)
        )
        moved = [(a * stretch, b * stretch) for a, b in random_segments(rng, dim, 40)]
        check(world, [(a, b) for a, b in moved if world.inside(a) and world.inside(b)])


@DIMS
@pytest.mark.parametrize("size", [1e-100, 1e-70, 1e100])
def test_tiny_and_huge_maps_get_a_grid(dim: int, size: float) -> None:
    """Nothing overflows or runs on for ever while the obstacles are entered."""
    boxes = [[0.2 * size] * dim + [0.4 * size] * dim] * 20
    obstacles = build_obstacle_grid(world_of(dim, high=size, boxes=boxes))
    inside, far = np.full(dim, 0.3 * size), np.full(dim, 0.9 * size)
    assert compiled_hits(obstacles, inside, far)
    assert not compiled_hits(obstacles, 0.6 * far, far)


@st.composite
def lattice_cases(draw: st.DrawFn) -> tuple[World, list[Segment]]:
    """Worlds and segments in small whole numbers, so that touching is frequent and exact."""
    dim = draw(st.sampled_from([2, 3]))
    anywhere = st.lists(st.integers(-4, 14), min_size=dim, max_size=dim)
    within = st.lists(st.integers(0, 10), min_size=dim, max_size=dim)
    sizes = st.integers(0, 5)
    balls = draw(st.lists(st.tuples(anywhere, sizes), max_size=4))
    boxes = draw(st.lists(st.tuples(anywhere, st.lists(sizes, min_size=dim, max_size=dim))))
    world = world_of(
        dim,
        balls=[[*centre, radius] for centre, radius in balls],
        boxes=[[*low, *np.add(low, sides)] for low, sides in boxes],
    )
    ends = draw(st.lists(st.tuples(within, within), min_size=1, max_size=20))
    return world, [(np.array(a, float), np.array(b, float)) for a, b in ends]


@MANY
@given(lattice_cases())
def test_whole_numbers_agree_exactly(case: tuple[World, list[Segment]]) -> None:
    """On a lattice the kernel and the exact test agree, touching included."""
    check_exactly(*case)


@DIMS
def test_every_segment_of_a_small_lattice(dim: int) -> None:
    """Every segment between lattice points around one box and one ball: faces, edges, corners."""
    points = np.stack(np.meshgrid(*[np.arange(5.0)] * dim), axis=-1).reshape(-1, dim)
    rng = np.random.default_rng(dim)
    pairs = rng.integers(0, len(points), (1500, 2)) if dim == 3 else np.indices((25, 25)).T
    segments = [(points[i], points[j]) for i, j in np.reshape(pairs, (-1, 2))]
    check_exactly(world_of(dim, high=4.0, boxes=[[1.0] * dim + [3.0] * dim]), segments)
    check_exactly(world_of(dim, high=4.0, balls=[[2.0] * dim + [1.0]]), segments)
    check_exactly(
        world_of(dim, high=4.0, boxes=[[2.0] * 2 * dim], balls=[[1.0] * dim + [0]]), segments
    )


@st.composite
def border_cases(draw: st.DrawFn) -> tuple[World, list[Segment]]:
    """Obstacles and segments whose coordinates lie on the borders of the grid's cells."""
    dim = draw(st.sampled_from([2, 3]))
    n = draw(st.integers(1, 6))
    size = draw(st.sampled_from([1.0, 0.3, 7.7, 100.0]))
    filler = world_of(dim, high=size, boxes=[[0.0] * 2 * dim] * n)
    cells = build_obstacle_grid(filler)
    borders = [
        st.sampled_from([min(k * cell, size) for k in range(count + 1)])
        for cell, count in zip(cells.cell, cells.shape, strict=True)
    ]
    point = st.tuples(*borders)
    boxes = [np.sort([draw(point), draw(point)], axis=0).ravel() for _ in range(n)]
    world = world_of(dim, high=size, boxes=boxes)
    ends = draw(st.lists(st.tuples(point, point), min_size=1, max_size=20))
    return world, [(np.array(a), np.array(b)) for a, b in ends]


@MANY
@given(border_cases())
def test_on_the_borders_of_cells(case: tuple[World, list[Segment]]) -> None:
    """Walks along, through and onto the borders and corners of cells miss no obstacle."""
    check(*case)


coordinates = st.floats(0, 10) | st.sampled_from([0.0, 5.0, 10.0, 1e-300, 5e-324, 1e-9, 4.999])


@MANY
@given(
    st.sampled_from([2, 3]),
    st.lists(coordinates, min_size=30, max_size=30),
    st.sampled_from([0.0, 1e-100, 1e-80, 1e-9, 1.0, 5.0, 1e3]),
)
@example(2, [0.0, 1e-300] * 15, 0.0)
@example(3, [5.0, 1e-300, 0.0] * 10, 5.0)
def test_odd_numbers(dim: int, numbers: list[float], radius: float) -> None:
    """Coordinates that hypothesis likes: zeros, subnormals, equal ones, neighbours."""
    points = np.array(numbers).reshape(-1, dim)
    boxes = [
        np.concatenate([points[k : k + 2].min(axis=0), points[k : k + 2].max(axis=0)])
        for k in (0, 2)
    ]
    world = world_of(dim, balls=[[*points[4], radius], [*points[5], 0.5]], boxes=boxes)
    check(world, list(pairwise(points[5:])))


@MANY
@given(st.sampled_from([2, 3]), st.floats(-1, 1), st.integers(0, 2), st.booleans())
def test_tiny_components(dim: int, along: float, axis: int, down: bool) -> None:
    """A component near zero neither hides an obstacle nor adds one."""
    assume(axis < dim)
    tiny = np.full(dim, 1e-300 if not down else -1e-300)
    a = np.full(dim, 5.0)
    a[axis] = 0.0 if not down else 1e-300
    b = a + tiny
    b[(axis + 1) % dim] += 3 * along
    world = world_of(
        dim,
        boxes=[[5.0] * dim + [6.0] * dim, [2.0] * dim + [4.0] * dim],
        balls=[[5.0] * dim + [1.0], [7.0] * dim + [2.0]],
    )
    check(world, [(a, np.clip(b, 0, 10))])


@pytest.mark.parametrize(
    ("a", "b", "touches"),
    [
        ((0, 4), (10, 4), True),  # along the lower face
        ((0, 6), (10, 6), True),  # along the upper face
        ((4, 0), (4, 10), True),
        ((6, 10), (6, 0), True),
        ((0, 4), (4, 4), True),  # up to a corner
        ((3, 5), (5, 3), True),  # through a corner
        ((2, 4), (4, 2), False),
        ((0, 3.9999999), (10, 3.9999999), False),
        ((6.0000001, 0), (6.0000001, 10), False),
        ((5, 5), (5, 5), True),  # no length: inside,
        ((4, 5), (4, 5), True),  # on a face,
        ((6, 6), (6, 6), True),  # on a corner,
        ((3, 5), (3, 5), False),  # outside
        ((5, 5), (5.5, 5.5), True),  # within
        ((0, 5), (3.9999999, 5), False),
        ((0, 5), (4, 5), True),
    ],
)
@pytest.mark.parametrize("dim", [2, 3])
def test_box_by_hand(
    dim: int,
    a: tuple[float, float],
    b: tuple[float, float],
    touches: bool,
) -> None:
    """Cases around the box from 4 to 6."""
    world = world_of(dim, boxes=[[4.0] * dim + [6.0] * dim])
    p, q = (np.array([*end, 4.0][:dim]) for end in (a, b))
    assert naive.hits(world, p, q) is touches
    check_exactly(world, [(p, q), (q, p)])


@pytest.mark.parametrize(
    ("a", "b", "touches"),
    [
        ((0, 3), (10, 3), True),  # tangent
        ((7, 0), (7, 10), True),
        ((0, 2.9999999), (10, 2.9999999), False),
        ((0, 5), (3, 5), True),  # ends on the border
        ((0, 5), (2.9999999, 5), False),
        ((3, 5), (3, 5), True),  # no length: on the border,
        ((5, 5), (5, 5), True),  # at the centre,
        ((3, 3), (3, 3), False),  # outside
        ((5, 5), (5, 6), True),  # within
        ((0, 5), (10, 5), True),
        ((8, 5), (10, 5), False),  # the line would hit, the segment does not
    ],
)
@pytest.mark.parametrize("dim", [2, 3])
def test_ball_by_hand(
    dim: int,
    a: tuple[float, float],
    b: tuple[float, float],
    touches: bool,
) -> None:
    """The same around the ball of radius 2 at 5."""
    world = world_of(dim, balls=[[5.0] * dim + [2.0]])
    p, q = (np.array([*end, 5.0][:dim]) for end in (a, b))
    assert naive.hits(world, p, q) is touches
    check_exactly(world, [(p, q), (q, p)])


@DIMS
def test_no_obstacles(dim: int) -> None:
    """An empty world is free everywhere."""
    rng = np.random.default_rng(dim)
    check_exactly(world_of(dim), list(random_segments(rng, dim, 50)))


@DIMS
def test_obstacles_beyond_the_bounds(dim: int) -> None:
    """Obstacles outside the bounds do not matter; those that reach inside do, at any size."""
    rng = np.random.default_rng(dim)
    beyond = [[-9.0] * dim + [-1.0] * dim, [11.0] * dim + [1e9] * dim]
    reaching = [[9.0] * dim + [1e9] * dim, [-1e9] * dim + [0.5] * dim]
    balls = [[-1e6] + [5.0] * (dim - 1) + [1e6 + 1]]
    segments = list(random_segments(rng, dim, 200))
    check_exactly(world_of(dim, boxes=beyond), segments)
    check_exactly(world_of(dim, boxes=beyond + reaching), segments)
    check(world_of(dim, boxes=beyond, balls=balls), segments)


@DIMS
def test_an_obstacle_as_large_as_the_map(dim: int) -> None:
    """Inside a box or ball that covers everything, everything hits."""
    rng = np.random.default_rng(dim)
    for world in (
        world_of(dim, boxes=[[-1e12] * dim + [1e12] * dim]),
        world_of(dim, balls=[[5.0] * dim + [100.0]]),
    ):
        obstacles = build_obstacle_grid(world)
        assert all(compiled_hits(obstacles, a, b) for a, b in random_segments(rng, dim, 30))


@DIMS
@pytest.mark.parametrize("radius", [0.0, 1e-12, 1e-6, 1e-4, 1e-2])
def test_very_small_balls(dim: int, radius: float) -> None:
    """A long motion past a ball that is thin as a wire is free unless it touches."""
    rng = np.random.default_rng(50 + dim)
    balls = np.column_stack([rng.uniform(3, 7, (5, dim)), np.full(5, radius)])
    world = world_of(dim, balls=balls)
    segments = []
    for ball in balls:
        for miss in (0.0, 0.5, 1.0, 1.5, 2.0):
            side = np.eye(dim)[0] * miss * (radius + 1e-8)
            along = rng.normal(size=dim)
            along *= 3 / np.linalg.norm(along)
            segments.append((ball[:dim] + side - along, ball[:dim] + side + along))
    check(world, segments)


@DIMS
def test_thin_walls(dim: int) -> None:
    """A wall without thickness stops every motion that crosses it."""
    rng = np.random.default_rng(60 + dim)
    wall = [3.3] + [0.0] * (dim - 1) + [3.3] + [10.0] * (dim - 1)
    world = world_of(dim, boxes=[wall])
    segments = list(random_segments(rng, dim, 300))
    check(world, segments)
    assert any(naive.hits(world, a, b) for a, b in segments)


@DIMS
def test_many_obstacles_share_cells(dim: int) -> None:
    """Thousands of overlapping obstacles: the grid stays small and loses none."""
    rng = np.random.default_rng(70 + dim)
    low = rng.uniform(0, 9, (3000, dim))
    world = world_of(dim, boxes=np.hstack([low, low + rng.uniform(0.01, 4, (3000, dim))]))
    obstacles = build_obstacle_grid(world)
    assert len(obstacles.items) <= 64 * 3000 + 4096
    check(world, random_segments(rng, dim, 30))


# Polygons


def polygon_world(rng: np.random.Generator, n: int) -> World:
    """Convex polygons and line segments in and around [0, 10]^2, of sizes from tiny to large."""
    polygons = []
    for _ in range(n):
        k = int(rng.integers(2, 9))
        angles = (np.arange(k) + rng.uniform(-0.3, 0.3, k)) * 2 * np.pi / k
        size = 3 * 10.0 ** -rng.uniform(0, 5)
        corners = size * np.stack([np.cos(angles), rng.uniform(0.1, 1) * np.sin(angles)], axis=1)
        polygons.append(rng.uniform(-2, 12, 2) + corners)
    return World("polygons", np.zeros(2), np.full(2, 10.0), polygons=tuple(polygons))


def test_random_segments_among_polygons() -> None:
    """Random segments, and segments along edges and through corners."""
    rng = np.random.default_rng(90)
    for n in (1, 3, 10, 30):
        for _ in range(4):
            world = polygon_world(rng, n)
            check(world, random_segments(rng, 2, 60))
            touching = []
            for _ in range(60):
                polygon = world.polygons[rng.integers(n)]
                u, v = (polygon[k % len(polygon)] for k in rng.integers(0, 2) + np.arange(2))
                along = rng.normal(size=2) if rng.random() < 0.5 else v - u
                along *= 10.0 ** rng.uniform(-2, 1)
                before, after = rng.choice([0.0, 0.3, 1.0], 2)
                a, b = v - before * along, v + after * along
                if world.inside(a) and world.inside(b):
                    touching.append((a, b))
            check(world, touching)


@MANY
@given(st.data())
def test_polygons_on_a_lattice_agree_exactly(data: st.DataObject) -> None:
    """In small whole numbers nothing rounds: touching is decided exactly."""
    corner = st.tuples(st.integers(0, 10), st.integers(0, 10))
    shapes = st.lists(st.lists(corner, min_size=2, max_size=3, unique=True), max_size=5)
    polygons = [
        np.array(shape, float)
        for shape in data.draw(shapes)
        if len(shape) == 2 or np.linalg.det(np.diff(shape, axis=0)) != 0
    ]
    world = World("lattice", np.zeros(2), np.full(2, 10.0), polygons=tuple(polygons))
    ends = data.draw(st.lists(st.tuples(corner, corner), min_size=1, max_size=20))
    check_exactly(world, [(np.array(a, float), np.array(b, float)) for a, b in ends])
