"""Cells of a lattice: those that a search has expanded, and its estimates of them."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrt.events import Events, Kind, Table
from brrt.scenario.contracts import contract_of
from brrt.scenario.manifest import Manifest
from brrt.views.colours import OTHER, TRACE, heat, packed, tree_style
from brrt.views.rerun.draw.canvas import Canvas, growing_rows, merged
from brrt.views.rerun.draw.decimate import Decimation, DrawnNodes
from brrt.views.rerun.draw.pages import Pages
from brrt.views.rerun.layout import CELLS_ENTITY, SEARCH_ENTITY

_RADIUS = {2: 0.42, 3: 0.16}
"""Radius of a cell's dot in edges of a cell, by dimensions; in 3D one sees between the dots."""

_SMALLEST, _DOT = 0.0025, {2: -3.0, 3: -2.25}
"""A dot's least radius as a part of the world's extent, and the radius, in points of the screen by
dimensions, of dots that would be smaller: cells of a fine lattice would not be visible."""

_SEARCH_LINE = 0.06
"""Radius of the line between two cells, in edges of a cell."""

_SEARCHED, _LEARNT = (0, 20**3), (20_000, 20**3)
"""Limits of `Decimation` in 3D, where cells hide each other, for searches and for planners that
learn: a search without a robot fills the space that it searches."""


class CellsDrawing:
    """Draws cells.

    A search that ends before the robot moves (A*) colours them by their cost, with lines to their
    parents. One that learns while the robot moves (LRTA*) colours them by their estimate of the
    cost-to-go. `nodes` gets the cells, as tree 0, for other parts of the drawing.
    """

    def __init__(self, canvas: Canvas, nodes: dict[int, DrawnNodes], manifest: Manifest) -> None:
        self._canvas, self._nodes = canvas, nodes
        contract = contract_of(manifest, canvas.frame.world)
        self._edge, self._learns = contract.cell * canvas.frame.scale, contract.learns
        radius = self._edge * _RADIUS[canvas.dim]
        fine = radius < _SMALLEST * canvas.world.extent
        self._radius = _DOT[canvas.dim] if fine else radius
        self._goal = np.array(manifest.goal)
        self._scale = float(canvas.robot.distance(np.array(manifest.start), self._goal)) or 1.0
        limits = () if canvas.dim == 2 else _LEARNT if self._learns else _SEARCHED
        self._cells = DrawnNodes(canvas.world, Decimation(canvas.world, *limits))
        self._raises = 0
        self._item = np.dtype([("place", "<f4", (canvas.dim,)), ("colour", "<u4")])
        self._pages = Pages(
            canvas, "/world/cells/learnt", self._columns, self._item, self._row_style
        )

    def write(self, events: Events) -> None:
        """Draw a batch."""
        expands, raised = events[Kind.EXPAND], events[Kind.HEURISTIC]
        if not len(expands) and not len(raised):
            return
        if not self._cells.count:
            self._begin()
        if self._learns:
            self._draw_estimates(expands, raised)
        elif len(expands):
            self._draw_search(expands)

    def close(self) -> None:
        """Draw the rest."""
        self._pages.close()

    def _begin(self) -> None:
        self._nodes[0] = self._cells
        self._canvas.plot_style("/series/nodes/cells", "expanded cells", TRACE)
        if self._learns:
            self._canvas.plot_style("/series/nodes/raises", "heuristic raises", OTHER)
        elif self._canvas.dim == 2:
            width, colour = self._edge * _SEARCH_LINE, tree_style(0)[1]
            self._canvas.style(SEARCH_ENTITY, self._canvas.lines, colour, width, 20.0)

    def _row_style(self, rows: int) -> Any:
        return self._canvas.row_style(self._canvas.points, rows, self._radius, 5.0)

    def _draw_search(self, expands: Table) -> None:
        """Draw each cell as it is expanded, and in 2D a line from its parent."""
        canvas, cells = self._canvas, self._cells
        drawn = expands[self._add(expands)]
        if not len(drawn):
            return
        ends = growing_rows(cells.drawn - len(drawn), len(drawn))
        items = self._items(canvas.places(drawn["q"]), drawn["cost"])
        counts, style = np.diff(ends, prepend=0), self._row_style(len(ends))
        canvas.send_rows(CELLS_ENTITY, drawn[ends - 1], counts, self._columns(items), style)
        if canvas.dim == 2:
            lines = canvas.segments(cells.places(drawn["parent"]), items["place"])
            canvas.send(SEARCH_ENTITY, drawn, ends, lines)

    def _draw_estimates(self, expands: Table, raised: Table) -> None:
        """Draw cells in the colours of their estimates: the distance until one is raised."""
        first_seen = np.zeros(len(expands), raised.dtype)
        for name in ("seq", "t", "iteration", "cell", "q"):
            first_seen[name] = expands[name]
        first_seen["h"] = np.nan
        rows = merged([first_seen, raised], "cell", "h", "q")
        new = self._add(rows)
        raises = ~np.isnan(rows["h"])
        rows["h"][~raises] = self._canvas.robot.distance(rows["q"][~raises], self._goal)
        slots = self._cells.slots(rows["cell"])
        which = np.flatnonzero((raises | new) & (slots >= 0))
        if len(which):
            items = self._items(self._canvas.places(rows["q"][which]), rows["h"][which])
            self._pages.change(rows[which], slots[which], items)
        if len(raised):
            ends = growing_rows(self._raises, len(raised))
            self._canvas.plot("/series/nodes/raises", raised[ends - 1], self._raises + ends)
            self._raises += len(raised)

    def _add(self, rows: Table) -> NDArray[np.bool_]:
        """Add cells that are new; return which rows are the first of a cell that is drawn."""
        canvas, cells, before = self._canvas, self._cells, self._cells.count
        first = np.zeros(len(rows), np.bool_)
        first[np.unique(rows["cell"], return_index=True)[1]] = True
        first &= ~cells.knows(rows["cell"])
        new = rows[first]
        if len(new):
            places = canvas.places(new["q"])
            drawn = cells.add(new["cell"], places, np.ones(len(new), np.bool_))
            ends = growing_rows(before, len(new))
            canvas.plot("/series/nodes/cells", new[ends - 1], before + ends)
            if cells.decimation.began_within(len(new)):
                full = cells.decimation.full
                beyond = f"beyond {full:,} " if full else ""
                canvas.add_text(new[-1], f"cells: {beyond}only those in new places are drawn")
            kept = np.flatnonzero(first)[drawn]
            first[:] = False
            first[kept] = True
        return first

    def _items(self, places: NDArray[np.float32], values: NDArray[np.float64]) -> NDArray[np.void]:
        items = np.empty(len(places), self._item)
        items["place"] = places
        items["colour"] = packed(heat(values / (values + self._scale)))
        return items

    def _columns(self, items: NDArray[np.void]) -> Any:
        return self._canvas.points.columns(
            positions=np.ascontiguousarray(items["place"]), colors=items["colour"]
        )
