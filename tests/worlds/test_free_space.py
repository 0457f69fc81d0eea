"""Occupied points, free share and connectivity, against slow and obvious implementations."""

import itertools
from collections.abc import Callable, Sequence
from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from brrt.worlds import World, make_world
from brrt.worlds.free_space import connected, free_fraction, occupied
from brrt.worlds.obstacle_arrays import obstacle_arrays
from brrt.worlds.occupancy import Grid
from brrt.worlds.rasterize import Raster, components
from tests.support import naive

Floats = NDArray[np.float64]

DIMS = pytest.mark.parametrize("dim", [2, 3])
seeds = st.integers(0, 2**32)


def halves(rng: np.random.Generator, low: float, high: float, shape: tuple[int, ...]) -> Floats:
    """Draw multiples of one half, so that contacts are exact."""
    return rng.integers(round(2 * low), round(2 * high), shape, endpoint=True) / 2


def made(name: str, upper: Sequence[float], **obstacles: Any) -> World:
    """Make a world from 0 to `upper`."""
    return World(name, np.zeros(len(upper)), np.array(upper, float), **obstacles)


def some_world(seed: int, dim: int, *, most: int = 6, exactly: bool = True) -> World:
    """Draw obstacles of every kind in and around a box from 0 to 10; some have no size."""
    rng = np.random.default_rng(seed)
    draw = halves if exactly else (lambda rng, low, high, shape: rng.uniform(low, high, shape))
    count = rng.integers(0, most + 1, 3)
    balls = np.concatenate([draw(rng, -1, 11, (count[0], dim)), draw(rng, 0, 2, (count[0], 1))], 1)
    least = draw(rng, -1, 10, (count[1], dim))
    boxes = np.concatenate([least, least + draw(rng, 0, 3, (count[1], dim))], axis=1)
    polygons = []
    for centre in draw(rng, 0, 10, (count[2] if dim == 2 else 0, 2)):
        corners = int(rng.integers(2, 5))
        shape = np.array([[-1, -0.5], [1, -1], [1.5, 1], [-0.5, 2]])[:corners]
        polygons.append(centre + shape * draw(rng, 0.5, 2, (1, 1)) * [[rng.choice([-1, 1]), 1]])
    return World("some", np.zeros(dim), np.full(dim, 10.0), balls, boxes, polygons=tuple(polygons))


def touches(world: World, point: Sequence[float] | Floats) -> bool:
    """Whether an obstacle touches a point, by exact arithmetic."""
    tests: list[tuple[Callable[..., bool], Sequence[Floats] | Floats]] = [
        (naive.segment_hits_ball, world.balls),
        (naive.segment_hits_box, world.boxes),
        (naive.segment_hits_polygon, world.polygons),
    ]
    return any(hits(point, point, shape) for hits, shapes in tests for shape in shapes)


def cell_touched(world: World, low: Floats, high: Floats, margin: float) -> bool:
    """Whether an obstacle touches a closed cell, widened by a margin, by exact arithmetic."""
    low, high = low - margin, high + margin
    d = world.dim
    for box in world.boxes:
        if (box[:d] <= high).all() and (low <= box[d:]).all():
            return True
    for *centre, radius in world.balls:
        nearest = naive.exact(np.clip(centre, low, high))
        apart = sum((a - b) ** 2 for a, b in zip(naive.exact(centre), nearest, strict=True))
        if apart <= Fraction(float(radius)) ** 2:
            return True
    around = np.array([low, [high[0], low[1]], high, [low[0], high[1]]]) if d == 2 else np.empty(0)
    for polygon in world.polygons:
        if any(naive.segment_hits_box(v, v, np.concatenate([low, high])) for v in polygon):
            return True
        sides = zip(around, np.roll(around, -1, axis=0), strict=True)
        if any(naive.segment_hits_polygon(a, b, polygon) for a, b in sides):
            return True
    return False


def flooded(free: NDArray[np.bool_], start: tuple[int, ...]) -> set[tuple[int, ...]]:
    """Return the cells that a walk through faces reaches."""
    seen, ahead = {start}, [start]
    while ahead:
        cell = ahead.pop()
        for axis, step in itertools.product(range(free.ndim), (-1, 1)):
            beside = (*cell[:axis], cell[axis] + step, *cell[axis + 1 :])
            inside = 0 <= beside[axis] < free.shape[axis]
            if inside and free[beside] and beside not in seen:
                seen.add(beside)
                ahead.append(beside)
    return seen


# Points


@DIMS
@settings(max_examples=60)
@given(seeds, st.integers(0, 60), st.booleans())
def test_points_are_covered_as_arithmetic_has_it(
    dim: int, seed: int, count: int, exactly: bool
) -> None:
    """Points inside, on the edge of and outside every kind of obstacle, also outside the bounds."""
    world = some_world(seed, dim, exactly=exactly)
    points = halves(np.random.default_rng(seed + 1), -2, 12, (count, dim))
    assert occupied(world, points).tolist() == [touches(world, point) for point in points]


@pytest.mark.parametrize(
    "spec",
    [
        "circles2d:n=1000,min_radius=0.1,max_radius=1",
        "boxes2d:n=300",
        "polygons2d:n=300,max_radius=4,max_corners=40",
        "boxes3d:n=3000,min_side=0.5,max_side=6",
        "spheres3d:n=300",
    ],
)
def test_many_obstacles_cover_what_each_of_them_covers(spec: str) -> None:
    """Many obstacles and points give the same as single tests."""
    world = make_world(spec)
    points = np.random.default_rng(5).uniform(world.lower, world.upper, (1000, world.dim))
    expected = [world.obstacle_at(point) is not None for point in points]
    assert 0.05 < np.mean(expected) < 0.95
    assert occupied(world, points).tolist() == expected


@DIMS
@pytest.mark.parametrize("scale", [1e-90, 1e-3, 1e12, 1e90])
def test_points_are_covered_at_every_scale(dim: int, scale: float) -> None:
    """Scaling a world and its points changes nothing."""
    world = some_world(11, dim, most=20, exactly=False)
    points = np.random.default_rng(1).uniform(-1, 11, (500, dim))
    grown = World(
        "grown", world.lower * scale, world.upper * scale, world.balls * scale,
        world.boxes * scale, polygons=tuple(polygon * scale for polygon in world.polygons),
    )  # fmt: skip
    assert (occupied(grown, points * scale) == occupied(world, points)).all()
    assert occupied(world, points).any()


# Share


@pytest.mark.parametrize(
    ("world", "share"),
    [
        (made("ball", [10, 10], balls=[[4, 5, 3.1]]), 1 - np.pi * 3.1**2 / 100),
        (made("box", [10, 1], boxes=[[4, 0.1, 7.345, 7]]), 1 - 3.345 * 0.9 / 10),
        (made("sphere", [9] * 3, balls=[[4, 5, 4, 3]]), 1 - 4 / 3 * np.pi * 27 / 729),
        (made("tiny", [1, 1], boxes=[[0.5, 0.5, 0.5003, 0.5003]]), 1 - 0.0003**2),
    ],
    ids=lambda value: value.name if isinstance(value, World) else "",
)
def test_the_standard_error_is_honest(world: World, share: float) -> None:
    """Over many seeds the deviation from the true share agrees with the standard error."""
    found = np.array([free_fraction(world, seed) for seed in range(60)])
    off = (found[:, 0] - share) / found[:, 1]
    assert np.abs(off).max() < 4.5
    # Two points a cell: the error of their difference is what is measured, so it is no guess.
    if world.name != "tiny":
        assert 0.75 < np.sqrt((off**2).mean()) < 1.3


def test_an_empty_world_is_free_for_certain() -> None:
    """The share is exact and the error 0."""
    assert free_fraction(made("empty", [3, 7])) == (1.0, 0.0)


def test_the_share_depends_on_the_seed_alone() -> None:
    """Equal seeds give equal points, other seeds others."""
    world = make_world("circles2d")
    assert free_fraction(world, 3) == free_fraction(world, 3) != free_fraction(world, 4)


# Cells


@given(
    st.lists(st.floats(1e-6, 1e6), min_size=2, max_size=3),
    st.integers(1, 5000),
)
def test_a_lattice_fills_its_box(size: list[float], cells: int) -> None:
    """A raster has about the requested number of cells, nearly cubes unless the box is thin."""
    upper = np.array(size)
    lattice = Raster.over(np.zeros(len(size)), upper, cells)
    shape = np.array(lattice.shape)
    assert np.allclose(lattice.cell * shape, upper)
    assert shape.prod() <= 3 * cells
    assert shape.prod() * 3 >= cells
    split = lattice.cell[shape > 2]
    assert not len(split) or split.max() <= 4 * split.min()


@DIMS
@settings(max_examples=60)
@given(seeds, st.booleans(), st.integers(1, 80))
def test_blocked_cells_are_the_touched_ones(dim: int, seed: int, exactly: bool, cells: int) -> None:
    """Exactly the cells that an obstacle touches are blocked, up to rounding."""
    world = some_world(seed, dim, most=3, exactly=exactly)
    lattice = Raster.over(world.lower, world.upper, cells)
    blocked = lattice.blocked(obstacle_arrays(world))
    assert blocked.shape == lattice.shape
    for index in np.ndindex(lattice.shape):
        low, high = lattice.corners(np.array(index))
        if blocked[index]:
            assert cell_touched(world, low, high, 1e-6), index
        else:
            assert not cell_touched(world, low, high, 0.0), index


@settings(max_examples=80)
@given(seeds, st.lists(st.integers(1, 9), min_size=2, max_size=3), st.floats(0, 1))
def test_components_are_those_of_a_walk(seed: int, shape: list[int], density: float) -> None:
    """Two cells have equal labels if and only if a walk connects them."""
    free = np.random.default_rng(seed).random(shape) >= density
    labels = components(free)
    assert ((labels == -1) == ~free).all()
    for cell in map(tuple, np.argwhere(free).tolist()):
        reached = flooded(free, cell)
        assert {tuple(c) for c in np.argwhere(labels == labels[cell]).tolist()} == reached


@pytest.mark.parametrize("turned", [False, True])
def test_a_long_way_takes_no_longer(turned: bool) -> None:
    """A serpentine of half a million cells is one component; one more wall makes two."""
    free = np.ones((1024, 1024), bool)
    free[1::4, :-1] = False
    free[3::4, 1:] = False
    cells = free.T if turned else free
    assert len(np.unique(components(cells)[cells])) == 1
    free[501, :] = False
    assert len(np.unique(components(cells)[cells])) == 2


# Ways


def of_cells(blocked: NDArray[np.bool_], start: Sequence[int], goal: Sequence[int]) -> World:
    """Make a world of unit boxes, with start and goal in the middle of cells."""
    low = np.argwhere(blocked).astype(float)
    boxes = np.concatenate([low, low + 1], axis=1)
    ends = [np.array(cell) + 0.5 for cell in (start, goal)]
    upper = np.array(blocked.shape, float)
    return World("cells", 0 * upper, upper, boxes=boxes, start=ends[0], goal=ends[1])


@settings(max_examples=60)
@given(seeds, st.lists(st.integers(1, 7), min_size=2, max_size=3))
def test_a_way_is_found_where_there_is_one(seed: int, shape: list[int]) -> None:
    """Corridors wider than the cells connect; boxes that touch at corners do not let through."""
    rng = np.random.default_rng(seed)
    blocked = rng.random(shape) < 0.4
    start, goal = (tuple(rng.integers(0, shape).tolist()) for _ in range(2))
    blocked[start] = blocked[goal] = False
    world = of_cells(blocked, start, goal)
    assert world.start is not None
    assert world.goal is not None
    found = connected(world, world.start, world.goal, cells=40 ** len(shape))
    if goal in flooded(~blocked, start):
        assert found.connected is True, found
    else:
        assert found.connected is None, found


@settings(max_examples=40)
@given(seeds, st.integers(3, 9), st.booleans())
def test_no_way_leads_through_a_thin_ring(seed: int, corners: int, pierced: bool) -> None:
    """Line segments enclose the start; without one of them there is a path."""
    rng = np.random.default_rng(seed)
    angles = 2 * np.pi * (np.arange(corners) + rng.uniform(-0.2, 0.2, corners)) / corners
    ring = 5 + 3 * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    walls = list(np.stack([ring, np.roll(ring, -1, axis=0)], axis=1))
    if pierced:
        walls.pop()
    world = made("ring", [10, 10], polygons=tuple(walls))
    found = connected(world, np.array([5.0, 5]), np.array([0.1, 9.9]), cells=1 << 16)
    assert found.connected is (True if pierced else None)


@DIMS
@settings(max_examples=30)
@given(seeds)
def test_a_way_that_is_found_stays_among_free_points(dim: int, seed: int) -> None:
    """A walk over a dense grid of points confirms every connection."""
    world = some_world(seed, dim, most=12 if dim == 2 else 40)
    if dim == 3:  # between boxes no way is narrower than half a unit
        world = replace(world, balls=np.empty((0, 4)))
    steps = (61, 61) if dim == 2 else (25, 25, 25)
    axes = [np.linspace(0, 10, n) for n in steps]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    free = ~occupied(world, points.reshape(-1, dim)).reshape(steps)
    if free.sum() < 2:
        return
    cells = np.argwhere(free)
    a, b = (tuple(cells[i].tolist()) for i in (0, -1))
    found = connected(world, points[a], points[b], cells=2000)
    if found.connected:
        assert b in flooded(free, a) or _finer(world, points[a], points[b])


def _finer(world: World, start: Floats, goal: Floats) -> bool:
    """Whether a walk over many more points connects two points, for narrow places."""
    steps = (1201, 1201) if world.dim == 2 else (121,) * 3
    axes = [np.linspace(0, 10, n) for n in steps]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, world.dim)
    label = components(~occupied(world, points).reshape(steps))
    ends = [np.round(end / 10 * (np.array(steps) - 1)).astype(int) for end in (start, goal)]
    return bool(label[tuple(ends[0])] == label[tuple(ends[1])] >= 0)


@settings(max_examples=80)
@given(seeds, st.integers(1, 8), st.integers(1, 8), st.sampled_from([0.0, 0.5, 2.0]))
def test_a_map_is_decided_on_its_own_cells(seed: int, rows: int, columns: int, yaw: float) -> None:
    """Grid maps are decided exactly, also at the border of cells; rasters never contradict."""
    rng = np.random.default_rng(seed)
    cells = rng.random((rows, columns)) < 0.4
    grid = Grid(cells, np.array([3.0, -2]), 0.5, yaw)
    world = World.of_grid("map", grid)
    ends = [tuple(rng.integers(0, (rows, columns)).tolist()) for _ in range(2)]
    places = grid.to_world((np.array(ends)[:, ::-1] + 0.5) * 0.5)
    found = connected(world, places[0], places[1])
    free = not (cells[ends[0]] or cells[ends[1]])
    assert found.connected is (free and ends[1] in flooded(~cells, ends[0]))
    assert free_fraction(replace(world, boxes=np.full((1, 4), 99.0)))[0] == pytest.approx(
        free_fraction(world)[0], abs=0.01
    )
    solid = connected(world.without_grid(), places[0], places[1], cells=1 << 14)
    assert solid.connected is not (not found.connected)


def test_a_map_with_a_wall_is_searched_as_a_world() -> None:
    """A grid with other obstacles is searched by rasters."""
    world = World.of_grid("map", Grid(np.zeros((4, 4), bool), np.zeros(2), 1.0))
    ends = np.array([0.5, 0.5]), np.array([3.5, 3.5])
    assert connected(world, *ends).connected is True
    walled = replace(world, polygons=(np.array([[0, 4], [4.0, 0]]),))
    assert connected(walled, *ends).connected is None


@pytest.mark.parametrize("gap", [1e-3, 1e-6, 1e-9])
def test_a_start_close_to_an_obstacle_is_led_away(gap: float) -> None:
    """A start in a blocked cell connects by a free straight motion."""
    box = made("box", [10, 10], boxes=[[2, 2, 8, 8]])
    ball = made("ball", [10] * 3, balls=[[5, 5, 5, 3]])
    for world, start, goal in ((box, [2 - gap, 5], [8 + gap, 5]), (ball, [2 - gap, 5, 5], [9] * 3)):
        assert connected(world, np.array(start), np.array(goal, float)).connected is True


def test_a_start_in_a_hole_too_small_for_a_cell_is_not_led_out() -> None:
    """Walls closer than a cell leave the answer open."""
    walls = [[4, 4, 6, 4.9999], [4, 5.0001, 6, 6], [4, 4, 4.9999, 6], [5.0001, 4, 6, 6]]
    world = made("hole", [10, 10], boxes=walls)
    found = connected(world, np.array([5.0, 5]), np.array([9.0, 9]))
    assert found.connected is None
    assert found.cell == pytest.approx(10 / 1024)


@pytest.mark.parametrize(
    ("start", "goal", "words"),
    [
        ([-1, 5], [9, 9], "the start lies outside the bounds"),
        ([1, 1], [5, 5], "the goal touches ball 0"),
        ([3, 5], [9, 9], "the start touches ball 0"),
    ],
)
def test_ends_that_are_of_no_use_are_named(
    start: list[float], goal: list[float], words: str
) -> None:
    """An end in an obstacle proves that there is no path."""
    world = made("ball", [10, 10], balls=[[5, 5, 2]])
    found = connected(world, np.array(start, float), np.array(goal, float))
    assert found.connected is False
    assert words in found.reason
