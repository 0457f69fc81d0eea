"""Free space of a world: occupied points, the free share, and whether start and goal connect.

Numpy only, so that it starts at once and works without compiled code.
"""

import itertools
from dataclasses import dataclass

import numpy as np

from brrt.worlds.arrays import Bools, Floats, Ints
from brrt.worlds.obstacle_arrays import ObstacleArray, chunks, expand_counts, obstacle_arrays
from brrt.worlds.occupancy import Grid
from brrt.worlds.rasterize import Raster, components, touches_box
from brrt.worlds.world import World

CELLS = 1 << 20
"""Cells of the finest raster: 1024 x 1024, or about 100 x 100 x 100."""
_COARSEST = 1 << 12
_FINER = 16
"""Ratio of the cells of consecutive rasters."""
_STRATA = 1 << 16
_BATCH = 64
_PAIRS = 1 << 21
_AROUND, _TRIES, _PARTS = 2, 8, 200
"""For a start in a blocked cell: how many cells in each direction are searched for a free one, how
many of these are tried, and into how many parts a motion to one may be divided."""


@dataclass(frozen=True, slots=True)
class Connection:
    """Whether a point can move from start to goal.

    Attributes:
        connected: True and False are proven; None means that no path of free cells was found.
        cell: Longest side of the finest cells that were searched; 0 if none were.
        reason: What the answer is based on, for people.
    """

    connected: bool | None
    cell: float
    reason: str


def occupied(world: World, points: Floats) -> Bools:
    """Whether each point touches an obstacle, inside or outside the bounds.

    Args:
        world: The world.
        points: Shape (n, d).

    Returns:
        Shape (n,).
    """
    points = np.ascontiguousarray(points, np.float64)
    hit = np.zeros(len(points), np.bool_) if world.grid is None else world.grid.covers(points)
    for obstacles in obstacle_arrays(world):
        # Large obstacles first, few at a time: the points they occupy are not tested again.
        order = np.argsort(-(obstacles.high - obstacles.low).prod(axis=1))
        begin, many = 0, _BATCH
        while begin < len(order):
            left = np.flatnonzero(~hit)
            if not len(left):
                return hit
            hit[left] = _occupied_by(obstacles, order[begin : begin + many], points[left])
            begin, many = begin + many, 2 * many
    return hit


def _occupied_by(obstacles: ObstacleArray, which: Ints, points: Floats) -> Bools:
    """Whether any of some obstacles touches each point; tests only obstacles in the same cell."""
    raster = Raster.over(points.min(axis=0), points.max(axis=0), len(points) // 2 + 1)
    length, cells = raster.shape[-1], int(np.prod(raster.shape))
    cell = np.ravel_multi_index(tuple(raster.index(points).T), raster.shape)
    order = np.argsort(cell, kind="stable")
    ends = np.cumsum(np.bincount(cell, minlength=cells))
    ends = np.concatenate([[0], ends])
    hit = np.zeros(len(points), np.bool_)
    for obstacle, row, first, last in raster.spans(obstacles, which):
        begin, end = ends[row * length + first], ends[row * length + last + 1]
        for part in chunks((end - begin) * obstacles.weights[obstacle], _PAIRS):
            owner, offset = expand_counts((end - begin)[part])
            if len(owner):
                near = order[begin[part][owner] + offset]
                touched = obstacles.touch(obstacle[part][owner], points[near])
                hit[near[touched]] = True
    return hit


def free_fraction(world: World, seed: int = 0) -> tuple[float, float]:
    """Measure the free share of the bounds by stratified sampling, two points in each cell.

    Args:
        world: The world.
        seed: Seed of the points.

    Returns:
        The share and its standard error. The error is 0 where the share is exact: a grid without
        other obstacles, or no obstacles. It is never less than that of one cell with two different
        points, since a small obstacle may be missed.
    """
    grid = grid_only(world)
    if grid is not None:
        area = grid.resolution**2 * float((~grid.cells).sum())
        return min(area / float((world.upper - world.lower).prod()), 1.0), 0.0
    if not obstacle_arrays(world) and world.grid is None:
        return 1.0, 0.0
    raster = Raster.over(world.lower, world.upper, _STRATA)
    index = np.stack(np.unravel_index(np.arange(np.prod(raster.shape)), raster.shape), axis=1)
    rng = np.random.default_rng(seed)
    pair = [raster.lower + (index + rng.random(index.shape)) * raster.cell for _ in range(2)]
    one, other = (~occupied(world, points) for points in pair)
    differing = int((one != other).sum())
    # The variance within a cell is estimated by half the squared difference of its two points.
    error = np.sqrt(max(differing, 1)) / (2 * len(index))
    return float((one.mean() + other.mean()) / 2), float(error)


def connected(world: World, start: Floats, goal: Floats, cells: int = CELLS) -> Connection:
    """Search for a path of a point from start to goal, cell by cell.

    A world that consists of a grid only is decided on the grid's own cells. Other worlds are
    divided into finer and finer rasters: a chain of cells that no obstacle touches proves a path;
    without one, a path through a narrower place may still exist.

    Args:
        world: The world.
        start: Shape (d,).
        goal: Shape (d,).
        cells: Cells of the finest raster.
    """
    ends, grid = np.array([start, goal], np.float64), grid_only(world)
    for name, point, hit in zip(("start", "goal"), ends, occupied(world, ends), strict=True):
        if not world.inside(point):
            return Connection(False, 0.0, f"the {name} lies outside the bounds")
        if hit:
            obstacle = world.obstacle_at(point) or "an obstacle"
            return Connection(False, 0.0, f"the {name} touches {obstacle}")
    return _search(world, ends, cells) if grid is None else _search_grid(grid, ends)


def grid_only(world: World) -> Grid | None:
    """Return the grid of a world without other obstacles whose bounds contain the grid."""
    if world.grid is None or obstacle_arrays(world):
        return None
    corners, slack = world.grid.corners, 1e-9 * world.extent
    within = (world.lower - slack <= corners) & (corners <= world.upper + slack)
    return world.grid if within.all() else None


def _search_grid(grid: Grid, ends: Floats) -> Connection:
    """Search through the sides of free cells: blocked cells are closed and share their corners."""
    label = components(~grid.cells)
    last = np.array(grid.cells.shape[::-1]) - 1
    columns, rows = np.clip(np.floor(grid.to_cells(ends)), 0, last).astype(np.int64).T
    one, other = label[rows, columns]
    if one == other:
        return Connection(True, grid.resolution, "the map's free cells lead to the goal")
    return Connection(False, grid.resolution, "the map's free cells do not lead to the goal")


def _search(world: World, ends: Floats, most: int) -> Connection:
    obstacles, cells = obstacle_arrays(world.without_grid()), min(_COARSEST, most)
    while True:
        raster = Raster.over(world.lower, world.upper, cells)
        free = ~raster.blocked(obstacles)
        size = float(raster.cell.max())
        nearest = [nearest_free_cell(raster, free, obstacles, end) for end in ends]
        if nearest[0] is not None and nearest[1] is not None:
            label = components(free)
            if label[nearest[0]] == label[nearest[1]]:
                return Connection(True, size, f"free cells of {size:.3g} lead to the goal")
        if cells >= most:
            return Connection(None, size, f"no free cells of {size:.3g} lead to the goal")
        cells = min(_FINER * cells, most)


def nearest_free_cell(
    raster: Raster, free: Bools, obstacles: list[ObstacleArray], point: Floats
) -> tuple[int, ...] | None:
    """Return a free cell that a free straight motion from a point leads to, or None."""
    here = raster.index(point)
    if free[tuple(here)]:
        return tuple(here.tolist())
    steps = np.array(list(itertools.product(range(-_AROUND, _AROUND + 1), repeat=len(here))))
    around = here + steps
    around = around[((around >= 0) & (around < raster.shape)).all(axis=1)]
    around = around[free[tuple(around.T)]]
    nearest = np.clip(point, *raster.corners(around))
    for i in np.argsort(((nearest - point) ** 2).sum(axis=1))[:_TRIES].tolist():
        if _is_motion_free(obstacles, point, nearest[i]):
            return tuple(around[i].tolist())
    return None


def _is_motion_free(obstacles: list[ObstacleArray], a: Floats, b: Floats) -> bool:
    """Whether a straight motion is proven free: each part of it lies in a free box."""
    parts = [(a, b)]
    for _ in range(_PARTS):
        if not parts:
            return True
        a, b = parts.pop()
        if touches_box(obstacles, np.minimum(a, b), np.maximum(a, b)):
            middle = (a + b) / 2
            parts += [(middle, b), (a, middle)]
    return False
