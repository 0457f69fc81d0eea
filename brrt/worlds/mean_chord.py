"""The mean length of lines in free space: how far a robot sees, on average."""

from functools import lru_cache

import numpy as np

from brrt.worlds.arrays import Bools, Floats
from brrt.worlds.free_space import grid_only
from brrt.worlds.obstacle_arrays import obstacle_arrays
from brrt.worlds.rasterize import Raster
from brrt.worlds.world import World

_CELLS = 1 << 16
"""Cells of the raster of a world that is more than a grid: 256 x 256, or about 40 x 40 x 40."""


@lru_cache(maxsize=2)  # a run asks several times
def mean_chord(world: World) -> float:
    """Return the mean length of axis-parallel chords of the free cells.

    It is the harmonic mean over the axes; a chord ends at blocked cells and at the bounds. By
    Cauchy's formula it is proportional to the free volume over its surface, so that it is a few
    times the width of the corridors, or the distance that obstacles leave. The cells are those of
    the map, and otherwise those of a raster.

    Returns:
        The length; the longest side of the bounds if no cell is free.
    """
    grid = grid_only(world)
    if grid is not None:
        free, sides = ~grid.cells, np.full(2, grid.resolution)
    else:
        free, sides = _raster(world)
    count = int(free.sum())
    if not count:
        return world.extent
    chords = sum(
        _runs(np.moveaxis(free, axis, -1)) / side for axis, side in enumerate(sides.tolist())
    )
    return float(count * free.ndim / chords)


def _raster(world: World) -> tuple[Bools, Floats]:
    """Return which cells are free, and the sides of a cell, shape (d,)."""
    raster = Raster.over(world.lower, world.upper, _CELLS)
    free = ~raster.blocked(obstacle_arrays(world.without_grid()))
    if world.grid is not None:
        index = np.stack(np.unravel_index(np.arange(free.size), free.shape), axis=1)
        centres = raster.lower + (index + 0.5) * raster.cell
        free &= ~world.grid.covers(centres).reshape(free.shape)
    return free, raster.cell


def _runs(free: Bools) -> int:
    """Count the runs of free cells along the last axis."""
    return int(free[..., 0].sum()) + int((free[..., 1:] & ~free[..., :-1]).sum())
