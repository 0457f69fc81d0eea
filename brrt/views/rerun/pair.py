"""Two runs in one picture: side by side, their plots over each other, and where they part."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import rerun as rr
import rerun.blueprint as rrb

from brrt.comparison.difference import Difference
from brrt.comparison.events import first_difference
from brrt.events import Events
from brrt.scenario.manifest import Manifest
from brrt.views.colours import Colour
from brrt.views.rerun import layout
from brrt.views.rerun.arrow import time_columns
from brrt.views.rerun.draw.canvas import moments
from brrt.views.rerun.draw.drawing import Drawing
from brrt.views.rerun.marker import place_of, ring
from brrt.views.rerun.sink import recording_id
from brrt.views.rerun.stream import filled, new_stream
from brrt.worlds.world import World

LINES: tuple[Colour, Colour] = ((92, 170, 255), (255, 160, 60))
"""Of the plots, for each run."""
_SHADES = 0.12
"""How much lighter each further line of a run is in one plot."""


@dataclass(frozen=True, slots=True, eq=False)
class Side:
    """One of two runs.

    Attributes:
        name: What it is called in the picture.
        manifest: Its manifest.
        world: Its world.
        events: Its whole log.
    """

    name: str
    manifest: Manifest
    world: World
    events: Events


def draw_pair(path: Path, left: Side, right: Side) -> Difference | None:
    """Draw two runs into an .rrd file: the first below `/A`, the second below `/B`.

    The file is for the eye: the exact events stay in the recordings.

    Args:
        path: The file; it is overwritten.
        left: The first run.
        right: The second run.

    Returns:
        The first event that is not the same in both, times apart; None if there is none.

    Raises:
        RecordingError: The file cannot be written.
    """
    difference = first_difference([left.events], [right.events])
    name = f"{recording_id(left.manifest)}+{recording_id(right.manifest)}"
    rec = new_stream(name, "brrt pair")  # in a window of its own
    with filled(rec, _layout(left, right), path, view=False):
        for letter, side, colour in zip("AB", (left, right), LINES, strict=True):
            branch: Any = _Branch(rec, f"/{letter}", letter, colour)
            _draw(branch, side)
            if difference is not None:
                other = difference.right if side is left else difference.left
                place = place_of(side.events, side.manifest, difference.seq, other)
                text = f"first difference: event {difference.seq}"
                ring(branch, side.manifest, side.world, place, text)
        if difference is not None:
            _tell(rec, max(left, right, key=lambda side: len(side.events)), difference)
    return difference


class _Branch:
    """A recording below an entity; its plots have a colour of their own.

    Args:
        rec: The recording.
        below: The entity.
        name: Stands before the names of plots.
        colour: Of the first line of each plot.
    """

    def __init__(self, rec: rr.RecordingStream, below: str, name: str, colour: Colour) -> None:
        self._rec, self._below, self._name, self._colour = rec, below, name, colour
        self._lines: dict[str, list[str]] = {}

    def log(self, entity: str, archetype: Any, *, static: bool = False) -> None:
        """Log below the entity."""
        if isinstance(archetype, rr.SeriesLines):
            archetype = self._line(entity)
        elif isinstance(archetype, rr.SeriesPoints):
            archetype = rr.SeriesPoints(names=self._name, colors=self._colour, marker_sizes=3)
        self._rec.log(f"{self._below}{entity}", archetype, static=static)

    def send_columns(self, entity: str, indexes: Any, columns: Any) -> None:
        """Send columns below the entity."""
        self._rec.send_columns(f"{self._below}{entity}", indexes, columns)

    def _line(self, entity: str) -> rr.SeriesLines:
        plot, _, name = entity.removeprefix("/series/").partition("/")
        lines = self._lines.setdefault(plot, [])
        if name not in lines:
            lines.append(name)
        light = 1 - (1 - _SHADES) ** lines.index(name)
        colour = [round(value + light * (255 - value)) for value in self._colour]
        text = f"{self._name} {name}".replace("_", " ").strip()
        return rr.SeriesLines(names=text, colors=colour, widths=1.5)


def _draw(branch: Any, side: Side) -> None:
    drawing = Drawing(branch, side.manifest, side.world)
    drawing.write(side.events)
    drawing.close()
    text = f"**{side.name}**\n\n{layout.document(side.manifest)}"
    branch.log("/run", rr.TextDocument(text, media_type=rr.MediaType.MARKDOWN), static=True)


def _tell(rec: Any, side: Side, difference: Difference) -> None:
    """Write to the log where the runs part."""
    until = side.events.until(seq=difference.seq)
    last = max((table[-1] for table in until.tables.values()), key=lambda row: int(row["seq"]))
    told = rr.TextLog.columns(text=[f"the runs part at {difference}"], level=["WARN"])
    rec.send_columns("/difference", time_columns(moments([last])), told)


def _title(side: Side) -> str:
    scenario = side.manifest.scenario
    return f"{side.name} ({scenario.planner}, seed {scenario.seed})"


def _layout(left: Side, right: Side) -> rrb.Blueprint:
    worlds = [
        layout.world_view(side.world, below=f"/{letter}", name=f"{letter}: {_title(side)}")
        for letter, side in (("A", left), ("B", right))
    ]
    log = rrb.TextLogView(
        origin="/",
        contents=["/difference", "/A/log", "/B/log"],
        name="Log",
        columns=rrb.TextLogColumns(
            timeline_columns=["iteration"], text_log_columns=["entitypath", "body"]
        ),
    )
    runs = [rrb.TextDocumentView(origin=f"/{each}/run", name=each) for each in "AB"]
    plots = layout.plots("/A", "/B")
    shares = [3] * len(plots) + [5, 4]
    below = rrb.Horizontal(*plots, log, rrb.Tabs(*runs), column_shares=shares)
    driven = any(side.manifest.scenario.execute for side in (left, right))
    return rrb.Blueprint(
        rrb.Vertical(rrb.Horizontal(*worlds), below, row_shares=[7, 3]),
        rrb.TimePanel(
            state="collapsed",
            timeline="event" if driven else "iteration",
            play_state="paused",
            fps=100,
        ),
        rrb.SelectionPanel(state="collapsed"),
        rrb.BlueprintPanel(state="collapsed"),
    )
