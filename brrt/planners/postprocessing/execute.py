"""The real-time mode: the robot drives the path in moves of bounded length."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrt.events import Events, Kind, Phase, Status
from brrt.kernels.event_log import EventLog
from brrt.planners.base.stop import Stop
from brrt.planners.postprocessing import _execute
from brrt.settings import Settings, param


@dataclass(frozen=True, slots=True)
class Execute(Settings):
    """Cut each motion of a path into the fewest equal moves that are no longer than `max_move`.

    Nobody waits: a move says when it was decided, and its planning time is the time since the one
    before. So a tree planner's first move carries all of its planning, while the robot stays put.
    """

    max_move: float = param(1.0, "longest move, in the robot's metric", above=0)

    def drive(
        self, path: NDArray[np.float64], space: Any, log: EventLog, stop: Stop, iteration: int
    ) -> Iterator[Events]:
        """Yield batches of events, among them each move.

        Args:
            path: Waypoints, shape (n, dof), n at least 1.
            space: Configuration space, as kernels see it.
            log: Numbers and times the events.
            stop: Interruption.
            iteration: The planner's count, for the events.
        """
        if log.room < 2:
            yield log.drain()
        log.emit(Kind.PHASE, iteration, name=Phase.EXECUTE, status=Status.BEGIN)
        place, cost, q = (
            np.zeros(_execute.PLACES, np.int64),
            np.zeros(1),
            np.empty((1, path.shape[1])),
        )
        while not stop.interrupted:
            log.tick()
            if _execute.follow(path, place, cost, q, space, log.buffer, iteration, self.max_move):
                break
            yield log.drain()
        if log.room < 1:
            yield log.drain()
        status = Status.INTERRUPTED if stop.interrupted else Status.DONE
        log.emit(Kind.PHASE, iteration, name=Phase.EXECUTE, status=status)
        yield log.drain()
