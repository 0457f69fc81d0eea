"""What every recording must satisfy as it is read, whatever its format."""

from collections.abc import Mapping
from pathlib import Path
from typing import Self

import numpy as np

from brrt.errors import BrrtError, RecordingError
from brrt.events import LATEST_NS, Events
from brrt.formats.validate import check_possible
from brrt.scenario.manifest import Manifest
from brrt.worlds.world import World

MOST_BYTES = 1 << 28
"""Bytes of one piece of a file: a wrong length must not exhaust the memory."""

_MOST_DOF = 4096


class BrokenError(RecordingError):
    """A file is cut or damaged; the events that were read before this are right.

    Args:
        path: The file.
        why: What is wrong with it.
        complete: Whether no event is missing: the damage is behind or beside them.
        ended: Whether, besides, the run came to its own end, so that its result follows from them.
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
        """Return the error with what is known after the last event that can be read."""
        remedy = "brrt.read(path, partial=True) reads up to there"
        ended = complete and ended
        return type(self)(self.path, self.why, complete=complete, ended=ended, remedy=remedy)

    def before_events(self) -> Self:
        """Return the error for a file that is cut or damaged before its first event."""
        return type(self)(self.path, f"{self.why}, before the first event: nothing can be saved")


class CutError(BrokenError):
    """The file ends before its footer."""


class DamagedError(BrokenError):
    """A checksum or the structure is wrong."""


class ReplacedError(RecordingError):
    """The file is another one than when it was opened."""

    def __init__(self, path: Path) -> None:
        super().__init__(f"{path}: was replaced while it was being read; read it again")


def parse_head(
    path: Path, texts: Mapping[str, str], world_json: str | bytes
) -> tuple[Manifest, World]:
    """Return the manifest and the world that a file begins with.

    Raises:
        RecordingError: One of them is damaged, or they do not belong together.
    """
    try:
        _check_size(texts)
        manifest, world = Manifest.from_strings(texts), World.from_json(world_json)
        _check_pair(manifest, world)
    except BrrtError as error:
        raise RecordingError(f"{path}: {error}") from None
    return manifest, world


def _check_size(texts: Mapping[str, str]) -> None:
    if sum(map(len, texts.values())) > MOST_BYTES >> 4:
        raise BrrtError(f"damaged: its manifest has more than {MOST_BYTES >> 4:,} letters")


def _check_pair(manifest: Manifest, world: World) -> None:
    if not 1 <= manifest.dof <= _MOST_DOF:
        raise BrrtError(f"damaged: a configuration of {manifest.dof} numbers")
    for name, q in (("start", manifest.start), ("goal", manifest.goal)):
        if len(q) != manifest.dof:
            raise BrrtError(f"damaged: {name} has {len(q)} numbers instead of {manifest.dof}")
        if not np.isfinite(q).all():
            raise BrrtError(f"damaged: {name} is {q}")
    if not 0 <= manifest.epoch_ns <= LATEST_NS:
        raise BrrtError(f"damaged: it began {manifest.epoch_ns} ns after 1970")
    if manifest.dim != world.dim:
        raise BrrtError(f"damaged: its world is {world.dim}D instead of {manifest.dim}D")
    dof = manifest.make_robot().dof(world)
    if dof != manifest.dof:
        raise BrrtError(f"damaged: its robot needs {dof} numbers instead of {manifest.dof}")


class Numbering:
    """Checks that batches follow each other, that no event is missing, and that all are possible.

    Attributes:
        next: Number of the next event.
    """

    def __init__(self) -> None:
        self.next = 0

    def take(self, events: Events) -> None:
        """Check the next batch.

        Raises:
            BrrtError: Events are missing, doubled or out of order, or have impossible values; the
                batch does not count.
        """
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
        self.next += n
