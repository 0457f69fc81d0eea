"""What every recording is held to as it is read, whatever its format."""

from collections.abc import Mapping
from pathlib import Path
from typing import Self

import numpy as np

from brrt.errors import BrrtError, RecordingError
from brrt.events import LATEST_NS, Events
from brrt.scenario.manifest import Manifest
from brrt.validate import check_possible
from brrt.worlds.world import World

MOST_BYTES = 1 << 28
"""Bytes that one piece of a file may hold: a length that lies must not exhaust the memory."""

_MOST_DOF = 4096


class BrokenError(RecordingError):
    """A file is not whole; what it has given up to here has been found sound.

    Args:
        path: The file.
        why: What is wrong with it.
        complete: Whether no event is missing: what is wrong stands behind or beside them.
        ended: Whether, besides, the run came to its own end, so that its figures follow from them.
        remedy: What to do in Python, if anything; on the command line it is another one.
    """

    def __init__(
        self,
        path: Path,
        why: str,
        *,
        complete: bool = False,
        ended: bool = False,
        remedy: str = "",
    ) -> None:
        self.path, self.why = path, why
        self.complete, self.ended = complete, ended
        super().__init__("; ".join(filter(None, (self.fault, remedy))))

    @property
    def fault(self) -> str:
        """What is wrong with which file, without a remedy."""
        return f"{self.path}: {self.why}"

    def judged(self, *, complete: bool, ended: bool) -> Self:
        """Return it with what is known once all that can be read has been."""
        remedy = "brrt.read(path, partial=True) takes what is whole"
        ended = complete and ended
        return type(self)(self.path, self.why, complete=complete, ended=ended, remedy=remedy)

    def in_front(self) -> Self:
        """Return it for a file of which nothing is of use."""
        why = f"{self.why}, ahead of the first event: there is nothing to save"
        return type(self)(self.path, why)


class CutError(BrokenError):
    """The file ends before its end."""


class DamagedError(BrokenError):
    """The file is not as it was written."""


class ReplacedError(RecordingError):
    """The file is another one than when it was opened."""

    def __init__(self, path: Path) -> None:
        super().__init__(f"{path}: was replaced while it was being read; read it again")


def head(path: Path, texts: Mapping[str, str], world_json: str | bytes) -> tuple[Manifest, World]:
    """Return the manifest and the world that a file begins with.

    Raises:
        RecordingError: One of them is damaged, or they do not go together.
    """
    try:
        _check_size(texts)
        manifest, world = Manifest.from_strings(texts), World.from_json(world_json)
        _together(manifest, world)
    except BrrtError as error:
        raise RecordingError(f"{path}: {error}") from None
    return manifest, world


def _check_size(texts: Mapping[str, str]) -> None:
    if sum(map(len, texts.values())) > MOST_BYTES >> 4:
        raise BrrtError("damaged: its manifest is larger than any real one")


def _together(manifest: Manifest, world: World) -> None:
    if not 1 <= manifest.dof <= _MOST_DOF:
        raise BrrtError(f"damaged: a configuration of {manifest.dof} numbers")
    for name, q in (("start", manifest.start), ("goal", manifest.goal)):
        if len(q) != manifest.dof:
            raise BrrtError(f"damaged: {name} has {len(q)} numbers, and not {manifest.dof}")
        if not np.isfinite(q).all():
            raise BrrtError(f"damaged: {name} is {q}")
    if not 0 <= manifest.epoch_ns <= LATEST_NS:
        raise BrrtError(f"damaged: it began {manifest.epoch_ns} ns after 1970")
    if manifest.dim != world.dim:
        raise BrrtError(f"damaged: its world is {world.dim}D, and not {manifest.dim}D")
    if manifest.robot is not None:
        dof = manifest.make_robot().dof(world)
        if dof != manifest.dof:
            raise BrrtError(f"damaged: its robot needs {dof} numbers, and not {manifest.dof}")


class Numbering:
    """Sees that batches go on where the one before ended, and that no event is missing.

    Args:
        first: Number of the first event to come.
    """

    def __init__(self, first: int = 0) -> None:
        self.next = first

    def take(self, events: Events) -> None:
        """Take in a batch.

        Raises:
            BrrtError: Events are missing, or are there twice, or say what none can.
        """
        self._check(events)
        self.next += len(events)

    def beginning(self, events: Events) -> tuple[Events, BrrtError | None]:
        """Take in a batch as far as it is sound; return that, and what is wrong with the rest."""
        try:
            self.take(events)
        except BrrtError as error:
            wrong = error
        else:
            return events, None
        there = in_front(events, self.next)
        sound, unsound = 0, len(there) + 1
        while unsound - sound > 1:
            middle = (sound + unsound) // 2
            try:
                self._check(there.until(seq=self.next + middle - 1))
            except BrrtError as error:
                unsound, wrong = middle, error
            else:
                sound = middle
        self.next += sound
        return there.until(seq=self.next - 1), wrong

    def _check(self, events: Events) -> None:
        n = len(events)
        present = np.zeros(n, np.bool_)
        for table in events.tables.values():
            places = table["seq"] - self.next
            if len(places) and not (places.min() >= 0 and places.max() < n):
                raise BrrtError("events are missing")
            if (np.diff(places) <= 0).any():
                raise BrrtError("events are out of order")
            present[places] = True
        if not present.all():
            raise BrrtError("events are there twice, others not at all")
        check_possible(events, self.next + n)


def in_front(events: Events, first: int) -> Events:
    """Return the events from a number on, as far as they are in order and none is missing."""
    n = len(events)
    present, tables = np.zeros(n + 1, np.bool_), {}
    for kind, table in events.tables.items():
        falls = np.flatnonzero(np.diff(table["seq"]) <= 0)
        rising = table[: falls[0] + 1] if len(falls) else table
        places = rising["seq"] - first
        tables[kind] = rising[(places >= 0) & (places < n)]
        present[tables[kind]["seq"] - first] = True
    return Events(events.dof, tables).until(seq=first + int(present.argmin()) - 1)
