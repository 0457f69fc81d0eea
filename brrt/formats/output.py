"""A file that is being recorded: there to read from its first second on, and kept up to its last.

It takes its name once its beginning is in it, in the place of an older file; so no name ever leads
to a file that says nothing. What is written is with the operating system at once, which a killed
process does not undo; and on the disk (fsync) each second and at the end, for power cuts.
"""

import errno
import os
import stat
import threading
from contextlib import suppress
from pathlib import Path

_SYNC_S = 1.0
_CANNOT_SYNC = (errno.EINVAL, errno.ENOTSUP, errno.EROFS)
"""Pipes and devices have no disk behind them."""


class Output:
    """A file to be written from its first byte to its last.

    All methods raise OSError where the file cannot be written.

    Args:
        path: Its name; what stands there is replaced, but not before `appear`. Pipes and devices
            are written into.
    """

    def __init__(self, path: Path) -> None:
        self._name = Path(os.path.realpath(path))
        self._hidden: Path | None = None
        if not _is_special(self._name):
            self._hidden = self._name.with_name(f".{self._name.stem}-{os.getpid()}{path.suffix}")
        self._file = (self._hidden or self._name).open("wb", buffering=0)
        self._dirty, self._closing = False, threading.Event()
        self._error: OSError | None = None
        self._syncing: threading.Thread | None = None

    @property
    def closed(self) -> bool:
        """Whether nothing can be written any more."""
        return self._file.closed

    def write(self, data: bytes | memoryview) -> None:
        """Write all of it."""
        if self._error is not None:
            raise self._error
        rest = memoryview(data)
        while rest:
            rest = rest[self._file.write(rest) :]
        self._dirty = True

    def cut(self, size: int) -> None:
        """Take back what stands behind a place, as half of what did not fit."""
        with suppress(OSError):
            self._file.truncate(size)

    def appear(self) -> None:
        """Take the name, from now on for good."""
        if self._hidden is None or self.closed:
            return
        _sync(self._file.fileno())
        hidden, self._hidden = self._hidden, None
        hidden.replace(self._name)
        self._syncing = threading.Thread(target=self._keep_synced, name="brrt sync", daemon=True)
        self._syncing.start()

    def close(self) -> None:
        """Close the file; one that has not appeared is gone."""
        if self.closed:
            return
        self._closing.set()
        if self._syncing is not None:
            self._syncing.join()
        try:
            if self._error is not None:
                raise self._error
            if self._hidden is None:
                _sync(self._file.fileno())
        finally:
            self._file.close()
            if self._hidden is not None:
                self._hidden.unlink(missing_ok=True)
        if self._syncing is not None:
            _sync_folder(self._name.parent)

    def _keep_synced(self) -> None:
        while not self._closing.wait(_SYNC_S):
            if self._dirty:
                self._dirty = False
                try:
                    _sync(self._file.fileno())
                except OSError as error:
                    self._error = error
                    return


def _is_special(path: Path) -> bool:
    try:
        mode = path.stat().st_mode
    except FileNotFoundError:
        return False
    if not os.access(path, os.W_OK):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
    # Where the folder takes no new file, a file that is there is written into.
    return not stat.S_ISREG(mode) or not os.access(path.parent, os.W_OK)


def _sync(number: int) -> None:
    try:
        os.fsync(number)
    except OSError as error:
        if error.errno not in _CANNOT_SYNC:
            raise


def _sync_folder(folder: Path) -> None:
    """Put names on the disk, too, where folders can be opened for that."""
    with suppress(OSError):
        number = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(number)
        finally:
            os.close(number)
