"""When to stop: a value that the caller passes to a planner."""

from dataclasses import dataclass

from brrt.events import Status
from brrt.scenario.scenario import DEFAULT_ITERATIONS


@dataclass(slots=True)
class Stop:
    """A budget, and a flag that may be set while a planner runs.

    Attributes:
        iterations: Limit of the iterations that count.
        draws: Limit of all draws; None for no limit.
        time_s: Limit in seconds; None for no limit, so that no event depends on the clock.
        interrupted: Set it to stop the run at the next batch.
        signal: Number of the signal that set it; 0 if none did.
        events: Limit of the log's events; used to reproduce a run that ended within an iteration.
    """

    iterations: int = DEFAULT_ITERATIONS
    draws: int | None = None
    time_s: float | None = None
    interrupted: bool = False
    signal: int = 0
    events: int | None = None

    def reached(self, iterations: int, elapsed_s: float) -> Status | None:
        """Return why to stop, or None to continue."""
        if self.interrupted:
            return Status.INTERRUPTED
        if iterations >= self.iterations:
            return Status.ITERATION_LIMIT
        if self.time_s is not None and elapsed_s >= self.time_s:
            return Status.TIME_LIMIT
        return None
