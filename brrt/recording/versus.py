"""Two runs compared, wherever they are: in files, opened already, or in memory."""

from collections.abc import Iterable
from pathlib import Path

from brrt.events import Events
from brrt.manifest import Manifest
from brrt.recording import read
from brrt.recording.recording import Recording
from brrt.replay.compare import Comparison, Side, compare_sides
from brrt.worlds.world import World

Comparable = Path | str | Recording | tuple[Manifest, World, Events | Iterable[Events]]
"""A file, an open recording, or a run in memory: manifest, world and events or batches of them."""


def compare(
    a: Comparable,
    b: Comparable,
    *,
    names: tuple[str, str] | None = None,
    tolerance: float = 0.0,
) -> Comparison:
    """Compare two runs; their events are read up to the first difference and no further.

    Args:
        a: The first run.
        b: The second run.
        names: What they are called; by default files are called as they are.
        tolerance: How far apart the events' numbers may be; by default every bit counts. It is
            relative to the greater of the two, and to 1 where both are less.

    Raises:
        RecordingError: A file cannot be read, or is cut or damaged ahead of the first difference.
    """
    called = names or ("", "")
    return compare_sides(_side(a, called[0]), _side(b, called[1]), tolerance)


def _side(run: Comparable, name: str) -> Side:
    if isinstance(run, tuple):
        manifest, world, events = run
        batches = [events] if isinstance(events, Events) else events
        return Side(name, manifest, world, batches)
    if not isinstance(run, Recording):
        name, run = name or str(run), read(run)
    return Side(name, run.manifest, run.world, run.batches(), run.result, run.counts)
