"""Trees as they grow, and as their edges change; the link where two of them meet."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrt.events import Events, Kind, Table
from brrt.views.rerun import layout
from brrt.views.rerun.draw.canvas import Canvas, growing_rows, merged, moments
from brrt.views.rerun.draw.decimate import DRAWN_IN_FULL, Sketch, thinned
from brrt.views.rerun.draw.pages import Pages
from brrt.views.rerun.draw.paths import draw_bodies
from brrt.views.rerun.draw.transient import Fading


class Trees:
    """Draws all trees of a run.

    Args:
        canvas: Where they are drawn.
        sketches: Gets each tree's sketch, for others to read.
        fading: Shows what was rewired for a moment.
    """

    def __init__(self, canvas: Canvas, sketches: dict[int, Sketch], fading: Fading) -> None:
        self._canvas, self._sketches, self._fading = canvas, sketches, fading
        self._trees: dict[int, _Tree] = {}
        self._links = 0
        canvas.style(layout.LINK_ENTITY, canvas.lines, layout.LINK, -2.5, 45.0)

    def write(self, events: Events) -> None:
        """Draw a batch."""
        edges, rewires = events[Kind.EDGE], events[Kind.REWIRE]
        for number in np.flatnonzero(np.bincount(edges["tree"])).tolist():
            if number not in self._trees:
                self._sketches[number] = Sketch(self._canvas.world)
                self._trees[number] = _Tree(self._canvas, number, self._sketches[number])
        for number, tree in self._trees.items():
            mine = _of_tree(rewires, number)
            tree.draw(_of_tree(edges, number), mine)
            if len(mine):
                self._fading.rewired(number, mine)
        self._draw_links(events[Kind.CONNECT])

    def close(self) -> None:
        """Draw what is still to be drawn."""
        for tree in self._trees.values():
            tree.close()

    def _draw_links(self, table: Table) -> None:
        if not len(table) or not {0, 1} <= self._sketches.keys():
            return
        rows = table[thinned(self._links, len(table))]
        self._links += len(table)
        if len(rows):
            places = self._sketches[0].places(rows["node"]), self._sketches[1].places(rows["other"])
            lines = np.stack(places, axis=1).reshape(-1, self._canvas.dim)
            ends = np.arange(1, len(rows) + 1)
            self._canvas.send(layout.LINK_ENTITY, rows, ends, self._canvas.strips(lines, 2))


class _Tree:
    """One tree: an entity that grows; from the first changed edge on, pages in its stead."""

    def __init__(self, canvas: Canvas, number: int, sketch: Sketch) -> None:
        self._canvas, self._sketch = canvas, sketch
        self._name, self._colour = layout.tree_style(number)
        self._entity = f"/world/tree/{self._name}"
        self._line = np.dtype([("ends", "<f4", (2, canvas.dim))])
        self._drawn: list[NDArray[np.void]] = []
        self._root: NDArray[np.float32] | None = None
        self._pages: Pages | None = None
        canvas.style(self._entity, canvas.lines, self._colour, -0.75, 20.0)
        canvas.plot_style(f"/series/nodes/{self._name}", f"{self._name} tree", self._colour)

    def draw(self, edges: Table, rewires: Table) -> None:
        """Draw the tree's events of a batch."""
        which = self._join(edges) if len(edges) else np.zeros(0, np.int64)
        self._draw_newest(edges)
        if self._pages is None and len(rewires):
            self._turn_to_pages(edges[which], rewires)
        if self._pages is not None:
            changes = merged([edges, rewires], "node", "parent")
            slots = self._sketch.slots(changes["node"])
            drawn = slots >= 0
            if drawn.any():
                which = np.flatnonzero(slots >= 0)
                lines = self._lines(changes, which)
                self._pages.change(changes.take(which), slots[which], lines)
        elif len(which):
            lines = self._lines(edges, which)
            ends = growing_rows(self._sketch.drawn - len(which), len(which))
            counts = np.diff(ends, prepend=0)
            rows = edges[which[ends - 1]]
            self._canvas.send_rows(self._entity, rows, counts, self._strips(lines))
            self._drawn.append(lines)

    def close(self) -> None:
        """Draw what is still to be drawn."""
        if self._pages is not None:
            self._pages.close()

    def _join(self, edges: Table) -> NDArray[np.int64]:
        canvas, before = self._canvas, self._sketch.nodes
        places = canvas.places(edges["q"])
        if self._root is None:
            self._root = places[0]
        which = self._sketch.join(edges["node"], places, edges["parent"] >= 0)
        ends = growing_rows(before, len(edges))
        canvas.plot(f"/series/nodes/{self._name}", edges[ends - 1], before + ends)
        if self._sketch.thinning.begins_within(len(edges)):
            limit = f"beyond {DRAWN_IN_FULL:,} nodes only edges to new places are drawn"
            canvas.tell(edges[-1], f"{self._name} tree: {limit}")
        return which

    def _draw_newest(self, edges: Table) -> None:
        """Show the body at the newest node, now and then."""
        if len(edges) and self._canvas.robot.outline(edges["q"][0]):
            ends = growing_rows(self._sketch.nodes - len(edges), len(edges))
            rows, entity = edges[ends - 1], f"/world/newest/{self._name}"
            if self._sketch.nodes == len(edges):
                self._canvas.style(entity, self._canvas.lines, layout.NEWEST, -0.75, 50.0)
            draw_bodies(self._canvas, entity, rows, [[q] for q in rows["q"]])

    def _turn_to_pages(self, edges: Table, rewires: Table) -> None:
        """Take what was drawn before this batch over to pages."""
        empty = np.zeros(0, self._line)
        entity, colour = f"{self._entity}_pages", layout.packed(self._colour)

        def style(rows: int) -> Any:
            return self._canvas.row_style(self._canvas.lines, rows, -0.75, 20.0, colour)

        self._pages = Pages(self._canvas, entity, self._strips, empty, style)
        if self._drawn:
            first = merged([edges, rewires])[:1]
            self._pages.fill(np.concatenate(self._drawn), moments(first)[0])
            assert self._root is not None  # noqa: S101 - nothing is drawn before the root
            self._canvas.put_away(self._entity, first[0], self._root)
            self._drawn.clear()

    def _lines(self, rows: Table, which: NDArray[np.int64]) -> NDArray[np.void]:
        """Return the edges that some rows tell of."""
        lines = np.empty(len(which), self._line)
        lines["ends"][:, 0] = self._sketch.places(rows["parent"][which])
        lines["ends"][:, 1] = self._sketch.places(rows["node"][which])
        return lines

    def _strips(self, lines: NDArray[np.void]) -> Any:
        return self._canvas.strips(lines["ends"].reshape(-1, self._canvas.dim), 2)


def _of_tree(table: Table, number: int) -> Table:
    mine = table["tree"] == number
    return table if mine.all() else table.take(np.flatnonzero(mine))  # a mask takes longer
