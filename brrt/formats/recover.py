"""A whole file out of one that was cut or damaged."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from brrt.errors import BrrtError, WriteError
from brrt.files import replacing
from brrt.formats import read
from brrt.formats.integrity import BrokenError
from brrt.formats.mcap.writer import McapSink
from brrt.recording import Recording
from brrt.replay.metrics import Metrics

NOTE = "brrt.recovered"
"""Name of what a recovered file says of its origin."""


@dataclass(frozen=True, slots=True)
class Recovery:
    """What was saved.

    Attributes:
        events: How many.
        until_s: When the last of them happened, in seconds of the run.
        lost: What is wrong with the file; None if it is whole.
        complete: Whether those are all events, so that only what stands beside them was lost.
        ended: Whether, besides, the run came to its own end.
    """

    events: int
    until_s: float
    lost: str | None
    complete: bool
    ended: bool


def recover(cut: Path | str, whole: Path | str) -> Recovery:
    """Write what is sound of a recording into a new file, which lacks nothing that a file has.

    Index, statistics and checksums are made anew. The run's figures are written where the run came
    to its end; otherwise the file says what it was made of (`NOTE`).

    Args:
        cut: The recording, .mcap or .rrd, as it was left.
        whole: The new file, .mcap or .rrd; it is there once it is complete.

    Raises:
        RecordingError: The recording cannot be read, or nothing of it is sound.
        BrrtError: The new file cannot be written.
    """
    cut, whole = Path(cut), Path(whole)
    if whole.exists() and cut.exists() and whole.samefile(cut):
        raise BrrtError(f"{whole}: is the recording itself; choose another name")
    recording = read(cut)
    with replacing(whole) as unfinished:
        try:
            recovery = _rewrite(cut, recording, unfinished)
        except WriteError as error:
            why = f"{error.reason}; nothing of it is left: name a file where there is more room"
            raise WriteError(whole, why) from None
    return recovery


def _rewrite(cut: Path, recording: Recording, path: Path) -> Recovery:
    """Write what is sound of a recording to a path."""
    sink, metrics = _sink(path, recording), Metrics(recording.manifest)
    try:
        recovery = _copy(recording, sink, metrics)
        if recovery.lost is not None:
            sink.annotate(NOTE, _note(cut, recovery))
    except BaseException:
        sink.close(None)
        raise
    sink.close(metrics.as_dict() if recovery.ended else None)
    return recovery


def _sink(path: Path, recording: Recording) -> Any:
    if path.suffix == ".rrd":
        from brrt.views.rerun.sink import RerunSink  # noqa: PLC0415 - costs half a second

        return RerunSink(recording.manifest, recording.world, path=path)
    return McapSink(path, recording.manifest, recording.world)


def _copy(recording: Recording, sink: Any, metrics: Metrics) -> Recovery:
    """Hand a sink the events as far as they are sound."""
    count, last = 0, 0
    batches = iter(recording.batches())
    while True:
        try:
            batch = next(batches, None)
        except BrokenError as error:
            return Recovery(count, last / 1e9, error.fault, error.complete, error.ended)
        if batch is None:
            return Recovery(count, last / 1e9, None, True, recording.result is not None)
        sink.write(batch)
        metrics.write(batch)
        count, last = count + len(batch), max(last, batch.last.t)


def _note(cut: Path, recovery: Recovery) -> dict[str, str]:
    return {
        "from": cut.name,
        "events": str(recovery.events),
        "until_s": f"{recovery.until_s:.9f}",
        "lost": (recovery.lost or "").replace(str(cut), cut.name),
    }
