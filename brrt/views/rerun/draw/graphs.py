"""The links of graphs, apart from the edges of trees, as they come and go."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrt.events import Events, Kind, Table
from brrt.replay.tree_fold import of_tree, trees_in
from brrt.views.colours import GRAPH, packed, tree_style
from brrt.views.rerun.draw.canvas import TIMES, Canvas
from brrt.views.rerun.draw.decimate import DRAWN_IN_FULL, DrawnNodes
from brrt.views.rerun.draw.pages import Pages

_KINDS = (Kind.LINK, Kind.CUT, Kind.REMOVE)


class GraphsDrawing:
    """Draws the links of all graphs; `nodes` has the nodes of each."""

    def __init__(self, canvas: Canvas, nodes: dict[int, DrawnNodes]) -> None:
        self._canvas, self._nodes = canvas, nodes
        self._graphs: dict[int, _GraphDrawing] = {}

    def write(self, events: Events) -> None:
        """Draw a batch, once its nodes are known."""
        tables = [events[kind] for kind in _KINDS]
        for number in trees_in(*tables):
            if number not in self._graphs and number in self._nodes and len(tables[0]):
                self._graphs[number] = _GraphDrawing(self._canvas, number, self._nodes[number])
            if number in self._graphs:
                self._graphs[number].write(*(of_tree(table, number) for table in tables))

    def close(self) -> None:
        """Draw the rest."""
        for graph in self._graphs.values():
            graph.close()


class _GraphDrawing:
    """The links of one graph; one that is cut, or loses a node, shrinks to a dot."""

    def __init__(self, canvas: Canvas, number: int, nodes: DrawnNodes) -> None:
        self._canvas, self._nodes = canvas, nodes
        self._slots: dict[tuple[int, int], int] = {}
        self._linked: dict[int, set[int]] = {}
        self._edge = np.dtype([("ends", "<f4", (2, canvas.dim))])
        self._name, colour = tree_style(number)[0], int(packed(GRAPH))

        def style(rows: int) -> Any:
            return canvas.row_style(canvas.lines, rows, -0.5, 15.0, colour)

        entity = f"/world/graph/{self._name}"
        self._pages = Pages(canvas, entity, self._columns, self._edge, style)

    def write(self, links: Table, cuts: Table, removals: Table) -> None:
        """Draw the events of a batch."""
        rows = sorted([*links, *cuts, *removals], key=lambda row: int(row["seq"]))
        changes: list[tuple[Any, int, int, int]] = []
        for row in rows:
            node, names = int(row["node"]), row.dtype.names or ()
            if "other" not in names:
                for other in sorted(self._linked.pop(node, ())):
                    self._linked[other].discard(node)
                    changes.append((row, self._slots[_pair(node, other)], node, node))
                continue
            other = int(row["other"])
            slot = self._slot(node, other, new="cost" in names)
            if slot >= 0:
                changes.append((row, slot, node, other if "cost" in names else node))
                self._keep(node, other, there="cost" in names)
        if changes:
            self._draw(changes)

    def close(self) -> None:
        """Draw the rest."""
        self._pages.close()

    def _slot(self, node: int, other: int, *, new: bool) -> int:
        """Return the slot of a link; -1 for one that is not drawn, or not known."""
        pair = _pair(node, other)
        if new and pair not in self._slots and len(self._slots) == DRAWN_IN_FULL:
            return -1
        return self._slots.setdefault(pair, len(self._slots)) if new else self._slots.get(pair, -1)

    def _keep(self, node: int, other: int, *, there: bool) -> None:
        for a, b in ((node, other), (other, node)):
            own = self._linked.setdefault(a, set())
            own.add(b) if there else own.discard(b)

    def _draw(self, changes: list[tuple[Any, int, int, int]]) -> None:
        rows, slots, nodes, others = zip(*changes, strict=True)
        times = np.array([(row["seq"], row["t"], row["iteration"]) for row in rows], TIMES)
        if len(self._slots) == DRAWN_IN_FULL:
            limit = f"beyond {DRAWN_IN_FULL:,} edges of the graph no others are drawn"
            self._canvas.add_text(times[-1], f"{self._name} graph: {limit}")
        items = np.empty(len(rows), self._edge)
        for end, numbers in enumerate((nodes, others)):
            items["ends"][:, end] = self._nodes.places(np.array(numbers, np.int32))
        self._pages.change(times, np.array(slots), items)

    def _columns(self, items: NDArray[np.void]) -> Any:
        return self._canvas.strips(items["ends"].reshape(-1, self._canvas.dim), 2)


def _pair(a: int, b: int) -> tuple[int, int]:
    return min(a, b), max(a, b)
