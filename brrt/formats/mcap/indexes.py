"""Compare the summary of an MCAP file with the records that it repeats, indexes and counts."""

import struct
from collections.abc import Iterable, Iterator
from hashlib import blake2b
from typing import Any

from mcap import records as stock
from mcap.opcode import Opcode

from brrt.errors import BrrtError
from brrt.formats.mcap.records import MAGIC, parse, parse_attachment

_CHUNK = struct.Struct("<QQQI")
"""A chunk's first fields: first and last log time, bytes unpacked, checksum."""

_NAMES: dict[int, str] = {
    Opcode.CHUNK_INDEX: "chunk",
    Opcode.METADATA_INDEX: "metadata",
    Opcode.ATTACHMENT_INDEX: "attachment",
}


class _Sum:
    """What a number of records say, in any order and in little memory.

    Attributes:
        count: How many records.
    """

    def __init__(self) -> None:
        self.count = self._total = 0

    def add(self, *fields: Any) -> None:
        """Add what a record says."""
        digest = blake2b(repr(fields).encode("utf-8", "backslashreplace"), digest_size=16)
        self.count += 1
        self._total = (self._total + int.from_bytes(digest.digest())) % (1 << 128)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Sum) and (self.count, self._total) == (other.count, other._total)

    __hash__ = None  # type: ignore[assignment]


class Indexes:
    """What the indexes of a file must say, by the records of its data section."""

    def __init__(self) -> None:
        self._at = len(MAGIC)
        self._there = {opcode: _Sum() for opcode in _NAMES}
        self._chunk: tuple[Any, ...] | None = None
        self._places = dict[int, int]()
        self._places_bytes = 0

    def watching(self, records: Iterable[tuple[int, bytes]]) -> Iterator[tuple[int, bytes]]:
        """Yield the opcode and content of each record of a data section, and take note of it.

        Raises:
            BrrtError: A record is wrong.
        """
        for opcode, data in records:
            self._take(opcode, data)
            yield opcode, data

    def check(self, summary: Iterable[tuple[int, bytes]]) -> None:
        """Check indexes and numbers of records; what a summary leaves out is not checked.

        Raises:
            BrrtError: One differs from the records.
        """
        stated = {opcode: _Sum() for opcode in _NAMES}
        for opcode, data in summary:
            if opcode == Opcode.CHUNK_INDEX:
                stated[opcode].add(*_of_chunk(parse(stock.ChunkIndex, data)))
            elif opcode == Opcode.METADATA_INDEX:
                metadata = parse(stock.MetadataIndex, data)
                stated[opcode].add(metadata.offset, metadata.length, metadata.name)
            elif opcode == Opcode.ATTACHMENT_INDEX:
                stated[opcode].add(*_of_attachment(parse(stock.AttachmentIndex, data)))
            elif opcode == Opcode.STATISTICS:
                self._check_statistics(parse(stock.Statistics, data))
        for opcode, name in _NAMES.items():
            if stated[opcode].count and stated[opcode] != self._there[opcode]:
                raise BrrtError(f"the {name} index differs from the records of the file")

    def _check_statistics(self, statistics: stock.Statistics) -> None:
        for opcode, name in _NAMES.items():
            number, there = getattr(statistics, f"{name}_count"), self._there[opcode].count
            if number != there:
                raise BrrtError(
                    f"by its statistics, {number:,} {name} records were written, {there:,} are "
                    "there"
                )

    def _take(self, opcode: int, data: bytes) -> None:
        at, size = self._at, 9 + len(data)
        self._at += size
        if opcode == Opcode.MESSAGE_INDEX:
            self._places_bytes += size
            if len(data) > 6:  # one that is empty need not be indexed
                self._places[int.from_bytes(data[:2], "little")] = at
            return
        self._end_chunk()
        if opcode == Opcode.CHUNK:
            low, high, unpacked, _ = _CHUNK.unpack_from(data.ljust(_CHUNK.size, b"\0"))
            self._chunk = at, size, low, high, unpacked
        elif opcode == Opcode.METADATA:
            name = parse(stock.Metadata, data).name
            self._there[Opcode.METADATA_INDEX].add(at, size, name)
        elif opcode == Opcode.ATTACHMENT:
            fields = parse_attachment(data)
            index = stock.AttachmentIndex(
                at, size, fields.create_time, fields.log_time, len(fields.data), fields.name,
                fields.media_type,
            )  # fmt: skip
            self._there[Opcode.ATTACHMENT_INDEX].add(*_of_attachment(index))

    def _end_chunk(self) -> None:
        """Take note of a chunk, whose indexes of messages follow it."""
        if self._chunk is not None:
            places = sorted(self._places.items())
            self._there[Opcode.CHUNK_INDEX].add(*self._chunk, self._places_bytes, places)
        self._chunk, self._places, self._places_bytes = None, {}, 0


def _of_chunk(index: stock.ChunkIndex) -> tuple[Any, ...]:
    return (
        index.chunk_start_offset, index.chunk_length, index.message_start_time,
        index.message_end_time, index.uncompressed_size, index.message_index_length,
        sorted(index.message_index_offsets.items()),
    )  # fmt: skip


def _of_attachment(index: stock.AttachmentIndex) -> tuple[Any, ...]:
    return (
        index.offset, index.length, index.create_time, index.log_time, index.data_size,
        index.name, index.media_type,
    )  # fmt: skip
