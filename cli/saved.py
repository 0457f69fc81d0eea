"""The events of a recording, of one that was cut as far as they are whole."""

from collections.abc import Callable, Iterator
from functools import wraps
from typing import TYPE_CHECKING, Any

from .console import counted, note

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


class Saved:
    """Yields a recording's batches; where the file is cut, says what was saved.

    Args:
        recording: The recording.
        partial: Whether the user takes what is whole of a file that was cut.
        verb: What the command does with it.
    """

    def __init__(self, recording: "Recording", *, partial: bool, verb: str) -> None:
        self._recording, self._partial, self._verb = recording, partial, verb
        self.cut, self.events = False, 0

    def __iter__(self) -> "Iterator[Events]":
        from brrt.errors import RecordingError  # noqa: PLC0415 - keep --help fast
        from brrt.recording import CutError  # noqa: PLC0415

        self.events, last = 0, 0
        try:
            for batch in self._recording.batches():
                self.events += len(batch)
                last = max((int(t["t"][-1]) for t in batch.tables.values()), default=last)
                yield batch
        except CutError as error:
            verb = "is" if self.events == 1 else "are"
            saved = f"{counted(self.events, 'event')} up to {last / 1e9:.6f} s {verb} whole"
            if not self._partial:
                raise RecordingError(
                    f"{error}; {saved}: {self._verb} with --partial, or save them with brrt recover"
                ) from None
            if not self.cut:  # it may be read more than once
                note(f"{error}; {saved}")
            self.cut = True
