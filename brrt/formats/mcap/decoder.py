"""Chunks of an MCAP file into events; every length and place in them may lie."""

import struct
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import zstandard
from mcap import records
from mcap.opcode import Opcode
from numpy.typing import NDArray

from brrt.errors import BrrtError, RecordingError
from brrt.events import FIELDS, Events, Kind, table_dtype
from brrt.formats.integrity import MOST_BYTES, BrokenError, DamagedError, Numbering
from brrt.formats.mcap.cdr import MESSAGE, RECORD_HEAD, Layout
from brrt.formats.mcap.records import parsed
from brrt.formats.mcap.summary import LABELS
from brrt.scenario.manifest import Manifest

_ANY, _TIMES = 1 << 20, 256
"""Of what a chunk unpacks to: bytes in any case, and times its size; events come to 15 times."""

_DECLARATIONS = (Opcode.SCHEMA, Opcode.CHANNEL)
_MOST_DECLARED, _MOST_SCHEMA = 100_000, 1 << 20
"""Schemas and channels in a file, which other tools repeat in each chunk; bytes of a schema."""

_MOST_SEARCHED = 4_000_000
"""Messages that are searched for in chunks without an index: a second or two."""

_INDEX = np.dtype([("log_time", "<u8"), ("offset", "<u8")])


@dataclass(slots=True)
class _Channel:
    kind: Kind
    layout: Layout


@dataclass(slots=True)
class Decoder:
    """Turns chunks into events; knows the channels seen so far.

    Attributes:
        path: The file.
        manifest: The run's.
        numbering: How far the events go.
        wrong: What is wrong with the file; None as long as nothing is.
        over: Whether an event is missing or unsound, so that nothing behind it is of use.
        searched: Messages that were looked for without an index.
        declared: Schemas and channels so far.
        schemas: Text of each schema.
        channels: What each channel holds, if it is ours.
    """

    path: Path
    manifest: Manifest
    numbering: Numbering = field(default_factory=Numbering)
    wrong: BrokenError | None = None
    over: bool = False
    searched: int = 0
    declared: int = 0
    schemas: dict[int, str] = field(default_factory=dict)
    channels: dict[int, _Channel] = field(default_factory=dict)

    def damaged(self, why: str) -> DamagedError:
        """Return the error for what is wrong behind the events so far."""
        last = self.numbering.next - 1
        place = "" if last < 0 else f" after event {last:,}"
        return DamagedError(self.path, f"damaged{place}: {why}")

    def index(self, data: bytes) -> tuple[int, NDArray[np.uint64]]:
        """Read where a channel's messages are in the chunk ahead."""
        if len(data) < 6:
            raise self.damaged("an index lies about its size")
        channel, nbytes = struct.unpack_from("<HI", data)
        if nbytes != len(data) - 6 or nbytes % _INDEX.itemsize:
            raise self.damaged("an index lies about its size")
        return channel, np.frombuffer(data, _INDEX, offset=6)["offset"]

    def unpack(self, data: bytes) -> bytes:
        """Decompress a chunk's records and check them."""
        chunk = parsed(self.path, records.Chunk, data)
        size = chunk.uncompressed_size
        try:
            if chunk.compression == "":
                raw = chunk.data
            elif chunk.compression != "zstd":
                raise self.damaged(f"compression {chunk.compression!r} is not brrt's")
            elif size > min(MOST_BYTES, _ANY + _TIMES * len(chunk.data)):
                raise self.damaged(f"a chunk says that it unpacks to {size:,} bytes")
            elif zstandard.frame_content_size(chunk.data) != size:
                raise self.damaged("a chunk lies about its size")
            else:
                raw = zstandard.ZstdDecompressor().decompress(chunk.data)
        except zstandard.ZstdError as error:
            raise self.damaged(str(error)) from None
        if len(raw) != size or zlib.crc32(raw) != chunk.uncompressed_crc:
            raise self.damaged("the checksum of a chunk does not match")
        return bytes(raw)

    def learn(self, raw: bytes) -> int:
        """Take in the schemas and channels that a chunk begins with; return where they end."""
        at = 0
        while at + 9 <= len(raw) and raw[at] in _DECLARATIONS:
            at = self._declare(raw, at)
        return at

    def _declare(self, raw: bytes, at: int) -> int:
        """Take in a schema or a channel; return where it ends."""
        opcode, length = struct.unpack_from("<BQ", raw, at)
        end: int = at + 9 + length
        self.declared += 1
        if self.declared > _MOST_DECLARED or length > _MOST_SCHEMA:
            raise self.damaged("it declares more than any real file")
        data = raw[at + 9 : end]
        if opcode == Opcode.SCHEMA:
            schema = parsed(self.path, records.Schema, data)
            self.schemas[schema.id] = schema.data.decode(errors="replace")
            return end
        channel = parsed(self.path, records.Channel, data)
        if channel.topic not in LABELS or channel.schema_id not in self.schemas:
            return end
        try:
            layout = Layout.parse(self.schemas[channel.schema_id])
        except (BrrtError, ValueError) as error:
            raise self.damaged(f"the schema of {channel.topic}: {error}") from None
        self.channels[channel.id] = _Channel(LABELS[channel.topic], layout)
        return end

    def events(self, chunk: bytes, index: Mapping[int, NDArray[np.uint64]]) -> Events:
        """Decode the messages of a chunk, as far as they are sound; the rest is noted.

        Args:
            chunk: Content of a chunk's record.
            index: Where the messages of each channel are, as far as its indexes say.

        Raises:
            RecordingError: The chunk does not hold what it says.
        """
        raw = self.unpack(chunk)
        begin = self.learn(raw)
        try:
            tables, size = self._tables(raw, index)
            # A file that was cut between a chunk and its indexes, or written anew by other tools.
            if begin + size == len(raw):
                events = self._joined(tables)
                self.numbering.take(events)
                return events
        except BrrtError as error:
            # The chunk's own checksum is right: its messages are there, wherever the index points.
            self.note(error)
        tables, _ = self._tables(raw, self._found(raw, begin))
        events, wrong = self.numbering.beginning(self._joined(tables))
        if wrong is not None:
            self.note(wrong)
            self.over = True
        return events

    def note(self, error: BrrtError) -> None:
        """Keep in mind what is wrong with the file: the first thing, which others follow from."""
        if self.wrong is not None:
            return
        if isinstance(error, BrokenError):
            self.wrong = error
        elif isinstance(error, RecordingError):
            self.wrong = DamagedError(self.path, str(error).removeprefix(f"{self.path}: "))
        else:
            self.wrong = self.damaged(str(error))

    def _joined(self, tables: Mapping[Kind, NDArray[np.void]]) -> Events:
        return Events(self.manifest.dof, dict(sorted(tables.items())))

    def _tables(
        self, raw: bytes, index: Mapping[int, NDArray[np.uint64]]
    ) -> tuple[dict[Kind, NDArray[np.void]], int]:
        """Decode the messages of our channels; return how many bytes they are, too."""
        tables, size = dict[Kind, NDArray[np.void]](), 0
        for number, offsets in index.items():
            channel = self.channels.get(number)
            if channel is not None and len(offsets):
                if channel.kind in tables:
                    raise self.damaged(f"two channels hold events of kind {channel.kind.label}")
                tables[channel.kind] = self._table(raw, number, channel, offsets)
                size += self._sizes(raw, channel, offsets)
        return tables, size

    def _sizes(self, raw: bytes, channel: _Channel, offsets: NDArray[np.uint64]) -> int:
        """Bytes of messages, of which `_table` has seen that they are some."""
        if channel.layout.ragged is None:
            return len(offsets) * channel.layout.record.itemsize
        return sum(9 + int(struct.unpack_from("<Q", raw, int(at) + 1)[0]) for at in offsets)

    def _found(self, raw: bytes, at: int) -> dict[int, NDArray[np.uint64]]:
        """Index the messages of a chunk by going from one to the next."""
        found: dict[int, list[int]] = {}
        while at < len(raw):
            if raw[at] in _DECLARATIONS and at + 9 <= len(raw):
                at = self._declare(raw, at)
                continue
            if at + RECORD_HEAD.itemsize > len(raw) or self.searched > _MOST_SEARCHED:
                raise self.damaged("a chunk without its index")
            opcode, length, channel = struct.unpack_from("<BQH", raw, at)
            if opcode == MESSAGE:
                found.setdefault(channel, []).append(at)
            at += 9 + length
            self.searched += 1
        return {channel: np.array(places, np.uint64) for channel, places in found.items()}

    def _table(
        self, raw: bytes, number: int, channel: _Channel, offsets: NDArray[np.uint64]
    ) -> NDArray[np.void]:
        layout, size = channel.layout, channel.layout.record.itemsize
        places = len(raw) - size + 1
        if len(offsets) * size > len(raw) or int(offsets.max()) >= places:
            raise self.damaged("an index points out of its chunk")
        window = np.ndarray((places,), f"V{size}", raw, strides=(1,))
        block = window[offsets].view(layout.record)
        sound = (block["op"] == MESSAGE) & (block["channel"] == number)
        if layout.ragged is None:
            sound &= block["length"] == size - 9
        if not sound.all():
            raise self.damaged("an index does not point at a message")
        table = np.empty(len(block), table_dtype(channel.kind, self.manifest.dof))
        table["seq"] = block["seq"]
        table["t"] = block["log_time"].astype(np.int64) - self.manifest.epoch_ns
        table["iteration"] = block["iteration"]
        for name in (f.name for f in FIELDS[channel.kind]):
            if name == layout.ragged:
                for i, offset in enumerate(offsets):
                    table[name][i] = self._sequence(raw, int(offset), layout, block[name][i])
            elif not _fits(block.dtype, table.dtype, name):
                raise self.damaged(f"{channel.kind.label} has no such field {name!r} as it needs")
            else:
                table[name] = block[name]
        return table

    def _sequence(self, raw: bytes, offset: int, layout: Layout, count: int) -> NDArray[np.float64]:
        begin, dof = offset + layout.sequence_at(), self.manifest.dof
        if begin + 8 * int(count) > len(raw) or int(count) % dof:
            raise self.damaged("a sequence reaches out of its chunk")
        return np.frombuffer(raw, "<f8", int(count), begin).reshape(-1, dof).copy()


def _fits(there: np.dtype[Any], wanted: np.dtype[Any], name: str) -> bool:
    """Whether a field is there with as many numbers, and of a type that holds no others."""
    if name not in (there.names or ()):
        return False
    a, b = there[name], wanted[name]
    return a.shape == b.shape and np.can_cast(a.base, b.base)
