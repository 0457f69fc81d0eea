"""A pipe into a file, for a writer that hangs when the disk is full."""

import fcntl
import os
import select
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from pathlib import Path

from brrt.errors import BrrtError, WriteError
from brrt.files import OutputFile

_BLOCK = 1 << 20
_PAUSE_S = 0.0005


class FilePipe:
    """Copies what is written into a pipe to a file, on a thread of its own.

    Rerun's file writer (rerun-sdk 0.41) stops at the first write that fails, and then `flush`,
    `disconnect` and the interpreter's exit may wait for it for ever. So it writes into this pipe,
    which accepts everything; the first error of the disk is kept and raised by `wait` and `close`.

    Args:
        path: The file; it is overwritten, but not before `wait` or `close`.

    Attributes:
        inlet: File name to write to; it can be opened until `close_inlet` is called.

    Raises:
        RecordingError: The file cannot be written.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._error: Exception | None = None
        try:
            self._file = OutputFile(path)
        except OSError as error:
            raise self._write_error(error) from None
        self._inlet: int | None
        self._outlet, self._inlet = os.pipe()
        with suppress(AttributeError, OSError):  # only Linux has larger pipes, and may refuse them
            fcntl.fcntl(self._inlet, fcntl.F_SETPIPE_SZ, _BLOCK)
        self.inlet = f"/dev/fd/{self._inlet}"
        self._copying = threading.Lock()
        self._thread = threading.Thread(target=self._copy, name="brrt pipe", daemon=True)
        self._thread.start()

    def close_inlet(self) -> None:
        """Close this end of the pipe; the file ends when all who opened the inlet close it."""
        if self._inlet is not None:
            os.close(self._inlet)
            self._inlet = None

    def wait(self) -> None:
        """Wait until the file has everything that was written to the inlet so far, and its name.

        Raises:
            RecordingError: The disk did not take it.
        """
        while self._thread.is_alive() and _poll(self._outlet).poll(0):
            time.sleep(_PAUSE_S)
        with self._copying:
            self._try(self._file.appear)
        self._check()

    def close(self) -> None:
        """Wait for the end of the pipe and close the file.

        Raises:
            RecordingError: The disk did not take everything.
        """
        self.close_inlet()
        self._thread.join()
        self._check()

    def discard(self) -> None:
        """Write nothing more; `close` deletes a file that has no name yet."""
        self._error = self._error or InterruptedError()

    def _copy(self) -> None:
        # The pipe is emptied even after an error: its writer would wait for ever.
        waiting = _poll(self._outlet)
        while waiting.poll():
            with self._copying:
                block = os.read(self._outlet, _BLOCK)
                if not block:
                    break
                self._try(partial(self._file.write, block))
        os.close(self._outlet)
        self._try(self._file.appear)
        try:
            self._file.close()
        except (OSError, BrrtError) as error:
            self._error = self._error or error

    def _try(self, action: Callable[[], None]) -> None:
        """Do something with the file, unless it has failed before."""
        if self._error is None:
            try:
                action()
            except Exception as error:  # noqa: BLE001 - raised again on the caller's thread
                self._error = error

    def _check(self) -> None:
        if isinstance(self._error, BrrtError):
            raise self._error
        if self._error is not None:
            raise self._write_error(self._error) from None

    def _write_error(self, error: Exception) -> WriteError:
        reason = getattr(error, "strerror", None) or str(error) or repr(error)
        return WriteError(self._path, reason)


def _poll(pipe: int) -> select.poll:
    """Return what waits for data in a pipe; each thread needs its own."""
    waiting = select.poll()
    waiting.register(pipe, select.POLLIN)
    return waiting
