"""Disks that fail: any operation on the files of a folder can be made to fail."""

import builtins
import errno
import io
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

WAYS = ("EIO", "ENOSPC", "short")
"""An error of the disk once; a full disk, from then on; half of a write, and then a full disk."""

_LATER = frozenset({"open", "write", "rename"})
"""What a full disk refuses from then on."""


class Disk:
    """The operations on a folder, of which one may fail.

    Args:
        folder: The folder.
        way: How it fails, one of `WAYS`.
        place: Number of the operation that fails; by default none.

    Attributes:
        done: What was done, in order.
        failed: Which operation failed; empty if none did.
    """

    def __init__(self, folder: Path, way: str = "EIO", place: int = -1) -> None:
        self._folder, self._way, self._place = str(folder), way, place
        self.done: list[str] = []
        self.failed = ""

    def concerns(self, path: Any) -> bool:
        """Whether a path or a descriptor leads into the folder."""
        try:
            name = Path(f"/proc/self/fd/{path}" if isinstance(path, int) else path)
            return self._folder in str(
                name.readlink() if isinstance(path, int) else name.absolute()
            )
        except (OSError, TypeError):
            return False

    def fail(self, what: str) -> None:
        """Count an operation; raise if it is to fail."""
        number = len(self.done)
        self.done.append(what)
        full = self._way != "EIO" and self.failed and what in _LATER
        if number == self._place or full:
            self.failed = self.failed or what
            code = errno.EIO if self._way == "EIO" else errno.ENOSPC
            raise OSError(code, os.strerror(code))

    def cut(self, data: Any) -> Any:
        """Return what a write takes of some bytes."""
        if self._way == "short" and len(self.done) == self._place and not self.failed:
            self.done.append("write")
            self.failed = "write"
            return memoryview(data).cast("B")[: len(memoryview(data).cast("B")) // 2]
        self.fail("write")
        return data


def _file_of(disk: Disk) -> type[io.FileIO]:
    class File(io.FileIO):
        def write(self, data: Any, /) -> int:
            return super().write(disk.cut(data))

        def truncate(self, size: int | None = None, /) -> int:
            return super().truncate(size)

        def close(self) -> None:
            if self.closed:
                return
            super().close()
            disk.fail("close")

    return File


@contextmanager
def failing(disk: Disk, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:  # noqa: C901 - many
    """Let files of the disk be opened, written, synced, renamed and closed under its control."""
    kind, usual, low = _file_of(disk), io.open, os.open

    def open_file(file: Any, mode: str = "r", buffering: int = -1, *args: Any, **kw: Any) -> Any:
        if not (set(mode) & set("wxa+") and disk.concerns(file)):
            return usual(file, mode, buffering, *args, **kw)
        if not isinstance(file, int):
            disk.fail("open")
        raw = kind(file, mode.replace("b", "").replace("t", ""))
        if buffering == 0:
            return raw
        buffered = io.BufferedWriter(raw)
        return buffered if "b" in mode else io.TextIOWrapper(buffered, *args, **kw)

    def open_number(path: Any, flags: int, *args: Any, **kw: Any) -> int:
        if disk.concerns(path) and flags & (os.O_WRONLY | os.O_RDWR):
            disk.fail("open")
        return low(path, flags, *args, **kw)

    def counted(name: str, what: str) -> None:
        function = getattr(os, name)

        def call(first: Any, *args: Any, **kw: Any) -> Any:
            if disk.concerns(first):
                disk.fail(what)
            return function(first, *args, **kw)

        patch.setattr(os, name, call)

    with monkeypatch.context() as patch:
        for module in (io, builtins):
            patch.setattr(module, "open", open_file)
        patch.setattr(os, "open", open_number)
        for name, what in (("fsync", "fsync"), ("replace", "rename"), ("rename", "rename"),
                           ("link", "rename")):  # fmt: skip
            counted(name, what)
        yield
