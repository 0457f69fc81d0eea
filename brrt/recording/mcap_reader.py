"""Events out of MCAP: record by record from the front, so that a cut file gives what it has."""

import json
import struct
import zlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from io import BytesIO
from pathlib import Path
from typing import IO, Any, TypeVar

import numpy as np
import zstandard
from mcap import records
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from numpy.typing import NDArray

from brrt.errors import BrrtError, RecordingError
from brrt.events import FIELDS, Events, Kind, table_dtype
from brrt.recording.cdr import MESSAGE, Layout
from brrt.recording.container import MAGIC
from brrt.recording.mcap_writer import RESULT, RUN, WORLD
from brrt.recording.recording import Recording
from brrt.scenario import Manifest
from brrt.worlds.world import World

T = TypeVar("T")
U = TypeVar("U")

_MAX_RECORD = 1 << 28
"""Bytes that a record or a chunk may hold: a length that lies must not exhaust the memory."""

_FOOTER = 29
"""Bytes of the footer's record."""

_INDEX = np.dtype([("log_time", "<u8"), ("offset", "<u8")])
_LABELS = {f"/brrt/{kind.label}": kind for kind in Kind}


class CutError(RecordingError):
    """The file ends before its end; what stands before the cut was delivered."""


def read_mcap(path: Path) -> Recording:
    """Open a recording.

    Its batches raise `CutError` behind the last whole chunk of a file that was cut.

    Raises:
        RecordingError: The file cannot be read, or is not a recording of brrt.
    """
    manifest: Manifest | None = None
    with _opened(path) as file:
        for opcode, data in _records(path, file, check_end=False):
            if opcode == Opcode.METADATA:
                metadata = _parse(path, records.Metadata, data)
                if metadata.name == RUN:
                    manifest = _named(path, Manifest.from_strings, metadata.metadata)
            elif opcode == Opcode.ATTACHMENT and manifest is not None:
                attachment = _parse(path, records.Attachment, data)
                if attachment.name == WORLD:
                    world = _named(path, World.from_json, attachment.data)
                    result = _result(path)
                    return Recording(manifest, world, partial(_batches, path, manifest), result)
            elif opcode in (Opcode.CHUNK, Opcode.DATA_END):
                break
    raise RecordingError(f"{path}: an MCAP file, but not a recording of brrt (no {RUN} in front)")


def _named(path: Path, parse: Callable[[T], U], value: T) -> U:
    try:
        return parse(value)
    except BrrtError as error:
        raise RecordingError(f"{path}: {error}") from None


def _opened(path: Path) -> IO[bytes]:
    try:
        file = path.open("rb")
        magic = file.read(len(MAGIC))
    except OSError as error:
        raise RecordingError(f"{path}: {error.strerror or error}") from None
    if magic != MAGIC:
        file.close()
        raise RecordingError(f"{path}: not an MCAP file")
    return file


def _parse(path: Path, kind: Any, data: bytes) -> Any:
    try:
        return kind.read(ReadDataStream(BytesIO(data)))
    except Exception as error:  # noqa: BLE001 - mcap raises whatever a damaged length leads to
        raise RecordingError(f"{path}: damaged {kind.__name__}: {error}") from None


def _records(path: Path, file: IO[bytes], *, check_end: bool) -> Iterator[tuple[int, bytes]]:
    """Yield opcode and content of each record of the data section, DataEnd included."""
    crc = zlib.crc32(MAGIC)
    while True:
        head = file.read(9)
        if len(head) < 9:
            raise CutError(f"{path}: the file is cut at byte {file.tell():,}")
        opcode, length = struct.unpack("<BQ", head)
        if length > _MAX_RECORD:
            raise RecordingError(
                f"{path}: damaged near byte {file.tell():,}: a record of {length} bytes"
            )
        data = file.read(length)
        if len(data) < length:
            raise CutError(f"{path}: the file is cut at byte {file.tell():,}")
        if opcode == Opcode.DATA_END:
            stated = _parse(path, records.DataEnd, data).data_section_crc
            yield opcode, data
            if check_end:
                if stated and stated != crc:
                    raise RecordingError(f"{path}: damaged: the checksum of the data differs")
                _check_summary(path, file)
            return
        crc = zlib.crc32(data, zlib.crc32(head, crc))
        yield opcode, data


def _check_summary(path: Path, file: IO[bytes]) -> None:
    """See that what follows the data is whole: summary, footer, magic.

    Raises:
        CutError: It is not all there.
        RecordingError: It is damaged.
    """
    rest = file.read(_MAX_RECORD)
    if not rest.endswith(MAGIC) or len(rest) < _FOOTER + len(MAGIC):
        raise CutError(f"{path}: the file is cut at byte {file.tell():,}, behind the last event")
    # All but the checksum itself, which is the footer's last field.
    body, crc = rest[: -len(MAGIC) - 4], rest[-len(MAGIC) - 4 : -len(MAGIC)]
    if zlib.crc32(body) != struct.unpack("<I", crc)[0]:
        raise RecordingError(f"{path}: damaged: the checksum of the summary differs")


def _result(path: Path) -> Mapping[str, Any] | None:
    """Look up the figures at the end of the file; None where it has no whole end."""
    from mcap.reader import SeekingReader  # noqa: PLC0415 - only here

    with path.open("rb") as file:
        try:
            for record in SeekingReader(file).iter_metadata():
                if record.name == RESULT:
                    return {name: json.loads(text) for name, text in record.metadata.items()}
        except Exception:  # noqa: BLE001 - a cut file fails in many ways; its events are still good
            return None
    return None


@dataclass(slots=True)
class _Channel:
    kind: Kind
    layout: Layout


@dataclass(slots=True)
class _Decoder:
    """Turns chunks into events; knows the channels seen so far."""

    path: Path
    manifest: Manifest
    seq: int = 0
    schemas: dict[int, str] = field(default_factory=dict)
    channels: dict[int, _Channel] = field(default_factory=dict)

    def damaged(self, why: str) -> RecordingError:
        return RecordingError(f"{self.path}: damaged after event {self.seq - 1:,}: {why}")

    def unpack(self, data: bytes) -> bytes:
        """Decompress a chunk's records and check them."""
        chunk = _parse(self.path, records.Chunk, data)
        size = chunk.uncompressed_size
        try:
            if chunk.compression == "":
                raw = chunk.data
            elif chunk.compression != "zstd":
                raise self.damaged(f"compression {chunk.compression!r} is not brrt's")
            elif size > _MAX_RECORD or zstandard.frame_content_size(chunk.data) != size:
                raise self.damaged("a chunk lies about its size")
            else:
                raw = zstandard.ZstdDecompressor().decompress(chunk.data)
        except zstandard.ZstdError as error:
            raise self.damaged(str(error)) from None
        if len(raw) != size or zlib.crc32(raw) != chunk.uncompressed_crc:
            raise self.damaged("the checksum of a chunk does not match")
        self._learn(raw)
        return bytes(raw)

    def _learn(self, raw: bytes) -> None:
        """Take in the schemas and channels that a chunk begins with."""
        at = 0
        while at + 9 <= len(raw) and raw[at] in (Opcode.SCHEMA, Opcode.CHANNEL):
            length = struct.unpack_from("<Q", raw, at + 1)[0]
            data = raw[at + 9 : at + 9 + length]
            if raw[at] == Opcode.SCHEMA:
                schema = _parse(self.path, records.Schema, data)
                self.schemas[schema.id] = schema.data.decode(errors="replace")
            else:
                channel = _parse(self.path, records.Channel, data)
                if channel.topic in _LABELS and channel.schema_id in self.schemas:
                    layout = Layout.parse(self.schemas[channel.schema_id])
                    self.channels[channel.id] = _Channel(_LABELS[channel.topic], layout)
            at += 9 + length

    def events(self, raw: bytes, index: Mapping[int, NDArray[np.uint64]]) -> Events:
        """Decode the messages that the indexes point at.

        Raises:
            RecordingError: An index or a record does not hold what it says.
        """
        tables = {}
        for number, offsets in index.items():
            channel = self.channels.get(number)
            if channel is not None and len(offsets):
                tables[channel.kind] = self._table(raw, number, channel, offsets)
        events = Events(self.manifest.dof, dict(sorted(tables.items())))
        n = len(events)
        seqs = np.concatenate([t["seq"] for t in tables.values()]) if tables else np.empty(0)
        if n and not (seqs.min() == self.seq and seqs.max() == self.seq + n - 1):
            raise self.damaged("events are missing")
        self.seq += n
        return events

    def _table(
        self, raw: bytes, number: int, channel: _Channel, offsets: NDArray[np.uint64]
    ) -> NDArray[np.void]:
        layout, size = channel.layout, channel.layout.record.itemsize
        places = len(raw) - size + 1
        if places <= 0 or int(offsets.max()) >= places:
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
            elif name not in (block.dtype.names or ()):
                raise self.damaged(f"the field {name!r} of {channel.kind.label} is missing")
            else:
                table[name] = block[name]
        return table

    def _sequence(self, raw: bytes, offset: int, layout: Layout, count: int) -> NDArray[np.float64]:
        begin, dof = offset + layout.sequence_at(), self.manifest.dof
        if begin + 8 * int(count) > len(raw) or int(count) % dof:
            raise self.damaged("a sequence reaches out of its chunk")
        return np.frombuffer(raw, "<f8", int(count), begin).reshape(-1, dof).copy()


def _batches(path: Path, manifest: Manifest) -> Iterator[Events]:
    """Yield the events of each chunk."""
    decoder = _Decoder(path, manifest)
    chunk: bytes | None = None
    index: dict[int, NDArray[np.uint64]] = {}
    with _opened(path) as file:
        for opcode, data in _records(path, file, check_end=True):
            if opcode == Opcode.MESSAGE_INDEX:
                channel, nbytes = struct.unpack_from("<HI", data)
                if nbytes != len(data) - 6 or nbytes % _INDEX.itemsize:
                    raise decoder.damaged("an index lies about its size")
                index[channel] = np.frombuffer(data, _INDEX, offset=6)["offset"]
                continue
            if chunk is not None:
                yield decoder.events(chunk, index)
                chunk, index = None, {}
            if opcode == Opcode.CHUNK:
                chunk = decoder.unpack(data)
