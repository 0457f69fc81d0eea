"""Read a recording from an MCAP file, in one pass from the front.

A file that was cut or damaged is good up to the first damage: trees and metrics are folds, which
need all earlier events.
"""

import json
from collections.abc import Iterable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import IO, Any, NamedTuple

import numpy as np
from mcap import records as stock
from mcap.opcode import Opcode
from numpy.typing import NDArray

from brrt.errors import BrrtError, RecordingError
from brrt.events import Events, Kind
from brrt.formats.integrity import (
    MOST_BYTES,
    BrokenError,
    CutError,
    DamagedError,
    ReplacedError,
    parse_head,
)
from brrt.formats.mcap.chunks import ChunkDecoder, Index
from brrt.formats.mcap.messages import TOPICS
from brrt.formats.mcap.records import (
    check_summary,
    open_mcap,
    parse,
    parse_attachment,
    parse_index,
    parse_metadata,
    read_records,
    read_summary,
    unpack_chunk,
)
from brrt.formats.mcap.sink import RESULT, RUN, WORLD
from brrt.recording import Recording, Result
from brrt.scenario.manifest import Manifest


def read_mcap(path: Path) -> Recording:
    """Open a recording.

    Its batches raise `CutError` or `DamagedError` after the last event that precedes the cut or
    the first damage.

    Raises:
        RecordingError: The file cannot be read, or is not a recording of brrt.
    """
    texts: Mapping[str, str] | None = None
    try:
        with open_mcap(path) as file:
            for opcode, data in read_records(path, file):
                if opcode == Opcode.METADATA:
                    metadata = parse_metadata(data)
                    texts = metadata.metadata if metadata.name == RUN else texts
                elif opcode == Opcode.ATTACHMENT and texts is not None:
                    attachment = parse_attachment(data)
                    if attachment.name == WORLD:
                        manifest, world = parse_head(path, texts, attachment.data)
                        batches = partial(_batches, path, manifest, texts)
                        end = _ending(path)
                        return Recording(manifest, world, batches, end.result, end.counts)
                elif opcode in (Opcode.CHUNK, Opcode.DATA_END):
                    break
    except CutError as error:
        raise error.before_events() from None
    except RecordingError:
        raise
    except BrrtError as error:
        raise DamagedError(path, f"damaged: {error}") from None
    raise RecordingError(
        f"{path}: an MCAP file, but not a recording of brrt, or one that another tool rewrote: "
        f"metadata {RUN} and then attachment {WORLD} must precede the first chunk; "
        "read the file that it was made of, or have the tool write them first"
    )


def is_whole(path: Path) -> bool:
    """Whether the checksums of data and summary are right; the events are not decoded."""
    try:
        with open_mcap(path) as file:
            for _ in read_records(path, file):
                pass
            check_summary(path, file)
    except BrrtError:
        return False
    return True


class _Ending(NamedTuple):
    """What the summary says of the run.

    Attributes:
        result: The metrics; None if they are not there, or damaged.
        counts: Events of each kind; None if they are not there.
        ended: Whether there is a result, so that the run came to its own end.
    """

    result: Result | None = None
    counts: Mapping[Kind, int] | None = None
    ended: bool = False


def _ending(path: Path) -> _Ending:
    """Read the result and the counts from the end of a file; of a cut file there are none."""
    counts, kinds, place = None, dict[int, Kind](), None
    try:
        with path.open("rb") as file:
            for opcode, data in read_summary(path, file):
                if opcode == Opcode.CHANNEL:
                    channel = parse(stock.Channel, data)
                    if channel.topic in TOPICS:
                        kinds[channel.id] = TOPICS[channel.topic]
                elif opcode == Opcode.STATISTICS:
                    stated = parse(stock.Statistics, data).channel_message_counts
                    counts = {kind: int(stated.get(number, 0)) for number, kind in kinds.items()}
                elif opcode == Opcode.METADATA_INDEX:
                    index = parse(stock.MetadataIndex, data)
                    place = index if index.name == RESULT else place
            return _Ending(_result_at(file, place), counts, ended=place is not None)
    except (OSError, OverflowError, BrrtError):
        return _Ending()


def _result_at(file: IO[bytes], place: stock.MetadataIndex | None) -> Result | None:
    """Read the result where the summary says that it is; None if it is not there, or damaged."""
    if place is None or place.length > MOST_BYTES:
        return None
    file.seek(place.offset)
    try:
        return _parse_result(parse_metadata(file.read(place.length)[9:]))
    except BrrtError:
        return None


def _parse_result(metadata: stock.Metadata) -> Result:
    try:
        return {name: json.loads(text) for name, text in metadata.metadata.items()}
    except (ValueError, RecursionError):
        raise BrrtError(f"{metadata.name} is not JSON") from None


def _batches(path: Path, manifest: Manifest, texts: Mapping[str, str]) -> Iterator[Events]:
    """Yield the events of each chunk, up to the end or the first damage.

    Raises:
        BrokenError: The file is cut or damaged.
        RecordingError: It cannot be read, or is another one than when it was opened.
    """
    reader = _Reader(path, manifest, texts)
    try:
        with open_mcap(path) as file:
            yield from reader.batches(file)
    except BrokenError as error:
        raise reader.judged(error) from None
    except RecordingError:
        raise
    except BrrtError as error:
        last = reader.count - 1
        place = f" after event {last:,}" if last >= 0 else ""
        raise reader.judged(DamagedError(path, f"damaged{place}: {error}")) from None


class _Reader:
    """Reads the records of a file in order.

    Args:
        path: The file.
        manifest: The run's.
        texts: Those that the manifest was read from.
    """

    def __init__(self, path: Path, manifest: Manifest, texts: Mapping[str, str]) -> None:
        self._path, self._texts = path, texts
        self._decoder = ChunkDecoder(manifest.dof, manifest.epoch_ns)
        self._same = self._at_end = False
        self._result: Result | None = None

    def batches(self, file: IO[bytes]) -> Iterator[Events]:
        """Yield the events of each chunk.

        Raises:
            BrrtError: The file is cut, damaged, or another one than when it was opened.
        """
        for opcode, data, index in _with_indexes(read_records(self._path, file)):
            if opcode == Opcode.CHUNK:
                self._check_same()
                events = self._decoder.events(unpack_chunk(data), index)
                if len(events):
                    yield events
            elif opcode == Opcode.MESSAGE:
                raise BrrtError("a message outside of a chunk, as brrt writes none")
            elif opcode == Opcode.METADATA:
                metadata = parse_metadata(data)
                if metadata.name == RESULT:
                    self._result = _parse_result(metadata)
                elif metadata.name == RUN:
                    self._same = self._same or metadata.metadata == self._texts
                    self._check_same()
        self._check_same()
        self._at_end = True
        check_summary(self._path, file)
        stated, count = self._stated(), self.count
        if stated not in (None, count):
            why = f"damaged: {stated} events were written, {count} are there"
            raise DamagedError(self._path, why)

    @property
    def count(self) -> int:
        """How many events were read."""
        return self._decoder.numbering.next

    def judged(self, error: BrokenError) -> BrokenError:
        """Return the error with whether all events were read, and whether the run had ended."""
        end = _ending(self._path)
        stated = self._stated()
        if stated is None and end.counts is not None:
            stated = sum(end.counts.values())
        complete = self._at_end if stated is None else stated == self.count
        return error.judged(complete=complete, ended=end.ended or self._result is not None)

    def _stated(self) -> Any:
        """Return how many events there are by the result, if that was read."""
        return None if self._result is None else self._result.get("events")

    def _check_same(self) -> None:
        if not self._same:
            raise ReplacedError(self._path)


def _with_indexes(records: Iterable[tuple[int, bytes]]) -> Iterator[tuple[int, bytes, Index]]:
    """Yield each record but MessageIndex records, which go with the chunk before them."""
    chunk, index = None, dict[int, NDArray[np.uint64]]()
    try:
        for opcode, data in records:
            if opcode == Opcode.MESSAGE_INDEX:
                index |= parse_index(data)
                continue
            if chunk is not None:
                yield Opcode.CHUNK, chunk, index
                chunk, index = None, {}
            if opcode == Opcode.CHUNK:
                chunk = data
            else:
                yield opcode, data, {}
    except BrrtError:
        if chunk is not None:
            yield Opcode.CHUNK, chunk, index
        raise
