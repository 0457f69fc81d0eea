"""stdout and stderr that take every text, and outlive a full disk, a closed pipe or terminal."""

import codecs
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from io import TextIOWrapper
from typing import Any

from brrt.text import readable, visible

_PLAIN = {"·": "-", "…": "."}
"""What stands for a character that the terminal's encoding lacks; others become escapes."""


class Stream(TextIOWrapper):
    """A text stream that goes to nowhere once it cannot be written.

    Controls in a text are written as escapes, in every print. Rich writes its styles through
    `rich_proxied_file`; the texts that it styles are escaped by `console.VisibleConsole`.

    Attributes:
        error: Why it cannot be written, if so.
    """

    error: OSError | None = None

    def write(self, text: str) -> int:
        """Write text; return its length, even if it went nowhere.

        Raises:
            TypeError: It is not text; other packages tell text streams from others by this error.
        """
        if not isinstance(text, str):
            raise TypeError(f"write() argument must be str, not {type(text).__name__}")
        self.write_styled(visible(text))
        return len(text)

    def write_styled(self, text: str) -> int:
        """Write text with escape sequences; return its length, even if it went nowhere."""
        try:
            return super().write(text)
        except OSError as error:
            self._leave(error)
            return len(text)

    def flush(self) -> None:
        """Write what is buffered."""
        try:
            super().flush()
        except OSError as error:
            self._leave(error)

    @property
    def rich_proxied_file(self) -> "_Styled":
        """The stream that consoles of Rich write to instead of this one."""
        return _Styled(self)

    def _leave(self, error: OSError) -> None:
        """Send what is buffered, and what comes, to nowhere."""
        self.error = error
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, self.fileno())
        os.close(null)


class _Styled:
    """A stream whose `write` takes escape sequences; all else is as in the stream itself."""

    def __init__(self, stream: Stream) -> None:
        self._stream, self.write = stream, stream.write_styled

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


@contextmanager
def robust_streams() -> Iterator[None]:
    """Replace stdout and stderr if they are the process's own, and not of a test or a notebook."""
    _open_closed()
    before = {"stdout": sys.stdout, "stderr": sys.stderr}
    for number, (name, stream) in enumerate(before.items(), 1):
        if stream is None or _descriptor(stream) == number:
            setattr(sys, name, _robust(stream, number))
    try:
        yield
    finally:
        for name, stream in before.items():
            getattr(sys, name).flush()
            setattr(sys, name, stream)


def output_error() -> OSError | None:
    """Return why stdout cannot be written; None if it can, or if its reader has closed it."""
    sys.stdout.flush()
    error = getattr(sys.stdout, "error", None)
    return None if isinstance(error, BrokenPipeError) else error


def output_ended() -> bool:
    """Whether what is printed goes nowhere."""
    return getattr(sys.stdout, "error", None) is not None


def _open_closed() -> None:
    """Open what is closed of stdin, stdout and stderr, or the next file would take its place."""
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)


def _descriptor(stream: Any) -> int | None:
    with suppress(OSError, ValueError, AttributeError):
        return int(stream.fileno())
    return None


def _robust(stream: Any, number: int) -> Stream:
    """Return a stream like another one, in which nothing that can happen raises an error."""
    if stream is None:
        return Stream(open(number, "wb", closefd=False), "utf-8", _SUBSTITUTE)
    stream.flush()
    escaped = stream.errors == "surrogateescape"
    return Stream(
        open(number, "wb", closefd=False, buffering=0 if stream.write_through else -1),
        stream.encoding,
        _SUBSTITUTE_TEXT if escaped else _SUBSTITUTE,
        line_buffering=stream.line_buffering,
        write_through=stream.write_through,
    )


def _substitute(error: UnicodeError) -> tuple[str | bytes, int]:
    r"""Replace a character; a byte of a file name that is not UTF-8 becomes \xff."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    char = error.object[error.start]
    plain = _PLAIN.get(char) or readable(char).encode("ascii", "backslashreplace").decode()
    return plain, error.start + 1


def _substitute_text(error: UnicodeError) -> tuple[str | bytes, int]:
    """Replace a character; a byte of a file name stays, as Python's own handler leaves it."""
    with suppress(UnicodeEncodeError):
        if isinstance(error, UnicodeEncodeError):
            char = error.object[error.start]
            return char.encode("ascii", "surrogateescape"), error.start + 1
    return _substitute(error)


_SUBSTITUTE, _SUBSTITUTE_TEXT = "brrt", "brrt-text"
codecs.register_error(_SUBSTITUTE, _substitute)
codecs.register_error(_SUBSTITUTE_TEXT, _substitute_text)
