"""What loaders of world files have in common."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import ClassVar

from brrt.errors import BrrtError
from brrt.files import is_there
from brrt.settings import Settings
from brrt.worlds.arrays import GREATEST
from brrt.worlds.world import World

MOST_BYTES = 64_000_000
"""Bytes of a text file, at most."""


@dataclass(frozen=True, slots=True)
class Loader(Settings):
    """Base of the loaders; the first line of their docstrings is what users read in lists.

    Attributes:
        endings: Endings of file names, in lower case.
        queries: What `#` after the file chooses (`12`); empty where there is nothing to choose.
    """

    endings: ClassVar[tuple[str, ...]] = ()
    queries: ClassVar[str] = ""

    @classmethod
    def recognises(cls, head: bytes) -> bool:
        """Whether a file that begins like this is of this format."""
        raise NotImplementedError

    def load(self, path: Path, query: str) -> World:
        """Read a world from a file.

        Args:
            path: The file.
            query: What stood behind the `#`, such as a number; empty without one.

        Raises:
            BrrtError: The file cannot be read, or is not a world.
        """
        raise NotImplementedError


def nothing_to_choose(path: Path, query: str) -> None:
    """Refuse a query to a file that holds none.

    Raises:
        BrrtError: There is a query.
    """
    if query:
        raise BrrtError(f"{path}: there is nothing to choose in it; leave out '#{query[:40]}'")


def finite(where: str, words: Sequence[str]) -> list[float]:
    """Read words as numbers.

    Raises:
        BrrtError: One is no number, not finite, or so large that its square overflows.
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
        BrrtError: It is none.
    """
    if word.isascii() and word.isdigit() and len(word) < 19 and low <= int(word) <= high:
        return int(word)
    raise BrrtError(
        f"{where}: {what} must be a whole number from {low} to {high:,}, not {word[:40]!r}"
    )


def named_inside(where: str, path: Path, name: str, remedy: str) -> Path:
    """Return the file that a file names; it may not lead out of that file's folder.

    A link in the folder is the user's own, and is followed.

    Args:
        where: File and place of the name, for messages.
        path: The file that holds the name.
        name: What it says.
        remedy: How a user names such a file by hand.

    Raises:
        BrrtError: The name is absolute, or climbs with `..`.
    """
    parts = (*PurePosixPath(name).parts, *PureWindowsPath(name).parts)
    absolute = PurePosixPath(name).is_absolute() or PureWindowsPath(name).anchor
    if absolute or PureWindowsPath(name).drive or ".." in parts:
        raise BrrtError(
            f"{where}: {name[:80]!r} leads out of the file's folder; if it is right, say {remedy}"
        )
    return path.parent / name


def named_by_user(path: Path, name: str) -> Path:
    """Return the file that a user names: from where they stand or, if it is not there, beside.

    Args:
        path: The world file.
        name: What the user says.
    """
    return Path(name) if is_there(name) else path.parent / name
