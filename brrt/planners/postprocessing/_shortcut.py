"""The compiled loop of shortcut smoothing."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrt.kernels.emit import Buffer, emit_shortcut, paused, room
from brrt.kernels.jit import inline_helper, kernel
from brrt.kernels.random import Random, uniform
from brrt.kernels.space import distance, segment_free

Floats = NDArray[np.float64]

WAYPOINTS, ATTEMPTS = range(2)
"""Places in `counts`: the number of waypoints and of attempts."""


@inline_helper
def path_cost(path: Floats, n: int, space: Any) -> float:
    """Length of the path over the first n waypoints, summed from the start."""
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
    """Make attempts until there are `attempts`, the path is one motion, or it is to pause.

    Args:
        path: Waypoints, shape (n, dof); shortened in place.
        counts: See above, shape (2,).
        cost: Length of the path, shape (1,); written.
        space: Configuration space.
        rng: Random draws.
        log: Events.
        iteration: The planner's count, for the events.
        attempts: Number of attempts in all.
    """
    if counts[ATTEMPTS] == 0:
        cost[0] = path_cost(path, counts[WAYPOINTS], space)
    while counts[ATTEMPTS] < attempts and counts[WAYPOINTS] > 2:
        if room(log) < 1 or paused(log):
            return
        n = counts[WAYPOINTS]
        counts[ATTEMPTS] += 1
        i, j = 0, 0
        while j - i < 2:
            # Draw again if the waypoints are neighbours; each other pair is equally likely.
            i, j = int(uniform(rng) * n), int(uniform(rng) * n)
            i, j = min(i, j), max(i, j)
        accepted = segment_free(space, path, i, path, j)
        if accepted:
            for k in range(j, n):
                for axis in range(len(space.lower)):
                    path[i + 1 + k - j, axis] = path[k, axis]
            counts[WAYPOINTS] = n - (j - i - 1)
            # Rounding may increase the sum along a straight line; the cost never increases.
            cost[0] = min(cost[0], path_cost(path, counts[WAYPOINTS], space))
        emit_shortcut(log, iteration, i, j, accepted, cost[0])
