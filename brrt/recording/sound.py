"""What every recording is held to as it is read, whatever its format."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from brrt.errors import BrrtError, RecordingError
from brrt.events import LATEST_NS, Events
from brrt.manifest import Manifest
from brrt.replay.possible import check_possible
from brrt.worlds.loaders.loader import MOST_LISTS
from brrt.worlds.world import World

MOST_BYTES = 1 << 28
"""Bytes that one piece of a file may hold: a length that lies must not exhaust the memory."""

_MOST_DOF = 4096


class CutError(RecordingError):
    """The file ends before its end; what stands before the cut was delivered.

    Attributes:
        result: The run's figures, where they stand before the cut: then no event is missing.
    """

    def __init__(self, message: str, result: Mapping[str, Any] | None = None) -> None:
        super().__init__(message)
        self.result = result


class DamagedError(RecordingError):
    """The checksum of a whole file is wrong; parts of it may be sound."""


def head(path: Path, texts: Mapping[str, str], world_json: str | bytes) -> tuple[Manifest, World]:
    """Return the manifest and the world that a file begins with.

    Raises:
        RecordingError: One of them is damaged, or they do not go together.
    """
    try:
        _bounded(texts, world_json)
        manifest, world = Manifest.from_strings(texts), World.from_json(world_json)
        _together(manifest, world)
    except BrrtError as error:
        raise RecordingError(f"{path}: {error}") from None
    return manifest, world


def _bounded(texts: Mapping[str, str], world: str | bytes) -> None:
    opens: tuple[Any, ...] = ("[", "{") if isinstance(world, str) else (b"[", b"{")
    if sum(map(world.count, opens)) > MOST_LISTS:
        raise BrrtError(f"damaged: its world has more than {MOST_LISTS:,} lists")
    if sum(map(len, texts.values())) > MOST_BYTES >> 4:
        raise BrrtError("damaged: its manifest is larger than any real one")


def _together(manifest: Manifest, world: World) -> None:
    if not 1 <= manifest.dof <= _MOST_DOF:
        raise BrrtError(f"damaged: a configuration of {manifest.dof} numbers")
    for name, q in (("start", manifest.start), ("goal", manifest.goal)):
        if len(q) != manifest.dof:
            raise BrrtError(f"damaged: {name} has {len(q)} numbers, and not {manifest.dof}")
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
            BrrtError: Events are missing, or are there twice.
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
