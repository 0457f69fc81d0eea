"""Recordings in files: sinks that write them, and `read`, which reads them."""

from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import replace
from functools import partial as bound
from pathlib import Path

from brrt.errors import BrrtError, RecordingError
from brrt.events import Events
from brrt.files import open_file
from brrt.formats.framing import framed
from brrt.formats.integrity import BrokenError, CutError, DamagedError
from brrt.formats.mcap.reader import is_whole, read_mcap
from brrt.formats.mcap.records import MAGIC
from brrt.formats.mcap.sink import McapSink
from brrt.recording import Recording


def read(path: Path | str, *, partial: bool = False) -> Recording:
    """Open a recording, MCAP or Rerun, whatever its name.

    Args:
        path: The file.
        partial: Take the events that precede a cut or the first damage of an MCAP file; otherwise
            the batches raise `CutError` or `DamagedError` there. A recording whose `result` is None
            ends before its run did.

    Raises:
        RecordingError: The file cannot be read, or is not a recording of brrt, or is a Rerun file
            that is cut or damaged.
    """
    try:
        path = Path(path)
    except TypeError:
        raise BrrtError(f"read takes the name of a file, not {type(path).__name__}") from None
    begin = _first_bytes(path)
    if begin.startswith(b"RRF"):
        from brrt.formats.rrd.reader import read_rrd  # noqa: PLC0415 - imports rerun

        return framed(replace(read_rrd(path), name=path.name))
    if begin != MAGIC:
        raise RecordingError(
            f"{path}: not a recording; brrt reads .mcap and .rrd files that it wrote"
        )
    recording = replace(read_mcap(path), name=path.name)
    if not partial:
        return framed(recording)
    if (recording.result or recording.counts) and not is_whole(path):
        recording = replace(recording, result=None, counts=None)
    return framed(replace(recording, batches=bound(_until_damage, recording.batches)))


def _first_bytes(path: Path) -> bytes:
    """Read how a file begins.

    Raises:
        RecordingError: It is not a file, or cannot be read.
    """
    try:
        if path.is_dir():
            raise RecordingError(f"{path}: is a folder; name a recording in it, .mcap or .rrd")
        with open_file(path) as file:
            return file.read(len(MAGIC))
    except OSError as error:
        raise RecordingError(f"{path}: {error.strerror or error}") from None


def _until_damage(batches: Callable[[], Iterable[Events]]) -> Iterator[Events]:
    """Yield the events that precede a cut or the first damage."""
    with suppress(BrokenError):
        yield from batches()


__all__ = [
    "BrokenError",
    "CutError",
    "DamagedError",
    "McapSink",
    "Recording",
    "read",
    "read_mcap",
]
