"""Events into MCAP: the ros2 profile, one topic a kind, a chunk of messages in one numpy pass."""

import json
import struct
import time
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import zstandard
from mcap import records
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from numpy.typing import NDArray

from brrt.errors import RecordingError
from brrt.events import FIELDS, Events, Kind
from brrt.recording.cdr import Layout, definition
from brrt.replay.metrics import Metrics
from brrt.scenario import Manifest
from brrt.worlds.world import World

MAGIC = b"\x89MCAP0\r\n"
RUN, RESULT, WORLD = "brrt.run", "brrt.result", "world.json"
"""Names of the metadata and of the attachment."""

_CHUNK_EVENTS = 8000
_CHUNK_SECONDS = 1.0
_INDEX = np.dtype([("log_time", "<u8"), ("offset", "<u8")])


def channel_of(kind: Kind) -> int:
    """Return the channel's number; 0 stands for no schema in MCAP."""
    return int(kind) + 1


class McapSink:
    """Writes every event, in order, to an MCAP file that stock tools read.

    Manifest and world come first, so that a cut file keeps them; the figures come last. A chunk
    is on its way to the disk at the latest a second after its first event was written.

    Args:
        path: The file; it is overwritten.
        manifest: The run's.
        world: The run's.

    Raises:
        RecordingError: The file cannot be written.
    """

    def __init__(self, path: Path | str, manifest: Manifest, world: World) -> None:
        self._path, self._epoch = Path(path), manifest.epoch_ns
        self._metrics = Metrics(manifest)
        self._layouts = {kind: Layout.parse(definition(kind, manifest.dof)) for kind in Kind}
        self._compressor = zstandard.ZstdCompressor(level=1)
        self._pending: list[Events] = []
        self._dof, self._pending_since = manifest.dof, 0.0
        self._position, self._crc = 0, 0
        self._index = _Summary(manifest.dof)
        try:
            self._file = self._path.open("wb")
        except OSError as error:
            raise RecordingError(f"cannot write {path}: {error.strerror or error}") from None
        self._write(MAGIC)
        self._record(records.Header("ros2", f"brrt {manifest.made_by.get('brrt', '')}".strip()))
        self._metadata(RUN, manifest.to_strings())
        self._attach(WORLD, world.to_json().encode(), manifest.epoch_ns)
        self._prefix = self._index.schemas_and_channels()

    def write(self, events: Events) -> None:
        """Take a batch; small ones are gathered into one chunk."""
        if not len(events):
            return
        now = time.monotonic()
        if not self._pending:
            self._pending_since = now
        self._pending.append(events)
        late = now - self._pending_since > _CHUNK_SECONDS
        if late or sum(map(len, self._pending)) >= _CHUNK_EVENTS:
            self._flush_chunk()

    def close(self, *, whole: bool) -> None:
        """Write what is pending, the figures, the index and the footer."""
        if self._file.closed:
            return
        try:
            self._flush_chunk()
            if whole:
                figures = self._metrics.as_dict()
                self._metadata(RESULT, {name: json.dumps(value) for name, value in figures.items()})
            self._finish()
        finally:
            self._shut()

    def _shut(self) -> None:
        try:
            self._file.close()
        except OSError as error:
            raise self._failure(error) from None

    def _failure(self, error: OSError) -> RecordingError:
        return RecordingError(
            f"cannot go on writing {self._path}: {error.strerror or error}; "
            f"what was written before can be replayed with --partial"
        )

    def _flush_chunk(self) -> None:
        if not self._pending:
            return
        pending = self._pending
        events = pending[0] if len(pending) == 1 else Events.concat(self._dof, pending)
        self._pending = []
        self._metrics.write(events)
        raw, times, channels, offsets = self._encode(events)
        if self._prefix:
            raw, offsets = self._prefix + raw, offsets + len(self._prefix)
            self._prefix = b""
        self._chunk(raw, times, channels, offsets)
        try:
            self._file.flush()
        except OSError as error:
            raise self._failure(error) from None

    def _encode(
        self, events: Events
    ) -> tuple[bytes, NDArray[np.uint64], NDArray[np.uint8], NDArray[np.uint64]]:
        """Lay out Message records: (bytes, log times, channels, offsets of the records)."""
        first, kinds = events.kinds_in_order()
        sizes = np.zeros(len(kinds), np.int64)
        times = np.empty(len(kinds), np.uint64)
        blocks: list[tuple[NDArray[np.int64], Any]] = []
        for kind, table in events.tables.items():
            rows = table["seq"] - first
            records_of = self._fill(kind, table)
            times[rows] = records_of["log_time"]
            layout = self._layouts[kind]
            if layout.ragged is None:
                sizes[rows] = layout.record.itemsize
                blocks.append((rows, records_of))
                continue
            for i, row in enumerate(rows):
                packed = layout.pack(records_of[i], table[layout.ragged][i])
                sizes[row] = len(packed)
                blocks.append((rows[i : i + 1], np.frombuffer(packed, f"V{len(packed)}")))
        offsets = np.cumsum(sizes) - sizes
        raw = np.empty(int(sizes.sum()), np.uint8)
        for rows, block in blocks:
            size = block.dtype.itemsize
            # Every place where a record of this size could begin, as one overlapping view.
            window = np.ndarray((len(raw) - size + 1,), f"V{size}", raw.data, strides=(1,))
            window[offsets[rows]] = block.view(f"V{size}")
        return raw.tobytes(), times, kinds + np.uint8(1), offsets.astype(np.uint64)

    def _fill(self, kind: Kind, table: NDArray[np.void]) -> NDArray[np.void]:
        """Copy a table's columns into Message records."""
        layout = self._layouts[kind]
        block = layout.blank(len(table), channel_of(kind))
        block["seq"] = table["seq"] & 0xFFFFFFFF
        block["log_time"] = table["t"] + self._epoch
        block["publish_time"] = block["log_time"]
        block["iteration"] = table["iteration"]
        for field in FIELDS[kind]:
            if field.name != layout.ragged:
                block[field.name] = table[field.name]
        return block

    def _chunk(
        self,
        raw: bytes,
        times: NDArray[np.uint64],
        channels: NDArray[np.uint8],
        offsets: NDArray[np.uint64],
    ) -> None:
        """Write a chunk with its message indexes."""
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

    def _write(self, data: bytes) -> None:
        self._crc = zlib.crc32(data, self._crc)
        self._position += len(data)
        try:
            self._file.write(data)
        except OSError as error:
            raise self._failure(error) from None

    def _record(self, record: records.McapRecord) -> tuple[int, int]:
        """Write a record; return where it begins and how long it is."""
        builder = RecordBuilder()
        record.write(builder)
        data, start = builder.end(), self._position
        self._write(data)
        return start, len(data)

    def _metadata(self, name: str, texts: dict[str, str]) -> None:
        start, length = self._record(records.Metadata(name, texts))
        self._index.metadata.append(records.MetadataIndex(start, length, name))

    def _attach(self, name: str, data: bytes, at_ns: int) -> None:
        kind = "application/json"
        attachment = records.Attachment(
            create_time=at_ns, log_time=at_ns, name=name, media_type=kind, data=data
        )
        start, length = self._record(attachment)
        self._index.attachments.append(
            records.AttachmentIndex(start, length, at_ns, at_ns, len(data), name, kind)
        )

    def _finish(self) -> None:
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
        try:
            self._file.flush()
        except OSError as error:
            raise self._failure(error) from None


class _Summary:
    """What the end of the file says of the rest."""

    def __init__(self, dof: int) -> None:
        self.schemas = [
            records.Schema(
                id=channel_of(kind),
                data=definition(kind, dof).encode(),
                encoding="ros2msg",
                name=f"brrt_msgs/msg/{kind.label.capitalize()}",
            )
            for kind in Kind
        ]
        self.channels = [
            records.Channel(
                id=channel_of(kind),
                topic=f"/brrt/{kind.label}",
                message_encoding="cdr",
                metadata={},
                schema_id=channel_of(kind),
            )
            for kind in Kind
        ]
        self.chunks: list[records.ChunkIndex] = []
        self.attachments: list[records.AttachmentIndex] = []
        self.metadata: list[records.MetadataIndex] = []
        self._counts: dict[int, int] = {}

    def schemas_and_channels(self) -> bytes:
        """Return their records, for the first chunk."""
        builder = RecordBuilder()
        for record in (*self.schemas, *self.channels):
            record.write(builder)
        return bytes(builder.end())

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
