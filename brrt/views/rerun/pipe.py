"""A pipe into a file, for a writer that must not meet a full disk itself."""

import fcntl
import os
import select
import threading
import time
import zlib
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from pathlib import Path

from brrt.errors import WriteError
from brrt.files import OutputFile

_BLOCK = 1 << 20
_PAUSE_S = 0.0005


class Drain:
    """Takes what comes out of a pipe and puts it into a file, on a thread of its own.

    Rerun's file writer (rerun-sdk 0.41) gives up at the first write that fails, and then `flush`,
    `disconnect` and the interpreter's end may wait for it for ever. So it writes into this pipe,
    which takes everything; what the disk did not take is kept as an error.

    Args:
        path: The file; it is overwritten, but not before `settle` or `close`.

    Attributes:
        size: Bytes that have come through.
        crc: Their CRC-32.
        inlet: File name to write to; it can be opened until `leave` is called.

    Raises:
        RecordingError: The file cannot be written.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._error: Exception | None = None
        self.size = self.crc = 0
        try:
            self._file = OutputFile(path)
        except OSError as error:
            raise self._cannot_write(error) from None
        self._inlet: int | None
        self._outlet, self._inlet = os.pipe()
        with suppress(AttributeError, OSError):  # a larger pipe is for Linux, and if it likes
            fcntl.fcntl(self._inlet, fcntl.F_SETPIPE_SZ, _BLOCK)
        self.inlet = f"/dev/fd/{self._inlet}"
        self._at_work = threading.Lock()
        self._thread = threading.Thread(target=self._work, name="brrt drain", daemon=True)
        self._thread.start()

    def leave(self) -> None:
        """Leave the pipe to who has opened the inlet: once they close it, the file is complete."""
        if self._inlet is not None:
            os.close(self._inlet)
            self._inlet = None

    def settle(self) -> None:
        """Wait until the file has all that was written to the inlet so far, and its name.

        Raises:
            RecordingError: The disk did not take it.
        """
        while self._thread.is_alive() and _readable(self._outlet).poll(0):
            time.sleep(_PAUSE_S)
        with self._at_work:
            if self._error is None:
                self._trying(self._file.appear)
        self._check()

    def _check(self) -> None:
        if self._error is not None:
            raise self._cannot_write(self._error) from None

    def close(self) -> None:
        """Wait for the end of the pipe and close the file.

        Raises:
            RecordingError: The disk did not take everything.
        """
        self.leave()
        self._thread.join()
        self._check()

    def _work(self) -> None:
        # Whatever happens here, the pipe is emptied: who writes to it would wait for ever.
        waiting = _readable(self._outlet)
        while waiting.poll():
            with self._at_work:
                block = os.read(self._outlet, _BLOCK)
                if not block:
                    break
                self.size, self.crc = self.size + len(block), zlib.crc32(block, self.crc)
                if self._error is None:
                    self._trying(partial(self._file.write, block))
        os.close(self._outlet)
        if self._error is None:
            self._trying(self._file.appear)
        self._trying(self._file.close)

    def _trying(self, action: Callable[[], None]) -> None:
        try:
            action()
        except Exception as error:  # noqa: BLE001 - told on the caller's thread
            self._error = self._error or error

    def _cannot_write(self, error: Exception) -> WriteError:
        reason = getattr(error, "strerror", None) or str(error) or repr(error)
        return WriteError(self._path, reason)


def _readable(pipe: int) -> select.poll:
    """What waits until there is something in a pipe; each thread needs its own."""
    waiting = select.poll()
    waiting.register(pipe, select.POLLIN)
    return waiting
