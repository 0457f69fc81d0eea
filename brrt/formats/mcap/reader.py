"""Read a recording from an MCAP file, in one pass from the front.

A file that was cut or damaged is good up to the first damage: trees and metrics are folds, which
need all earlier events.
"""

import struct
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from functools import partial
from hashlib import blake2b
from pathlib import Path
from typing import IO, Any

import numpy as np
from mcap.opcode import Opcode
from mcap.records import Metadata
from numpy.typing import NDArray

from brrt.errors import BrrtError, RecordingError
from brrt.events import Events, Kind
from brrt.formats.integrity import (
    BrokenError,
    CutError,
    DamagedError,
    ReplacedError,
    parse_head,
)
from brrt.formats.mcap.chunks import DECLARATIONS, ChunkDecoder, Index
from brrt.formats.mcap.compression import unpack_chunk
from brrt.formats.mcap.ending import Ending, parse_result, read_ending
from brrt.formats.mcap.indexes import Indexes
from brrt.formats.mcap.records import (
    check_summary,
    open_mcap,
    parse_attachment,
    parse_index,
    parse_metadata,
    read_records,
)
from brrt.formats.mcap.sink import RESULT, RUN, WORLD
from brrt.recording import Recording, Result
from brrt.scenario.manifest import Manifest

_JOINED, _JOINED_BYTES = -1, 1 << 20
"""In place of an opcode: records outside of chunks, joined as in a chunk of so many bytes."""


def read_mcap(path: Path) -> Recording:
    """Open a recording.

    Its batches raise `CutError` or `DamagedError` after the last event that precedes the cut or
    the first damage.

    Raises:
        RecordingError: The file cannot be read, or is not a recording of brrt.
    """
    texts: Mapping[str, str] | None = None
    world_json: bytes | None = None
    try:
        with open_mcap(path) as file:
            for opcode, data in read_records(path, file):
                if opcode == Opcode.METADATA:
                    metadata = parse_metadata(data)
                    texts = metadata.metadata if metadata.name == RUN and not texts else texts
                elif opcode == Opcode.ATTACHMENT:
                    attachment = parse_attachment(data)
                    if attachment.name == WORLD and world_json is None:
                        world_json = attachment.data
                elif opcode in (Opcode.CHUNK, Opcode.MESSAGE, Opcode.DATA_END):
                    break
                if texts is not None and world_json is not None:
                    manifest, world = parse_head(path, texts, world_json)
                    batches = partial(_batches, path, manifest, texts, _digest(world_json))
                    end = read_ending(path)
                    return Recording(manifest, world, batches, end.result, end.counts or None)
    except CutError as error:
        raise error.before_events() from None
    except RecordingError:
        raise
    except BrrtError as error:
        raise DamagedError(path, f"damaged: {error}") from None
    raise RecordingError(
        f"{path}: an MCAP file, but not a recording of brrt, or one that another tool rewrote: "
        f"metadata {RUN} and attachment {WORLD} must precede the first message; "
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


def _digest(data: bytes) -> bytes:
    return blake2b(data).digest()


def _batches(
    path: Path, manifest: Manifest, texts: Mapping[str, str], world: bytes
) -> Iterator[Events]:
    """Yield the events of each chunk, up to the end or the first damage.

    Raises:
        BrokenError: The file is cut or damaged.
        RecordingError: It cannot be read, or is another one than when it was opened.
    """
    reader = _Reader(path, manifest, texts, world)
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
        world: Digest of the world's text.
    """

    def __init__(
        self, path: Path, manifest: Manifest, texts: Mapping[str, str], world: bytes
    ) -> None:
        self._path, self._texts, self._world = path, texts, world
        self._indexes = Indexes()
        self._decoder = ChunkDecoder(manifest.dof, manifest.epoch_ns)
        self._same = self._at_end = False
        self._result: Result | None = None
        self._counts = Counter[Kind]()
        self._epoch_ns, self._ends = manifest.epoch_ns, list[int]()

    def batches(self, file: IO[bytes]) -> Iterator[Events]:
        """Yield the events of each chunk.

        Raises:
            BrrtError: The file is cut, damaged, or another one than when it was opened.
        """
        try:
            yield from self._data(file)
        except BrrtError:
            with suppress(BrrtError):
                yield from self._counted(self._decoder.rest())
            raise
        self._check_same()
        self._at_end = True
        check_summary(self._path, file)
        self._check_counts()

    def _data(self, file: IO[bytes]) -> Iterator[Events]:
        """Yield the events of the data section."""
        records = self._indexes.watching(read_records(self._path, file))
        for opcode, data, index in _with_indexes(_joined(records)):
            if opcode == Opcode.CHUNK:
                self._check_same()
                yield from self._counted(self._decoder.events(unpack_chunk(data), index, len(data)))
            elif opcode == _JOINED:
                yield from self._counted(self._decoder.events(data, index, len(data)))
            elif opcode == Opcode.METADATA:
                self._take(parse_metadata(data))
            elif opcode == Opcode.ATTACHMENT:
                attachment = parse_attachment(data)
                if attachment.name == WORLD and _digest(attachment.data) != self._world:
                    raise BrrtError(f"it has two attachments {WORLD} that differ")
        self._decoder.check_complete()

    def _take(self, metadata: Metadata) -> None:
        """Take in named texts; the same may be there twice."""
        if metadata.name == RESULT:
            result = parse_result(metadata)
            if self._result not in (None, result):
                raise BrrtError(f"it has two metadata records {RESULT} that differ")
            self._result = result
        elif metadata.name == RUN:
            if self._same and metadata.metadata != self._texts:
                raise BrrtError(f"it has two metadata records {RUN} that differ")
            self._same = metadata.metadata == self._texts
            self._check_same()

    def _counted(self, events: Events) -> Iterator[Events]:
        """Yield a batch, unless it is empty."""
        if len(events):
            self._check_same()
            self._counts.update(events.counts)
            self._ends += [f(t["t"]) for t in events.tables.values() for f in (np.min, np.max)]
            self._ends = [min(self._ends), max(self._ends)]
            yield events

    def _check_counts(self) -> None:
        """Check that as many events were read as the result and the statistics say.

        Raises:
            DamagedError: They say otherwise.
        """
        end, count = read_ending(self._path), self.count
        stated = self._stated()
        if stated not in (None, count):
            raise DamagedError(self._path, f"damaged: {_differ(stated, count, 'events')}")
        for kind, number in end.counts_of(self._decoder.kinds).items():
            if number != self._counts[kind]:
                why = _differ(number, self._counts[kind], f"events of kind {kind.label}")
                raise DamagedError(self._path, f"damaged: by its statistics, {why}")
        messages = count + self._decoder.foreign
        if end.statistics is not None and end.statistics.message_count != messages:
            why = _differ(end.statistics.message_count, messages, "messages")
            raise DamagedError(self._path, f"damaged: by its statistics, {why}")
        self._check_indexes(end)

    def _check_indexes(self, end: Ending) -> None:
        """Check that indexes, times and channels in the summary are those of the records.

        Raises:
            DamagedError: They are others.
        """
        try:
            self._indexes.check(end.records)
            self._decoder.check_repeated(end.records)
        except BrrtError as error:
            raise DamagedError(self._path, f"damaged: {error}") from None
        statistics = end.statistics
        if statistics is None or not self._ends or self._decoder.foreign:
            return
        stated = statistics.message_start_time, statistics.message_end_time
        if stated != tuple(int(t) + self._epoch_ns for t in self._ends):
            why = "by its statistics, the messages are of other times"
            raise DamagedError(self._path, f"damaged: {why}")

    @property
    def count(self) -> int:
        """How many events were read."""
        return self._decoder.numbering.next

    def judged(self, error: BrokenError) -> BrokenError:
        """Return the error with whether all events were read, and whether the run had ended."""
        end = read_ending(self._path)
        stated = self._stated()
        if stated is None:
            stated = sum(end.counts_of(self._decoder.kinds).values()) or None
        complete = self._at_end if stated is None else stated == self.count
        return error.judged(complete=complete, ended=end.ended or self._result is not None)

    def _stated(self) -> Any:
        """Return how many events there are by the result, if that was read."""
        return None if self._result is None else self._result.get("events")

    def _check_same(self) -> None:
        if not self._same:
            raise ReplacedError(self._path)


def _differ(stated: Any, there: int, what: str) -> str:
    return f"{stated} {what} were written, {there} are there"


def _joined(records: Iterable[tuple[int, bytes]]) -> Iterator[tuple[int, bytes]]:
    """Yield records; messages and declarations outside of chunks are joined as `_JOINED`."""
    parts, size = list[bytes](), 0
    try:
        for opcode, data in records:
            loose = opcode == Opcode.MESSAGE or opcode in DECLARATIONS
            if loose:
                parts += struct.pack("<BQ", opcode, len(data)), data
                size += len(data)
            if parts and (not loose or size > _JOINED_BYTES):
                yield _JOINED, b"".join(parts)
                parts, size = [], 0
            if not loose:
                yield opcode, data
    except BrrtError:
        if parts:
            yield _JOINED, b"".join(parts)
        raise


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
