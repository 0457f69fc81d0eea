"""Base class of the loaders of world files, and helpers to read text formats."""

import math
import os
from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path, PureWindowsPath
from typing import ClassVar

from brrt.errors import BrrtError
from brrt.files import is_there, read_text
from brrt.settings import Settings
from brrt.worlds.arrays import GREATEST
from brrt.worlds.world import World

MOST_BYTES = 64_000_000
"""Maximum size of a text file."""


@dataclass(frozen=True, slots=True)
class Loader(Settings):
    """Base class of the loaders; the first line of a loader's docstring is shown to users.

    Attributes:
        endings: Suffixes of file names, in lower case.
        queries: What `#` after the file selects; empty for formats without queries.
    """

    greatest_number: ClassVar[float] = GREATEST
    endings: ClassVar[tuple[str, ...]] = ()
    queries: ClassVar[str] = ""

    @classmethod
    @abstractmethod
    def recognises(cls, head: bytes) -> bool:
        """Whether a file that begins with these bytes is of this format."""

    def load(self, path: Path, query: str) -> World:
        """Read a world from a file.

        Args:
            path: The file.
            query: The text after `#`, such as a number; empty if there is none.

        Raises:
            BrrtError: The file cannot be read or is not a world, or has no such query.
        """
        if not self.queries:
            refuse_query(path, query)
        return self.read(path, query)

    @abstractmethod
    def read(self, path: Path, query: str, /) -> World:
        """Read a world from a file; see `load`."""


def refuse_query(path: Path, query: str) -> None:
    """Raise if there is a query, for files without queries.

    Raises:
        BrrtError: There is a query.
    """
    if query:
        raise BrrtError(f"{path}: this file has no queries to choose from; omit '#{query[:40]}'")


def read_world_text(path: Path) -> str:
    """Read a text file that holds a world.

    Raises:
        BrrtError: The file cannot be read, is too large, or is not text.
    """
    return read_text(path, "a world", MOST_BYTES)


def finite(where: str, words: Sequence[str]) -> list[float]:
    """Read words as finite numbers.

    Raises:
        BrrtError: A word is not a number, not finite, or beyond `GREATEST`.
    """
    try:
        numbers = [float(word) for word in words]
    except ValueError:
        raise BrrtError(f"{where}: {' '.join(words)[:60]!r} is not all numbers") from None
    if not all(map(math.isfinite, numbers)):
        raise BrrtError(f"{where}: a number is not finite")
    if any(abs(number) > GREATEST for number in numbers):
        raise BrrtError(f"{where}: a number is beyond {GREATEST:g}")
    return numbers


def whole(where: str, what: str, word: str, low: int, high: int) -> int:
    """Read a word as a whole number from `low` to `high`.

    Raises:
        BrrtError: The word is something else.
    """
    if word.isascii() and word.isdigit() and len(word) < 19 and low <= int(word) <= high:
        return int(word)
    raise BrrtError(
        f"{where}: {what} must be a whole number from {low} to {high:,}, not {word[:40]!r}"
    )


def file_named_in(where: str, path: Path, name: str, remedy: str) -> Path:
    """Return the path of a file that another file names; it must be in the same folder or below.

    Symbolic links in the folder are followed: they are the user's own.

    Args:
        where: File and position of the name, for messages.
        path: The file that contains the name.
        name: The name; absolute, or relative to the file's folder.
        remedy: How the user can name such a file explicitly.

    Raises:
        BrrtError: The name leads out of the folder.
    """
    folder = os.path.abspath(path.parent)  # noqa: PTH100 - pathlib does not remove `..`
    named = os.path.normpath(os.path.join(folder, name))  # noqa: PTH118
    followed = os.path.realpath(Path(named).parent), os.path.realpath(folder)
    for inner, outer in ((named, folder), followed):
        if Path(inner).is_relative_to(outer) and not _is_of_windows(name):
            return path.parent / os.path.relpath(named, folder) if inner == named else Path(named)
    raise BrrtError(
        f"{where}: {name[:80]!r} is outside the file's folder; if it is right, give {remedy}"
    )


def _is_of_windows(name: str) -> bool:
    """Whether a name leads out of a folder on Windows only."""
    windows = PureWindowsPath(name)
    return os.name != "nt" and "\\" in name and (bool(windows.anchor) or ".." in windows.parts)


def file_named_by_user(path: Path, name: str) -> Path:
    """Return the path of a file that the user names, relative to here or to the world file.

    Args:
        path: The world file.
        name: The name.
    """
    return Path(name) if is_there(name) else path.parent / name
