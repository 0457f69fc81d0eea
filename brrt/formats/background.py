"""Write while planning: a sink on a thread of its own."""

import queue
import threading

from brrt.events import Events
from brrt.recording import Result, Sink

_BATCHES = 24
"""Batches in waiting, half a megabyte each: so far a planner may be ahead before it waits."""

_IDLE_S = 0.1
"""After so long without a batch the sink gets an empty one, to look at what it holds back."""


class Background:
    """Hands batches to another sink on a thread; kernels run without the GIL meanwhile.

    While no batch comes, the sink is asked all the same whether it is time to write what it holds.

    What the sink raises is raised again by the next call here.

    Args:
        sink: The sink that does the work.
    """

    def __init__(self, sink: Sink) -> None:
        self._sink = sink
        self._queue: queue.Queue[Events | None] = queue.Queue(_BATCHES)
        self._error: BaseException | None = None
        self._failed = False
        self._thread = threading.Thread(target=self._work, name="brrt recorder", daemon=True)
        self._thread.start()

    def write(self, events: Events) -> None:
        """Queue a batch."""
        self._raise()
        self._queue.put(events)

    def close(self, result: Result | None) -> None:
        """Wait for what is queued, then close the sink."""
        self._queue.put(None)
        self._thread.join()
        try:
            self._raise()
        except BaseException:
            self._sink.close(None)
            raise
        self._sink.close(result)

    def _work(self) -> None:
        while (events := self._next()) is not None:
            if not self._failed:  # a batch behind one that is missing is of no use
                try:
                    self._sink.write(events)
                except BaseException as error:  # noqa: BLE001 - raised again on the caller's thread
                    self._error, self._failed = error, True

    def _next(self) -> Events | None:
        try:
            return self._queue.get(timeout=_IDLE_S)
        except queue.Empty:
            return Events(0, {})

    def _raise(self) -> None:
        if self._error is not None:
            error, self._error = self._error, None
            raise error
