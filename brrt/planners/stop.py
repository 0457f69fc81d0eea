"""When to stop, as a value that the caller passes."""

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from types import FrameType

from brrt.events import Status


@dataclass(slots=True)
class Stop:
    """A budget and a flag that anyone may raise while a planner runs.

    Attributes:
        iterations: Iterations that a planner may count.
        draws: Draws that it may make, whether they count or not; None for no limit.
        time_s: Seconds it may take; None for no limit, and then no event depends on the clock.
        interrupted: Set it to stop the run at the next batch.
    """

    iterations: int = 1_000_000
    draws: int | None = None
    time_s: float | None = None
    interrupted: bool = False

    def reached(self, iterations: int, elapsed_s: float) -> Status | None:
        """Say why to stop, or None to go on."""
        if self.interrupted:
            return Status.INTERRUPTED
        if iterations >= self.iterations:
            return Status.ITERATION_LIMIT
        if self.time_s is not None and elapsed_s >= self.time_s:
            return Status.TIME_LIMIT
        return None

    def share(self, iterations: int) -> int:
        """Iterations until the next look at the clock: few where time is limited."""
        left = self.iterations - iterations
        return left if self.time_s is None else min(left, 1024)


@contextmanager
def stop_on_signals(stop: Stop) -> Iterator[None]:
    """Let Ctrl-C and SIGTERM end the run properly instead of killing it; a second one kills."""

    def raise_flag(number: int, frame: FrameType | None) -> None:  # noqa: ARG001
        if stop.interrupted:
            raise KeyboardInterrupt
        stop.interrupted = True

    before = {
        number: signal.signal(number, raise_flag) for number in (signal.SIGINT, signal.SIGTERM)
    }
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
