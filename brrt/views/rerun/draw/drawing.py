"""Events as pictures in Rerun: trees as they grow, samples, rejections, paths, plots, a log.

All of it is float32, and thinned out where there is more than an eye or a viewer can take: the
exact events stand beside it.
"""

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from brrt.events import Events, Kind, Phase, Reason, Status, Table
from brrt.scenario.manifest import Manifest
from brrt.views.rerun import layout
from brrt.views.rerun.draw.canvas import Canvas, growing_rows
from brrt.views.rerun.draw.cells import Cells
from brrt.views.rerun.draw.decimate import Sketch
from brrt.views.rerun.draw.iteration_time import Pace
from brrt.views.rerun.draw.moves import Moves
from brrt.views.rerun.draw.paths import Paths
from brrt.views.rerun.draw.transient import Fading
from brrt.views.rerun.draw.trees import Trees
from brrt.worlds.world import World

_ACCEPTED = "/series/extensions/accepted"


class Drawing:
    """Draws batches of events into a recording.

    Args:
        rec: The recording.
        manifest: The run's.
        world: The run's.
    """

    def __init__(self, rec: rr.RecordingStream, manifest: Manifest, world: World) -> None:
        layout.log_scene(rec, manifest, world)
        canvas, sketches = Canvas(rec, manifest, world), dict[int, Sketch]()
        self._canvas = canvas
        self._fading = Fading(canvas, sketches)
        self._trees = Trees(canvas, sketches, self._fading)
        self._cells = Cells(canvas, sketches, manifest)
        self._moves = Moves(canvas, manifest)
        self._paths = Paths(canvas)
        self._added, self._rejects = 0, dict.fromkeys(Reason, 0)
        canvas.plot_style(_ACCEPTED, "accepted", layout.NEWEST)
        for reason, colour in layout.REJECTS.items():
            canvas.plot_style(_rejected(reason), reason.key, colour)
        self._pace = Pace(canvas)

    def write(self, events: Events) -> None:
        """Draw a batch."""
        self._trees.write(events)
        self._cells.write(events)
        self._fading.rejects(events[Kind.REJECT])
        self._fading.samples(events[Kind.SAMPLE])
        self._plot_extensions(events)
        self._pace.write(events)
        self._moves.write(events)
        self._paths.write(events)
        for event in events[Kind.PHASE]:
            self._canvas.tell(event, _phase_text(event))
        self._canvas.tell_news()

    def close(self) -> None:
        """Draw what was put off."""
        self._trees.close()
        self._cells.close()

    def _plot_extensions(self, events: Events) -> None:
        """Plot which part of all extensions so far was accepted, or rejected for a reason."""
        table, added = events[Kind.REJECT], (events[Kind.EDGE], events[Kind.EXPAND])
        before = self._added + sum(self._rejects.values())

        def plot(entity: str, have: int, some: Table, which: NDArray[np.int64]) -> None:
            ends = growing_rows(have, len(which))
            rows = some[which[ends - 1]]
            tried = before + sum(_count_until(rows, each) for each in (table, *added))
            self._canvas.plot(entity, rows, 100 * (have + ends) / tried)

        for reason in Reason:
            rejected = np.flatnonzero(table["reason"] == reason)
            if len(rejected):
                plot(_rejected(reason), self._rejects[reason], table, rejected)
                self._rejects[reason] += len(rejected)
        for some in filter(len, added):
            plot(_ACCEPTED, self._added, some, np.arange(len(some)))
            self._added += len(some)


def _count_until(rows: Table, table: Table) -> np.ndarray:
    """Count the events of a table up to each of some others."""
    return np.searchsorted(table["seq"], rows["seq"], "right")


def _rejected(reason: Reason) -> str:
    return f"/series/extensions/{reason.key}"


def _phase_text(event: np.void) -> str:
    phase, status = Phase(int(event["name"])), Status(int(event["status"]))
    if status is Status.BEGIN:
        return f"{phase.label} begins"
    return f"{phase.label} ends: {status.label}"
