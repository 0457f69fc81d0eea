"""A pipe into a file, for a writer that must not meet a full disk itself."""

import fcntl
import os
import threading
from contextlib import suppress
from pathlib import Path

from brrt.errors import RecordingError

_BLOCK = 1 << 20


class Drain:
    """Takes what comes out of a pipe and puts it into a file, on a thread of its own.

    Rerun's file writer (rerun-sdk 0.41) gives up at the first write that fails, and then `flush`,
    `disconnect` and the interpreter's end may wait for it for ever. So it writes into this pipe,
    which takes everything; what the disk did not take is kept as an error.

    Args:
        path: The file; it is overwritten.

    Attributes:
        inlet: File name to write to; it can be opened until `leave` is called.

    Raises:
        RecordingError: The file cannot be written.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._error: OSError | None = None
        try:
            self._file = path.open("wb", buffering=0)
        except OSError as error:
            raise self._cannot_write(error) from None
        self._inlet: int | None
        self._outlet, self._inlet = os.pipe()
        with suppress(AttributeError, OSError):  # a larger pipe is for Linux, and if it likes
            fcntl.fcntl(self._inlet, fcntl.F_SETPIPE_SZ, _BLOCK)
        self.inlet = f"/dev/fd/{self._inlet}"
        self._thread = threading.Thread(target=self._work, name="brrt drain", daemon=True)
        self._thread.start()

    def leave(self) -> None:
        """Leave the pipe to who has opened the inlet: once they close it, the file is complete."""
        if self._inlet is not None:
            os.close(self._inlet)
            self._inlet = None

    def check(self) -> None:
        """Say whether the file took everything so far.

        Raises:
            RecordingError: It did not.
        """
        if self._error is not None:
            raise self._cannot_write(self._error) from None

    def close(self) -> None:
        """Wait for the end of the pipe, then check."""
        self.leave()
        self._thread.join()
        self.check()

    def _work(self) -> None:
        with open(self._outlet, "rb", buffering=0) as outlet, self._file:  # noqa: PTH123 - no path
            while block := outlet.read(_BLOCK):
                if self._error is None:
                    try:
                        self._write(memoryview(block))
                    except OSError as error:
                        self._error = error

    def _write(self, block: memoryview) -> None:
        while block:
            block = block[self._file.write(block) :]

    def _cannot_write(self, error: OSError) -> RecordingError:
        return RecordingError(f"cannot write {self._path}: {error.strerror or error}")
