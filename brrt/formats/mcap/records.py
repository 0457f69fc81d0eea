"""What an MCAP file is made of: records, read from the front into bounded memory."""

import json
import struct
import zlib
from collections.abc import Iterator, Mapping
from io import BytesIO
from os import SEEK_END
from pathlib import Path
from typing import IO, Any

from mcap import records
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode

from brrt.errors import RecordingError
from brrt.formats.integrity import MOST_BYTES, CutError, DamagedError
from brrt.formats.mcap.container import MAGIC

_BLOCK = 1 << 20
_MOST_BARREN = 1 << 17
"""Records between two chunks: there are 65,536 channels, and each may have an index."""
SEAL = "crc32"
"""Name of the text that is the checksum of the others."""
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
        raise DamagedError(path, f"damaged {kind.__name__}: {str(error) or repr(error)}") from None


def sealed(texts: Mapping[str, str]) -> dict[str, str]:
    """Add a checksum to named texts: of Metadata, MCAP has none but that of all the data."""
    return {**texts, SEAL: _seal(texts)}


def metadata_of(path: Path, data: bytes) -> records.Metadata:
    """Read named texts from their record; their checksum, if they have one, is seen to and gone.

    Raises:
        RecordingError: They are damaged.
    """
    metadata: records.Metadata = parsed(path, records.Metadata, data)
    stated = metadata.metadata.pop(SEAL, None)
    if stated is not None and stated != _seal(metadata.metadata):
        raise DamagedError(path, f"damaged: the checksum of {metadata.name} does not match")
    return metadata


def _seal(texts: Mapping[str, str]) -> str:
    return str(zlib.crc32(json.dumps(sorted(texts.items())).encode()))


def attachment_of(path: Path, data: bytes) -> records.Attachment:
    """Read an attachment from its record.

    Raises:
        RecordingError: It is damaged.
    """
    attachment: records.Attachment = parsed(path, records.Attachment, data)
    stated = struct.unpack("<I", data[-4:])[0]
    if stated and stated != zlib.crc32(data[:-4]):  # 0 is for none
        raise DamagedError(path, f"damaged: the checksum of {attachment.name} does not match")
    return attachment


def records_of(path: Path, file: IO[bytes]) -> Iterator[tuple[int, bytes]]:
    """Yield opcode and content of each record of the data section, DataEnd if that is right.

    Args:
        path: The file, for messages.
        file: Open behind its magic.

    Raises:
        CutError: The file ends before that.
        RecordingError: It is damaged.
    """
    crc, barren = zlib.crc32(MAGIC), 0
    while True:
        head = file.read(9)
        if len(head) < 9:
            raise CutError(path, f"the file is cut at byte {file.tell():,}")
        opcode, length = struct.unpack("<BQ", head)
        if not any(head):  # a disk that lost its power may fill up what it did not write
            raise CutError(path, f"the file is cut at byte {file.tell() - 9:,}: zeros follow")
        barren = 0 if opcode == Opcode.CHUNK else barren + 1
        if barren > _MOST_BARREN:
            why = f"damaged near byte {file.tell():,}: {barren:,} records without an event"
            raise DamagedError(path, why)
        if length > MOST_BYTES:
            why = f"damaged near byte {file.tell():,}: a record of {length} bytes"
            raise DamagedError(path, why)
        data = _up_to(file, length)
        if len(data) < length:
            raise CutError(path, f"the file is cut at byte {file.tell():,}")
        if opcode == Opcode.DATA_END:
            stated = parsed(path, records.DataEnd, data).data_section_crc
            if stated and stated != crc:
                raise DamagedError(path, "damaged: the checksum of the data differs")
            yield opcode, data
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
        raise CutError(path, f"the file is cut at byte {file.tell():,}, behind the last event")
    # All but the checksum itself, which is the footer's last field.
    body, crc = rest[: -len(MAGIC) - 4], rest[-len(MAGIC) - 4 : -len(MAGIC)]
    if zlib.crc32(body) != struct.unpack("<I", crc)[0]:
        raise DamagedError(path, "damaged: the checksum of the summary differs")


def ends_as_mcap(file: IO[bytes]) -> bool:
    """Whether a file has its last bytes, so that it was not cut."""
    file.seek(-len(MAGIC), SEEK_END)
    return file.read() == MAGIC


def _up_to(file: IO[bytes], size: int) -> bytes:
    """Read so many bytes or as many as there are; `read` makes room for all of them first."""
    if size <= _BLOCK:
        return file.read(size)
    blocks = []
    while size > 0 and (block := file.read(min(size, _BLOCK))):
        blocks.append(block)
        size -= len(block)
    return b"".join(blocks)
