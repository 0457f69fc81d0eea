"""Temporary names of files that are written, and their final names.

A temporary name cannot be predicted and is made exclusively, so that no other process can put a
link there that redirects the data.
"""

import errno
import os
import secrets
import stat
from itertools import count
from pathlib import Path

from brrt.errors import BrrtError, WriteError

_TRIES = 100
_CANNOT_LINK = (errno.EPERM, errno.ENOSYS, errno.EOPNOTSUPP, errno.EMLINK, errno.EACCES)
"""os.link fails with these on file systems without hard links."""

_expected_new: set[str] = set()


class TakenError(BrrtError):
    """Another process made a file of the same name meanwhile; this one has another name.

    Attributes:
        kept: The other name.
    """

    def __init__(self, path: Path, kept: Path) -> None:
        super().__init__(
            f"{path}: another process made a file of this name meanwhile; what was written here is "
            f"in {kept}"
        )
        self.kept = kept


def expect_new(path: Path, *, new: bool) -> None:
    """Say whether a file that this process is about to write must not replace another.

    By default it may. One that appears meanwhile is then kept, and `TakenError` is raised.
    """
    (_expected_new.add if new else _expected_new.discard)(os.path.realpath(path))


def open_temporary(path: Path) -> tuple[Path, int]:
    """Make an empty file beside another one; return its name, and the descriptor that writes it.

    Raises:
        OSError: It cannot be made.
    """
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC
    for _ in range(_TRIES):
        name = path.with_name(f".brrt-{secrets.token_hex(8)}{path.suffix}")
        try:
            return name, os.open(name, flags, 0o666)
        except FileExistsError:
            continue
    raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST))


def give_name(temporary: Path, path: Path) -> Path:
    """Rename a temporary file to its final name.

    Returns:
        The name: `path`, or one with a number where `expect_new` forbids to replace another file.

    Raises:
        OSError: It cannot be renamed.
    """
    if os.path.realpath(path) not in _expected_new:
        return temporary.replace(path)
    for number in count(1):
        name = path if number == 1 else path.with_name(f"{path.stem}-{number}{path.suffix}")
        try:
            os.link(temporary, name)
        except FileExistsError:
            continue
        except OSError as error:
            if error.errno not in _CANNOT_LINK:
                raise
            if os.path.lexists(name):
                continue
            return temporary.replace(name)  # another process has microseconds to come between
        temporary.unlink()
        expect_new(path, new=False)
        return name
    raise AssertionError


def check_present(path: Path, number: int) -> None:
    """Raise if the file of a descriptor has no name any more, as where its folder was removed.

    Raises:
        WriteError: It was removed, or another file replaced it.
    """
    status = os.fstat(number)
    if stat.S_ISREG(status.st_mode) and not status.st_nlink:
        raise WriteError(path, "it was removed or replaced while it was written")
