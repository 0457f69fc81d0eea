"""A sink on a thread of its own, so that the planner goes on while files are written."""

import queue
import threading
import time
from collections import deque
from pathlib import Path

from brrt.events import Events
from brrt.recording import Result, Sink

_BATCHES = 24
"""Batches that may wait, half a megabyte each, before the planner waits too."""

_BEHIND_S = 0.15
"""How long a batch may wait to be written before the planner waits too, on a busy machine."""

_IDLE_S = 0.1
"""After so long without a batch the sink gets an empty one, to write what it has buffered."""


class BackgroundSink:
    """Hands batches to another sink on a thread; kernels run without the GIL meanwhile.

    What the sink raises is raised again by the next call here.

    Args:
        sink: The sink that does the work.
        path: Its file.

    Attributes:
        path: The file.
        closed: Whether the sink is closed.
    """

    def __init__(self, sink: Sink, path: Path | None = None) -> None:
        self._sink, self.path, self.closed = sink, path, False
        self._queue: queue.SimpleQueue[Events | None] = queue.SimpleQueue()
        self._pending = deque[float]()  # since when each batch waits
        self._progress = threading.Condition()
        self._batch_s = _BEHIND_S / 4  # seconds that a batch takes, on a running average
        self._error: BaseException | None = None
        self._failed = False
        self._thread = threading.Thread(target=self._work, name="brrt recorder", daemon=True)
        self._thread.start()

    def write(self, events: Events) -> None:
        """Queue a batch; wait while the sink is behind."""
        self._raise()
        with self._progress:
            self._pending.append(time.monotonic())
            self._queue.put(events)
            while self._is_behind() and self._thread.is_alive():
                self._progress.wait(_IDLE_S)

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
        self.closed = True

    def _is_behind(self) -> bool:
        waits = self._pending
        late = bool(waits) and time.monotonic() - waits[0] > _BEHIND_S
        return late or len(waits) > max(1, min(_BATCHES, _BEHIND_S / max(self._batch_s, 1e-6)))

    def _work(self) -> None:
        while True:
            try:
                events, idle = self._queue.get(timeout=_IDLE_S), False
            except queue.Empty:
                events, idle = Events(0, {}), True
            if events is None:
                return
            began = time.monotonic()
            if not self._failed:  # events after missing ones cannot be replayed
                try:
                    self._sink.write(events)
                except BaseException as error:  # noqa: BLE001 - raised again on the caller's thread
                    self._error, self._failed = error, True
            if not idle:
                with self._progress:
                    self._pending.popleft()
                    self._batch_s += (time.monotonic() - began - self._batch_s) / 8
                    self._progress.notify()

    def _raise(self) -> None:
        if self._error is not None:
            error, self._error = self._error, None
            raise error
