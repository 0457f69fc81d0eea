"""The errors that brrt raises on purpose."""

from collections.abc import Iterable
from difflib import get_close_matches


class BrrtError(Exception):
    """Bad input or an unusable file; the message is one line that names the remedy."""


class RecordingError(BrrtError):
    """A recording cannot be written, or cannot be read in whole."""


class WriteError(RecordingError):
    """A recording cannot be written, or not to its end.

    Args:
        path: The file.
        reason: What the system says of it.
        left: What there is of the file all the same; nothing by default.
    """

    def __init__(self, path: object, reason: str, left: str = "") -> None:
        how = f"cannot go on writing {path}: {reason}; {left}"
        super().__init__(how if left else f"cannot write {path}: {reason}")
        self.reason = reason


class LogError(RecordingError):
    """The events of a recording contradict each other, so that there is nothing to tell of it."""


def unknown(what: str, name: str, known: Iterable[str]) -> BrrtError:
    """Return the error for `name`, which is none of the `known` names of a `what`."""
    names = sorted(known)
    near = get_close_matches(name.lower(), names, n=1, cutoff=0.5)
    there = "there is: " + ", ".join(names) if names else "there is none"
    hint = f"did you mean {near[0]!r}?" if near else there
    return BrrtError(f"unknown {what} {name!r}; {hint}")
