"""Files: a text is read whole or refused in one line, and what we write is never half there."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from brrt.errors import BrrtError


def read_text(path: Path, what: str, most_bytes: int) -> str:
    """Read a text file, with or without a byte order mark.

    Args:
        path: The file.
        what: What it is to hold, for messages ("a world").
        most_bytes: A longer file is refused unread.

    Raises:
        BrrtError: The file cannot be read, is too long, or is no text.
    """
    try:
        size = path.stat().st_size
        if size > most_bytes:
            raise BrrtError(f"{path}: {size:,} bytes are too many; {what} has {most_bytes:,}")
        return path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise BrrtError(f"{path}: {error.strerror or error}") from None
    except UnicodeDecodeError:
        raise BrrtError(f"{path}: not a text file") from None


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
