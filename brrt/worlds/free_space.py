"""What a world is like: which points are free, what share of it is, whether the query can be met.

Plain numpy: it starts at once, and is at hand where nothing is compiled.
"""

import itertools
from dataclasses import dataclass

import numpy as np

from brrt.worlds.obstacle_arrays import (
    Bools,
    Floats,
    Ints,
    ObstacleArray,
    chunks,
    expand_counts,
    obstacle_arrays,
)
from brrt.worlds.occupancy import Grid
from brrt.worlds.rasterize import Raster, components, touches_box
from brrt.worlds.world import World

CELLS = 1 << 20
"""Cells of the finest lattice: 1024 x 1024, or about 100 x 100 x 100."""
_COARSEST = 1 << 12
_FINER = 16
"""Each lattice has that many times the cells of the one before."""
_STRATA = 1 << 16
_BATCH = 64
_PAIRS = 1 << 21
_AROUND, _TRIES, _PARTS = 2, 8, 200
"""A start in a blocked cell: how many cells each way are looked at, how many of them are headed
for, and into how many parts a motion may be cut."""


@dataclass(frozen=True, slots=True)
class Connection:
    """Whether a point can go from start to goal.

    Attributes:
        connected: True and False are proven; None means that cells of this size show no way.
        cell: Longest side of the cells that were looked at last; 0 if it took none.
        reason: What it rests on, in words.
    """

    connected: bool | None
    cell: float
    reason: str


def occupied(world: World, points: Floats) -> Bools:
    """Whether each point touches an obstacle; bounds do not matter.

    Args:
        world: The world.
        points: Shape (n, d).

    Returns:
        Shape (n,).
    """
    points = np.ascontiguousarray(points, np.float64)
    hit = np.zeros(len(points), np.bool_) if world.grid is None else world.grid.covers(points)
    for shapes in obstacle_arrays(world):
        # Large ones first, few at a time: what they cover is not asked about again.
        order = np.argsort(-(shapes.high - shapes.low).prod(axis=1))
        begin, many = 0, _BATCH
        while begin < len(order):
            left = np.flatnonzero(~hit)
            if not len(left):
                return hit
            hit[left] = _covered_by(shapes, order[begin : begin + many], points[left])
            begin, many = begin + many, 2 * many
    return hit


def _covered_by(shapes: ObstacleArray, which: Ints, points: Floats) -> Bools:
    """Whether any of some obstacles touches each point: it is compared with those in its cell."""
    lattice = Raster.over(points.min(axis=0), points.max(axis=0), len(points) // 2 + 1)
    length, cells = lattice.shape[-1], int(np.prod(lattice.shape))
    cell = np.ravel_multi_index(tuple(lattice.index(points).T), lattice.shape)
    order = np.argsort(cell, kind="stable")
    ends = np.cumsum(np.bincount(cell, minlength=cells))
    ends = np.concatenate([[0], ends])
    hit = np.zeros(len(points), np.bool_)
    for obstacle, row, first, last in lattice.spans(shapes, which):
        begin, end = ends[row * length + first], ends[row * length + last + 1]
        for part in chunks((end - begin) * shapes.weights[obstacle], _PAIRS):
            owner, offset = expand_counts((end - begin)[part])
            if len(owner):
                near = order[begin[part][owner] + offset]
                touched = shapes.touch(obstacle[part][owner], points[near])
                hit[near[touched]] = True
    return hit


def free_fraction(world: World, seed: int = 0) -> tuple[float, float]:
    """Measure which share of the bounds is free, by two random points in each of many cells.

    Args:
        world: The world.
        seed: Seed of the points.

    Returns:
        The share, and the standard error of it: 0 where cells of a map, or nothing at all, could be
        counted. Where no cell's two points differ it is taken to be that of one such cell:
        something may have been missed.
    """
    grid = grid_only(world)
    if grid is not None:
        area = grid.resolution**2 * float((~grid.cells).sum())
        return min(area / float((world.upper - world.lower).prod()), 1.0), 0.0
    if not obstacle_arrays(world) and world.grid is None:
        return 1.0, 0.0
    lattice = Raster.over(world.lower, world.upper, _STRATA)
    index = np.stack(np.unravel_index(np.arange(np.prod(lattice.shape)), lattice.shape), axis=1)
    rng = np.random.default_rng(seed)
    pair = [lattice.lower + (index + rng.random(index.shape)) * lattice.cell for _ in range(2)]
    one, other = (~occupied(world, points) for points in pair)
    differing = int((one != other).sum())
    # The variance within a cell is estimated by half the square of the difference of its two.
    error = np.sqrt(max(differing, 1)) / (2 * len(index))
    return float((one.mean() + other.mean()) / 2), float(error)


def connected(world: World, start: Floats, goal: Floats, cells: int = CELLS) -> Connection:
    """Look for a way from start to goal for a point, cell by cell.

    A map that is nothing but an occupancy grid is decided on its own cells. Elsewhere lattices are
    laid over the world, each finer than the one before: a chain of cells that no obstacle touches
    proves that there is a way; where there is no chain, a narrower way may still exist.

    Args:
        world: The world.
        start: Where it begins, shape (d,).
        goal: Where it should end, shape (d,).
        cells: Cells of the finest lattice.
    """
    ends, grid = np.array([start, goal], np.float64), grid_only(world)
    for name, point, hit in zip(("start", "goal"), ends, occupied(world, ends), strict=True):
        if not world.inside(point):
            return Connection(False, 0.0, f"the {name} lies outside the bounds")
        if hit:
            obstacle = world.obstacle_at(point) or "an obstacle"
            return Connection(False, 0.0, f"the {name} touches {obstacle}")
    return _search(world, ends, cells) if grid is None else _search_map(grid, ends)


def grid_only(world: World) -> Grid | None:
    """Return the grid of a world that is nothing but a grid, as far as the bounds reach."""
    if world.grid is None or obstacle_arrays(world):
        return None
    corners, slack = world.grid.corners, 1e-9 * world.extent
    within = (world.lower - slack <= corners) & (corners <= world.upper + slack)
    return world.grid if within.all() else None


def _search_map(grid: Grid, ends: Floats) -> Connection:
    """Look for a way through the sides of free cells: closed cells leave none through a corner."""
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
        lattice = Raster.over(world.lower, world.upper, cells)
        free = ~lattice.blocked(obstacles)
        size = float(lattice.cell.max())
        nearest = [nearest_free_cell(lattice, free, obstacles, end) for end in ends]
        if nearest[0] is not None and nearest[1] is not None:
            label = components(free)
            if label[nearest[0]] == label[nearest[1]]:
                return Connection(True, size, f"free cells of {size:.3g} lead to the goal")
        if cells >= most:
            return Connection(None, size, f"no free cells of {size:.3g} lead to the goal")
        cells = min(_FINER * cells, most)


def nearest_free_cell(
    lattice: Raster, free: Bools, obstacles: list[ObstacleArray], point: Floats
) -> tuple[int, ...] | None:
    """Return a free cell that a straight motion from a point leads to, or None."""
    here = lattice.index(point)
    if free[tuple(here)]:
        return tuple(here.tolist())
    steps = np.array(list(itertools.product(range(-_AROUND, _AROUND + 1), repeat=len(here))))
    around = here + steps
    around = around[((around >= 0) & (around < lattice.shape)).all(axis=1)]
    around = around[free[tuple(around.T)]]
    nearest = np.clip(point, *lattice.corners(around))
    for i in np.argsort(((nearest - point) ** 2).sum(axis=1))[:_TRIES].tolist():
        if _free_motion(obstacles, point, nearest[i]):
            return tuple(around[i].tolist())
    return None


def _free_motion(obstacles: list[ObstacleArray], a: Floats, b: Floats) -> bool:
    """Whether a straight motion is proven to be free: a free box holds each part of it."""
    parts = [(a, b)]
    for _ in range(_PARTS):
        if not parts:
            return True
        a, b = parts.pop()
        if touches_box(obstacles, np.minimum(a, b), np.maximum(a, b)):
            middle = (a + b) / 2
            parts += [(middle, b), (a, middle)]
    return False


__all__ = [
    "CELLS",
    "Connection",
    "connected",
    "free_fraction",
    "grid_only",
    "nearest_free_cell",
    "occupied",
]
