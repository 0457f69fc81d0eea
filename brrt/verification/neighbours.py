"""Nodes near given places, in any metric, by the triangle inequality alone.

Nodes that are close together form a block, with a centre and a radius. A block whose centre is
farther from a place than its radius and the radius of the search holds no node near the place.
"""

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Distance = Callable[[Floats, Floats], Floats]

_AT_ONCE = 1 << 14
"""Distances that are measured at once, at least; more leave the cache of the processor."""

_SLACK = 1e-9
_GOLDEN = 0.6180339887498949


class NeighbourSearch:
    """Finds the nodes of a tree that were near given places at given moments.

    Args:
        q: The nodes in the order in which they joined, shape (n, dof).
        distance: The robot's metric.
        places: The centres of the searches, shape (m, dof).
        radius: Their radii, shape (m,).
        count: How many nodes there were, shape (m,).
        most: Distances to measure in each doubling of the tree; places beyond that, spread over
            all of them, are skipped.

    Attributes:
        searched: Which places were not skipped, shape (m,); known after `pairs`.
    """

    def __init__(
        self, q: Floats, distance: Distance, places: Floats, radius: Floats, count: Ints, most: int
    ) -> None:
        self._q, self._distance, self._places, self._radius = q, distance, places, radius
        self._count, self._most = count, most
        self.searched = np.zeros(len(places), bool)

    def pairs(self) -> Iterator[tuple[Ints, Ints, Floats]]:
        """Yield places, nodes within their radius, and distances; all nodes of a place together."""
        # Trees of up to 2^k nodes are searched in blocks of the first 2^k nodes.
        level = np.ceil(np.log2(np.maximum(self._count, 1))).astype(np.int64)
        for k in np.unique(level).tolist():
            yield from self._among(np.flatnonzero(level == k), 1 << k)

    def _among(self, rows: Ints, nodes: int) -> Iterator[tuple[Ints, Ints, Floats]]:
        order, size, centres, far = self._blocks(nodes)
        # In this order, the first n places are spread over all for every n.
        rows = rows[np.argsort(np.arange(len(rows)) * _GOLDEN % 1.0)]
        left, at_once = self._most, max(1, _AT_ONCE // len(centres))
        for first in range(0, len(rows), at_once):
            if left <= 0:
                return
            some = rows[first : first + at_once]
            apart = self._distance(self._places[some][:, None], centres[None])
            reach = far + self._radius[some][:, None]
            place, block = np.nonzero(apart <= reach * (1 + _SLACK))
            # Places that would exceed the limit are skipped.
            ends = np.searchsorted(place, np.arange(1, len(some) + 1))
            spent = np.arange(1, len(some) + 1) * len(centres) + ends * size
            done = max(int(np.searchsorted(spent, left)), 1)
            left -= int(spent[done - 1])
            some, chosen = some[:done], slice(ends[done - 1])
            self.searched[some] = True
            yield from self._within(some, place[chosen], block[chosen], order, size)

    def _within(
        self, rows: Ints, place: Ints, block: Ints, order: Ints, size: int
    ) -> Iterator[tuple[Ints, Ints, Floats]]:
        """Yield near nodes of the blocks, for a few places at a time."""
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
        """Sort the first nodes into blocks; return order, block size, centres and radii."""
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
    """Return the numbers of places along a space-filling curve (Morton 1966), shape (n,)."""
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


def nearest(search: NeighbourSearch) -> tuple[Ints, Floats, Floats]:
    """Return the node nearest to each place within its radius, or -1.

    Returns:
        The nodes, their distances, and the distances of the second nearest nodes; inf for none.
    """
    m = len(search.searched)
    node, least, second = np.full(m, -1), np.full(m, np.inf), np.full(m, np.inf)
    for places, others, away in search.pairs():
        order = np.lexsort((away, places))
        place, other, far = places[order], others[order], away[order]
        first = np.flatnonzero(np.diff(place, prepend=-1))
        node[place[first]], least[place[first]] = other[first], far[first]
        after = first[first + 1 < np.append(first[1:], len(place))] + 1
        second[place[after]] = far[after]
    return node, least, second
