"""The compiled loop of the execution in moves."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrt.kernels.emit import Buffer, emit_move, room
from brrt.kernels.jit import kernel
from brrt.kernels.space import distance, interpolate

Floats = NDArray[np.float64]

MOTION, PART, STEP, PLACES = range(4)
"""Places in `place`: the motion of the path, the moves of it that are made, and all moves; and the
number of places."""


@kernel
def follow(
    path: Floats,
    place: NDArray[np.int64],
    cost: Floats,
    q: Floats,
    space: Any,
    log: Buffer,
    iteration: int,
    max_move: float,
) -> bool:
    """Make moves until the end of the path or until the log is full; return whether at the end.

    Args:
        path: Waypoints, shape (n, dof).
        place: Progress of the robot, see above, shape (PLACES,).
        cost: Length of the moves so far, shape (1,).
        q: End of a move, shape (1, dof).
        space: Configuration space.
        log: Events.
        iteration: The planner's count, for the events.
        max_move: Longest move.
    """
    while place[MOTION] < len(path) - 1:
        i = place[MOTION]
        far = distance(space, path, i, path, i + 1)
        # A motion as long as a number of moves must not take one more because of rounding.
        moves = max(1, math.ceil(far / max_move * (1.0 - 1e-12)))
        while place[PART] < moves:
            if room(log) < 1:
                return False
            place[PART] += 1
            place[STEP] += 1
            for k in range(path.shape[1]):
                q[0, k] = path[i + 1, k]
            if place[PART] < moves:
                interpolate(space, path, i, path, i + 1, place[PART] / moves, q, 0)
            cost[0] += far / moves
            emit_move(log, iteration, 0, place[STEP], -1, cost[0], q, 0)
        place[MOTION] += 1
        place[PART] = 0
    return True
