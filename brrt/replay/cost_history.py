"""Costs of nodes of a tree that rewires, each at a moment of its own, by the way up to the root."""

import numpy as np

from brrt.errors import LogError
from brrt.replay.tree_fold import Flags, Floats, Ints, TreeChanges

_CHUNK = 1 << 14
"""Nodes whose ancestors are looked up at once."""


class CostHistory:
    """Finds the costs of nodes at any moments; each takes as many steps as the tree is deep.

    Args:
        changes: The changes of the tree.
        length: Length of the edge that each change makes, shape (m,).
        valid: Which changes can be made, shape (m,); of the others rewires are skipped, and nodes
            join as roots.
    """

    def __init__(self, changes: TreeChanges, length: Floats, valid: Flags) -> None:
        self._changes, self._length, m = changes, length, len(changes.seq)
        # The changes of each node, oldest first, under keys that rise.
        rows = np.flatnonzero(valid | changes.joins)
        node = np.asarray(changes.node[rows], np.int64)
        order = np.argsort(node, kind="stable")
        self._rows, node = rows[order], node[order]
        self._keys = node * (m + 1) + self._rows
        # Which change of the same node comes next, and which one made the parent what it was then.
        self._next = np.full(m, m, np.int32)
        repeated = np.flatnonzero(node[1:] == node[:-1])
        self._next[self._rows[repeated]] = self._rows[repeated + 1]
        self._above = np.full(m, -1, np.int32)
        below = np.flatnonzero(valid & (changes.parent >= 0))
        self._above[below] = self.latest(changes.parent[below], below)

    def latest(self, node: Ints, count: Ints) -> Ints:
        """Return the last change of each node among the first `count` of all, -1 without one."""
        if not len(self._keys):
            return np.full(len(node), -1)
        key = np.asarray(node, np.int64) * (len(self._next) + 1)
        at = np.searchsorted(self._keys, key + count) - 1
        return np.where((at >= 0) & (self._keys[at] >= key), self._rows[at], -1)

    def at(self, seq: Ints, node: Ints) -> tuple[Floats, Ints]:
        """Return what nodes cost after events, and until which change that stays so.

        Args:
            seq: Numbers of the events, shape (k,).
            node: The nodes, shape (k,).

        Returns:
            The costs, nan where a node does not exist yet, and for each the first change after the
            event that gives the node or an ancestor another parent, m without one.

        Raises:
            LogError: A node is its own ancestor.
        """
        count = np.searchsorted(self._changes.seq, seq, side="right")
        change = self.latest(node, count)
        cost, until = np.full(len(node), np.nan), np.full(len(node), len(self._next))
        exist = np.flatnonzero(change >= 0)
        for first in range(0, len(exist), _CHUNK):
            rows = exist[first : first + _CHUNK]
            cost[rows], until[rows] = self._climb(change[rows], count[rows])
        return cost, until

    def _climb(self, change: Ints, count: Ints) -> tuple[Floats, Ints]:
        """Go up to the roots from the nodes as changes have left them, then add up the lengths."""
        cost, until = np.zeros(len(change)), np.full(len(change), len(self._next))
        rows: Ints = np.arange(len(change))
        way: list[tuple[Ints, Ints]] = []
        while len(rows):
            if len(way) > len(self._rows):
                raise LogError("a node is its own ancestor")
            way.append((rows, change))
            until[rows] = np.minimum(until[rows], self._next[change])
            above = self._above[change]
            onward = np.flatnonzero(above >= 0)
            rows, change, count = rows[onward], above[onward], count[onward]
            late = np.flatnonzero(self._next[change] < count)
            while len(late):
                change[late] = self._next[change[late]]
                late = late[self._next[change[late]] < count[late]]
        for rows, change in reversed(way):
            total = cost[rows] + self._length[change]
            cost[rows] = np.where(self._above[change] < 0, self._changes.stated[change], total)
        return cost, until
