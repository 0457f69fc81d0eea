"""Read the records of MCAP files into bounded memory; every length in a file may be wrong."""

import json
import struct
import zlib
from collections.abc import Iterator, Mapping
from io import BytesIO
from os import SEEK_END
from pathlib import Path
from typing import IO, Any

import numpy as np
import zstandard
from mcap import records
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from numpy.typing import NDArray

from brrt.errors import BrrtError, RecordingError
from brrt.formats.integrity import MOST_BYTES, CutError, DamagedError

MAGIC = b"\x89MCAP0\r\n"
INDEX_ENTRY = np.dtype([("log_time", "<u8"), ("offset", "<u8")])
FOOTER_BYTES = 29
CHECKSUM = "crc32"
"""Name of the text that is the checksum of the others in a Metadata record."""

_BLOCK = 1 << 20
_MOST_BETWEEN = 1 << 17
"""Records between two chunks: there are 65,536 channels, and each may have an index."""
_ANY, _TIMES = 1 << 20, 256
"""Bytes that a chunk may unpack to: in any case, and times its size. Events come to 15 times."""


def open_mcap(path: Path) -> IO[bytes]:
    """Open an MCAP file behind its magic.

    Raises:
        RecordingError: It cannot be read, or is no such file.
    """
    try:
        file = path.open("rb")
        magic = file.read(len(MAGIC))
    except OSError as error:
        raise RecordingError(f"{path}: {error.strerror or error}") from None
    if magic != MAGIC:
        file.close()
        raise RecordingError(f"{path}: not an MCAP file")
    return file


def read_records(path: Path, file: IO[bytes]) -> Iterator[tuple[int, bytes]]:
    """Yield opcode and content of each record of the data section, DataEnd included.

    Args:
        path: The file, for messages.
        file: Open behind its magic.

    Raises:
        CutError: The file ends before the data section does.
        DamagedError: A length or the section's checksum is wrong.
    """
    crc, between = zlib.crc32(MAGIC), 0
    while True:
        head, data = _next_record(path, file)
        opcode = head[0]
        between = 0 if opcode == Opcode.CHUNK else between + 1
        if between > _MOST_BETWEEN:
            why = f"damaged near byte {file.tell():,}: {between:,} records without an event"
            raise DamagedError(path, why)
        if opcode == Opcode.DATA_END:
            stated = parse(records.DataEnd, data).data_section_crc
            if stated not in (0, crc):  # 0 stands for no checksum
                raise DamagedError(path, "damaged: the checksum of the data does not match")
            yield opcode, data
            return
        crc = zlib.crc32(data, zlib.crc32(head, crc))
        yield opcode, data


def _next_record(path: Path, file: IO[bytes]) -> tuple[bytes, bytes]:
    """Read opcode and length of a record, 9 bytes, and its content."""
    at, head = file.tell(), file.read(9)
    if head == MAGIC:
        raise DamagedError(path, "damaged: the data section has no end")
    if len(head) < 9:
        raise CutError(path, f"the file is cut at byte {file.tell():,}")
    if not any(head):  # after a power cut a file may have its length, but zeros at its end
        raise CutError(path, f"the file is cut at byte {at:,}: zeros follow")
    length = struct.unpack_from("<Q", head, 1)[0]
    if length > MOST_BYTES:
        raise DamagedError(path, f"damaged near byte {at:,}: a record of {length:,} bytes")
    data = _up_to(file, length)
    if len(data) < length:
        size = file.tell()
        file.seek(-len(MAGIC), SEEK_END)
        if file.read() == MAGIC:
            raise DamagedError(path, f"damaged near byte {at:,}: a record has a wrong length")
        raise CutError(path, f"the file is cut at byte {size:,}")
    return head, data


def _up_to(file: IO[bytes], size: int) -> bytes:
    """Read so many bytes or as many as there are; `read` makes room for all of them first."""
    if size <= _BLOCK:
        return file.read(size)
    blocks = []
    while size > 0 and (block := file.read(min(size, _BLOCK))):
        blocks.append(block)
        size -= len(block)
    return b"".join(blocks)


def with_checksum(texts: Mapping[str, str]) -> dict[str, str]:
    """Return named texts and their checksum: MCAP has none for one Metadata record."""
    return {**texts, CHECKSUM: str(zlib.crc32(json.dumps(sorted(texts.items())).encode()))}


def parse(kind: Any, data: bytes) -> Any:
    """Read a record of a kind from its content.

    Raises:
        BrrtError: It is not one.
    """
    try:
        return kind.read(ReadDataStream(BytesIO(data)))
    except Exception as error:  # noqa: BLE001 - mcap raises whatever a damaged length leads to
        raise BrrtError(f"a wrong {kind.__name__} record ({str(error) or repr(error)})") from None


def parse_metadata(data: bytes) -> records.Metadata:
    """Read named texts; their checksum, if they have one, is checked and removed.

    Raises:
        BrrtError: They are damaged.
    """
    metadata: records.Metadata = parse(records.Metadata, data)
    stated = metadata.metadata.pop(CHECKSUM, None)
    if stated is not None and stated != with_checksum(metadata.metadata)[CHECKSUM]:
        raise BrrtError(f"the checksum of {metadata.name} does not match")
    return metadata


def parse_attachment(data: bytes) -> records.Attachment:
    """Read an attachment.

    Raises:
        BrrtError: It is damaged.
    """
    attachment: records.Attachment = parse(records.Attachment, data)
    stated = struct.unpack("<I", data[-4:])[0]
    if stated not in (0, zlib.crc32(data[:-4])):  # 0 stands for no checksum
        raise BrrtError(f"the checksum of {attachment.name} does not match")
    return attachment


def parse_index(data: bytes) -> dict[int, NDArray[np.uint64]]:
    """Read where a channel's messages are in the chunk before; empty if the record is wrong."""
    if len(data) >= 6:
        channel, size = struct.unpack_from("<HI", data)
        if size == len(data) - 6 and size % INDEX_ENTRY.itemsize == 0 and size:
            return {channel: np.frombuffer(data, INDEX_ENTRY, offset=6)["offset"]}
    return {}


def unpack_chunk(data: bytes) -> bytes:
    """Return the records in a chunk.

    Raises:
        BrrtError: The chunk is damaged.
    """
    chunk = parse(records.Chunk, data)
    raw, size = chunk.data, chunk.uncompressed_size
    if chunk.compression not in ("", "zstd"):
        raise BrrtError(f"a chunk has the compression {chunk.compression!r:.40}, brrt reads zstd")
    if chunk.compression:
        if size > min(MOST_BYTES, _ANY + _TIMES * len(raw)):
            raise BrrtError(f"a chunk says that it unpacks to {size:,} bytes")
        try:
            if zstandard.frame_content_size(raw) != size:
                raise BrrtError("a chunk has a wrong size")
            raw = zstandard.ZstdDecompressor().decompress(raw)
        except zstandard.ZstdError as error:
            raise BrrtError(f"a chunk cannot be unpacked ({error})") from None
    if len(raw) != size or zlib.crc32(raw) != chunk.uncompressed_crc:
        raise BrrtError("the checksum of a chunk does not match")
    return bytes(raw)


def check_summary(path: Path, file: IO[bytes]) -> None:
    """Check that what follows the data section is whole: summary, footer, magic.

    Raises:
        CutError: It is not all there.
        DamagedError: Its checksum is wrong.
    """
    rest = _up_to(file, MOST_BYTES)
    if not rest.endswith(MAGIC) or len(rest) < FOOTER_BYTES + len(MAGIC):
        raise CutError(path, f"the file is cut at byte {file.tell():,}, after the last event")
    # All but the checksum itself, which is the footer's last field.
    body, crc = rest[: -len(MAGIC) - 4], rest[-len(MAGIC) - 4 : -len(MAGIC)]
    if zlib.crc32(body) != struct.unpack("<I", crc)[0]:
        raise DamagedError(path, "damaged: the checksum of the summary does not match")


def read_summary(path: Path, file: IO[bytes]) -> Iterator[tuple[int, bytes]]:
    """Yield opcode and content of each record of the summary.

    Raises:
        OSError: The file is too short, or cannot be read.
        BrrtError: The summary is not there or damaged.
    """
    size = file.seek(-FOOTER_BYTES - len(MAGIC), SEEK_END)
    start = parse(records.Footer, file.read(FOOTER_BYTES)[9:]).summary_start
    if 0 < size - start <= MOST_BYTES:
        file.seek(start)
        check_summary(path, file)
        file.seek(start)
        for opcode, data in read_records(path, file):
            if opcode == Opcode.FOOTER:
                return
            yield opcode, data
