"""The events of a recording; of one that was cut or damaged, as far as they are whole."""

import shlex
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any

from brrt.replay.text import counted

from .console import note

if TYPE_CHECKING:
    from brrt.events import Events
    from brrt.recording import Recording


def naming_runs(command: Callable[..., None]) -> Callable[..., None]:
    """Let a command name its file, and what to look with, where the events make no sense."""

    @wraps(command)
    def named(**given: Any) -> None:
        from brrt.errors import BrrtError, LogError  # noqa: PLC0415 - keep --help fast

        try:
            command(**given)
        except LogError as error:
            runs = given["runs"] if "runs" in given else [given["run"]]
            looked = " or ".join(map(str, runs))
            raise BrrtError(f"{looked}: {error}; see brrt verify") from None

    return named


def opened(run: Path, *, partial: bool) -> "Recording":
    """Open a recording; one that is not whole, and taken in part, lacks its run's end."""
    from brrt.formats import read  # noqa: PLC0415 - keep --help fast

    recording = read(run)
    if not partial:
        return recording
    known = read(run, partial=True)
    return replace(recording, result=known.result, counts=known.counts)


class Saved:
    """Yields a recording's batches; where the file is cut or damaged, says what was saved.

    Args:
        recording: The recording.
        partial: Whether the user takes what is whole of such a file.
        verb: What the command does with it.
    """

    def __init__(self, recording: "Recording", *, partial: bool, verb: str) -> None:
        self._recording, self._partial, self._verb = recording, partial, verb
        self.cut, self.events = False, 0

    def __iter__(self) -> "Iterator[Events]":
        from brrt.errors import RecordingError  # noqa: PLC0415 - keep --help fast
        from brrt.formats import BrokenError  # noqa: PLC0415

        self.events, last = 0, 0
        try:
            for batch in self._recording.batches():
                self.events += len(batch)
                last = max((int(t["t"][-1]) for t in batch.tables.values()), default=last)
                yield batch
        except BrokenError as error:
            found = f"{error.fault}; {told_of(self.events, last / 1e9, complete=error.complete)}"
            if not self._partial:
                remedy = f"brrt recover {shlex.quote(str(error.path))} --out whole.mcap"
                what, them = (self._verb, "them") if self.events else ("take the problem", "it")
                raise RecordingError(
                    f"{found}: {what} with --partial, or save {them} with {remedy}"
                ) from None
            if not self.cut:  # it may be read more than once
                note(found)
            self.cut = True


def told_of(events: int, until_s: float, *, complete: bool) -> str:
    """Say how many events are whole of a file that is not."""
    if not events:
        return "no event is whole"
    until = f"{counted(events, 'event')} up to {until_s:.6f} s"
    if complete:
        return f"no event is lost, all {until} are whole"
    return f"{until} {'is' if events == 1 else 'are'} whole"
