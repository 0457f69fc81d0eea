"""The smoother's compiled loop."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrt.events import Kind
from brrt.kernels.emit import Buffer, emit, room
from brrt.kernels.jit import inline_helper, kernel
from brrt.kernels.random import Random, uniform
from brrt.kernels.space import distance, segment_free

Floats = NDArray[np.float64]

SHORTCUT = int(Kind.SHORTCUT)

WAYPOINTS, ATTEMPTS = range(2)
"""Places in `counts`."""


@inline_helper
def path_cost(path: Floats, n: int, space: Any) -> float:
    """Length of the first n waypoints, summed from the start."""
    cost = 0.0
    for i in range(1, n):
        cost += distance(space, path, i - 1, path, i)
    return cost


@kernel
def shorten(
    path: Floats,
    counts: NDArray[np.int64],
    cost: Floats,
    space: Any,
    rng: Random,
    log: Buffer,
    iteration: int,
    attempts: int,
) -> None:
    """Try until `attempts` are made, the path is one motion, or the log is full.

    Args:
        path: Waypoints, shape (n, dof); shortened in place.
        counts: How many of them stand, and attempts made so far, shape (2,).
        cost: Length of the path as it stands, shape (1,); written.
        space: Configuration space.
        rng: Random draws.
        log: Events.
        iteration: The planner's count, for the events.
        attempts: Attempts to make in all.
    """
    if counts[ATTEMPTS] == 0:
        cost[0] = path_cost(path, counts[WAYPOINTS], space)
    while room(log) > 0 and counts[ATTEMPTS] < attempts and counts[WAYPOINTS] > 2:
        n = counts[WAYPOINTS]
        counts[ATTEMPTS] += 1
        i, j = 0, 0
        while j - i < 2:
            # Waypoints that are neighbours already are drawn again: each pair is equally likely.
            i, j = int(uniform(rng) * n), int(uniform(rng) * n)
            i, j = min(i, j), max(i, j)
        accepted = segment_free(space, path, i, path, j)
        if accepted:
            for k in range(j, n):
                for axis in range(len(space.lower)):
                    path[i + 1 + k - j, axis] = path[k, axis]
            counts[WAYPOINTS] = n - (j - i - 1)
            # Along a straight line the sum may round up; the cost never rises.
            cost[0] = min(cost[0], path_cost(path, counts[WAYPOINTS], space))
        emit(log, SHORTCUT, iteration, i, j, int(accepted), cost[0], path, 0)
