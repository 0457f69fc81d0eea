"""Which nodes are near: by the triangle inequality alone, so in any metric, and no planner's tree.

Nodes that lie together make a block, with a centre and the farthest of them from it. A block whose
centre is farther from a place than that and the radius asked for holds nothing near the place.
"""

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Distance = Callable[[Floats, Floats], Floats]

_AT_ONCE = 1 << 18
"""Distances that are measured at once, at least."""

_SLACK = 1e-9
_GOLDEN = 0.6180339887498949


class Neighbours:
    """The nodes of a tree that are near some places, as the tree stood at some moments.

    Args:
        q: The nodes in the order in which they joined, shape (n, dof).
        distance: The robot's metric.
        places: Where to look, shape (m, dof).
        radius: How far, shape (m,).
        count: Nodes that there were, shape (m,).
        most: Distances to measure in each doubling of the tree; beyond it places are left out,
            all over the log.

    Attributes:
        looked: Which places were not left out, shape (m,); known after `pairs`.
    """

    def __init__(
        self, q: Floats, distance: Distance, places: Floats, radius: Floats, count: Ints, most: int
    ) -> None:
        self._q, self._distance, self._places, self._radius = q, distance, places, radius
        self._count, self._most = count, most
        self.looked = np.zeros(len(places), bool)

    def pairs(self) -> Iterator[tuple[Ints, Ints, Floats]]:
        """Yield places, nodes within their radius, and how far these are; each place at once."""
        # A tree that counted up to 2^k nodes is looked up among the first 2^k.
        level = np.ceil(np.log2(np.maximum(self._count, 1))).astype(np.int64)
        for k in np.unique(level).tolist():
            yield from self._among(np.flatnonzero(level == k), 1 << k)

    def _among(self, rows: Ints, nodes: int) -> Iterator[tuple[Ints, Ints, Floats]]:
        order, size, centres, far = self._blocks(nodes)
        # Any beginning of this order is spread over the whole.
        rows = rows[np.argsort(np.arange(len(rows)) * _GOLDEN % 1.0)]
        left, at_once = self._most, max(1, _AT_ONCE // len(centres))
        for first in range(0, len(rows), at_once):
            if left <= 0:
                return
            some = rows[first : first + at_once]
            apart = self._distance(self._places[some][:, None], centres[None])
            reach = far + self._radius[some][:, None]
            place, block = np.nonzero(apart <= reach * (1 + _SLACK))
            # Places that would take more than is left are left out.
            ends = np.searchsorted(place, np.arange(1, len(some) + 1))
            spent = np.arange(1, len(some) + 1) * len(centres) + ends * size
            done = max(int(np.searchsorted(spent, left)), 1)
            left -= int(spent[done - 1])
            some, chosen = some[:done], slice(ends[done - 1])
            self.looked[some] = True
            yield from self._within(some, place[chosen], block[chosen], order, size)

    def _within(
        self, rows: Ints, place: Ints, block: Ints, order: Ints, size: int
    ) -> Iterator[tuple[Ints, Ints, Floats]]:
        """Yield what is near among the nodes of blocks, a few places at a time."""
        batch = np.searchsorted(place, np.arange(len(rows) + 1)) * size // _AT_ONCE
        parts = np.split(np.arange(len(rows)), np.flatnonzero(np.diff(batch[:-1])) + 1)
        for part in parts:
            chosen = slice(*np.searchsorted(place, [part[0], part[-1] + 1]))
            at = block[chosen, None] * size + np.arange(size)
            here = np.broadcast_to(rows[place[chosen]][:, None], at.shape)
            there = at < len(order)
            here, node = here[there], order[at[there]]
            there = node < self._count[here]
            here, node = here[there], node[there]
            far = np.asarray(self._distance(self._places[here], self._q[node]))
            near = far <= self._radius[here]
            yield here[near], node[near], far[near]

    def _blocks(self, nodes: int) -> tuple[Ints, int, Floats, Floats]:
        """Sort the first nodes into blocks of a size; return centres, and how far each reaches."""
        q = self._q[:nodes]
        order, size = np.argsort(_curve(q), kind="stable"), max(8, int(len(q) ** 0.5))
        starts = np.arange(0, len(q), size)
        centres = q[order[np.minimum(starts + size // 2, len(q) - 1)]]
        far = np.empty(len(starts))
        many = max(1, _AT_ONCE // size)
        for first in range(0, len(starts), many):
            some = order[first * size : (first + many) * size]
            block = np.arange(len(some)) // size
            away = self._distance(q[some], centres[first + block])
            far[first : first + many] = np.maximum.reduceat(away, starts[: block[-1] + 1])
        return order, size, centres, far


def _curve(q: Floats) -> Ints:
    """Number places along a curve that leaves no neighbourhood in a hurry (Morton 1966)."""
    low, high = q.min(axis=0), q.max(axis=0)
    bits, wide = min(16, 60 // q.shape[1]), np.where(high > low, high - low, 1)
    keys = np.zeros(len(q), np.int64)
    for first in range(0, len(q), _AT_ONCE):
        some = slice(first, first + _AT_ONCE)
        cells = (np.nan_to_num((q[some] - low) / wide) * (2.0**bits - 1)).astype(np.int64)
        for bit in range(bits - 1, -1, -1):
            for k in range(q.shape[1]):
                keys[some] = keys[some] << 1 | cells[:, k] >> bit & 1
    return keys


def nearest(near: Neighbours) -> tuple[Ints, Floats, Floats]:
    """Return for each place its nearest node, or -1 where none is near, and how far two are.

    Returns:
        The nodes, their distances, and those of the second nearest nodes; inf where there is none.
    """
    m = len(near.looked)
    node, least, second = np.full(m, -1), np.full(m, np.inf), np.full(m, np.inf)
    for places, others, away in near.pairs():
        order = np.lexsort((away, places))
        place, other, far = places[order], others[order], away[order]
        first = np.flatnonzero(np.diff(place, prepend=-1))
        node[place[first]], least[place[first]] = other[first], far[first]
        after = first[first + 1 < np.append(first[1:], len(place))] + 1
        second[place[after]] = far[after]
    return node, least, second
