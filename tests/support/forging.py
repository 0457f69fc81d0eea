"""MCAP files with anything changed in them, and all checksums and indexes right nevertheless."""

import struct
import zlib
from collections.abc import Callable, Iterable
from dataclasses import replace
from io import BytesIO
from typing import Any

from mcap import records
from mcap.data_stream import ReadDataStream, RecordBuilder
from mcap.opcode import Opcode

from brrt.formats.mcap.records import FOOTER_BYTES, MAGIC

Parts = list[Any]
"""Records, as stock mcap reads them, in order."""

_KINDS: dict[int, Any] = {
    Opcode.HEADER: records.Header, Opcode.SCHEMA: records.Schema, Opcode.CHANNEL: records.Channel,
    Opcode.MESSAGE: records.Message, Opcode.CHUNK: records.Chunk,
    Opcode.MESSAGE_INDEX: records.MessageIndex, Opcode.CHUNK_INDEX: records.ChunkIndex,
    Opcode.ATTACHMENT: records.Attachment, Opcode.ATTACHMENT_INDEX: records.AttachmentIndex,
    Opcode.METADATA: records.Metadata, Opcode.METADATA_INDEX: records.MetadataIndex,
    Opcode.STATISTICS: records.Statistics,
}  # fmt: skip


def to_bytes(*written: Any) -> bytes:
    """Return records as a file has them."""
    builder = RecordBuilder()
    for record in written:
        record.write(builder)
    return bytes(builder.end())


def split(raw: bytes) -> Parts:
    """Return the records of bytes that have nothing else, up to one of an unknown kind."""
    found, at = [], 0
    while at + 9 <= len(raw):
        opcode, length = struct.unpack_from("<BQ", raw, at)
        content = raw[at + 9 : at + 9 + length]
        if opcode not in _KINDS:
            break
        # Stock mcap must be told how long a message is.
        length_of = (length,) if opcode == Opcode.MESSAGE else ()
        found.append(_KINDS[opcode].read(ReadDataStream(BytesIO(content)), *length_of))
        at += 9 + length
    return found


def data_of(file: bytes) -> Parts:
    """Return the records of the data section of a file, without its end."""
    return split(file[len(MAGIC) :])


def declared_in(file: bytes) -> Parts:
    """Return the schemas and channels that the summary of a file repeats."""
    start = struct.unpack_from("<Q", file, len(file) - len(MAGIC) - FOOTER_BYTES + 9)[0]
    return [r for r in split(file[start:]) if isinstance(r, records.Schema | records.Channel)]


def summary_of(data: Parts, channels: Iterable[Any]) -> Parts:
    """Return the right summary of a data section whose messages are in chunks.

    Args:
        data: Its records.
        channels: Schemas and channels to repeat.
    """
    at, found, counts = len(MAGIC), list[Any](), dict[int, int]()
    for record in data:
        size = len(to_bytes(record))
        if isinstance(record, records.Chunk):
            found.append(
                records.ChunkIndex(
                    size, at, record.compression, len(record.data), record.message_end_time, 0, {},
                    record.message_start_time, record.uncompressed_size,
                )
            )  # fmt: skip
        elif isinstance(record, records.MessageIndex):
            chunk = found[-1]
            chunk.message_index_offsets[record.channel_id] = at
            chunk.message_index_length += size
            counts[record.channel_id] = counts.get(record.channel_id, 0) + len(record.records)
        elif isinstance(record, records.Metadata):
            found.append(records.MetadataIndex(at, size, record.name))
        elif isinstance(record, records.Attachment):
            found.append(
                records.AttachmentIndex(
                    at, size, record.create_time, record.log_time, len(record.data), record.name,
                    record.media_type,
                )
            )  # fmt: skip
        at += size
    declared = list(channels)
    chunks = [i for i in found if isinstance(i, records.ChunkIndex)]
    number = {kind: sum(isinstance(i, kind) for i in found + declared) for kind in _KINDS.values()}
    statistics = records.Statistics(
        number[records.AttachmentIndex], number[records.Channel], counts, len(chunks),
        sum(counts.values()), max((c.message_end_time for c in chunks), default=0),
        min((c.message_start_time for c in chunks), default=0), number[records.MetadataIndex],
        number[records.Schema],
    )  # fmt: skip
    return [*declared, statistics, *found]


def file_of(data: Parts, summary: Parts) -> bytes:
    """Return a file with right checksums of the data section and of the summary."""
    body = MAGIC + to_bytes(*data)
    body += to_bytes(records.DataEnd(zlib.crc32(body)))
    tail = to_bytes(*summary)
    footer = struct.pack("<BQQQ", Opcode.FOOTER, 20, len(body) if tail else 0, 0)
    crc = zlib.crc32(tail + footer)
    return body + tail + footer + struct.pack("<I", crc) + MAGIC


def rechunked(data: Parts, change: Callable[[Parts], Parts]) -> Parts:
    """Return a data section with the records of each chunk changed; its index is made anew."""
    import zstandard

    found = []
    for record in data:
        if isinstance(record, records.MessageIndex):
            continue
        if not isinstance(record, records.Chunk):
            found.append(record)
            continue
        raw = record.data
        if record.compression == "zstd":
            raw = zstandard.ZstdDecompressor().decompress(raw)
        inside = change(split(raw))
        raw, indexes, at = to_bytes(*inside), dict[int, records.MessageIndex](), 0
        for message in inside:
            if isinstance(message, records.Message):
                number = message.channel_id
                index = indexes.setdefault(number, records.MessageIndex(number, []))
                index.records.append((message.log_time, at))
            at += len(to_bytes(message))
        times = [m.log_time for m in inside if isinstance(m, records.Message)] or [0]
        packed = zstandard.ZstdCompressor().compress(raw)
        found += [
            records.Chunk("zstd", packed, max(times), min(times), zlib.crc32(raw), len(raw)),
            *indexes.values(),
        ]
    return found


def changed(parts: Parts, kind: Any, number: int = 0, **fields: Any) -> Parts:
    """Return records in which one of a kind has other fields."""
    places = [i for i, record in enumerate(parts) if isinstance(record, kind)]
    place = places[number]
    return [*parts[:place], replace(parts[place], **fields), *parts[place + 1 :]]
