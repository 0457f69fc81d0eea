"""How many obstacles it takes to cover a share of the map."""

from collections.abc import Iterable

import numpy as np

from brrt.errors import BrrtError
from brrt.worlds.obstacle_arrays import Floats, Ints, ObstacleArray, chunks, expand_counts
from brrt.worlds.rasterize import Raster

POINTS = 1 << 15
"""Points at which the share is measured, about: one at random in each cell of a lattice."""
_SEED = 0
_PAIRS = 1 << 20
_LAYERS, _MANY = 100, 2000
"""How often obstacles may cover the map on average before the share is given up, and how many of
them it takes at least."""

_SPARE = 1.5
"""By how much the share that many obstacles will cover may be off, as a factor of their volume."""


def fewest(
    density: float, upper: Floats, obstacles: Iterable[ObstacleArray], most: int
) -> tuple[int, float]:
    """Count the obstacles of a sequence that are needed to cover a share of the map.

    Args:
        density: The share, 0 to 1.
        upper: Greatest corner of the map, shape (d,); the least is the origin.
        obstacles: The sequence, cut into parts of any length.
        most: How many obstacles there are in it.

    Returns:
        The least number of obstacles that cover the share or more, and what they cover.

    Raises:
        BrrtError: The sequence does not, or so much of it does not that the rest will not either.
    """
    lattice = Raster.over(np.zeros(len(upper)), upper, POINTS)
    index = np.argwhere(np.ones(lattice.shape, np.bool_))
    points = (index + np.random.default_rng(_SEED).random(index.shape)) * lattice.cell
    never = np.iinfo(np.int64).max
    first = np.full(len(points), never)
    wanted = int(np.ceil(density * len(points)))
    count, layers = 0, 0.0
    for shapes in obstacles:
        if (first < never).sum() >= wanted or (layers > _LAYERS and count > _MANY):
            break
        _mark(first, count, shapes, lattice, points)
        count += len(shapes.low)
        layers += float(((shapes.high - shapes.low) / upper).prod(axis=1).sum())
        # n obstacles of volume v leave free about exp(-n v) of the map.
        if -np.expm1(-_SPARE * layers * most / count) < density:
            raise BrrtError(
                f"density {density:g} would take more than {most:,} obstacles of this size; ask "
                f"for less, or for larger ones"
            )
    covered = int((first < never).sum())
    if covered < wanted:
        raise BrrtError(
            f"density {density:g} cannot be reached: {count} obstacles cover no more than "
            f"{covered / len(points):.4f} of the map; ask for less, or for larger ones"
        )
    count = int(np.sort(first)[wanted - 1]) + 1 if wanted else 0
    return count, float((first < count).mean())


def _mark(first: Ints, count: int, shapes: ObstacleArray, lattice: Raster, points: Floats) -> None:
    """Note at the points that were not covered which of some more obstacles is the first to do so.

    Args:
        first: Number of the first obstacle that covers each point, shape (n,); changed.
        count: Number of the first of these obstacles.
        shapes: The obstacles.
        lattice: Holds one point in each cell.
        points: Shape (n, d).
    """
    length = lattice.shape[-1]
    for obstacle, row, begin, end in lattice.spans(shapes, np.arange(len(shapes.low))):
        for part in chunks((end - begin + 1) * shapes.weights[obstacle], _PAIRS):
            owner, offset = expand_counts((end - begin + 1)[part])
            point = (row * length + begin)[part][owner] + offset
            left = first[point] >= count
            point, which = point[left], obstacle[part][owner][left]
            if len(point):
                hit = shapes.touch(which, points[point])
                np.minimum.at(first, point[hit], count + which[hit])
