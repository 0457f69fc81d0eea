"""Shortcut smoothing (Geraerts and Overmars 2007)."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrt.events import Events, Kind, Phase, Stage, Status
from brrt.kernels.event_log import EventLog
from brrt.kernels.random import copy_state, restore_state
from brrt.planners.base.stop import Stop
from brrt.planners.postprocessing import _shortcut
from brrt.settings import Settings, param


@dataclass(frozen=True, slots=True)
class Shortcut(Settings):
    """Pick two waypoints at random; replace those between by a direct motion if it is free.

    The cost never increases, and start and goal do not change.
    """

    attempts: int = param(100, "pairs to try", low=0)

    def smooth(
        self,
        path: NDArray[np.float64],
        space: Any,
        rng: np.random.Generator,
        log: EventLog,
        stop: Stop,
        iteration: int,
    ) -> Iterator[Events]:
        """Yield batches of events; the last event but one is the smoothed path.

        Args:
            path: Waypoints, shape (n, dof), n at least 1.
            space: Configuration space, as kernels see it.
            rng: Source of all random draws.
            log: Numbers and times the events.
            stop: Interruption; its budget is not used.
            iteration: The planner's last iteration, for the events.
        """
        if log.room < 3:
            yield log.drain()
        log.emit(Kind.PHASE, iteration, name=Phase.SMOOTH, status=Status.BEGIN)
        draws = copy_state(rng)
        points, counts, cost = path.copy(), np.array([len(path), 0]), np.zeros(1)
        while True:
            log.allow()
            _shortcut.shorten(
                points, counts, cost, space, draws, log.buffer, iteration, self.attempts
            )
            waypoints, made = (int(n) for n in counts)
            if log.room < 2 or log.overdue:
                yield log.drain()
            if stop.interrupted or made >= self.attempts or waypoints <= 2:
                break
        restore_state(draws, rng)
        log.emit(
            Kind.PATH,
            iteration,
            stage=Stage.SMOOTHED,
            cost=cost[0],
            waypoints=points[:waypoints],
        )
        status = Status.INTERRUPTED if stop.interrupted else Status.DONE
        log.emit(Kind.PHASE, iteration, name=Phase.SMOOTH, status=status)
        yield log.drain()
