"""Folds: computations that take the events of a log batch by batch."""

from collections.abc import Iterable, Iterator
from typing import Protocol

from brrt.events import Events
from brrt.recording import Limits


class Fold(Protocol):
    """A computation that takes events, batch by batch."""

    def write(self, events: Events) -> None:
        """Take a batch."""


def until(batches: Iterable[Events], limits: Limits) -> Iterator[Events]:
    """Yield the events up to an instant; no batch after the one with the instant is read."""
    for batch in batches:
        part = batch.until(**limits) if limits else batch
        yield part
        if len(part) < len(batch):
            return


def feed(batches: Iterable[Events], folds: Iterable[Fold], limits: Limits | None = None) -> None:
    """Pass the events up to an instant to folds, in one pass."""
    folds = list(folds)
    for part in until(batches, limits or {}):
        for fold in folds:
            fold.write(part)
