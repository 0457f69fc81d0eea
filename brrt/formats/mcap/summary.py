"""What stands at the end of an MCAP file: figures and counts, read without the events."""

import json
from collections.abc import Iterator, Mapping
from io import BytesIO
from os import SEEK_END
from pathlib import Path
from typing import IO, Any, NamedTuple

from mcap import records
from mcap.opcode import Opcode

from brrt.errors import RecordingError
from brrt.events import Kind
from brrt.formats.integrity import MOST_BYTES
from brrt.formats.mcap.container import MAGIC
from brrt.formats.mcap.records import FOOTER, check_summary, metadata_of, parsed, records_of
from brrt.formats.mcap.writer import RESULT

LABELS = {f"/brrt/{kind.label}": kind for kind in Kind}
"""The topic of each kind of event."""

Result = Mapping[str, Any]
Counts = Mapping[Kind, int]


class Ending(NamedTuple):
    """What the end of a file says of the run.

    Attributes:
        result: The figures; None if they are not there, or damaged.
        counts: Events of each kind; None if they are not there.
        ended: Whether there are figures, so that the run came to its own end.
    """

    result: Result | None = None
    counts: Counts | None = None
    ended: bool = False


def ending(path: Path) -> Ending:
    """Look up the figures and the events of each kind.

    A file that was cut has no end, and one whose end is damaged none to rely on; their events are
    still good, as far as they are there.
    """
    counts: Counts | None = None
    kinds, place = dict[int, Kind](), None
    try:
        with path.open("rb") as file:
            for opcode, data in _summary(path, file):
                if opcode == Opcode.CHANNEL:
                    channel = parsed(path, records.Channel, data)
                    if channel.topic in LABELS:
                        kinds[channel.id] = LABELS[channel.topic]
                elif opcode == Opcode.STATISTICS:
                    stated = parsed(path, records.Statistics, data).channel_message_counts
                    counts = {kind: int(stated.get(id_, 0)) for id_, kind in kinds.items()}
                elif opcode == Opcode.METADATA_INDEX:
                    index = parsed(path, records.MetadataIndex, data)
                    place = index if index.name == RESULT else place
            return Ending(_result(path, file, place), counts, ended=place is not None)
    except (OSError, OverflowError, RecordingError):
        return Ending()


def _result(path: Path, file: IO[bytes], place: records.MetadataIndex | None) -> Result | None:
    """Read the figures where they are; None if there are none, or damaged."""
    if place is None or place.length > MOST_BYTES:
        return None
    file.seek(place.offset)
    try:
        return figures_of(path, metadata_of(path, file.read(place.length)[9:]))
    except RecordingError:
        return None


def chunk_starts(path: Path) -> list[int]:
    """Return where the chunks of a file begin, in order; none where its summary is not whole."""
    starts = set[int]()
    try:
        with path.open("rb") as file:
            for opcode, data in _summary(path, file):
                if opcode == Opcode.CHUNK_INDEX:
                    starts.add(parsed(path, records.ChunkIndex, data).chunk_start_offset)
            size = file.seek(0, SEEK_END)
    except (OSError, OverflowError, RecordingError):
        return []
    return sorted(start for start in starts if start < size)


def _summary(path: Path, file: IO[bytes]) -> Iterator[tuple[int, bytes]]:
    """Yield opcode and content of each record behind the data; none where that is not whole."""
    size = file.seek(-FOOTER - len(MAGIC), SEEK_END)
    start = parsed(path, records.Footer, file.read(FOOTER)[9:]).summary_start
    if 0 < size - start <= MOST_BYTES:
        file.seek(start)
        check_summary(path, file)
        file.seek(start)
        rest = BytesIO(file.read(size - start + FOOTER))
        for opcode, data in records_of(path, rest):
            if opcode == Opcode.FOOTER:
                return
            yield opcode, data


def figures_of(path: Path, metadata: records.Metadata) -> Result:
    """Read the figures from their texts.

    Raises:
        RecordingError: It is damaged.
    """
    try:
        return {name: json.loads(text) for name, text in metadata.metadata.items()}
    except (ValueError, RecursionError):
        raise RecordingError(f"{path}: damaged: the figures are not JSON") from None
