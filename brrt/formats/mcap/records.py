"""Read the records of MCAP files into bounded memory; every length in a file may be wrong."""

import json
import struct
import zlib
from collections.abc import Iterator, Mapping
from io import BytesIO
from os import SEEK_CUR, SEEK_END
from pathlib import Path
from typing import IO, Any

import numpy as np
from mcap import records
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from numpy.typing import NDArray

from brrt.errors import BrrtError, RecordingError
from brrt.files import open_file
from brrt.formats.integrity import MOST_BYTES, CutError, DamagedError

MAGIC = b"\x89MCAP0\r\n"
INDEX_ENTRY = np.dtype([("log_time", "<u8"), ("offset", "<u8")])
FOOTER_BYTES = 29
CHECKSUM = "crc32"
"""Name of the text that is the checksum of the others in a Metadata record."""

_MOST_FIELDS = 10_000
"""Texts of a Metadata record; those of a recording have some dozens."""

_BLOCK = 1 << 20
_MOST_BETWEEN = 1 << 17
"""Records between two chunks: there are 65,536 channels, and each may have an index."""


def open_mcap(path: Path) -> IO[bytes]:
    """Open an MCAP file behind its magic.

    Raises:
        RecordingError: It cannot be read, or is no such file.
    """
    try:
        file = open_file(path)
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
        between = 0 if opcode in (Opcode.CHUNK, Opcode.MESSAGE) else between + 1
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


def _check_fields(data: bytes) -> None:
    """Check how many fields there are, before stock mcap spends seconds on a million of them."""
    lengths, at, count = struct.Struct("<I"), 0, -2  # the name, and the length of all, come first
    while at + lengths.size <= len(data):
        if count > 2 * _MOST_FIELDS:
            raise BrrtError(f"a Metadata record has over {_MOST_FIELDS:,} fields")
        (length,) = lengths.unpack_from(data, at)
        at += lengths.size + (length if count != -1 else 0)
        count += 1


def parse_metadata(data: bytes) -> records.Metadata:
    """Read named texts; their checksum, if they have one, is checked and removed.

    Raises:
        BrrtError: They are damaged.
    """
    _check_fields(data)
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
    # Two times, two texts and the data with their lengths; later versions may add fields.
    texts = attachment.name.encode() + attachment.media_type.encode()
    end = 32 + len(texts) + len(attachment.data)
    stated = struct.unpack_from("<I", data, end)[0]
    if stated not in (0, zlib.crc32(data[:end])):  # 0 stands for no checksum
        raise BrrtError(f"the checksum of {attachment.name} does not match")
    return attachment


def parse_index(data: bytes) -> dict[int, NDArray[np.uint64]]:
    """Read where a channel's messages are in the chunk before; empty if the record is wrong."""
    if len(data) >= 6:
        channel, size = struct.unpack_from("<HI", data)
        if size == len(data) - 6 and size % INDEX_ENTRY.itemsize == 0 and size:
            return {channel: np.frombuffer(data, INDEX_ENTRY, offset=6)["offset"]}
    return {}


def check_summary(path: Path, file: IO[bytes]) -> bytes:
    """Check that what follows the data section is whole, and return it: summary, footer, magic.

    Raises:
        CutError: It is not all there.
        DamagedError: Its checksum is wrong.
    """
    rest = _up_to(file, MOST_BYTES)
    if not rest.endswith(MAGIC) or len(rest) < FOOTER_BYTES + len(MAGIC):
        raise CutError(path, f"the file is cut at byte {file.tell():,}, after the last event")
    # All but the checksum itself, which is the footer's last field.
    body, crc = rest[: -len(MAGIC) - 4], rest[-len(MAGIC) - 4 : -len(MAGIC)]
    if struct.unpack("<I", crc)[0] not in (0, zlib.crc32(body)):  # 0 stands for no checksum
        raise DamagedError(path, "damaged: the checksum of the summary does not match")
    return rest


def read_summary(path: Path, file: IO[bytes]) -> Iterator[tuple[int, bytes]]:
    """Yield opcode and content of each record of the summary; none if there is no summary.

    Raises:
        OSError: The file is too short, or cannot be read.
        BrrtError: The end of the file is not there or damaged.
    """
    size = file.seek(-FOOTER_BYTES - len(MAGIC), SEEK_END)
    start = parse(records.Footer, file.read(FOOTER_BYTES)[9:]).summary_start or size
    if not 0 <= size - start <= MOST_BYTES:
        raise BrrtError("the summary is not where the footer says")
    file.seek(start)
    yield from _records_in(check_summary(path, file)[: size - start])


def _records_in(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Yield opcode and content of each record in bytes.

    Raises:
        BrrtError: A record reaches beyond their end.
    """
    at = 0
    while at < len(data):
        head = data[at : at + 9].ljust(9, b"\xff")
        opcode, length = struct.unpack("<BQ", head)
        end = at + 9 + length
        if end > len(data):
            raise BrrtError("a record reaches out of the summary")
        yield opcode, data[at + 9 : end]
        at = end


def find_metadata(file: IO[bytes], name: str) -> records.Metadata | None:
    """Return the last metadata of a name, for files without an index; None if there is none.

    Raises:
        BrrtError: The data section is damaged.
    """
    found, between = None, 0
    file.seek(len(MAGIC))
    while len(head := file.read(9)) == 9 and head[0] != Opcode.DATA_END and between < _MOST_BETWEEN:
        between = 0 if head[0] in (Opcode.CHUNK, Opcode.MESSAGE) else between + 1
        length = struct.unpack_from("<Q", head, 1)[0]
        if head[0] == Opcode.METADATA and length <= MOST_BYTES:
            metadata = parse_metadata(_up_to(file, length))
            found = metadata if metadata.name == name else found
        else:
            file.seek(length, SEEK_CUR)
    return found
