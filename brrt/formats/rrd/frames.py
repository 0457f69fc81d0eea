"""What an .rrd file is made of: frames that hold Arrow record batches, read into bounded memory.

A frame is a kind, a length and a message of Protocol Buffers; in that an Arrow stream, as a rule
compressed by LZ4. Every length in it may lie.
"""

import struct
from collections.abc import Iterator
from typing import Any

import pyarrow  # noqa: ICN001 - it gets that name below

from brrt.errors import BrrtError
from brrt.formats.integrity import MOST_BYTES

pa: Any = pyarrow  # mypy knows none of its names

MAGIC, HEAD, FRAME = b"RRF2", 12, struct.Struct("<QQ")
"""How a file begins, bytes before its first frame, and kind and length of each frame."""

STREAM_ENDS, BATCH, FRAMES = 0, 2, range(4)
"""Kinds of frames: the end of the stream, one record batch, and all that there are."""

_COMPRESSION, _SIZE, _PAYLOAD = 2, 3, 5
"""Fields of a frame that holds a record batch."""
_LZ4 = 2
_MOST_FIELDS = 16


def unpacked(message: bytes) -> memoryview:
    """Return the Arrow stream in a message.

    Raises:
        BrrtError: The message says what cannot be.
    """
    found = _protobuf(memoryview(message))
    payload, size = found[_PAYLOAD], found.get(_SIZE, 0)
    if found.get(_COMPRESSION) != _LZ4:
        return memoryview(payload)
    # A byte of LZ4 stands for 255 at most.
    if size > min(MOST_BYTES, 255 * len(payload)):
        raise BrrtError(f"{len(payload):,} bytes cannot hold {size:,}")
    return memoryview(pa.Codec("lz4_raw").decompress(pa.py_buffer(payload), size))


def _protobuf(data: memoryview) -> dict[int, Any]:
    """Split a message of Protocol Buffers into its fields: numbers or bytes."""
    found: dict[int, Any] = {}
    at = 0
    while at < len(data):
        key, at = _varint(data, at)
        number, wire = key >> 3, key & 7
        if len(found) > _MOST_FIELDS or number in found:
            raise BrrtError("a message with too many fields")
        if wire == 0:
            found[number], at = _varint(data, at)
            continue
        if wire != 2:
            raise BrrtError("a message with a field of an unknown kind")
        length, at = _varint(data, at)
        if length > len(data) - at:
            raise BrrtError("a message lies about its size")
        found[number], at = data[at : at + length], at + length
    return found


def _varint(data: memoryview, at: int) -> tuple[int, int]:
    value = shift = 0
    while shift < 64:
        byte = data[at]
        value, at = value | (byte & 127) << shift, at + 1
        if byte < 128:
            return value, at
        shift += 7
    raise BrrtError("a number without an end")


def opened(arrow: memoryview) -> tuple[str, Iterator[Any]]:
    """Return the entity of an Arrow stream and its record batches, found sound."""
    stream = pa.ipc.open_stream(pa.py_buffer(arrow))
    entity = (stream.schema.metadata or {}).get(b"rerun:entity_path", b"").decode()
    return entity, _record_batches(arrow)


def _record_batches(arrow: memoryview) -> Iterator[Any]:
    messages = pa.ipc.MessageReader.open_stream(pa.py_buffer(arrow))
    schema = pa.ipc.read_schema(messages.read_next_message())
    for message in messages:
        if message.type != "record batch" or _compresses(message.metadata.to_pybytes()):
            raise BrrtError("a record batch in a form that Rerun does not write")
        batch = pa.ipc.read_record_batch(message, schema)
        batch.validate(full=True)
        yield batch


def _compresses(message: bytes) -> bool:
    """Whether a message's buffers are compressed once more, to a size that only they know.

    By the FlatBuffers of Arrow: the header is the third field of a Message, the compression the
    fourth of a RecordBatch.
    """
    root = struct.unpack_from("<I", message)[0]
    batch = _slot(message, root, 2)
    if not batch:
        return False
    return _slot(message, batch + struct.unpack_from("<I", message, batch)[0], 3) != 0


def _slot(data: bytes, table: int, number: int) -> int:
    """Where a field of a FlatBuffers table is; 0 where it is left out."""
    slots = table - struct.unpack_from("<i", data, table)[0]
    entry = 4 + 2 * number
    if entry >= struct.unpack_from("<H", data, slots)[0]:
        return 0
    offset = struct.unpack_from("<H", data, slots + entry)[0]
    return table + offset if offset else 0
