"""MCAP files chunk by chunk: whatever is no message, every index, and every checksum."""

import struct
import zlib
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

MAGIC = b"\x89MCAP0\r\n"

_INDEX = np.dtype([("log_time", "<u8"), ("offset", "<u8")])


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
        self._index = _Summary()
        self._prefix = b""
        self._file = OutputFile(path)
        self._waiting: list[bytes] = []
        self._written = 0
        self._write(MAGIC)
        self._record(records.Header("ros2", library))

    @property
    def closed(self) -> bool:
        """Whether nothing can be written any more."""
        return self._file.closed

    def declare(self, *declared: records.Schema | records.Channel) -> None:
        """Declare schemas and channels before the first chunk that needs them."""
        builder = RecordBuilder()
        for record in declared:
            record.write(builder)
        self._prefix += builder.end()
        self._index.declare(*declared)

    def chunk(
        self,
        raw: bytes,
        times: NDArray[np.uint64],
        channels: NDArray[np.unsignedinteger[Any]],
        offsets: NDArray[np.uint64],
    ) -> None:
        """Write a chunk with its message indexes, as far as the disk.

        Args:
            raw: Message records, at least one.
            times: Their log times, none before the one ahead of it, shape (n,).
            channels: Their channels, shape (n,).
            offsets: Where they begin, shape (n,).
        """
        if self._prefix:
            raw, offsets = self._prefix + raw, offsets + np.uint64(len(self._prefix))
            self._prefix = b""
        low, high = int(times[0]), int(times[-1])
        data = self._compressor.compress(raw)
        chunk = records.Chunk("zstd", data, high, low, zlib.crc32(raw), len(raw))
        start, length = self._record(chunk)
        index_offsets, begin = {}, self._position
        counts = np.bincount(channels)
        for channel in np.flatnonzero(counts):
            mine = channels == channel
            entries = np.empty(int(counts[channel]), _INDEX)
            entries["log_time"], entries["offset"] = times[mine], offsets[mine]
            index_offsets[int(channel)] = self._position
            # opcode MessageIndex, length, channel, bytes of entries
            head = struct.pack("<BQHI", 7, 6 + entries.nbytes, channel, entries.nbytes)
            self._write(head + entries.tobytes())
        self._index.add_chunk(
            records.ChunkIndex(
                length,
                start,
                "zstd",
                len(data),
                high,
                self._position - begin,
                index_offsets,
                low,
                len(raw),
            ),
            {int(c): int(counts[c]) for c in np.flatnonzero(counts)},
        )
        self.flush()

    def metadata(self, name: str, texts: dict[str, str]) -> None:
        """Write named texts."""
        start, length = self._record(records.Metadata(name, texts))
        self._index.metadata.append(records.MetadataIndex(start, length, name))

    def attach(self, name: str, data: bytes, at_ns: int) -> None:
        """Write an attachment in JSON."""
        kind = "application/json"
        attachment = records.Attachment(
            create_time=at_ns, log_time=at_ns, name=name, media_type=kind, data=data
        )
        start, length = self._record(attachment)
        self._index.attachments.append(
            records.AttachmentIndex(start, length, at_ns, at_ns, len(data), name, kind)
        )

    def finish(self) -> None:
        """Write the end of the data section, the summary and the footer."""
        self._record(records.DataEnd(self._crc))
        start = self._position
        summary, offsets_at = self._index.build(start)
        # opcode Footer, length, start of the summary, start of its offsets: all under the CRC
        crc = zlib.crc32(
            struct.pack("<BQQQ", Opcode.FOOTER, 20, start, offsets_at), zlib.crc32(summary)
        )
        self._write(summary)
        self._record(records.Footer(start, offsets_at, crc))
        self._write(MAGIC)
        self.flush()

    def flush(self) -> None:
        """Write what there is as far as the operating system; only now the file has its name.

        A disk that does not take all of it gets none of it, and the file is closed: what it holds
        can be read.
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
        builder = RecordBuilder()
        record.write(builder)
        data, start = builder.end(), self._position
        self._write(data)
        return start, len(data)


class _Summary:
    """What the end of the file says of the rest."""

    def __init__(self) -> None:
        self.schemas: list[records.Schema] = []
        self.channels: list[records.Channel] = []
        self.chunks: list[records.ChunkIndex] = []
        self.attachments: list[records.AttachmentIndex] = []
        self.metadata: list[records.MetadataIndex] = []
        self._counts: dict[int, int] = {}

    def declare(self, *declared: records.Schema | records.Channel) -> None:
        """Note schemas and channels."""
        self.schemas += [record for record in declared if isinstance(record, records.Schema)]
        self.channels += [record for record in declared if isinstance(record, records.Channel)]

    def add_chunk(self, chunk: records.ChunkIndex, counts: dict[int, int]) -> None:
        """Note a chunk and its messages by channel."""
        self.chunks.append(chunk)
        for channel, count in counts.items():
            self._counts[channel] = self._counts.get(channel, 0) + count

    def build(self, start: int) -> tuple[bytes, int]:
        """Return the summary that begins at `start`, and where its offsets begin."""
        groups: list[tuple[Opcode, list[Any]]] = [
            (Opcode.SCHEMA, self.schemas),
            (Opcode.CHANNEL, self.channels),
            (Opcode.STATISTICS, [self._statistics()]),
            (Opcode.CHUNK_INDEX, self.chunks),
            (Opcode.ATTACHMENT_INDEX, self.attachments),
            (Opcode.METADATA_INDEX, self.metadata),
        ]
        builder, offsets = RecordBuilder(), []
        for opcode, group in groups:
            begin = builder.count
            for record in group:
                record.write(builder)
            if group:
                offsets.append(records.SummaryOffset(opcode, start + begin, builder.count - begin))
        at = start + builder.count
        for offset in offsets:
            offset.write(builder)
        return builder.end(), at

    def _statistics(self) -> records.Statistics:
        return records.Statistics(
            attachment_count=len(self.attachments),
            channel_count=len(self.channels),
            channel_message_counts=self._counts,
            chunk_count=len(self.chunks),
            message_count=sum(self._counts.values()),
            message_end_time=self.chunks[-1].message_end_time if self.chunks else 0,
            message_start_time=self.chunks[0].message_start_time if self.chunks else 0,
            metadata_count=len(self.metadata),
            schema_count=len(self.schemas),
        )
