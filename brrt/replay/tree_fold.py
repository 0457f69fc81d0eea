"""Parents and costs of a tree that rewires, at every moment: a fold, one change after another.

A rewire changes the costs of all descendants, which the log does not state. The fold marks those
as stale, and computes a stale cost when it is needed next.
"""

import math
from array import array
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from brrt.events import Table

Floats = NDArray[np.float64]
Ints = NDArray[np.signedinteger[Any]]
Flags = NDArray[np.bool_]
Verdicts = NDArray[np.uint8]

Distance = Callable[[Floats, Floats], Floats]
"""A robot's metric: distances between rows of configurations, shapes (m, dof) to (m,)."""

VALID, NO_PARENT, NO_NODE, CYCLE = range(4)
"""Verdict on a change: it can be made; the parent does not exist (yet); the rewired node does not
exist (yet); the parent descends from the node."""

DETACHED = int(np.iinfo(np.int32).min)
"""The parent of a node that is rewired to none, since its edge was cut or its parent removed; see
`brrt.replay.graph`."""

_CHUNK = 1 << 16
"""Changes that are measured, or converted to Python numbers, at once."""


def trees_in(*tables: Table) -> list[int]:
    """Return the numbers of the trees that edges or rewires belong to, in order."""
    counts = (np.bincount(table["tree"], minlength=256) for table in tables)
    return np.flatnonzero(sum(counts)).tolist()


def of_tree(table: Table, tree: int) -> Table:
    """Return the events of one tree; the table itself and no copy where that is all of them."""
    mine = table["tree"] == tree
    return table if mine.all() else table[mine]


class TreeChanges(NamedTuple):
    """The edges and rewires of one tree, in the order of the log; the n-th edge makes node n.

    Attributes:
        seq: Numbers of the events, shape (m,).
        node: Nodes that join or are rewired, shape (m,).
        parent: Their parents from then on; below 0 for a root, `DETACHED` for a node that loses its
            parent; shape (m,).
        stated: Their costs-to-come, as the events state them, shape (m,).
        joins: Whether the node joins the tree (an edge) or is rewired, shape (m,).
    """

    seq: Ints
    node: Ints
    parent: Ints
    stated: Floats
    joins: Flags

    @classmethod
    def of(cls, edges: Table, rewires: Table, first: int = 0) -> Self:
        """Merge a tree's edges and rewires; its nodes are numbered on from `first`."""
        nodes = np.arange(first, first + len(edges))
        if not len(rewires):  # no copies: there may be millions of edges
            joins = np.ones(len(edges), np.bool_)
            return cls(edges["seq"], nodes, edges["parent"], edges["cost"], joins)
        seq = np.concatenate([edges["seq"], rewires["seq"]])
        order = np.argsort(seq, kind="stable")
        node = np.concatenate([nodes, rewires["node"]])[order]
        parent = np.concatenate([edges["parent"], rewires["parent"]])[order]
        stated = np.concatenate([edges["cost"], rewires["cost"]])[order]
        return cls(seq[order], node, parent, stated, order < len(edges))

    def lengths(self, q: Floats, distance: Distance) -> Floats:
        """Measure the edge that each change makes, shape (m,); nan where an end does not exist."""
        n, length = len(q), np.full(len(self.seq), np.nan)
        for first in range(0, len(length), _CHUNK):
            chunk = slice(first, first + _CHUNK)
            node, parent = self.node[chunk], self.parent[chunk]
            exist = np.flatnonzero((parent >= 0) & (parent < n) & (node >= 0) & (node < n))
            length[first + exist] = distance(q[parent[exist]], q[node[exist]])
        return length

    def existence(self, first: int = 0) -> Verdicts:
        """Return the verdict on each change apart from cycles, shape (m,); `first` nodes exist."""
        exist = first + np.cumsum(self.joins)
        no_parent = (self.parent >= exist) | (self.joins & (self.parent == self.node))
        no_parent |= ~self.joins & (self.parent < 0) & (self.parent != DETACHED)
        no_node = ~self.joins & ((self.node < 0) | (self.node >= exist))
        return np.select([no_node, no_parent], [NO_NODE, NO_PARENT], VALID).astype(np.uint8)


class CostFold(NamedTuple):
    """What a fold finds of each change, and the tree after all of them.

    Attributes:
        parent_cost: Cost of the parent when the change is made, nan without one, shape (m,).
        before: Cost of the node right before a rewire whose ends exist, else nan, shape (m,).
        verdict: Whether the change can be made; one that cannot is skipped; shape (m,).
        parent: Parents at the end, -1 for a root, shape (n,).
        cost: Costs-to-come at the end, shape (n,).
    """

    parent_cost: Floats
    before: Floats
    verdict: Verdicts
    parent: Ints
    cost: Floats


def fold_costs(changes: TreeChanges, length: Floats | None = None) -> CostFold:
    """Make the changes one after another; the costs of all descendants follow each.

    Args:
        changes: The changes.
        length: Length of the edge that each change makes, shape (m,). By default it is the stated
            cost less the parent's cost at that moment, so that costs are right to about depth
            roundings.
    """
    verdict, nothing = changes.existence(), np.broadcast_to(np.nan, len(changes.seq))
    if length is None:
        length = nothing
    elif changes.joins.all():
        # No cost changes afterwards, so one pass over the nodes is enough.
        parent = np.where((verdict == VALID) & (changes.parent >= 0), changes.parent, -1)
        cost = sum_lengths(parent, length, changes.stated)
        return CostFold(np.where(parent >= 0, cost[parent], np.nan), nothing, verdict, parent, cost)
    parent_cost, before = nothing.copy(), nothing.copy()
    # Single numbers are written to views of memory twice as fast as to arrays.
    tree = _fold(changes, length, parent_cost.data, before.data, verdict.data)
    return CostFold(parent_cost, before, verdict, np.array(tree.parent), np.array(tree.costs()))


def _fold(
    changes: TreeChanges,
    length: Floats,
    parent_cost: "memoryview[Any]",
    before: "memoryview[Any]",
    verdict: "memoryview[Any]",
) -> "_Tree":
    """Fold the changes whose ends exist; write what is found into the columns, shape (m,)."""
    joined = changes.node[changes.joins]
    tree = _Tree(changes.stated[changes.joins][np.argsort(joined)])
    # A node that joins in order has no descendants yet, and where no edge is shorter than 0, no
    # descendant costs less than its ancestor: as a rule no cycle needs to be searched for.
    ordered = bool((np.diff(joined) > 0).all())
    rising = ordered
    for i, v, p, stated, joins, measured in _rows(changes, length, np.asarray(verdict)):
        if p < 0:
            before[i] = tree.cost_of(v)
            tree.detach(v)
            continue
        parent_cost[i] = above = tree.cost_of(p)
        if not (joins and ordered):
            now = tree.cost_of(v)
            if not joins:
                before[i] = now
            if not (rising and above < now) and tree.descends(p, v):
                verdict[i] = CYCLE
                continue
        more = measured
        if math.isnan(measured):
            more = stated - above if above < math.inf else 0.0
        rising = rising and more >= 0.0
        tree.hang(v, p, more)
    return tree


def _rows(
    changes: TreeChanges, length: Floats, verdict: Verdicts
) -> Iterator[tuple[int, int, int, float, bool, float]]:
    """Yield number, node, parent, stated cost, whether it joins, and length of valid changes."""
    for first in range(0, len(length), _CHUNK):
        chunk = slice(first, first + _CHUNK)
        moves = (changes.parent[chunk] >= 0) | (changes.parent[chunk] == DETACHED)
        rows = first + np.flatnonzero((verdict[chunk] == VALID) & moves)
        columns = changes.node, changes.parent, changes.stated, changes.joins, length
        yield from zip(rows.tolist(), *(c[rows].tolist() for c in columns), strict=True)


def sum_lengths(parent: Ints, length: Floats, cost: Floats, order: Ints | None = None) -> Floats:
    """Add up the lengths of the edges from the roots on, shape (n,).

    Args:
        parent: Ints, -1 for a root, shape (n,).
        length: Lengths of the edges to the parents, shape (n,).
        cost: Costs, which count for roots, shape (n,).
        order: The nodes, each after its parent; 0, 1, 2 ... by default.
    """
    total = np.array(cost, np.float64)
    costs = total.data
    for first in range(0, len(total), _CHUNK):
        nodes = np.arange(first, min(first + _CHUNK, len(total)))
        nodes = nodes if order is None else order[nodes]
        nodes = nodes[parent[nodes] >= 0]
        columns = nodes, parent[nodes], length[nodes]
        for node, above, more in zip(*(column.tolist() for column in columns), strict=True):
            costs[node] = costs[above] + more
    return total


class _Tree:
    """A tree at one moment; nodes without a parent, -1, have the given costs, shape (n,)."""

    def __init__(self, cost: Floats) -> None:
        nodes = len(cost)
        self.parent, self._length = array("i", [-1]) * nodes, array("d", [0.0]) * nodes
        self._cost, self._fresh = array("d", cost.tobytes()), bytearray(b"\1") * nodes
        # A node's first child, and the siblings after and before it.
        self._child, self._next, self._last = (array("i", [-1]) * nodes for _ in range(3))

    def cost_of(self, node: int) -> float:
        """Return a node's cost; compute those above it that are stale."""
        fresh, cost = self._fresh, self._cost
        if fresh[node]:
            return cost[node]
        parent, length, stale = self.parent, self._length, []
        while not fresh[node]:
            stale.append(node)
            node = parent[node]
        total = cost[node]
        for node in reversed(stale):
            total += length[node]
            cost[node] = total
            fresh[node] = 1
        return total

    def costs(self) -> "array[float]":
        """Return all costs."""
        for node in range(len(self._cost)):
            self.cost_of(node)
        return self._cost

    def descends(self, node: int, root: int) -> bool:
        """Whether `node` is `root` or below it."""
        parent = self.parent
        while self._child[root] >= 0 and node not in (-1, root):
            node = parent[node]
        return node == root

    def detach(self, node: int) -> None:
        """Make a node a root of infinite cost."""
        self._leave(node)
        self.parent[node] = self._next[node] = self._last[node] = -1
        self._cost[node], self._fresh[node] = math.inf, 1
        if self._child[node] >= 0:
            self._spoil(self._child[node])

    def _leave(self, node: int) -> None:
        """Take a node out of its siblings."""
        child, after, before = self._child, self._next, self._last
        left, right, old = before[node], after[node], self.parent[node]
        if left >= 0:
            after[left] = right
        elif old >= 0:
            child[old] = right
        if right >= 0:
            before[right] = left

    def hang(self, node: int, parent: int, length: float) -> None:
        """Put a node below a parent whose cost is fresh."""
        child, after, before = self._child, self._next, self._last
        if self.parent[node] >= 0:
            self._leave(node)
        first = child[parent]
        child[parent], after[node], before[node] = node, first, -1
        if first >= 0:
            before[first] = node
        self.parent[node], self._length[node] = parent, length
        self._cost[node], self._fresh[node] = self._cost[parent] + length, 1
        if child[node] >= 0:
            self._spoil(child[node])

    def _spoil(self, node: int) -> None:
        """Mark a node, its later siblings and all below them as stale."""
        fresh, child, after, todo = self._fresh, self._child, self._next, [node]
        while todo:
            node = todo.pop()
            while node >= 0:
                if fresh[node]:  # below a stale node all are stale
                    fresh[node] = 0
                    if child[node] >= 0:
                        todo.append(child[node])
                node = after[node]
