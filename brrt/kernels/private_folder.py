"""Folders and files that only their owner can write to: unpickling a file runs its code."""

import os
import stat
from pathlib import Path

_OTHERS = stat.S_IWGRP | stat.S_IWOTH


def make_private(folder: Path) -> None:
    """Make a folder, and those above it, that only their owner can enter; existing ones stay.

    Raises:
        OSError: It cannot be made.
    """
    if not os.path.lexists(folder):
        make_private(folder.parent)
        folder.mkdir(mode=0o700, exist_ok=True)


def fault_of_folder(folder: Path | str, *, shared: bool = False) -> str | None:
    """Return why a folder is not trusted; None if it is.

    Args:
        folder: The folder. A link to one is not followed.
        shared: Accept a folder like /tmp, in which everybody may make files and remove only theirs.

    Raises:
        OSError: It does not exist.
    """
    status = os.lstat(folder)
    if not stat.S_ISDIR(status.st_mode):
        return "it is no folder, or a link to one"
    if shared and status.st_mode & stat.S_ISVTX and status.st_uid == 0:
        return None
    return _fault(status)


def read_private(path: str) -> bytes:
    """Read a file; a link is not followed, and no pipe is waited for.

    Raises:
        OSError: It cannot be read.
        PermissionError: It is not trusted.
    """
    number = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
    with open(number, "rb") as file:  # noqa: PTH123 - a descriptor
        status = os.fstat(number)
        fault = _fault(status) if stat.S_ISREG(status.st_mode) else "it is no file"
        if fault is not None:
            raise PermissionError(f"{path}: {fault}")
        return file.read()


def _fault(status: os.stat_result) -> str | None:
    if status.st_uid not in {os.geteuid(), 0}:
        return "it belongs to another user"
    if status.st_mode & _OTHERS:
        return "other users may write to it (chmod go-w it if its files are yours)"
    return None
