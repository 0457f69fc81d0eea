"""The narrowest passage on the widest path, against slow and obvious searches."""

import heapq
from itertools import product
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from brrt import BrrtError, Grid, World, make_world
from brrt.worlds.convex import convex_polygon, inscribed
from brrt.worlds.free_space import occupied
from brrt.worlds.narrow_passage import clearance, max_width, narrowest_passage
from brrt.worlds.obstacle_arrays import obstacle_arrays
from brrt.worlds.rasterize import Raster

SHAPES = st.sampled_from([(5, 7), (9, 4), (3, 4, 5)])
FREE = SHAPES.flatmap(lambda shape: arrays(np.bool_, shape))


@settings(max_examples=30)
@given(FREE, st.integers(1, 9))
def test_clearance_is_the_distance_to_what_is_not_free(free: np.ndarray, farthest: int) -> None:
    """Each cell's clearance is the least distance to any cell that is not free."""
    cell = np.array([1.0, 1.5, 0.5])[: free.ndim]
    found = clearance(free, cell, farthest)
    padded = np.pad(free, 1)
    taken = np.argwhere(~padded) - 1
    for index in product(*map(range, free.shape)):
        apart = (taken - np.array(index)) * cell
        square = float((apart**2).sum(axis=1).min())
        most = (farthest * cell.max()) ** 2
        assert found[index] == pytest.approx(min(square, most))


def _widest(square: np.ndarray, start: tuple[int, ...], goal: tuple[int, ...]) -> float:
    """Return the greatest least clearance of any path: Dijkstra's algorithm with min for plus."""
    best, waiting = {start: float(square[start])}, [(-float(square[start]), start)]
    while waiting:
        room, at = heapq.heappop(waiting)
        if at == goal:
            return -room
        for axis, step in product(range(square.ndim), (-1, 1)):
            other = tuple(x + step * (i == axis) for i, x in enumerate(at))
            if all(0 <= x < n for x, n in zip(other, square.shape, strict=True)):
                through = min(-room, float(square[other]))
                if through > max(best.get(other, 0.0), 0.0):
                    best[other] = through
                    heapq.heappush(waiting, (-through, other))
    return 0.0


@settings(max_examples=25)
@given(st.integers(0, 10**6))
def test_the_bottleneck_is_that_of_the_widest_way(seed: int) -> None:
    """On a grid map: width, place, and the cells beyond the passage."""
    rng = np.random.default_rng(seed)
    free = rng.random((24, 30)) > 0.12
    grid = Grid(~free, np.zeros(2), 1.0)
    ends = rng.permutation(np.argwhere(free))[:2]
    start, goal = (np.array([column + 0.5, row + 0.5]) for row, column in ends)
    world = World.of_grid("map", grid)
    found = narrowest_passage(world, start, goal)
    square = clearance(free.T, np.ones(2), 32)
    # Ends in a narrow place of their own do not count: from each it is uphill at first.
    peaks = [_uphill(square, np.floor(end).astype(int)) for end in (start, goal)]
    least = _widest(square, *peaks)
    if _widest(square, *(tuple(np.floor(end).astype(int)) for end in (start, goal))) == 0:
        assert found is None
        return
    assert found is not None
    assert (found.low, found.high) == (2 * np.sqrt(least) - 1, 2 * np.sqrt(least) + 2)
    at = tuple(np.floor(found.place).astype(int))
    assert square[at] == least
    if found.beyond.any():
        assert found.beyond[peaks[1]]
        assert not found.beyond[peaks[0]]
        assert (square[found.beyond] > least).all()


def _uphill(square: np.ndarray, at: np.ndarray) -> tuple[int, ...]:
    while True:
        around = [at + np.array(step) for step in product((-1, 0, 1), repeat=len(at))]
        inside = [c for c in around if ((c >= 0) & (c < square.shape)).all()]
        best = max(inside, key=lambda c: square[tuple(c)])
        if square[tuple(best)] <= square[tuple(at)]:
            return tuple(at.tolist())
        at = best


@pytest.mark.parametrize("gap", [0.4, 3.7, 12.0])
@pytest.mark.parametrize("kind", ["gap2d", "passage2d"])
def test_a_gap_is_as_wide_as_it_was_made(kind: str, gap: float) -> None:
    """The width is within the estimates, the place in the wall, the goal beyond it."""
    world = make_world(f"{kind}:gap={gap}")
    assert world.start is not None
    assert world.goal is not None
    found = narrowest_passage(world, world.start, world.goal)
    assert found is not None
    assert found.low <= gap <= found.high
    assert found.high - found.low < 5
    walls = world.boxes
    assert walls[:, 0].min() - 1 <= found.place[0] <= walls[:, 2].max() + 1
    assert found.is_beyond(np.array([[90.0, 50.0], [10.0, 50.0]])).tolist() == [True, False]


def test_no_way_is_none() -> None:
    """Closed walls around the goal: no passage, and width 0."""
    boxes = np.array([[4, 4, 9, 5], [4, 8, 9, 9], [4, 4, 5, 9], [8, 4, 9, 9]], float)
    world = World("walled", np.zeros(2), np.full(2, 10.0), boxes=boxes)
    assert narrowest_passage(world, np.array([1.0, 1.0]), np.array([6.5, 6.5])) is None
    assert max_width(world, np.array([1.0, 1.0]), np.array([6.5, 6.5]), 1 << 12, 1.0) == 0


@settings(max_examples=25)
@given(st.integers(0, 10**6))
def test_what_no_disc_gets_through_is_proven(seed: int) -> None:
    """On a grid map: no path is wider than the bound, and there is none if the bound is 0."""
    rng = np.random.default_rng(seed)
    free = rng.random((24, 30)) > 0.12
    ends = rng.permutation(np.argwhere(free))[:2]
    start, goal = (np.array([column + 0.5, row + 0.5]) for row, column in ends)
    bound = max_width(
        World.of_grid("map", Grid(~free, np.zeros(2), 1.0)), start, goal, 1 << 15, 9.0
    )
    square = clearance(free.T, np.ones(2), 32)
    least = _widest(square, *(tuple(np.floor(end).astype(int)) for end in (start, goal)))
    # From middle to middle there is as much room, but for half of each cell and of the way.
    assert least == 0 or bound >= max(1e-9, 2 * (np.sqrt(least) - np.sqrt(0.5) - 0.5))
    assert least > 0 or bound < 0.5  # walls that meet in a corner may be thinner than a cell


@pytest.mark.parametrize(("gap", "bound"), [(0.5, 2.1), (3.7, 5.3), (6.0, 7.6), (9.0, np.inf)])
def test_the_bound_is_near_to_the_width(gap: float, bound: float) -> None:
    """The bound is within four cells of the true width, or inf beyond the requested width."""
    world = make_world(f"passage2d:gap={gap}")
    assert world.start is not None
    assert world.goal is not None
    assert gap <= max_width(world, world.start, world.goal, 1 << 16, 8.0) <= bound


@pytest.mark.parametrize("wall", [
    {"boxes": np.array([[8.0, 0.0, 12.0, 20.0]])},
    {"polygons": [np.array([[8.0, 0.0], [12.0, 0.0], [12.0, 20.0], [8.0, 20.0]])]},
])  # fmt: skip
def test_a_wall_that_ends_at_the_bounds_separates(wall: dict[str, Any]) -> None:
    """Nothing passes between an obstacle and the bounds that it reaches."""
    world = World("wall", np.zeros(2), np.full(2, 20.0), **wall)
    assert max_width(world, np.array([2.0, 10.0]), np.array([18.0, 10.0]), 1 << 12, 5.0) == 0


@settings(max_examples=30)
@given(st.integers(0, 10**6))
def test_what_is_filled_is_not_free(seed: int) -> None:
    """All points of filled cells are occupied; the cells inside a box are filled."""
    rng = np.random.default_rng(seed)
    world = make_world(f"polygons2d:n=6,size=20,seed={seed % 100}")
    lattice = Raster.over(world.lower, world.upper, 900)
    filled = lattice.filled(obstacle_arrays(world))
    cells = np.argwhere(filled)
    assert not filled[~lattice.blocked(obstacle_arrays(world))].any()
    points = lattice.lower + (cells + rng.random(cells.shape)) * lattice.cell
    assert not len(points) or occupied(world, points).all()
    box = World(
        "box", np.zeros(3), np.full(3, 8.0), boxes=np.array([[1.5, 1.5, 1.5, 5.5, 4.5, 4.5]])
    )
    assert Raster.over(box.lower, box.upper, 512).filled(obstacle_arrays(box)).sum() == 3 * 2 * 2


@settings(max_examples=40)
@given(st.integers(3, 40), st.floats(0.05, 20), st.integers(0, 10**6))
def test_the_inscribed_disc_is_within(corners: int, flat: float, seed: int) -> None:
    """The disc crosses no edge; in a rectangle it is as wide as the shorter side."""
    angles = np.sort(np.random.default_rng(seed).uniform(0, 2 * np.pi, corners))
    ring = np.stack([np.cos(angles), flat * np.sin(angles)], axis=1)
    try:
        polygon = convex_polygon("ring", ring)
    except BrrtError:
        return
    middle, radius = inscribed(polygon)
    around = np.linspace(0, 2 * np.pi, 64)
    disc = middle + radius * np.stack([np.cos(around), np.sin(around)], axis=1)
    edges = np.roll(polygon, -1, axis=0) - polygon
    to = disc[:, None] - polygon
    assert (edges[:, 0] * to[..., 1] - edges[:, 1] * to[..., 0] >= -1e-7).all()
    sides = np.array([[-1, -flat], [1, -flat], [1, flat], [-1, flat]]) / 2
    assert inscribed(sides)[1] == pytest.approx(min(1, flat) / 2)
