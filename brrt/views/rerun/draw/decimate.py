"""What a drawing knows of nodes or cells: where they are, and which of them are worth drawing."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrt.worlds.world import World

DRAWN_IN_FULL = 100_000
"""Nodes up to which every edge is drawn; `benchmarks/scrubbing.py` tells what a viewer makes of
them."""

IN_FULL, STRIDE = 10_000, 16
"""Items of a kind that stay for a moment, as samples do: so many are all drawn, then one of 16."""

_CELLS = 1 << 16
"""Cells of the grid over the world that thins out what comes after: a cell then takes one edge. So
a million edges stay a picture that a viewer can turn, and yet every place that is reached shows."""

_KEPT_NODES = 1 << 19
"""Nodes whose places are kept (16 bytes each in 3D); edges that leave from later ones are not
drawn."""


def thinned(first: int, count: int) -> NDArray[np.int64]:
    """Return which of some items that stay for a moment are drawn, of which some came before."""
    end, few = first + count, max(first, IN_FULL)
    number = np.arange(first, min(end, IN_FULL)), np.arange(few + -few % STRIDE, end, STRIDE)
    return np.concatenate(number) - first


class Thinning:
    """Takes everything up to a number, and then what reaches new places.

    Args:
        world: Where these are.
        full: The number; None takes `DRAWN_IN_FULL`.
        cells: Of the grid over the world, about; None takes `_CELLS`.

    Attributes:
        count: Items that have come.
        full: As given.
    """

    def __init__(self, world: World, full: int | None = None, cells: int | None = None) -> None:
        self.count, self.full = 0, DRAWN_IN_FULL if full is None else full
        side = int((_CELLS if cells is None else cells) ** (1 / world.dim) + 1e-9)
        self._lower = world.lower.astype(np.float32)
        self._scale = (side / (world.upper - world.lower)).astype(np.float32)
        self._grid = (side,) * world.dim
        self._taken = np.zeros(side**world.dim, np.bool_)

    def worth(self, places: NDArray[np.float32]) -> NDArray[np.bool_]:
        """Tell which of the next items are worth drawing, by their places, shape (n, dim)."""
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

    def begins_within(self, count: int) -> bool:
        """Whether it first left something out among the last so many items."""
        return self.count - count <= self.full < self.count


class Sketch:
    """The nodes of a tree, or the cells of a lattice, as far as they have come.

    Args:
        world: Where they are.
        thinning: What decides which of them are worth drawing.

    Attributes:
        drawn: Nodes that were worth drawing; each has a slot, numbered from 0.
        thinning: As given.
    """

    def __init__(self, world: World, thinning: Thinning | None = None) -> None:
        self.drawn, self.thinning = 0, thinning or Thinning(world)
        self._places = np.full((1024, world.dim), np.nan, np.float32)
        self._slots = np.full(1024, -1, np.int32)

    @property
    def nodes(self) -> int:
        """Nodes that have joined."""
        return self.thinning.count

    def join(
        self, nodes: NDArray[np.int32], places: NDArray[np.float32], wanted: NDArray[np.bool_]
    ) -> NDArray[np.int64]:
        """Take in new nodes.

        Args:
            nodes: Their numbers, shape (n,).
            places: Where they are, shape (n, dim).
            wanted: Whether they are to be drawn if they are worth it.

        Returns:
            Which of them have got the next slots.
        """
        which = np.flatnonzero(wanted & self.thinning.worth(places))
        self._make_room(nodes)
        slots = np.full(len(nodes), -1, np.int32)
        slots[which] = np.arange(self.drawn, self.drawn + len(which))
        kept: Any = (nodes >= 0) & (nodes < _KEPT_NODES)
        kept = slice(None) if kept.all() else kept  # which spares copies
        self._places[nodes[kept]] = places[kept]
        self._slots[nodes[kept]] = slots[kept]
        self.drawn += len(which)
        return which

    def places(self, nodes: NDArray[np.int32]) -> NDArray[np.float32]:
        """Where nodes are, shape (n, dim); NaN, which no viewer draws, where that is not kept."""
        found = self._places.take(nodes, axis=0, mode="clip")
        found[(nodes < 0) | (nodes >= len(self._places))] = np.nan
        return found

    def knows(self, nodes: NDArray[np.int32]) -> NDArray[np.bool_]:
        """Whether nodes have joined, as far as that is kept: later ones pass for known."""
        found = np.isfinite(self.places(nodes)).all(axis=1)
        return np.asarray(found | (nodes >= _KEPT_NODES))

    def slots(self, nodes: NDArray[np.int32]) -> NDArray[np.int32]:
        """Slots of nodes, shape (n,); -1 for those that are not drawn."""
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
