"""Words of commands that a shell takes as they are printed."""

import shlex
from collections.abc import Iterable
from pathlib import Path

from brrt.text import readable


def file_word(path: Path | str) -> str:
    """Return a file as a word of a command, where one that begins with - would be an option."""
    return f"./{path}" if str(path).startswith("-") else str(path)


def join(words: Iterable[str]) -> str:
    """Return a command of these words."""
    return " ".join(map(_quoted, words))


def file_argument(path: Path | str) -> str:
    """Return a file as it is typed in a command, quoted where necessary."""
    return _quoted(file_word(path))


def _quoted(word: str) -> str:
    if word.isprintable():
        return shlex.quote(word)
    try:
        data = word.encode("utf-8", "surrogateescape")  # the bytes of a name that is not UTF-8
    except UnicodeEncodeError:
        data = readable(word).encode()
    plain = (chr(b) if 32 <= b < 127 and chr(b) not in "'\\" else f"\\x{b:02x}" for b in data)
    return f"$'{''.join(plain)}'"
