"""What loaders of world files have in common."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import ClassVar, NamedTuple

from brrt.errors import BrrtError
from brrt.files import is_file, is_there, read_text
from brrt.settings import Settings
from brrt.worlds.convex import GREATEST
from brrt.worlds.world import World

MOST_BYTES = 64_000_000
"""Bytes of a text file, at most."""
MOST_LISTS = 5_000_000
"""In JSON, each of which takes a hundred bytes once it is parsed."""


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


class FileSpec(NamedTuple):
    """A world file as a user names it: `FILE[:name=value,...][#query]`."""

    path: Path
    params: str
    query: str

    @classmethod
    def parse(cls, spec: str) -> "FileSpec":
        """Take a name apart; what exists as a file is never taken apart further.

        Where nothing exists, the file ends before the first `:name=` or the last `#`.
        """
        if is_there(spec):
            return cls(Path(spec), "", "")
        cuts = [i for i, letter in enumerate(spec) if letter in ":#"]
        there = [i for i in cuts if is_file(spec[:i])]
        if there:
            cut = there[-1]
        else:
            named = [i for i in cuts if _is_cut(spec, i)]
            cut = named[0] if named else len(spec)
        path, rest = Path(spec[:cut]), spec[cut:]
        if rest.startswith("#"):
            return cls(path, "", rest[1:])
        params, number, query = rest[1:].rpartition("#")
        return cls(path, params, query) if number else cls(path, query, "")


def _is_cut(spec: str, i: int) -> bool:
    """Whether parameters or a query could begin at a `:` or `#`; not at that of `C:`."""
    name, equals, _ = spec[i + 1 :].partition("=")
    return spec[i] == "#" or bool(equals and name.strip().isidentifier())


def json_text(path: Path) -> str:
    """Read a file of JSON that will not take gigabytes once it is parsed.

    Raises:
        BrrtError: It cannot be read, is too long, or holds millions of lists.
    """
    text = read_text(path, "a world", MOST_BYTES)
    if text.count("[") + text.count("{") > MOST_LISTS:
        raise BrrtError(f"{path}: more than {MOST_LISTS:,} lists; that is too much for a world")
    return text


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
