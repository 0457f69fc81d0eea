"""What is shown for a moment: samples, rejected extensions, edges that were rewired."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from brrt.events import Reason, Source, Table
from brrt.views.rerun import layout
from brrt.views.rerun.draw import decimate
from brrt.views.rerun.draw.canvas import Canvas
from brrt.views.rerun.draw.decimate import Sketch, thinned

_ROW = 16
"""Items in a row; they appear and vanish by rows."""


class Fading:
    """Draws what the layout lets fade.

    Args:
        canvas: Where it is drawn.
        sketches: The trees, or the cells in place of tree 0.
    """

    def __init__(self, canvas: Canvas, sketches: Mapping[int, Sketch]) -> None:
        self._canvas, self._sketches = canvas, sketches
        self._seen: dict[str, int] = {}
        for source, colour in layout.SAMPLES.items():
            canvas.style(f"/world/samples/{source.key}", canvas.points, colour, -2, 30.0)
        for reason, colour in layout.REJECTS.items():
            entity = f"/world/rejected/{reason.key}"
            canvas.style(entity, canvas.lines, colour, -0.5, 10.0)
        for name, colour in layout.REWIRED.items():
            canvas.style(f"/world/rewired/{name}", canvas.lines, colour, -1.25, 25.0)

    def samples(self, table: Table) -> None:
        """Draw samples."""
        sources = np.ascontiguousarray(table["source"])
        for source in Source:
            name = source.key
            rows = table.take(self._shown(table, sources == source, f"{name} samples"))
            if len(rows):
                points = self._canvas.points.columns(positions=self._canvas.places(rows["q"]))
                self._canvas.send(f"/world/samples/{name}", rows, _even_rows(len(rows)), points)

    def rejects(self, table: Table) -> None:
        """Draw from where to where extensions were tried in vain."""
        for reason in Reason:
            name = reason.key
            rows = table.take(self._shown(table, table["reason"] == reason, f"{name} rejections"))
            if len(rows):
                self._send_lines(f"rejected/{name}", rows, self._attempts(rows))

    def rewired(self, tree: int, table: Table) -> None:
        """Highlight the new edges of a tree."""
        name, nodes = layout.tree_style(tree)[0], self._sketches[tree]
        every = np.ones(len(table), np.bool_)
        rows = table.take(self._shown(table, every, f"rewired edges of the {name} tree"))
        if len(rows):
            ends = nodes.places(rows["parent"]), nodes.places(rows["node"])
            lines = np.stack(ends, axis=1).reshape(-1, self._canvas.dim)
            self._send_lines(f"rewired/{name}", rows, lines)

    def _send_lines(self, name: str, rows: Table, ends: NDArray[np.float32]) -> None:
        strips = self._canvas.strips(ends, 2)
        self._canvas.send(f"/world/{name}", rows, _even_rows(len(rows)), strips)

    def _attempts(self, rejects: Table) -> NDArray[np.float32]:
        """Return where each extension left from and wanted to go, shape (2 n, dim)."""
        dim = self._canvas.dim
        ends = np.full((len(rejects), 2, dim), np.nan, np.float32)
        for number, nodes in self._sketches.items():
            mine = rejects["tree"] == number
            ends[mine, 0] = nodes.places(rejects["node"][mine])
        ends[:, 1] = self._canvas.places(rejects["q"])
        return ends.reshape(-1, dim)

    def _shown(self, table: Table, mine: NDArray[np.bool_], what: str) -> NDArray[np.int64]:
        """Return which of a table's rows that are meant are drawn: not all after many."""
        which = np.flatnonzero(mine)
        first = self._seen.get(what, 0)
        self._seen[what] = end = first + len(which)
        if first <= decimate.IN_FULL < end:
            text = f"{what}: beyond {decimate.IN_FULL:,} one in {decimate.STRIDE} is drawn"
            self._canvas.tell(table[which[-1]], text)
        return np.asarray(which[thinned(first, len(which))])


def _even_rows(count: int) -> NDArray[np.int64]:
    return np.append(np.arange(_ROW, count, _ROW), count)
