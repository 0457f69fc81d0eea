"""Join small batches into large ones, which cost less to write, within a time limit."""

import time

from brrt.events import Events


class Batching:
    """Collects batches until there are enough events, or the first has waited long enough.

    Args:
        dof: Numbers in a configuration.
        events: How many events are enough.
        seconds: How long an event may wait.
    """

    def __init__(self, dof: int, events: int, seconds: float) -> None:
        self._dof, self._enough, self._seconds = dof, events, seconds
        self._batches: list[Events] = []
        self._since = 0.0

    def add(self, batch: Events) -> Events | None:
        """Take a batch, and return all that wait if it is time; an empty batch only asks that."""
        now = time.monotonic()
        if len(batch):
            if not self._batches:
                self._since = now
            self._batches.append(batch)
        late = now - self._since >= self._seconds
        return self.take() if late or sum(map(len, self._batches)) >= self._enough else None

    def take(self) -> Events | None:
        """Return all waiting events as one batch; None if there are none."""
        batches, self._batches = self._batches, []
        if len(batches) > 1:
            return Events.concat(self._dof, batches)
        return batches[0] if batches else None
