"""Write the events that precede a cut or damage into a new, whole file."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from brrt.errors import BrrtError
from brrt.files import replacing
from brrt.formats import read
from brrt.formats.integrity import BrokenError
from brrt.formats.mcap.sink import McapSink
from brrt.recording import Recording
from brrt.replay.metrics import Metrics
from brrt.scenario.manifest import Manifest
from brrt.text import readable
from brrt.worlds.world import World

NOTE = "brrt.recovered"
"""Name of the texts in which a recovered file names its origin."""


@dataclass(frozen=True, slots=True)
class Recovery:
    """What was recovered.

    Attributes:
        events: How many events.
        until_s: When the last of them happened, in seconds of the run.
        lost: What is wrong with the file; None if it is whole.
        complete: Whether those are all events, so that the damage is behind or beside them.
        ended: Whether, besides, the run came to its own end.
    """

    events: int
    until_s: float
    lost: str | None
    complete: bool
    ended: bool


def recover(
    cut: Path | str,
    whole: Path | str,
    open_sink: Callable[[Path, Manifest, World], Any] = McapSink,
) -> Recovery:
    """Write the events that precede a cut or the first damage into a new, whole file.

    Index, statistics and checksums are made anew. The run's result is computed and written if the
    run came to its end; otherwise the file names its origin (`NOTE`).

    Args:
        cut: The recording: an .mcap file in any state, or an .rrd file that is whole.
        whole: The new file; it appears once it is complete.
        open_sink: Opens the sink that writes it.

    Raises:
        RecordingError: The recording cannot be read, or is cut or damaged before its first event.
        BrrtError: The new file cannot be written.
    """
    cut, whole = Path(cut), Path(whole)
    if whole.exists() and cut.exists() and whole.samefile(cut):
        raise BrrtError(f"{whole}: is the recording itself; choose another name")
    recording = read(cut)
    with replacing(whole) as unfinished:
        sink = open_sink(unfinished, recording.manifest, recording.world)
        return _rewrite(cut, recording, sink)


def _rewrite(cut: Path, recording: Recording, sink: Any) -> Recovery:
    """Write what can be read of a recording to a sink, and close it."""
    metrics = Metrics(recording.manifest)
    try:
        recovery = _copy(recording, sink, metrics)
        if recovery.lost is not None:
            sink.annotate(NOTE, _note(cut, recovery))
    except BaseException:
        sink.close(None)
        raise
    sink.close(metrics.as_dict() if recovery.ended else None)
    return recovery


def _copy(recording: Recording, sink: Any, metrics: Metrics) -> Recovery:
    """Hand the events to a sink, up to the end or the first damage."""
    count, last = 0, 0
    try:
        for batch in recording.batches():
            sink.write(batch)
            metrics.write(batch)
            count, last = count + len(batch), max(last, batch.last.t)
    except BrokenError as error:
        return Recovery(count, last / 1e9, error.fault, error.complete, error.ended)
    return Recovery(count, last / 1e9, None, True, recording.result is not None)


def _note(cut: Path, recovery: Recovery) -> dict[str, str]:
    return {
        "from": readable(cut.name),
        "events": str(recovery.events),
        "until_s": f"{recovery.until_s:.9f}",
        "lost": readable((recovery.lost or "").replace(str(cut), cut.name)),
    }
