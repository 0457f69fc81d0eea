"""Which nodes, cells and other items are drawn where there are many; where drawn nodes are."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrt.worlds.world import World

DRAWN_IN_FULL = 100_000
"""Nodes up to which every edge is drawn; `benchmarks/scrubbing.py` measures how fast viewers are
with them."""

IN_FULL, STRIDE = 10_000, 16
"""Transient items of a kind, such as samples, up to which all are drawn; later ones one in 16."""

_CELLS = 1 << 16
"""Cells of the grid over the world that decimates later nodes, one edge a cell: a viewer can turn
the picture of a million edges, and every place that the tree reaches is shown."""

_KEPT_NODES = 1 << 19
"""Nodes whose places are kept (16 bytes each in 3D); edges from later ones are not drawn."""


def one_in_stride(first: int, count: int) -> NDArray[np.int64]:
    """Return which of `count` transient items are drawn, with `first` items before them."""
    end, few = first + count, max(first, IN_FULL)
    number = np.arange(first, min(end, IN_FULL)), np.arange(few + -few % STRIDE, end, STRIDE)
    return np.concatenate(number) - first


class Decimation:
    """Keeps every item up to a number, and later ones only where they reach new cells of a grid.

    Attributes:
        count: Items so far.
        full: The number; None takes `DRAWN_IN_FULL`.
    """

    def __init__(self, world: World, full: int | None = None, cells: int | None = None) -> None:
        self.count, self.full = 0, DRAWN_IN_FULL if full is None else full
        side = int((_CELLS if cells is None else cells) ** (1 / world.dim) + 1e-9)
        self._lower = world.lower.astype(np.float32)
        self._scale = (side / (world.upper - world.lower)).astype(np.float32)
        self._grid = (side,) * world.dim
        self._taken = np.zeros(side**world.dim, np.bool_)

    def keep(self, places: NDArray[np.float32]) -> NDArray[np.bool_]:
        """Return which of the next items to draw, by their places, shape (n, dim)."""
        steps = (places - self._lower) * self._scale
        steps = np.clip(steps, 0, np.array(self._grid) - 1).astype(np.intp)
        cells = np.ravel_multi_index(tuple(steps.T), self._grid)
        begin = min(max(self.full - self.count, 0), len(places))
        self._taken[cells[:begin]] = True
        late = cells[begin:]
        new = np.flatnonzero(~self._taken[late])
        first_in_cell = new[np.unique(late[new], return_index=True)[1]]
        wanted = np.arange(len(places)) < begin
        wanted[begin + first_in_cell] = True
        self._taken[late] = True
        self.count += len(places)
        return wanted

    def began_within(self, count: int) -> bool:
        """Return whether the last `count` items are the first that were not all kept."""
        return self.count - count <= self.full < self.count


class DrawnNodes:
    """The nodes of a tree, or the cells of a lattice, that have appeared so far.

    Attributes:
        drawn: Number of drawn nodes; each has a slot, numbered from 0.
        decimation: Decides which nodes are drawn.
    """

    def __init__(self, world: World, decimation: Decimation | None = None) -> None:
        self.drawn, self.decimation = 0, decimation or Decimation(world)
        self._places = np.full((1024, world.dim), np.nan, np.float32)
        self._slots = np.full(1024, -1, np.int32)

    @property
    def count(self) -> int:
        """Nodes so far, drawn or not."""
        return self.decimation.count

    def add(
        self, nodes: NDArray[np.int32], places: NDArray[np.float32], wanted: NDArray[np.bool_]
    ) -> NDArray[np.int64]:
        """Add new nodes at places, shape (n, dim); `wanted` are those that may be drawn.

        Return the indices of those that are drawn; they get the next slots.
        """
        which = np.flatnonzero(wanted & self.decimation.keep(places))
        self._make_room(nodes)
        slots = np.full(len(nodes), -1, np.int32)
        slots[which] = np.arange(self.drawn, self.drawn + len(which))
        kept: Any = (nodes >= 0) & (nodes < _KEPT_NODES)
        kept = slice(None) if kept.all() else kept  # a slice makes no copies
        self._places[nodes[kept]] = places[kept]
        self._slots[nodes[kept]] = slots[kept]
        self.drawn += len(which)
        return which

    def places(self, nodes: NDArray[np.int32]) -> NDArray[np.float32]:
        """Return where nodes are, shape (n, dim); NaN, which viewers skip, where unknown."""
        found = self._places.take(nodes, axis=0, mode="clip")
        found[(nodes < 0) | (nodes >= len(self._places))] = np.nan
        return found

    def knows(self, nodes: NDArray[np.int32]) -> NDArray[np.bool_]:
        """Return which nodes have been added; those beyond `_KEPT_NODES` count as added."""
        found = np.isfinite(self.places(nodes)).all(axis=1)
        return np.asarray(found | (nodes >= _KEPT_NODES))

    def slots(self, nodes: NDArray[np.int32]) -> NDArray[np.int32]:
        """Return the slots of nodes, shape (n,); -1 for those that are not drawn."""
        found = self._slots.take(nodes, mode="clip")
        found[(nodes < 0) | (nodes >= len(self._slots))] = -1
        return found

    def _make_room(self, nodes: NDArray[np.int32]) -> None:
        need, have = min(int(nodes.max(initial=-1)) + 1, _KEPT_NODES), len(self._places)
        if need > have:
            room = min(max(need, 2 * have), _KEPT_NODES) - have
            places = np.full((room, self._places.shape[1]), np.nan, np.float32)
            self._places = np.concatenate([self._places, places])
            self._slots = np.concatenate([self._slots, np.full(room, -1, np.int32)])
