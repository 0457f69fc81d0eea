"""Two recordings compared; their events are read no further than needed."""

from collections import deque
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from brrt.comparison.events import Deviation, first_difference
from brrt.comparison.report import Comparison, Cut
from brrt.comparison.settings import metadata_of, settings_of
from brrt.errors import BrrtError, RecordingError
from brrt.events import COUNTS, Events, Kind
from brrt.formats import read
from brrt.recording import Recording
from brrt.replay.metrics import Metrics

_NEEDED = ("solved", "status", "iterations", "events")
"""Metrics without which a recording's result is not used."""


def compare(
    a: Recording | Path | str,
    b: Recording | Path | str,
    *,
    names: tuple[str, str] | None = None,
    tolerance: float = 0.0,
) -> Comparison:
    """Compare two runs: settings, versions, metrics, and events up to the first difference.

    A recording without a result is read to its end for its metrics.

    Args:
        a: The first recording, or the name of its file.
        b: The second one.
        names: What they are called; by default the names of the files.
        tolerance: How far apart numbers may be, relative to the greater of the two, and to 1 if
            both are less; by default every bit counts.

    Raises:
        BrrtError: An argument is neither a recording nor the name of a file.
        RecordingError: A file cannot be read, or is damaged before the first difference.
    """
    pairs = [
        (read(run), str(run)) if isinstance(run, Path | str) else (run, getattr(run, "name", ""))
        for run in (a, b)
    ]
    for run, _ in pairs:
        if not isinstance(run, Recording):
            raise BrrtError(
                f"compare takes recordings or names of files, not {type(run).__name__}; "
                "brrt.Run(...).record() returns a recording"
            )
    (one, called_one), (other, called_other) = pairs
    left, right = _Log(one), _Log(other)
    first = first_difference(left, right, Deviation(allowed=tolerance))
    left.finish()
    right.finish()
    return Comparison(
        names=names or (called_one, called_other),
        settings=tuple(settings_of(one, other)),
        metadata=tuple(metadata_of(one.manifest, other.manifest)),
        cuts=(left.cut(), right.cut()),
        metrics=(left.metrics(), right.metrics()),
        timed=all(run.manifest.scenario.clock == "real" for run, _ in pairs),
        counts=(left.counts(), right.counts()),
        tolerance=tolerance,
        first=first,
    )


class _Log:
    """The events of a recording, read once, and the metrics of those read so far."""

    def __init__(self, recording: Recording) -> None:
        self._recording, self._batches = recording, iter(recording.batches())
        self._metrics, self._last_t = Metrics(recording.manifest), 0
        self._complete = self._damaged = False

    def __iter__(self) -> Iterator[Events]:
        for batch in self._batches:
            self._metrics.write(batch)
            self._last_t = max(self._last_t, batch.last.t)
            yield batch
        self._complete = True

    def finish(self) -> None:
        """Read the rest, unless the result makes that unnecessary."""
        if self._complete or set(_NEEDED) <= (self._recording.result or {}).keys():
            return
        try:
            deque(self, maxlen=0)
        except RecordingError:  # after the first difference, so that only the metrics end here
            self._complete = self._damaged = True

    def cut(self) -> Cut | None:
        """Return where the recording ends, if that is before its run's end."""
        unfinished = self._recording.result is None and self._metrics.cut
        if not (self._damaged or unfinished):
            return None
        return Cut(sum(self._metrics.counts.values()), self._last_t / 1e9)

    def metrics(self) -> Mapping[str, Any]:
        """Return the metrics of the events if all of them were read, otherwise the result."""
        return self._metrics.as_dict() if self._complete else self._recording.result or {}

    def counts(self) -> Mapping[str, int]:
        """Return the number of events of each kind, as far as it is known."""
        counts = self._metrics.counts if self._complete else self._recording.counts
        if counts is not None:
            return {kind.label: counts.get(kind, 0) for kind in Kind}
        result = self._recording.result or {}
        return {k.label: result[c.key] for k, c in COUNTS.items() if c.key and c.key in result}
