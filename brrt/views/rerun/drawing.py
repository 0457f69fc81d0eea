"""A run drawn in Rerun: trees as they grow, samples, rejections, paths, cells, plots and a log.

Places are float32 and decimated where there are more than a viewer can take.
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import rerun as rr

from brrt.events import Events, Kind, Phase, Status
from brrt.recording import Recording, Result
from brrt.scenario.manifest import Manifest
from brrt.views.colours import GOAL, START
from brrt.views.rerun import layout
from brrt.views.rerun.draw.canvas import Canvas
from brrt.views.rerun.draw.cells import CellsDrawing
from brrt.views.rerun.draw.decimate import DrawnNodes
from brrt.views.rerun.draw.paths import MovesDrawing, PathsDrawing, body_lines
from brrt.views.rerun.draw.plots import ExtensionsPlot, IterationTimePlot
from brrt.views.rerun.draw.transient import TransientDrawing
from brrt.views.rerun.draw.trees import TreesDrawing
from brrt.views.rerun.draw_world import log_marker, log_world
from brrt.views.rerun.frame import Frame
from brrt.views.rerun.ring import draw_ring, place_of
from brrt.views.rerun.stream import rrd_file
from brrt.worlds.world import World


def draw_run(
    path: Path,
    recording: Recording,
    *,
    ring: int | None = None,
    progress: Callable[[int], object] = int,
) -> None:
    """Draw a run into an .rrd file for the viewer; brrt cannot read the events back from it.

    Args:
        path: The file; it is overwritten.
        recording: The run.
        ring: Number of an event to draw a ring around.
        progress: Gets the number of events drawn so far.

    Raises:
        BrrtError: The file cannot be written.
    """
    manifest, world = recording.manifest, recording.world
    names = layout.recording_id(manifest), layout.application(manifest, world)
    with rrd_file(path, *names, layout.blueprint(manifest, world)) as rec:
        draw_into(rec, recording, progress)
        if ring is not None:
            events = recording.events()
            kinds = [kind.label for kind, table in events.tables.items() if ring in table["seq"]]
            text = ": ".join([f"event {ring}", *kinds])
            draw_ring(rec, manifest, world, place_of(events, manifest, ring), text)


def draw_into(
    rec: rr.RecordingStream, recording: Recording, progress: Callable[[int], object] = int
) -> None:
    """Draw a run into a Rerun recording stream; see `draw_run`."""
    drawing, done = RunDrawing(rec, recording.manifest, recording.world), 0
    for batch in recording.batches():
        drawing.write(batch)
        progress(done := done + len(batch))
    drawing.close(recording.result)


class RunDrawing:
    """Draws the events of a run, batch by batch, into a Rerun recording stream.

    `title`, in Markdown, is shown above the description of the run.
    """

    def __init__(
        self, rec: rr.RecordingStream, manifest: Manifest, world: World, title: str = ""
    ) -> None:
        self._rec, self._manifest, self._title = rec, manifest, title
        frame = self._frame = Frame.of(world)
        log_world(rec, frame)
        _log_ends(rec, manifest, frame)
        self._describe(None)
        canvas, nodes = Canvas(rec, manifest, frame), dict[int, DrawnNodes]()
        self._canvas = canvas
        self._transient = TransientDrawing(canvas, nodes)
        self._trees = TreesDrawing(canvas, nodes, self._transient)
        self._cells = CellsDrawing(canvas, nodes, manifest)
        self._extensions, self._iteration_time = ExtensionsPlot(canvas), IterationTimePlot(canvas)
        self._moves = MovesDrawing(canvas, manifest)
        self._paths = PathsDrawing(canvas)

    def write(self, events: Events) -> None:
        """Draw a batch."""
        self._trees.write(events)
        self._cells.write(events)
        self._transient.draw_rejects(events[Kind.REJECT])
        self._transient.draw_samples(events[Kind.SAMPLE])
        self._extensions.write(events)
        self._iteration_time.write(events)
        self._moves.write(events)
        self._paths.write(events)
        for event in events[Kind.PHASE]:
            self._canvas.add_text(event, _phase_text(event))
        self._canvas.send_texts()

    def close(self, result: Result | None) -> None:
        """Draw the rest, and describe the run with its result if there is one."""
        self._trees.close()
        self._cells.close()
        if result is not None:
            self._describe(result)

    def _describe(self, result: Result | None) -> None:
        text = self._title + layout.document(self._manifest, result, self._frame.text)
        markdown = rr.TextDocument(text, media_type=rr.MediaType.MARKDOWN)
        self._rec.log("/run", markdown, static=True)


def _log_ends(rec: rr.RecordingStream, manifest: Manifest, frame: Frame) -> None:
    """Draw start and goal, and the body there."""
    robot = manifest.make_robot()
    for name, q, colour in (("start", manifest.start, START), ("goal", manifest.goal, GOAL)):
        body = [frame.points(line) for line in body_lines(robot, np.array(q))]
        if body and manifest.dim == 2:
            rec.log(
                f"/world/{name}/body",
                rr.LineStrips2D(body, colors=colour, radii=-1.5, draw_order=90),
                static=True,
            )
        elif body:
            lines = rr.LineStrips3D(body, colors=colour, radii=-3)
            rec.log(f"/world/{name}/body", lines, static=True)
        log_marker(rec, frame.drawn, name, frame.places([q], robot), colour)


def _phase_text(event: np.void) -> str:
    phase, status = Phase(int(event["name"])), Status(int(event["status"]))
    if status is Status.BEGIN:
        return f"{phase.label} begins"
    return f"{phase.label} ends: {status.label}"
