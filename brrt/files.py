"""Safe file I/O: bounded reads, atomic replacement, and output files that survive a crash."""

import errno
import json
import os
import re
import stat
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, BinaryIO

from brrt.errors import BrrtError, WriteError
from brrt.output_names import TakenError, check_present, give_name, open_temporary
from brrt.text import readable

LONGEST_LINE = 10_000
"""Maximum characters of a line of a text format; real lines have about a hundred."""

MOST_LINES = 4_000_000
"""Maximum lines of a text format; each takes one or two microseconds to parse."""

MOST_JSON_LISTS = 5_000_000
"""Maximum lists and objects in JSON; each takes about a hundred bytes of memory once parsed."""

_LINE = re.compile(r"([^\r\n]*)(?:\r\n?|\n|\Z)")

_SYNC_S = 1.0
_CANNOT_SYNC = (errno.EINVAL, errno.ENOTSUP, errno.EROFS)
"""fsync fails with these on pipes and devices, which have no disk behind them."""


def is_there(path: Path | str) -> bool:
    """Whether a path exists; False where pathlib raises, as for a name that is too long."""
    return os.path.exists(path)  # noqa: PTH110


def is_file(path: Path | str) -> bool:
    """Whether a path is a file; False where pathlib raises, as for a name that is too long."""
    return os.path.isfile(path)  # noqa: PTH113


@contextmanager
def readable_name(path: Path) -> Iterator[Path]:
    """Yield a name of a file that is UTF-8: its own, or that of a temporary link to it."""
    if readable(path) == str(path):
        yield path
        return
    with TemporaryDirectory(prefix="brrt-") as folder:
        link = Path(folder) / f"run{path.suffix}"
        link.symlink_to(path.absolute())
        yield link


def open_file(path: Path) -> BinaryIO:
    """Open a regular file to read it: a pipe blocks who opens it, a device may have no end.

    Raises:
        OSError: The file cannot be opened, or is something else.
        ValueError: The name has a zero byte.
    """
    _check_regular(os.stat(path))  # noqa: PTH116 - opening a device may have effects
    return open(path, "rb", opener=_open_without_blocking)  # pathlib has no opener


def _open_without_blocking(path: str, flags: int) -> int:
    number = os.open(path, flags | getattr(os, "O_NONBLOCK", 0))  # it may be a pipe by now
    try:
        _check_regular(os.fstat(number))
    except OSError:
        os.close(number)
        raise
    return number


def _check_regular(found: os.stat_result) -> None:
    if stat.S_ISDIR(found.st_mode):
        raise IsADirectoryError(errno.EISDIR, "is a folder")
    if not stat.S_ISREG(found.st_mode):
        raise OSError(errno.EINVAL, "a pipe or a device; save it to a file first")


def read_bytes(path: Path, what: str, most_bytes: int, *, rest: bool = True) -> bytes:
    """Read a file into bounded memory.

    Args:
        path: The file.
        what: What the file should contain, for messages ("a world").
        most_bytes: Maximum size. A larger file is refused before it is read.
        rest: If False, return the first `most_bytes` of a larger file instead of refusing it.

    Raises:
        BrrtError: The file cannot be read or is too large.
    """
    try:
        with open_file(path) as file:
            size = os.fstat(file.fileno()).st_size
            if size > most_bytes and rest:
                raise BrrtError(
                    f"{path}: {size:,} bytes are too many; {what} has at most {most_bytes:,}"
                )
            # Files of /proc and /sys state the size 0.
            data = file.read(min(most_bytes, size or most_bytes) + rest)
    except (OSError, ValueError) as error:
        raise BrrtError(f"{path}: {getattr(error, 'strerror', None) or error}") from None
    if len(data) > most_bytes:
        raise BrrtError(f"{path}: too long; {what} has at most {most_bytes:,} bytes")
    return data


def read_text(path: Path, what: str, most_bytes: int) -> str:
    """Read a UTF-8 text file, with or without byte order mark; see `read_bytes`.

    Raises:
        BrrtError: The file cannot be read, is too large, or is not text.
    """
    try:
        text = read_bytes(path, what, most_bytes).decode("utf-8-sig")
    except UnicodeDecodeError:
        raise BrrtError(f"{path}: not a text file") from None
    if "\0" in text:
        raise BrrtError(f"{path}: not a text file")
    return text


def parse_json(text: str | bytes, what: str) -> Any:
    """Parse JSON in bounded memory.

    Args:
        text: The JSON.
        what: What it should contain, for messages ("a JSON world").

    Raises:
        BrrtError: The text is not JSON, or has more than `MOST_JSON_LISTS` lists and objects.
    """
    brackets: tuple[Any, ...] = ("[", "{") if isinstance(text, str) else (b"[", b"{")
    if sum(map(text.count, brackets)) > MOST_JSON_LISTS:
        raise BrrtError(f"not {what}: it has more than {MOST_JSON_LISTS:,} lists")
    try:
        return json.loads(text)
    except (ValueError, RecursionError) as error:
        raise BrrtError(f"not {what}: {str(error)[:120]}") from None


def lines_of(name: str, text: str) -> Iterator[tuple[int, str]]:
    r"""Yield the number, from 1, and the text of each line; ends may be \n, \r\n or \r.

    Args:
        name: Name of the file, for messages.
        text: The text of the file.

    Raises:
        BrrtError: A line is longer than `LONGEST_LINE`, or there are more than `MOST_LINES`.
    """
    for number, match in enumerate(_LINE.finditer(text), 1):
        start, end = match.span(1)
        if end - start > LONGEST_LINE:
            raise BrrtError(
                f"{name}:{number}: {end - start:,} characters; a line has at most {LONGEST_LINE:,}"
            )
        if number > MOST_LINES:
            raise BrrtError(f"{name}: more than {MOST_LINES:,} lines")
        yield number, match[1]


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Write a file under a temporary name and rename it to `path` once it is complete.

    See `expect_new` for a file that exists by then.

    Yields:
        The temporary name, in the same folder and with the same suffix.

    Raises:
        BrrtError: The file cannot be written.
    """
    unfinished: Path | None = None
    try:
        unfinished, number = open_temporary(path)
        os.close(number)
        yield unfinished
        name = give_name(unfinished, path)
    except OSError as error:
        raise BrrtError(f"cannot write {path}: {error.strerror or error}") from None
    except WriteError as error:
        if str(unfinished) not in str(error):
            raise
        why = f"{error.reason}; nothing of it is left: name a file where there is more room"
        raise WriteError(path, why) from None
    finally:
        if unfinished is not None:
            unfinished.unlink(missing_ok=True)
    if name != path:
        raise TakenError(path, name)


def make_folder_of(path: Path) -> None:
    """Make the folder of a file that is about to be written.

    Raises:
        BrrtError: The folder cannot be made.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise BrrtError(f"cannot write {path}: {error.strerror or error}") from None


class OutputFile:
    """A file that is written over a long time and can be read while it grows.

    It is written under a temporary name until `appear`, so that an older file of the same name is
    replaced only once there is something to read in the new one. Data reaches the operating system
    at once and survives a killed process; it is synced to the disk every second and at the end, and
    survives a power cut up to there.

    All methods raise OSError if the file cannot be written.

    Args:
        path: The file. Pipes and devices are written to directly.
    """

    def __init__(self, path: Path) -> None:
        self._name = Path(os.path.realpath(path))
        self._wanted = self._name
        self._temporary: Path | None = None
        if _is_written_in_place(self._name):
            self._file = self._name.open("wb", buffering=0)
        else:
            self._temporary, number = open_temporary(self._name)
            self._file = open(number, "wb", buffering=0)  # noqa: PTH123, SIM115 - a descriptor
        self._dirty, self._closing = False, threading.Event()
        self._error: OSError | None = None
        self._syncing: threading.Thread | None = None

    @property
    def closed(self) -> bool:
        """Whether the file is closed."""
        return self._file.closed

    def write(self, data: bytes | memoryview) -> None:
        """Write all of `data`."""
        if self._error is not None:
            raise self._error
        rest = memoryview(data)
        while rest:
            rest = rest[self._file.write(rest) :]
        self._dirty = True

    def rewrite(self, at: int, data: bytes) -> bool:
        """Replace bytes that were written; return False for pipes, which keep what they took."""
        if not self._file.seekable():
            return False
        end = self._file.tell()
        try:
            self._file.seek(at)
            self.write(data)
        finally:
            self._file.seek(end)
        return True

    def truncate(self, size: int) -> None:
        """Remove what was written after the first `size` bytes, such as half a record."""
        with suppress(OSError):
            self._file.truncate(size)

    def appear(self) -> None:
        """Rename the file to its final name; later calls do nothing."""
        if self._temporary is None or self.closed:
            return
        _sync(self._file.fileno())
        self._name = give_name(self._temporary, self._name)
        self._temporary = None
        self._syncing = threading.Thread(target=self._keep_synced, name="brrt sync", daemon=True)
        self._syncing.start()

    def close(self) -> None:
        """Close the file; one that has not appeared is deleted.

        Raises:
            TakenError: The file has another name, since another process took its own.
            WriteError: It was removed, or its folder, while it was written.
        """
        if self.closed:
            return
        self._closing.set()
        if self._syncing is not None:
            self._syncing.join()
        try:
            if self._error is not None:
                raise self._error
            if self._temporary is None:
                _sync(self._file.fileno())
            if self._syncing is not None:
                check_present(self._wanted, self._file.fileno())
        finally:
            self._file.close()
            if self._temporary is not None:
                self._temporary.unlink(missing_ok=True)
        if self._syncing is not None:
            _sync_folder(self._name.parent)
        if self._name != self._wanted:
            raise TakenError(self._wanted, self._name)

    def _keep_synced(self) -> None:
        while not self._closing.wait(_SYNC_S):
            if self._dirty:
                self._dirty = False
                try:
                    _sync(self._file.fileno())
                except OSError as error:
                    self._error = error
                    return


def _is_written_in_place(path: Path) -> bool:
    try:
        mode = path.stat().st_mode
    except FileNotFoundError:
        return False
    if not os.access(path, os.W_OK):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
    # A folder that takes no new file leaves only writing into the existing one.
    return not stat.S_ISREG(mode) or not os.access(path.parent, os.W_OK)


def _sync(number: int) -> None:
    try:
        os.fsync(number)
    except OSError as error:
        if error.errno not in _CANNOT_SYNC:
            raise


def _sync_folder(folder: Path) -> None:
    """Sync the names in a folder to the disk, where folders can be opened for that."""
    try:
        number = os.open(folder, os.O_RDONLY)
    except (PermissionError, IsADirectoryError):
        return
    try:
        _sync(number)
    finally:
        os.close(number)
