"""Write MCAP files: chunks of messages, texts, indexes and the summary, all with checksums."""

import struct
import zlib
from collections import Counter
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import zstandard
from mcap import records
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from numpy.typing import NDArray

from brrt.files import OutputFile
from brrt.formats.mcap.records import FOOTER_BYTES, INDEX_ENTRY, MAGIC

SLACK = 16
"""Bytes by which rewritable texts may grow, such as a checksum by the digits of another one."""

_SUMMARY = {
    records.Schema: Opcode.SCHEMA,
    records.Channel: Opcode.CHANNEL,
    records.Statistics: Opcode.STATISTICS,
    records.ChunkIndex: Opcode.CHUNK_INDEX,
    records.AttachmentIndex: Opcode.ATTACHMENT_INDEX,
    records.MetadataIndex: Opcode.METADATA_INDEX,
}
"""What the summary consists of, in this order."""


class Container:
    """An MCAP file of the ros2 profile that is being written.

    All methods raise OSError where the file cannot be written.

    Args:
        path: The file; it is overwritten, but not before the first `flush`.
        library: Who writes it.
        level: Of the compression by zstd.
    """

    def __init__(self, path: Path, library: str, level: int = 1) -> None:
        self._compressor = zstandard.ZstdCompressor(level=level)
        self._position, self._crc = 0, 0
        self._summary: dict[type, list[Any]] = {kind: [] for kind in _SUMMARY}
        self._counts: Counter[int] = Counter()
        self._declarations = b""
        self._file = OutputFile(path)
        self._waiting: list[bytes] = []
        self._written = 0
        try:
            self._write(MAGIC)
            self._record(records.Header("ros2", library))
        except BaseException:
            self._file.close()
            raise

    @property
    def closed(self) -> bool:
        """Whether nothing can be written any more."""
        return self._file.closed

    def declare(self, *declared: records.Schema | records.Channel) -> None:
        """Declare schemas and channels before the first chunk that needs them."""
        self._declarations += _to_bytes(*declared)
        for record in declared:
            self._summary[type(record)].append(record)

    def chunk(
        self,
        raw: bytes,
        times: NDArray[np.uint64],
        channels: NDArray[np.unsignedinteger[Any]],
        offsets: NDArray[np.uint64],
    ) -> None:
        """Write a chunk with its message indexes, and hand it to the operating system.

        Args:
            raw: Message records, at least one.
            times: Their log times, which never fall, shape (n,).
            channels: Their channels, shape (n,).
            offsets: Where they begin, shape (n,).
        """
        raw, offsets = self._declarations + raw, offsets + np.uint64(len(self._declarations))
        self._declarations = b""
        low, high = int(times[0]), int(times[-1])
        data = self._compressor.compress(raw)
        start, length = self._record(
            records.Chunk("zstd", data, high, low, zlib.crc32(raw), len(raw))
        )
        indexes, begin = {}, self._position
        counts = np.bincount(channels)
        for channel in map(int, np.flatnonzero(counts)):
            of_channel = channels == channel
            entries = np.empty(int(counts[channel]), INDEX_ENTRY)
            entries["log_time"], entries["offset"] = times[of_channel], offsets[of_channel]
            indexes[channel] = self._position
            self._counts[channel] += len(entries)
            size = entries.nbytes
            head = struct.pack("<BQHI", Opcode.MESSAGE_INDEX, 6 + size, channel, size)
            self._write(head + entries.tobytes())
        self._summary[records.ChunkIndex].append(
            records.ChunkIndex(
                chunk_length=length,
                chunk_start_offset=start,
                compression="zstd",
                compressed_size=len(data),
                message_end_time=high,
                message_index_length=self._position - begin,
                message_index_offsets=indexes,
                message_start_time=low,
                uncompressed_size=len(raw),
            )
        )
        self.flush()

    def metadata(self, name: str, texts: Mapping[str, str]) -> None:
        """Write named texts."""
        start, length = self._record(records.Metadata(name, dict(texts)))
        self._summary[records.MetadataIndex].append(records.MetadataIndex(start, length, name))

    def rewritable_metadata(self, name: str, texts: Mapping[str, str]) -> None:
        """Write named texts that `rewrite_metadata` can replace."""
        start, length = self._write_at_end(_padded(name, texts))
        self._summary[records.MetadataIndex].append(records.MetadataIndex(start, length, name))

    def rewrite_metadata(self, name: str, old: Mapping[str, str], new: Mapping[str, str]) -> None:
        """Replace rewritable texts by others of at most `SLACK` bytes more; pipes keep the old."""
        index = next(i for i in self._summary[records.MetadataIndex] if i.name == name)
        before, after = _padded(name, old), _padded(name, new, index.length)
        self.flush()
        if self._file.rewrite(index.offset, after):
            # A CRC changes by that of the bytes that differ, followed by zeros up to the end.
            changed = bytes(a ^ b for a, b in zip(before, after, strict=True))
            rest = self._position - index.offset - len(after)
            self._crc ^= _crc_before_zeros(changed, rest)
            self._crc ^= _crc_before_zeros(bytes(len(changed)), rest)

    def attach(self, name: str, data: bytes, at_ns: int) -> None:
        """Write an attachment in JSON."""
        kind = "application/json"
        start, length = self._record(
            records.Attachment(
                create_time=at_ns, log_time=at_ns, name=name, media_type=kind, data=data
            )
        )
        self._summary[records.AttachmentIndex].append(
            records.AttachmentIndex(start, length, at_ns, at_ns, len(data), name, kind)
        )

    def finish(self) -> None:
        """Write the end of the data section, the summary and the footer."""
        self._record(records.DataEnd(self._crc))
        self._summary[records.Statistics] = [self._statistics()]
        start, offsets = self._position, list[records.SummaryOffset]()
        summary = b""
        for kind, opcode in _SUMMARY.items():
            group = _to_bytes(*self._summary[kind])
            if group:
                offsets.append(records.SummaryOffset(opcode, start + len(summary), len(group)))
            summary += group
        offsets_at = start + len(summary)
        summary += _to_bytes(*offsets)
        # Opcode, length, start of the summary and start of its offsets are under the CRC too.
        footer = struct.pack("<BQQQ", Opcode.FOOTER, FOOTER_BYTES - 9, start, offsets_at)
        self._write(summary)
        self._write(footer + struct.pack("<I", zlib.crc32(footer, zlib.crc32(summary))))
        self._write(MAGIC)
        self.flush()

    def flush(self) -> None:
        """Hand everything to the operating system; the first time, the file takes its name.

        What the disk does not take in whole is taken back, and the file is closed: what it then
        holds can be read.
        """
        waiting, self._waiting = b"".join(self._waiting), []
        try:
            self._file.write(waiting)
            self._file.appear()
        except OSError:
            self._file.truncate(self._written)
            with suppress(OSError):
                self._file.close()
            raise
        self._written = self._position

    def close(self) -> None:
        """Close the file as it is."""
        self._file.close()

    def _write(self, data: bytes) -> None:
        self._crc = zlib.crc32(data, self._crc)
        self._position += len(data)
        self._waiting.append(data)

    def _record(self, record: records.McapRecord) -> tuple[int, int]:
        """Write a record; return where it begins and how long it is."""
        return self._write_at_end(_to_bytes(record))

    def _write_at_end(self, data: bytes) -> tuple[int, int]:
        start = self._position
        self._write(data)
        return start, len(data)

    def _statistics(self) -> records.Statistics:
        chunks, counts = self._summary[records.ChunkIndex], self._counts
        return records.Statistics(
            attachment_count=len(self._summary[records.AttachmentIndex]),
            channel_count=len(self._summary[records.Channel]),
            channel_message_counts=counts,
            chunk_count=len(chunks),
            message_count=sum(counts.values()),
            message_end_time=chunks[-1].message_end_time if chunks else 0,
            message_start_time=chunks[0].message_start_time if chunks else 0,
            metadata_count=len(self._summary[records.MetadataIndex]),
            schema_count=len(self._summary[records.Schema]),
        )


def _padded(name: str, texts: Mapping[str, str], length: int | None = None) -> bytes:
    """Return a Metadata record with bytes at its end that readers ignore, as MCAP allows.

    Args:
        name: Its name.
        texts: Its texts.
        length: Bytes of the whole record; by default `SLACK` more than it needs.

    Raises:
        ValueError: It does not fit.
    """
    data = _to_bytes(records.Metadata(name, dict(texts)))
    length = len(data) + SLACK if length is None else length
    if len(data) > length:
        raise ValueError(f"{name} needs {len(data)} bytes, not {length}")
    head = struct.pack("<BQ", Opcode.METADATA, length - 9)
    return (head + data[len(head) :]).ljust(length, b"\0")


def _crc_before_zeros(data: bytes, zeros: int) -> int:
    """Return the CRC-32 of bytes and of as many zeros after them."""
    crc, block = zlib.crc32(data), bytes(1 << 20)
    for left in range(zeros, 0, -len(block)):
        crc = zlib.crc32(block[:left], crc)
    return crc


def _to_bytes(*written: records.McapRecord) -> bytes:
    builder = RecordBuilder()
    for record in written:
        record.write(builder)
    return bytes(builder.end())
