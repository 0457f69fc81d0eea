"""A sink on a thread of its own, so that the planner goes on while files are written."""

import queue
import threading

from brrt.events import Events
from brrt.recording import Result, Sink

_BATCHES = 24
"""Batches that may wait, half a megabyte each, before the planner waits too."""

_IDLE_S = 0.1
"""After so long without a batch the sink gets an empty one, to write what it has buffered."""


class BackgroundSink:
    """Hands batches to another sink on a thread; kernels run without the GIL meanwhile.

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
            if not self._failed:  # events after missing ones cannot be replayed
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
