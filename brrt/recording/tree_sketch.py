"""What a drawing knows of a tree: where its nodes are, and which of its edges are worth drawing."""

import numpy as np
from numpy.typing import NDArray

from brrt.events import Table
from brrt.recording.scene import places
from brrt.robots import Robot
from brrt.worlds.world import World

DRAWN_IN_FULL = 50_000
"""Nodes up to which every edge is drawn."""

_CELLS = 1 << 16
"""Cells of the grid over the world that thins out what comes after: a cell then takes one edge. So
a million edges stay a picture that a viewer can turn, and yet every place that is reached shows."""

_KEPT_NODES = 1 << 19
"""Nodes whose places are kept (12 bytes each in 3D); edges that leave from later ones are not
drawn."""


class TreeSketch:
    """The tree as far as it has grown.

    Args:
        world: Where it grows.
        robot: What moves there.

    Attributes:
        nodes: Nodes that have joined.
        drawn: Edges that were worth drawing.
    """

    def __init__(self, world: World, robot: Robot) -> None:
        self._robot = robot
        self.nodes, self.drawn = 0, 0
        self._places = np.full((1024, world.dim), np.nan, np.float32)
        side = int(_CELLS ** (1 / world.dim))
        self._lower, self._scale = world.lower, side / (world.upper - world.lower)
        self._grid = (side,) * world.dim
        self._taken = np.zeros(side**world.dim, np.bool_)

    def join(self, rows: Table) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
        """Take in edges.

        Returns:
            Both ends of each line to draw, one after the other, shape (2 n, dim); and which
            edges these are, shape (n,).
        """
        ends = places(rows["q"], self._robot)
        self._keep(rows["node"], ends)
        wanted = rows["parent"] >= 0
        cells = self._cells_of(self._robot.places(rows["q"]))
        number = np.arange(self.nodes, self.nodes + len(rows))
        if number[-1] >= DRAWN_IN_FULL:
            first_in_cell = np.zeros(len(rows), np.bool_)
            first_in_cell[np.unique(cells, return_index=True)[1]] = True
            wanted &= (number < DRAWN_IN_FULL) | (first_in_cell & ~self._taken[cells])
        self._taken[cells] = True
        which = np.flatnonzero(wanted)
        self.nodes, self.drawn = self.nodes + len(rows), self.drawn + len(which)
        lines = np.stack([self.places(rows["parent"][which]), ends[which]], axis=1)
        return lines.reshape(-1, len(self._grid)), which

    def places(self, nodes: NDArray[np.int32]) -> NDArray[np.float32]:
        """Where nodes are, shape (n, dim); NaN, which no viewer draws, where that is not kept."""
        found = self._places[np.clip(nodes, 0, len(self._places) - 1)]
        found[(nodes < 0) | (nodes >= len(self._places))] = np.nan
        return found

    def _keep(self, nodes: NDArray[np.int32], ends: NDArray[np.float32]) -> None:
        kept = (nodes >= 0) & (nodes < _KEPT_NODES)
        if not kept.all():
            nodes, ends = nodes[kept], ends[kept]
        need, have = int(nodes.max(initial=-1)) + 1, len(self._places)
        if need > have:
            more = np.full((max(need, 2 * have) - have, ends.shape[1]), np.nan, np.float32)
            self._places = np.concatenate([self._places, more])
        self._places[nodes] = ends

    def _cells_of(self, positions: NDArray[np.float64]) -> NDArray[np.int64]:
        steps = ((positions - self._lower) * self._scale).astype(np.int64)
        cells: NDArray[np.int64] = np.ravel_multi_index(tuple(steps.T), self._grid, mode="clip")
        return cells
