"""Folds: computations that take the events of a log batch by batch."""

from collections.abc import Iterable, Iterator
from typing import Protocol

from brrt.events import Events, Instant
from brrt.recording import Limits


class Fold(Protocol):
    """A computation that takes events, batch by batch."""

    def write(self, events: Events) -> None:
        """Take a batch."""


def until(batches: Iterable[Events], limits: Limits) -> Iterator[Events]:
    """Yield the events up to an instant; no batch after the one with the instant is read.

    Args:
        batches: A log.
        limits: The instant, as `Events.until` takes it; the end of the log if it is empty.
    """
    for batch in batches:
        part = batch.until(**limits) if limits else batch
        yield part
        if len(part) < len(batch):
            return


def feed(
    batches: Iterable[Events], folds: Iterable[Fold], limits: Limits | None = None
) -> tuple[int, Instant] | None:
    """Pass the events up to an instant to folds, in one pass; see `until`.

    Returns:
        The number of events and the last one's instant; None if the limits leave out any.
    """
    folds = list(folds)
    count, last = 0, Instant(0, 0)
    for batch in batches:
        part = batch.until(**limits) if limits else batch
        for fold in folds:
            fold.write(part)
        if len(part) < len(batch):
            return None
        count, last = count + len(batch), batch.last if len(batch) else last
    return count, last
