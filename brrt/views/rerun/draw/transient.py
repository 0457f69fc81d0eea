"""What is drawn for a short time: samples, rejected extensions, edges that were rewired."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrt.events import Reason, Source, Table
from brrt.views.colours import REJECTS, REWIRED, SAMPLES, tree_style
from brrt.views.rerun.draw import decimate
from brrt.views.rerun.draw.canvas import Canvas
from brrt.views.rerun.draw.decimate import DrawnNodes, one_in_stride

_ROW = 16
"""Items in a row; they appear and vanish by rows."""


class TransientDrawing:
    """Draws items that the layout shows only until a certain age.

    `nodes` has the nodes of the trees, or the cells in place of tree 0.
    """

    def __init__(self, canvas: Canvas, nodes: Mapping[int, DrawnNodes]) -> None:
        self._canvas, self._nodes = canvas, nodes
        self._counts: dict[str, int] = {}
        for source, colour in SAMPLES.items():
            canvas.style(f"/world/samples/{source.key}", canvas.points, colour, -2, 30.0)
        for reason, colour in REJECTS.items():
            entity = f"/world/rejected/{reason.key}"
            canvas.style(entity, canvas.lines, colour, -0.5, 10.0)
        for name, colour in REWIRED.items():
            canvas.style(f"/world/rewired/{name}", canvas.lines, colour, -1.25, 25.0)

    def draw_samples(self, table: Table) -> None:
        """Draw samples, an entity for each source."""
        sources = np.ascontiguousarray(table["source"])
        for source in Source:
            name = source.key
            rows = self._decimated(table, sources == source, f"{name} samples")
            if len(rows):
                points = self._canvas.points.columns(positions=self._canvas.places(rows["q"]))
                self._send(f"samples/{name}", rows, points)

    def draw_rejects(self, table: Table) -> None:
        """Draw rejected extensions as lines to their targets, an entity for each reason."""
        for reason in Reason:
            name = reason.key
            rows = self._decimated(table, table["reason"] == reason, f"{name} rejections")
            if len(rows):
                ends = self._canvas.places(rows["q"])
                begins = np.full(ends.shape, np.nan, np.float32)
                for number, nodes in self._nodes.items():
                    mine = rows["tree"] == number
                    begins[mine] = nodes.places(rows["node"][mine])
                self._send(f"rejected/{name}", rows, self._canvas.segments(begins, ends))

    def draw_rewired(self, tree: int, table: Table) -> None:
        """Draw the new edges of a tree."""
        name, nodes = tree_style(tree)[0], self._nodes[tree]
        every = np.ones(len(table), np.bool_)
        rows = self._decimated(table, every, f"rewired edges of the {name} tree")
        if len(rows):
            ends = nodes.places(rows["parent"]), nodes.places(rows["node"])
            self._send(f"rewired/{name}", rows, self._canvas.segments(*ends))

    def _send(self, name: str, rows: Table, columns: Any) -> None:
        ends = np.append(np.arange(_ROW, len(rows), _ROW), len(rows))
        self._canvas.send(f"/world/{name}", rows, ends, columns)

    def _decimated(self, table: Table, mine: NDArray[np.bool_], what: str) -> Table:
        """Return the rows of a table that are selected and drawn: beyond many, not all are."""
        which = np.flatnonzero(mine)
        first = self._counts.get(what, 0)
        self._counts[what] = end = first + len(which)
        if first <= decimate.IN_FULL < end:
            text = f"{what}: beyond {decimate.IN_FULL:,} one in {decimate.STRIDE} is drawn"
            self._canvas.add_text(table[which[-1]], text)
        return table.take(which[one_in_stride(first, len(which))])
