"""Files: read whole or refused in one line, and what we write is never half there."""

import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from brrt.errors import BrrtError

LONGEST_LINE = 10_000
"""Characters of a line of a text format, at most; real ones have a hundred."""

MOST_LINES = 4_000_000
"""Of a text format; each takes a microsecond or two."""

_LINE = re.compile(r"([^\r\n]*)(?:\r\n?|\n|\Z)")


def is_there(path: Path | str) -> bool:
    """Whether there is something of that name; no if it cannot be told, where pathlib raises."""
    return os.path.exists(path)  # noqa: PTH110


def is_file(path: Path | str) -> bool:
    """Whether there is a file of that name; no if it cannot be told, where pathlib raises."""
    return os.path.isfile(path)  # noqa: PTH113


def read_bytes(path: Path, what: str, most_bytes: int, *, rest: bool = True) -> bytes:
    """Read a file, of whatever kind, into bounded memory.

    Args:
        path: The file.
        what: What it is to hold, for messages ("a world").
        most_bytes: A longer file is refused unread, an endless one once it is longer.
        rest: Without it, the beginning of a longer file is returned.

    Raises:
        BrrtError: The file cannot be read, or is too long.
    """
    try:
        with path.open("rb") as file:
            size = os.fstat(file.fileno()).st_size
            if size > most_bytes and rest:
                raise BrrtError(f"{path}: {size:,} bytes are too many; {what} has {most_bytes:,}")
            data = file.read(min(most_bytes, size or most_bytes) + rest)
    except (OSError, ValueError) as error:
        raise BrrtError(f"{path}: {getattr(error, 'strerror', None) or error}") from None
    if len(data) > most_bytes:
        raise BrrtError(f"{path}: it does not end; {what} has at most {most_bytes:,} bytes")
    return data


def read_text(path: Path, what: str, most_bytes: int) -> str:
    """Read a text file, with or without a byte order mark, as `read_bytes` does.

    Raises:
        BrrtError: The file cannot be read, is too long, or is no text.
    """
    try:
        text = read_bytes(path, what, most_bytes).decode("utf-8-sig")
    except UnicodeDecodeError:
        raise BrrtError(f"{path}: not a text file") from None
    if "\0" in text:
        raise BrrtError(f"{path}: not a text file")
    return text


def lines_of(name: str, text: str) -> Iterator[tuple[int, str]]:
    """Yield number, from 1 on, and text of each line, one at a time: there may be millions.

    Args:
        name: Name of the file, for messages.
        text: Its text; lines may end in any of the usual ways.

    Raises:
        BrrtError: A line is longer than any that means something, or there are too many.
    """
    for number, match in enumerate(_LINE.finditer(text), 1):
        start, end = match.span(1)
        if end - start > LONGEST_LINE:
            raise BrrtError(
                f"{name}:{number}: {end - start:,} characters; a line has at most {LONGEST_LINE:,}"
            )
        if number > MOST_LINES:
            raise BrrtError(f"{name}: more than {MOST_LINES:,} lines; that is too much for a world")
        yield number, match[1]


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Write a file elsewhere; it takes its name, and any older file's place, once it is whole.

    Yields:
        The name to write to, in the same folder and with the same ending.

    Raises:
        BrrtError: The file cannot be written.
    """
    unfinished = path.with_name(f".{path.stem}-{os.getpid()}{path.suffix}")
    try:
        yield unfinished
        unfinished.replace(path)
    except OSError as error:
        raise BrrtError(f"cannot write {path}: {error.strerror or error}") from None
    finally:
        unfinished.unlink(missing_ok=True)
