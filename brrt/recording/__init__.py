"""Recordings: sinks that write them, and `read` for what they wrote."""

from dataclasses import replace
from pathlib import Path

from brrt.errors import RecordingError
from brrt.files import is_there
from brrt.recording.container import MAGIC
from brrt.recording.mcap_reader import read_mcap
from brrt.recording.mcap_writer import McapSink
from brrt.recording.memory import Memory
from brrt.recording.recording import Recording
from brrt.recording.sound import BrokenError, CutError, DamagedError

_RRD = b"RRF"


def read(path: Path | str) -> Recording:
    """Open a recording, MCAP or Rerun, told apart by how the file begins.

    Raises:
        RecordingError: The file cannot be read, or is not a recording of brrt.
    """
    path = Path(path)
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
        from brrt.recording.rrd_reader import read_rerun  # noqa: PLC0415 - pyarrow is slow to load

        return replace(read_rerun(path), name=path.name)
    raise RecordingError(f"{path}: not a recording; brrt reads .mcap and .rrd files that it wrote")


__all__ = [
    "BrokenError",
    "CutError",
    "DamagedError",
    "McapSink",
    "Memory",
    "Recording",
    "read",
    "read_mcap",
]
