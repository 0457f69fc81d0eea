"""What an MCAP file is made of: records, read from the front into bounded memory."""

import struct
import zlib
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import IO, Any

from mcap import records
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode

from brrt.errors import RecordingError
from brrt.recording.container import MAGIC
from brrt.recording.sound import MOST_BYTES, CutError

_BLOCK = 1 << 20
FOOTER = 29
"""Bytes of the footer's record."""


def opened(path: Path) -> IO[bytes]:
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


def parsed(path: Path, kind: Any, data: bytes) -> Any:
    """Read a record of a kind from its content.

    Raises:
        RecordingError: It does not hold one.
    """
    try:
        return kind.read(ReadDataStream(BytesIO(data)))
    except Exception as error:  # noqa: BLE001 - mcap raises whatever a damaged length leads to
        raise RecordingError(f"{path}: damaged {kind.__name__}: {error}") from None


def records_of(path: Path, file: IO[bytes], *, check_end: bool) -> Iterator[tuple[int, bytes]]:
    """Yield opcode and content of each record of the data section, DataEnd included.

    Args:
        path: The file, for messages.
        file: Open behind its magic.
        check_end: See that checksum, summary and footer are there and right.

    Raises:
        CutError: The file ends before that.
        RecordingError: It is damaged.
    """
    crc = zlib.crc32(MAGIC)
    while True:
        head = file.read(9)
        if len(head) < 9:
            raise CutError(f"{path}: the file is cut at byte {file.tell():,}")
        opcode, length = struct.unpack("<BQ", head)
        if length > MOST_BYTES:
            raise RecordingError(
                f"{path}: damaged near byte {file.tell():,}: a record of {length} bytes"
            )
        data = _up_to(file, length)
        if len(data) < length:
            raise CutError(f"{path}: the file is cut at byte {file.tell():,}")
        if opcode == Opcode.DATA_END:
            stated = parsed(path, records.DataEnd, data).data_section_crc
            yield opcode, data
            if check_end:
                if stated and stated != crc:
                    raise RecordingError(f"{path}: damaged: the checksum of the data differs")
                check_summary(path, file)
            return
        crc = zlib.crc32(data, zlib.crc32(head, crc))
        yield opcode, data


def check_summary(path: Path, file: IO[bytes]) -> None:
    """See that what follows the data is whole: summary, footer, magic.

    Raises:
        CutError: It is not all there.
        RecordingError: It is damaged.
    """
    rest = _up_to(file, MOST_BYTES)
    if not rest.endswith(MAGIC) or len(rest) < FOOTER + len(MAGIC):
        raise CutError(f"{path}: the file is cut at byte {file.tell():,}, behind the last event")
    # All but the checksum itself, which is the footer's last field.
    body, crc = rest[: -len(MAGIC) - 4], rest[-len(MAGIC) - 4 : -len(MAGIC)]
    if zlib.crc32(body) != struct.unpack("<I", crc)[0]:
        raise RecordingError(f"{path}: damaged: the checksum of the summary differs")


def _up_to(file: IO[bytes], size: int) -> bytes:
    """Read so many bytes or as many as there are; `read` makes room for all of them first."""
    if size <= _BLOCK:
        return file.read(size)
    blocks = []
    while size > 0 and (block := file.read(min(size, _BLOCK))):
        blocks.append(block)
        size -= len(block)
    return b"".join(blocks)
