"""Cells of a lattice: those that a search has expanded, and what it has learnt about them."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrt.events import Events, Kind, Table
from brrt.scenario.contracts import contract_of
from brrt.scenario.manifest import Manifest
from brrt.views.rerun import layout
from brrt.views.rerun.draw.canvas import Canvas, growing_rows, merged
from brrt.views.rerun.draw.decimate import Sketch, Thinning
from brrt.views.rerun.draw.pages import Pages

_IN_PLANE, _IN_SPACE = 0.42, 0.16
"""Radius of a cell's dot in edges of a cell; small in 3D, where one has to look through."""

_SMALLEST, _DOT = 0.0025, {2: -3.0, 3: -2.25}
"""A dot's least radius as a part of the world's extent; what stands for less, by the world's
dimensions, in points of the screen: a cell of a fine lattice would not be seen at all."""

_WAY = 0.06
"""Radius of the line between two cells, in edges of a cell."""

_SEARCHED, _LEARNT = (0, 20**3), (20_000, 20**3)
"""In 3D, where cells hide each other: how many are drawn in full, and then parts of the world with
a cell each. A search without a robot fills the space that it looks through."""


class Cells:
    """Draws cells.

    A search that ends before the robot moves (A*) colours them by their cost, and leaves a tree.
    One that learns as the robot moves (LRTA*) colours them by their estimate of the cost-to-go.

    Args:
        canvas: Where they are drawn.
        sketches: Gets the cells, as tree 0, for others to read.
        manifest: The run's.
    """

    def __init__(self, canvas: Canvas, sketches: dict[int, Sketch], manifest: Manifest) -> None:
        self._canvas, self._sketches = canvas, sketches
        contract = contract_of(manifest, canvas.world)
        self._edge, self._learns = contract.epsilon, contract.learns
        radius = self._edge * (_IN_PLANE if canvas.dim == 2 else _IN_SPACE)
        fine = radius < _SMALLEST * canvas.world.extent
        self._radius = _DOT[canvas.dim] if fine else radius
        self._goal = np.array(manifest.goal)
        self._scale = float(canvas.robot.distance(np.array(manifest.start), self._goal)) or 1.0
        limits = () if canvas.dim == 2 else _LEARNT if self._learns else _SEARCHED
        self._cells = Sketch(canvas.world, Thinning(canvas.world, *limits))
        self._raises = 0
        self._item = np.dtype([("place", "<f4", (canvas.dim,)), ("colour", "<u4")])
        self._pages = Pages(
            canvas, "/world/cells/learnt", self._dots, np.zeros(0, self._item), self._style
        )

    def write(self, events: Events) -> None:
        """Draw a batch."""
        expands, raised = events[Kind.EXPAND], events[Kind.HEURISTIC]
        if not len(expands) and not len(raised):
            return
        if not self._cells.nodes:
            self._begin()
        if self._learns:
            self._learn(expands, raised)
        elif len(expands):
            self._search(expands)

    def close(self) -> None:
        """Draw what is still to be drawn."""
        self._pages.close()

    def _begin(self) -> None:
        self._sketches[0] = self._cells
        self._canvas.plot_style("/series/nodes/cells", "expanded cells", layout.TRACE)
        if self._learns:
            self._canvas.plot_style("/series/nodes/raises", "heuristic raises", layout.OTHER)
        elif self._canvas.dim == 2:
            thin, colour = self._edge * _WAY, layout.tree_style(0)[1]
            self._canvas.style(layout.SEARCH_ENTITY, self._canvas.lines, colour, thin, 20.0)

    def _style(self, rows: int) -> Any:
        return self._canvas.row_style(self._canvas.points, rows, self._radius, 5.0)

    def _search(self, rows: Table) -> None:
        """Draw each cell where the search reached it, and the way that it came."""
        canvas, cells = self._canvas, self._cells
        drawn = rows[self._join(rows)]
        if not len(drawn):
            return
        ends = growing_rows(cells.drawn - len(drawn), len(drawn))
        items = self._items(canvas.places(drawn["q"]), drawn["cost"])
        counts, style = np.diff(ends, prepend=0), self._style(len(ends))
        canvas.send_rows(layout.CELLS_ENTITY, drawn[ends - 1], counts, self._dots(items), style)
        if canvas.dim > 2:
            return  # from where one came that is not drawn
        ways = [cells.places(drawn["parent"]), items["place"]]
        lines = np.stack(ways, axis=1).reshape(-1, canvas.dim)
        canvas.send(layout.SEARCH_ENTITY, drawn, ends, canvas.strips(lines, 2))

    def _learn(self, expands: Table, raised: Table) -> None:
        """Keep each cell's colour up to date; an estimate not raised yet is the distance."""
        first_seen = np.zeros(len(expands), raised.dtype)
        for name in ("seq", "t", "iteration", "cell", "q"):
            first_seen[name] = expands[name]
        first_seen["h"] = np.nan
        rows = merged([first_seen, raised], "cell", "h", "q")
        fresh = self._join(rows)
        told = ~np.isnan(rows["h"])
        rows["h"][~told] = self._canvas.robot.distance(rows["q"][~told], self._goal)
        slots = self._cells.slots(rows["cell"])
        which = np.flatnonzero((told | fresh) & (slots >= 0))
        if len(which):
            items = self._items(self._canvas.places(rows["q"][which]), rows["h"][which])
            self._pages.change(rows[which], slots[which], items)
        if len(raised):
            ends = growing_rows(self._raises, len(raised))
            self._canvas.plot("/series/nodes/raises", raised[ends - 1], self._raises + ends)
            self._raises += len(raised)

    def _join(self, rows: Table) -> NDArray[np.bool_]:
        """Take in the cells that have not been seen before, and tell which of them are drawn."""
        canvas, cells, before = self._canvas, self._cells, self._cells.nodes
        first = np.zeros(len(rows), np.bool_)
        first[np.unique(rows["cell"], return_index=True)[1]] = True
        first &= ~cells.knows(rows["cell"])
        new = rows[first]
        if len(new):
            places = canvas.places(new["q"])
            drawn = cells.join(new["cell"], places, np.ones(len(new), np.bool_))
            ends = growing_rows(before, len(new))
            canvas.plot("/series/nodes/cells", new[ends - 1], before + ends)
            if cells.thinning.begins_within(len(new)):
                beyond = f"beyond {cells.thinning.full:,} " if cells.thinning.full else ""
                canvas.tell(new[-1], f"cells: {beyond}only those in new places are drawn")
            kept = np.flatnonzero(first)[drawn]
            first[:] = False
            first[kept] = True
        return first

    def _items(self, places: NDArray[np.float32], values: NDArray[np.float64]) -> NDArray[np.void]:
        items = np.empty(len(places), self._item)
        items["place"] = places
        items["colour"] = layout.heat(values / (values + self._scale))
        return items

    def _dots(self, items: NDArray[np.void]) -> Any:
        return self._canvas.points.columns(
            positions=np.ascontiguousarray(items["place"]), colors=items["colour"]
        )
