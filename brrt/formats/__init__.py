"""Recordings: sinks that write them, and `read` for what they wrote."""

from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import replace
from functools import partial as bound
from pathlib import Path

from brrt.errors import BrrtError, RecordingError
from brrt.events import Events
from brrt.files import is_there
from brrt.formats.integrity import BrokenError, CutError, DamagedError
from brrt.formats.mcap.container import MAGIC
from brrt.formats.mcap.reader import is_whole, read_mcap
from brrt.formats.mcap.writer import McapSink
from brrt.recording import Recording

_RRD = b"RRF"


def read(path: Path | str, *, partial: bool = False) -> Recording:
    """Open a recording, MCAP or Rerun, told apart by how the file begins.

    Args:
        path: The file.
        partial: Take what is whole of a file that was cut or damaged; otherwise `CutError` or
            `DamagedError` is raised where that is met. A recording whose `result` is None ends
            ahead of its run's end.

    Raises:
        RecordingError: The file cannot be read, or is not a recording of brrt.
    """
    recording = _opened(path)
    if not partial:
        return recording
    if recording.result is not None and not _is_whole(Path(path)):
        recording = replace(recording, result=None, counts=None)
    return replace(recording, batches=bound(_whole_part, recording.batches))


def _is_whole(path: Path) -> bool:
    """Whether no event is lost of a file that has an end; an .rrd has none if that is not so."""
    with path.open("rb") as file:
        return file.read(len(_RRD)) == _RRD or is_whole(path)


def _whole_part(batches: Callable[[], Iterable[Events]]) -> Iterator[Events]:
    """Yield the events that stand ahead of a cut or of damage."""
    with suppress(BrokenError):
        yield from batches()


def _opened(given: Path | str) -> Recording:
    try:
        path = Path(given)
    except TypeError:
        raise BrrtError(f"read takes the name of a file, not {type(given).__name__}") from None
    try:
        if path.is_dir():
            raise RecordingError(f"{path}: is a folder; name a recording in it, .mcap or .rrd")
        if not path.is_file() and is_there(path):
            raise RecordingError(f"{path}: no file but a pipe or a device; save it to a file first")
        with path.open("rb") as file:
            begin = file.read(len(MAGIC))
    except OSError as error:
        raise RecordingError(f"{path}: {error.strerror or error}") from None
    if begin == MAGIC:
        return replace(read_mcap(path), name=path.name)
    if begin.startswith(_RRD):
        from brrt.formats.rrd.reader import read_rerun  # noqa: PLC0415 - pyarrow is slow to load

        return replace(read_rerun(path), name=path.name)
    raise RecordingError(f"{path}: not a recording; brrt reads .mcap and .rrd files that it wrote")


__all__ = [
    "BrokenError",
    "CutError",
    "DamagedError",
    "McapSink",
    "Recording",
    "read",
    "read_mcap",
]
