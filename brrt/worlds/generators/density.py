"""The number of obstacles that it takes to cover a share of the map."""

from collections.abc import Iterable

import numpy as np

from brrt.errors import BrrtError
from brrt.worlds.arrays import Floats, Ints
from brrt.worlds.obstacle_arrays import ObstacleArray, chunks, expand_counts
from brrt.worlds.rasterize import Raster

POINTS = 1 << 15
"""Approximate number of points at which the share is measured, one at random in each cell."""
_SEED = 0
_PAIRS = 1 << 20
_LAYERS, _MANY = 100, 2000
"""The search gives up after obstacles with that many times the map's volume, and that many."""

_SPARE = 1.5
"""Factor by which the obstacles still to come may be larger than those so far."""


def count_for_density(
    density: float, upper: Floats, sequence: Iterable[ObstacleArray], most: int
) -> tuple[int, float]:
    """Count how many obstacles of a sequence cover a share of the map.

    Args:
        density: The share, 0 to 1.
        upper: Greatest corner of the map, shape (d,); the least corner is the origin.
        sequence: The obstacles, in parts of any length.
        most: Number of obstacles in the sequence.

    Returns:
        The least number of obstacles that cover at least the share, and the share they cover.

    Raises:
        BrrtError: The sequence does not cover the share, or clearly will not.
    """
    raster = Raster.over(np.zeros(len(upper)), upper, POINTS)
    index = np.argwhere(np.ones(raster.shape, np.bool_))
    points = (index + np.random.default_rng(_SEED).random(index.shape)) * raster.cell
    never = np.iinfo(np.int64).max
    first = np.full(len(points), never)
    wanted = int(np.ceil(density * len(points)))
    count, layers = 0, 0.0
    for obstacles in sequence:
        if (first < never).sum() >= wanted or (layers > _LAYERS and count > _MANY):
            break
        _mark(first, count, obstacles, raster, points)
        count += len(obstacles.low)
        layers += float(((obstacles.high - obstacles.low) / upper).prod(axis=1).sum())
        # n obstacles of volume v leave about exp(-n v) of the map free.
        if -np.expm1(-_SPARE * layers * most / count) < density:
            raise BrrtError(
                f"density {density:g} would take more than {most:,} obstacles of this size; ask "
                f"for a lower density or larger obstacles"
            )
    covered = int((first < never).sum())
    if covered < wanted:
        raise BrrtError(
            f"density {density:g} cannot be reached: {count} obstacles cover only "
            f"{covered / len(points):.4f} of the map; ask for a lower density or larger obstacles"
        )
    count = int(np.sort(first)[wanted - 1]) + 1 if wanted else 0
    return count, float((first < count).mean())


def _mark(
    first: Ints, count: int, obstacles: ObstacleArray, raster: Raster, points: Floats
) -> None:
    """Store at each point the number of the first obstacle that covers it.

    Args:
        first: Number of the first obstacle that covers each point, shape (n,); changed in place.
        count: Number of the first of these obstacles.
        obstacles: The obstacles.
        raster: Cells with one of the points in each.
        points: Shape (n, d).
    """
    length = raster.shape[-1]
    for obstacle, row, begin, end in raster.spans(obstacles, np.arange(len(obstacles.low))):
        for part in chunks((end - begin + 1) * obstacles.weights[obstacle], _PAIRS):
            owner, offset = expand_counts((end - begin + 1)[part])
            point = (row * length + begin)[part][owner] + offset
            left = first[point] >= count
            point, which = point[left], obstacle[part][owner][left]
            if len(point):
                hit = obstacles.touch(which, points[point])
                np.minimum.at(first, point[hit], count + which[hit])
