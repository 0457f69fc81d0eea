"""When to stop: a value that the caller passes to a planner."""

import math
import time
from dataclasses import dataclass, field

from brrt.events import Status
from brrt.scenario.scenario import DEFAULT_ITERATIONS

_BRIEF_S, _LONG_S, _MOST_SHARE = 0.1, 0.4, 1 << 40


@dataclass(slots=True)
class Stop:
    """A budget, and a flag that may be set while a planner runs.

    Attributes:
        iterations: Limit of the iterations that count.
        draws: Limit of all draws; None for no limit.
        time_s: Limit in seconds; None for no limit, so that no event depends on the clock.
        interrupted: Set it to stop the run at the next batch.
        signal: Number of the signal that set it; 0 if none did.
    """

    iterations: int = DEFAULT_ITERATIONS
    draws: int | None = None
    time_s: float | None = None
    interrupted: bool = False
    signal: int = 0
    _share: int = field(default=256, init=False, repr=False, compare=False)
    _asked: float = field(default=math.inf, init=False, repr=False, compare=False)

    def reached(self, iterations: int, elapsed_s: float) -> Status | None:
        """Return why to stop, or None to continue."""
        if self.interrupted:
            return Status.INTERRUPTED
        if iterations >= self.iterations:
            return Status.ITERATION_LIMIT
        if self.time_s is not None and elapsed_s >= self.time_s:
            return Status.TIME_LIMIT
        return None

    def share(self, iterations: int) -> int:
        """Return iterations until the next check of clock and flag: about a tenth of a second.

        With a limit of time they are few. No event depends on how a run is divided.
        """
        now = time.monotonic()
        passed, self._asked = now - self._asked, now
        if 0 <= passed < _BRIEF_S:
            self._share = min(2 * self._share, _MOST_SHARE)
        elif passed > _LONG_S:
            self._share = max(1, self._share // 2)
        left = self.iterations - iterations
        return min(left, self._share if self.time_s is None else min(self._share, 1024))
