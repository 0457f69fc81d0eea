"""Trees as they grow and as their edges change, and the links between two trees."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrt.events import Events, Kind, Table
from brrt.replay.graph import GraphFold, is_vertex
from brrt.views.colours import LINK, NEWEST, packed, tree_style
from brrt.views.rerun.draw.canvas import Canvas, growing_rows, merged, times_of
from brrt.views.rerun.draw.decimate import DRAWN_IN_FULL, DrawnNodes, one_in_stride
from brrt.views.rerun.draw.graphs import GraphsDrawing
from brrt.views.rerun.draw.pages import Pages
from brrt.views.rerun.draw.paths import draw_bodies, has_body
from brrt.views.rerun.draw.transient import TransientDrawing
from brrt.views.rerun.layout import LINK_ENTITY


class TreesDrawing:
    """Draws all trees of a run; `nodes` gets the nodes of each, for other parts of the drawing."""

    def __init__(
        self, canvas: Canvas, nodes: dict[int, DrawnNodes], transient: TransientDrawing
    ) -> None:
        self._canvas, self._nodes, self._transient = canvas, nodes, transient
        self._trees: dict[int, _TreeDrawing] = {}
        self._links = 0
        self._graph, self._graphs = GraphFold(), GraphsDrawing(canvas, nodes)
        canvas.style(LINK_ENTITY, canvas.lines, LINK, -2.5, 45.0)

    def write(self, events: Events) -> None:
        """Draw a batch."""
        made = self._graph.take(events)
        edges, rewires = made[Kind.EDGE], made[Kind.REWIRE]
        for number in np.flatnonzero(np.bincount(edges["tree"])).tolist():
            if number not in self._trees:
                self._nodes[number] = DrawnNodes(self._canvas.world)
                self._trees[number] = _TreeDrawing(self._canvas, number, self._nodes[number])
        for number, tree in self._trees.items():
            rewired = _of_tree(rewires, number)
            tree.draw(_of_tree(edges, number), rewired)
            rewired = rewired[rewired["parent"] >= 0]
            if len(rewired):
                self._transient.draw_rewired(number, rewired)
        self._graphs.write(events)
        self._draw_links(events[Kind.CONNECT])

    def close(self) -> None:
        """Draw the rest."""
        for tree in self._trees.values():
            tree.close()
        self._graphs.close()

    def _draw_links(self, table: Table) -> None:
        if not len(table) or not {0, 1} <= self._nodes.keys():
            return
        rows = table[one_in_stride(self._links, len(table))]
        self._links += len(table)
        if len(rows):
            ends = self._nodes[0].places(rows["node"]), self._nodes[1].places(rows["other"])
            each = np.arange(1, len(rows) + 1)
            self._canvas.send(LINK_ENTITY, rows, each, self._canvas.segments(*ends))


class _TreeDrawing:
    """One tree: an entity that grows; pages take its place from the first rewired edge on."""

    def __init__(self, canvas: Canvas, number: int, nodes: DrawnNodes) -> None:
        self._canvas, self._nodes = canvas, nodes
        self._name, self._colour = tree_style(number)
        self._entity = f"/world/tree/{self._name}"
        self._edge = np.dtype([("ends", "<f4", (2, canvas.dim))])
        self._drawn: list[NDArray[np.void]] = []
        self._root: NDArray[np.float32] | None = None
        self._pages: Pages | None = None
        canvas.style(self._entity, canvas.lines, self._colour, -0.75, 20.0)
        canvas.plot_style(f"/series/nodes/{self._name}", f"{self._name} tree", self._colour)

    def draw(self, edges: Table, rewires: Table) -> None:
        """Draw the tree's events of a batch."""
        which = self._add(edges) if len(edges) else np.zeros(0, np.int64)
        self._draw_newest(edges)
        if self._pages is None and len(rewires):
            self._start_pages(edges[which], rewires)
        if self._pages is not None:
            changes = merged([edges, rewires], "node", "parent")
            slots = self._nodes.slots(changes["node"])
            drawn = np.flatnonzero(slots >= 0)
            if len(drawn):
                changes = changes.take(drawn)
                self._pages.change(changes, slots[drawn], self._edges(changes))
        elif len(which):
            rows = edges[which]
            items = self._edges(rows)
            ends = growing_rows(self._nodes.drawn - len(which), len(which))
            self._canvas.send(self._entity, rows, ends, self._columns(items))
            self._drawn.append(items)

    def close(self) -> None:
        """Draw the rest."""
        if self._pages is not None:
            self._pages.close()

    def _add(self, edges: Table) -> NDArray[np.int64]:
        """Add new nodes; return which of their edges are drawn."""
        canvas, before = self._canvas, self._nodes.count
        places = canvas.places(edges["q"])
        if self._root is None:
            self._root = places[0]
        wanted = (edges["parent"] >= 0) | is_vertex(edges)
        which = self._nodes.add(edges["node"], places, wanted)
        ends = growing_rows(before, len(edges))
        canvas.plot(f"/series/nodes/{self._name}", edges[ends - 1], before + ends)
        if self._nodes.decimation.began_within(len(edges)):
            limit = f"beyond {DRAWN_IN_FULL:,} nodes only edges to new places are drawn"
            canvas.add_text(edges[-1], f"{self._name} tree: {limit}")
        return which

    def _draw_newest(self, edges: Table) -> None:
        """Draw the body at some of the newest nodes."""
        if len(edges) and has_body(self._canvas.robot, edges["q"][0]):
            ends = growing_rows(self._nodes.count - len(edges), len(edges))
            rows, entity = edges[ends - 1], f"/world/newest/{self._name}"
            if self._nodes.count == len(edges):
                self._canvas.style(entity, self._canvas.lines, NEWEST, -0.75, 50.0)
            draw_bodies(self._canvas, entity, rows, [[q] for q in rows["q"]])

    def _start_pages(self, edges: Table, rewires: Table) -> None:
        """Move what was drawn before this batch to pages."""
        entity, colour = f"{self._entity}_pages", int(packed(self._colour))

        def style(rows: int) -> Any:
            return self._canvas.row_style(self._canvas.lines, rows, -0.75, 20.0, colour)

        self._pages = Pages(self._canvas, entity, self._columns, self._edge, style)
        if self._drawn:
            first = merged([edges, rewires])[:1]
            self._pages.fill(np.concatenate(self._drawn), times_of(first)[0])
            assert self._root is not None  # noqa: S101 - nothing is drawn before the root
            self._canvas.hide_from(first[0], self._entity, self._root)
            self._drawn.clear()

    def _edges(self, rows: Table) -> NDArray[np.void]:
        """Return the edges of some events as items."""
        items = np.empty(len(rows), self._edge)
        # The edge of a node without a parent is a dot.
        begins = np.where(rows["parent"] >= 0, rows["parent"], rows["node"])
        items["ends"][:, 0] = self._nodes.places(begins)
        items["ends"][:, 1] = self._nodes.places(rows["node"])
        return items

    def _columns(self, items: NDArray[np.void]) -> Any:
        return self._canvas.strips(items["ends"].reshape(-1, self._canvas.dim), 2)


def _of_tree(table: Table, number: int) -> Table:
    mine = table["tree"] == number
    return table if mine.all() else table.take(np.flatnonzero(mine))  # faster than a mask
