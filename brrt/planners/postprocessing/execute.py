"""The real-time mode: the robot follows the path in moves of bounded length."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrt.digits import at_least
from brrt.errors import BrrtError
from brrt.events import Events, Kind, Phase, Status
from brrt.kernels.event_log import EventLog
from brrt.planners.base.stop import Stop
from brrt.planners.postprocessing import _execute
from brrt.settings import Settings, param

_MOST_MOVES = 2e9
"""Moves are counted with 32 bits."""


@dataclass(frozen=True, slots=True)
class Execute(Settings):
    """Cut each motion of a path into the fewest equal moves of at most `max_move`.

    Nothing is delayed: the time of a move is that of its decision, and its planning time is the
    time since the move before. So the first move after a tree planner has all of its planning time.
    """

    max_move: float = param(1.0, "longest move, in the robot's metric", above=0)

    def check(self, length: float, what: str) -> None:
        """Raise if a path takes more moves than can be counted.

        Args:
            length: Its length.
            what: What is of that length, for the message.

        Raises:
            BrrtError: It does.
        """
        least = length / _MOST_MOVES
        if self.max_move < least:
            raise BrrtError(
                f"max_move {self.max_move:g} is too small for {what}; it must be at least "
                f"{at_least(least, 2)}"
            )

    def follow(
        self, path: NDArray[np.float64], space: Any, log: EventLog, stop: Stop, iteration: int
    ) -> Iterator[Events]:
        """Yield the moves along a path, in batches of events.

        Args:
            path: Waypoints, shape (n, dof), n at least 1.
            space: Configuration space, as kernels see it.
            log: Numbers and times the events.
            stop: Interruption; its budget is not used.
            iteration: The planner's last iteration, for the events.
        """
        if log.room < 2:
            yield log.drain()
        log.emit(Kind.PHASE, iteration, name=Phase.EXECUTE, status=Status.BEGIN)
        place, cost = np.zeros(_execute.PLACES, np.int64), np.zeros(1)
        q = np.empty((1, path.shape[1]))
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
