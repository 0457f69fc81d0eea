"""Recordings as commands open them: complete files, and cut or damaged ones up to the fault."""

from collections.abc import Iterator, Mapping
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path

from brrt.errors import RecordingError
from brrt.events import Events, Instant
from brrt.formats import BrokenError, CutError, read
from brrt.recording import Recording
from brrt.replay.text import counted
from brrt.shell import file_argument

from .console import note
from .progress import ProgressBar


def open_run(
    path: Path, limits: Mapping[str, int] | None = None, *, partial: bool, watched: bool = True
) -> Recording:
    """Open a recording for a command.

    Args:
        path: The file.
        limits: The instant that the user asks for, as `Events.until` takes it. If the recording
            ends earlier, a line on stderr reports where.
        partial: Take a cut or damaged file up to the fault, and report that once on stderr.
        watched: Show a progress bar while batches are read; not where each is printed at once.

    Returns:
        The recording; reading its batches raises `RecordingError` at a fault unless `partial`.

    Raises:
        RecordingError: The file cannot be read, or is no recording.
    """
    recording = read(path)
    if partial:
        whole = read(path, partial=True)
        recording = replace(recording, result=whole.result, counts=whole.counts)
    batches = _Batches(recording, limits or {}, partial=partial, watched=watched)
    return replace(recording, batches=batches)


class _Batches:
    """The batches of a recording, which report a fault of the file and an early end.

    Args:
        recording: The recording.
        limits: The instant that the user asks for.
        partial: Whether to report a fault; otherwise it is raised with the remedy.
        watched: Whether to show a progress bar.
    """

    def __init__(
        self, recording: Recording, limits: Mapping[str, int], *, partial: bool, watched: bool
    ) -> None:
        self._batches, self._limits, self._partial = recording.batches, limits, partial
        self._title, self._watched = f"reading {recording.name}", watched
        self._total = sum(recording.counts.values()) if recording.counts else None
        self._reported = False

    def __call__(self) -> Iterator[Events]:
        count, last = 0, Instant(0, 0)
        try:
            bar = ProgressBar(self._total, self._title)
            with bar.running() if self._watched else nullcontext():
                for batch in self._batches():
                    count, last = count + len(batch), batch.last if len(batch) else last
                    yield batch
                    bar.update(count, self._title, counted(count, "event"))
        except BrokenError as error:
            if not self._partial:
                raise RecordingError(refusal(error, count, last)) from None
            self._report(fault(error, count, last))
        late = end_before(self._limits, count, last)
        if late is not None:
            self._report(f"{late}; this is its end")

    def _report(self, text: str) -> None:
        if not self._reported:  # the batches may be read more than once
            note(text)
        self._reported = True


def fault(error: BrokenError, count: int, last: Instant) -> str:
    """Describe what is wrong with a file, and which events come before that."""
    text = f"{error.fault}; {events_left(count, last.t / 1e9, complete=error.complete)}"
    cut = isinstance(error, CutError) and not error.complete
    return f"{text}; the end of the run is missing" if cut else text


def refusal(error: BrokenError, count: int, last: Instant) -> str:
    """Describe what is wrong with a file, and how to use or save the rest of it."""
    remedy = f"brrt recover {file_argument(error.path)} --out whole.mcap"
    rest = "them" if count else "the problem"
    return f"{fault(error, count, last)}: use {rest} with --partial, or save {rest} with {remedy}"


def events_left(events: int, until_s: float, *, complete: bool) -> str:
    """Describe how many events of a cut or damaged file can be read."""
    if not events:
        return "no event is whole"
    until = f"{counted(events, 'event')} up to {until_s:.6f} s"
    if complete:
        return f"no event is lost, all {until} are whole"
    return f"{until} {'is' if events == 1 else 'are'} whole"


def end_before(limits: Mapping[str, int], count: int, last: Instant) -> str | None:
    """Describe how a recording ends if that is before an instant; None otherwise.

    Args:
        limits: The instant, as `Events.until` takes it.
        count: Events of the recording.
        last: When the last of them happened.
    """
    ends = {
        "seq": (count - 1, f"with event {count - 1:,}"),
        "t": (last.t, f"at {last.t / 1e9:.6f} s"),
        "iteration": (last.iteration, f"with iteration {last.iteration:,}"),
    }
    for name, limit in limits.items():
        end, text = ends[name]
        if limit > end:
            return f"the recording ends {text}"
    return None
