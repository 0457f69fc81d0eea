"""Errors that brrt raises for bad input and unusable files."""

import math
from collections.abc import Iterable
from difflib import get_close_matches

from brrt.text import visible


class BrrtError(Exception):
    """Bad input or an unusable file; the message is one line that names the remedy."""

    def __str__(self) -> str:
        """Return the message; what it quotes cannot steer the terminal."""
        return visible(super().__str__())


class RecordingError(BrrtError):
    """A recording cannot be written, or cannot be read completely."""


class WriteError(RecordingError):
    """A recording cannot be written, or writing it failed part-way.

    Args:
        path: The file.
        reason: The operating system's message.
        left: What the file contains after all; empty if it does not exist.
    """

    def __init__(self, path: object, reason: str, left: str = "") -> None:
        if left:
            super().__init__(f"writing {path} failed: {reason}; {left}")
        else:
            super().__init__(f"cannot write {path}: {reason}")
        self.reason = reason


class LogError(RecordingError):
    """The events of a recording contradict each other."""


def unknown(what: str, name: str, known: Iterable[str]) -> BrrtError:
    """Return the error for a name that is not among the `known` names of a `what`."""
    names = sorted(known)
    begins = [each for each in names if name and each.startswith(name.lower())]
    near = begins[:1] or get_close_matches(name.lower(), names, n=1, cutoff=0.5)
    if near:
        hint = f"did you mean {near[0]!r}?"
    else:
        hint = f"choose from: {', '.join(names)}" if names else f"there is no {what}"
    return BrrtError(f"unknown {what} {name!r}; {hint}")


def address_space() -> float:
    """Return how many bytes the process may map (`ulimit -v`), infinity without a limit."""
    try:
        import resource  # noqa: PLC0415 - POSIX alone has it
    except ImportError:
        return math.inf
    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    return math.inf if limit == resource.RLIM_INFINITY else limit
