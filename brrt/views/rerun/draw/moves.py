"""The robot as it moves: where it is, and the way it has come."""

import numpy as np

from brrt.events import Events, Kind, Table
from brrt.scenario.contracts import contract_of
from brrt.scenario.manifest import Manifest
from brrt.views.rerun import layout
from brrt.views.rerun.draw.canvas import Canvas, growing_rows
from brrt.views.rerun.draw.decimate import Thinning, thinned
from brrt.views.rerun.draw.paths import draw_bodies

_IN_SPACE = (2000, 20**3)
"""In 3D, moves to cells that are drawn in full, and parts of the world with one each after that:
where a robot goes to and fro, they would hide what it learns."""


class Moves:
    """Draws moves.

    Args:
        canvas: Where they are drawn.
        manifest: The run's.
    """

    def __init__(self, canvas: Canvas, manifest: Manifest) -> None:
        edge = contract_of(manifest, canvas.world).epsilon
        limits = _IN_SPACE if edge and canvas.dim > 2 else ()
        self._canvas, self._thinning = canvas, Thinning(canvas.world, *limits)
        self._start = canvas.places([manifest.start])
        self._at, self._drawn = self._start, 0
        colour = layout.TRACE_ON_CELLS[canvas.dim] if edge else layout.TRACE
        canvas.style(layout.TRACE_ENTITY, canvas.lines, colour, -0.4 if edge else -0.5, 28.0)
        canvas.style(layout.ROBOT_ENTITY, canvas.points, layout.ROBOT, -5, 60.0)
        if canvas.dim == 2:
            canvas.style(layout.BODY_ENTITY, canvas.lines, layout.ROBOT, -1.5, 55.0)
        self._edge = edge
        if edge:
            canvas.style(layout.TAIL_ENTITY, canvas.points, layout.ROBOT, -1.25, 30.0)
            canvas.style(layout.CELL_ENTITY, canvas.boxes, layout.ROBOT, -1, 58.0)

    def write(self, events: Events) -> None:
        """Draw the moves of a batch."""
        table = events[Kind.MOVE]
        if len(table):
            before = self._thinning.count
            places = self._draw_trace(table)
            shown = np.union1d(thinned(before, len(table)), [len(table) - 1])
            rows, ones = table[shown], np.ones(len(shown), np.int64)
            points = self._canvas.points.columns(positions=places[shown])
            self._canvas.send_rows(layout.ROBOT_ENTITY, rows, ones, points)
            if self._edge:
                self._canvas.send_rows(layout.TAIL_ENTITY, rows, ones, points)
                half = np.full((len(rows), self._canvas.dim), self._edge / 2, np.float32)
                cells = self._canvas.boxes.columns(centers=places[shown], half_sizes=half)
                self._canvas.send_rows(layout.CELL_ENTITY, rows, ones, cells)
            if self._canvas.robot.outline(table["q"][0]):
                draw_bodies(self._canvas, layout.BODY_ENTITY, rows, [[q] for q in rows["q"]])

    def _draw_trace(self, table: Table) -> np.ndarray:
        places = self._canvas.places(table["q"])
        froms = np.concatenate([self._at, places[:-1]])
        froms[table["step"] == 1] = self._start  # where each trial begins
        self._at = places[-1:]
        worth = self._thinning.worth(places)
        if self._thinning.begins_within(len(table)):
            text = f"moves: beyond {self._thinning.full:,} only those to new places are drawn"
            self._canvas.tell(table[-1], text)
        if worth.any():
            rows = table[worth]
            lines = np.stack([froms[worth], places[worth]], axis=1).reshape(-1, self._canvas.dim)
            ends = growing_rows(self._drawn, len(rows))
            self._canvas.send(layout.TRACE_ENTITY, rows, ends, self._canvas.strips(lines, 2))
            self._drawn += len(rows)
        return places
