"""A checksum inside a file of a format that has none.

Rerun's format lets most damage pass unseen, and some of it ends the process that reads the file:
of 1000 flipped bits 341 went unnoticed, and 11 made rerun-sdk 0.41 abort. So the writer puts a
blank into a text of its file, and once the file is complete, size and CRC-32 of it all into the
blank. A reader looks there first. A file that was written anew by other tools has another size,
and is taken as it is.
"""

import re
import zlib
from os import SEEK_END
from pathlib import Path
from typing import IO

_BEGIN, _END = "!crc#", "#!"
BLANK = f"{_BEGIN}QZ~jX^vK%wJ`yH&zP|uF*tB+{_END}"
"""Letters of which no four come together anywhere else, so that compression leaves them alone."""

WRITTEN = f"QjZ~{BLANK}~Xw^"
"""What is written. The letters on either side are for compression to take: what it finds anew near
the text, such as zeros and a length, it extends into the text, by the first or the last letters."""

_BLOCK = 1 << 20
_TAIL = 1 << 22
"""The blank is written last but for the index of chunks, a few dozen bytes for each of them."""

_STAMP = re.compile(f"{_BEGIN}([0-9a-f]{{16}})([0-9a-f]{{8}}){_END}".encode())


def stamp(path: Path, crc: int) -> None:
    """Fill in the blank of a complete file whose CRC-32 is known.

    Raises:
        OSError: The file cannot be changed.
    """
    with path.open("r+b") as file:
        size, at = _find(file, BLANK)
        if at >= 0:
            filled = f"{_BEGIN}{size:016x}{crc:08x}{_END}"
            file.seek(at)
            file.write(filled.encode())


def is_damaged(path: Path) -> bool:
    """Whether a file has a stamp of its size that does not fit its content.

    Raises:
        OSError: The file cannot be read.
    """
    with path.open("rb") as file:
        size, at = _find(file, _BEGIN)
        if at < 0:
            return False
        file.seek(at)
        found = _STAMP.match(file.read(len(BLANK)))
        if found is None or int(found[1], 16) != size:
            return False
        before = _crc(file, 0, at)
        behind = at + len(BLANK)
        whole = _crc(file, behind, size, zlib.crc32(BLANK.encode(), before))
        return whole != int(found[2], 16)


def _find(file: IO[bytes], text: str) -> tuple[int, int]:
    """Return the file's size, and where a text stands last near its end; -1 if it does not."""
    size = file.seek(0, SEEK_END)
    begin = max(0, size - _TAIL)
    file.seek(begin)
    at = file.read().rfind(text.encode())
    return size, at if at < 0 else begin + at


def _crc(file: IO[bytes], begin: int, end: int, crc: int = 0) -> int:
    """Checksum of a stretch of the file, read block by block: a map would count as memory."""
    file.seek(begin)
    while begin < end:
        block = file.read(min(_BLOCK, end - begin))
        if not block:
            break
        crc, begin = zlib.crc32(block, crc), begin + len(block)
    return crc
