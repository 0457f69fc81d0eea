"""Two runs in one drawing: side by side, with shared plots and a ring where they first differ."""

from pathlib import Path
from typing import Any

import rerun as rr
import rerun.blueprint as rrb

from brrt.comparison.difference import Difference
from brrt.comparison.events import first_difference
from brrt.events import Events
from brrt.formats.rrd.columns import time_columns
from brrt.recording import Recording
from brrt.text import markdown, readable, visible
from brrt.views.colours import RUNS, Colour
from brrt.views.rerun import layout
from brrt.views.rerun.draw.canvas import times_of
from brrt.views.rerun.drawing import RunDrawing
from brrt.views.rerun.ring import draw_ring, place_of
from brrt.views.rerun.stream import rrd_file

_LIGHTER = 0.12
"""How much lighter each further line of a run is in one plot."""


def draw_pair(path: Path, a: Recording, b: Recording) -> Difference | None:
    """Draw two runs into an .rrd file for the viewer, below the entities `/A` and `/B`.

    Returns:
        The first event that differs in more than its time; None if there is none.

    Raises:
        BrrtError: The file cannot be written.
    """
    runs = (a, b)
    logs = [run.events() for run in runs]
    difference = first_difference([logs[0]], [logs[1]])
    name = "+".join(layout.recording_id(run.manifest) for run in runs)
    # A viewer keeps one layout for each application: this one is not that of a single run.
    with rrd_file(path, name, "brrt pair", _layout(runs)) as rec:
        for letter, run, events, colour in zip("AB", runs, logs, RUNS, strict=True):
            below: Any = _Below(rec, letter, colour)
            drawing = RunDrawing(below, run.manifest, run.world, f"**{markdown(run.name)}**\n\n")
            drawing.write(events)
            drawing.close(None)
            if difference is not None:
                other = difference.right if run is a else difference.left
                place = place_of(events, run.manifest, difference.seq, other)
                text = f"first difference: event {difference.seq}"
                draw_ring(below, run.manifest, run.world, place, text)
        if difference is not None:
            _log_difference(rec, max(logs, key=len), difference)
    return difference


class _Below:
    """A recording stream below the entity of a letter; its plots have shades of one colour."""

    def __init__(self, rec: rr.RecordingStream, letter: str, colour: Colour) -> None:
        self._rec, self._letter, self._colour = rec, letter, colour
        self._lines: dict[str, list[str]] = {}

    def log(self, entity: str, archetype: Any, *, static: bool = False) -> None:
        """Log below the entity."""
        if isinstance(archetype, rr.SeriesLines):
            archetype = self._line(entity)
        elif isinstance(archetype, rr.SeriesPoints):
            archetype = rr.SeriesPoints(names=self._letter, colors=self._colour, marker_sizes=3)
        self._rec.log(f"/{self._letter}{entity}", archetype, static=static)

    def send_columns(self, entity: str, indexes: Any, columns: Any) -> None:
        """Send columns below the entity."""
        self._rec.send_columns(f"/{self._letter}{entity}", indexes, columns)

    def _line(self, entity: str) -> rr.SeriesLines:
        plot, _, name = entity.removeprefix("/series/").partition("/")
        lines = self._lines.setdefault(plot, [])
        if name not in lines:
            lines.append(name)
        light = 1 - (1 - _LIGHTER) ** lines.index(name)
        colour = [round(value + light * (255 - value)) for value in self._colour]
        text = f"{self._letter} {name}".replace("_", " ").strip()
        return rr.SeriesLines(names=text, colors=colour, widths=1.5)


def _log_difference(rec: Any, events: Events, difference: Difference) -> None:
    """Add a line to the text log at the first event that differs."""
    until = events.until(seq=difference.seq)
    last = max((table[-1] for table in until.tables.values()), key=lambda row: int(row["seq"]))
    line = visible(readable(f"the runs part at {difference}"))
    text = rr.TextLog.columns(text=[line], level=["WARN"])
    rec.send_columns("/difference", time_columns(times_of([last])), text)


def _layout(runs: tuple[Recording, Recording]) -> rrb.Blueprint:
    worlds = []
    for letter, run in zip("AB", runs, strict=True):
        scenario = run.manifest.scenario
        title = f"{letter}: {run.name} ({scenario.planner}, seed {scenario.seed})"
        worlds.append(
            layout.world_view(run.world, below=f"/{letter}", name=visible(readable(title)))
        )
    log = rrb.TextLogView(
        origin="/",
        contents=["/difference", "/A/log", "/B/log"],
        name="Log",
        columns=rrb.TextLogColumns(
            timeline_columns=["iteration"], text_log_columns=["entitypath", "body"]
        ),
    )
    documents = [rrb.TextDocumentView(origin=f"/{each}/run", name=each) for each in "AB"]
    plots = layout.plots("/A", "/B")
    shares = [3] * len(plots) + [5, 4]
    below = rrb.Horizontal(*plots, log, rrb.Tabs(*documents), column_shares=shares)
    return layout.framed(
        rrb.Vertical(rrb.Horizontal(*worlds), below, row_shares=[7, 3]),
        executed=any(run.manifest.scenario.execute for run in runs),
    )
