"""The nodes of a recorded tree or graph, for numbers and costs that the caller leaves out."""

import math
from array import array
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from brrt.errors import BrrtError

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


class Nodes:
    """The nodes of a tree, or of a graph: each has a parent or none, and may have links.

    Args:
        dof: Numbers in a configuration.

    Attributes:
        parent: Their parents; -1 for a root.
        cost: Their costs now, as far as they are connected; see `cost_of`.
        loose: Nodes without a parent that are no roots: they and what is below have no cost.
        removed: Nodes that were removed.
        rows: For `Recorder.tree`: number of the node in each row of the caller's arrays.
    """

    def __init__(self, dof: int) -> None:
        self._dof = dof
        self._q, self.parent, self.cost = array("d"), array("q"), array("d")
        # Looked up once: `join` is called for each edge.
        self._add_q, self._add_parent = self._q.extend, self.parent.append
        self._add_cost = self.cost.append
        # The children of each node; None until a rewire needs them.
        self._children: list[set[int]] | None = None
        self.loose: set[int] = set()
        self.removed: set[int] = set()
        # The links, as pairs in order; those of arrays wait until a cut needs them.
        self._links: set[tuple[int, int]] = set()
        self._waiting: list[Ints] = []
        self.rows = np.empty(0, np.int64)

    def __len__(self) -> int:
        return len(self.parent)

    def straight(self, node: int, q: Sequence[float]) -> float:
        """Return the straight distance of a node from a configuration."""
        at = node * self._dof
        return math.dist(self._q[at : at + self._dof], q)

    def place(self, node: int) -> Sequence[float]:
        """Return the configuration of a node."""
        return self._q[node * self._dof : (node + 1) * self._dof]

    def places(self, nodes: Ints) -> Floats:
        """Return the configurations of nodes, shape (n, dof)."""
        # A view, which is gone before the array grows: a copy would take time for all nodes.
        whole = (
            np.frombuffer(self._q).reshape(-1, self._dof) if self._q else np.empty((0, self._dof))
        )
        return np.asarray(whole[nodes])

    def costs(self, nodes: Ints) -> Floats:
        """Return `cost` of nodes, shape (n,)."""
        return np.asarray((np.frombuffer(self.cost) if self.cost else np.empty(0))[nodes])

    def cost_of(self, node: int) -> float:
        """Return a node's cost-to-come; infinite if no root is above it."""
        return math.inf if self.loose and self.root(node) in self.loose else self.cost[node]

    def root(self, node: int) -> int:
        """Return the node without a parent that is above a node, or is it."""
        while self.parent[node] >= 0:
            node = self.parent[node]
        return node

    def join(self, q: Sequence[float], parent: int, cost: float) -> None:
        """Add a node."""
        self._add_q(q)
        self._add_parent(parent)
        self._add_cost(cost)
        if self._children is not None:
            self._children.append(set())
            if parent >= 0:
                self._children[parent].add(len(self.parent) - 1)

    def join_many(self, q: Floats, parent: Ints, cost: Floats) -> None:
        """Add nodes."""
        first = len(self)
        for column, values in ((self._q, q), (self.parent, parent), (self.cost, cost)):
            column.frombytes(np.ascontiguousarray(values).tobytes())
        if self._children is None or len(parent) > first:
            self._children = None  # gathering them all anew, if ever, takes as long
            return
        self._children += [set() for _ in range(len(parent))]
        for child, up in enumerate(parent.tolist(), first):
            if up >= 0:
                self._children[up].add(child)

    def join_vertex(self, q: Sequence[float]) -> None:
        """Add a node that is no root and has no parent."""
        self.loose.add(len(self))
        self.join(q, -1, 0.0)

    def join_vertices(self, q: Floats) -> None:
        """Add nodes that are no roots and have no parent."""
        first = len(self)
        self.join_many(q, np.full(len(q), -1), np.zeros(len(q)))
        self.loose.update(range(first, first + len(q)))

    def children(self) -> list[set[int]]:
        """Return the children of each node."""
        if self._children is None:
            self._children = [set() for _ in self.parent]
            for child, up in enumerate(self.parent):
                if up >= 0:
                    self._children[up].add(child)
        return self._children

    def move(self, node: int, parent: int, cost: float) -> None:
        """Give a node another parent; its descendants' costs follow."""
        children = self.children()
        if self.parent[node] >= 0:
            children[self.parent[node]].discard(node)
        children[parent].add(node)
        self.parent[node] = parent
        self.loose.discard(node)
        change, below = cost - self.cost[node], [node]
        while below:
            at = below.pop()
            self.cost[at] += change
            below += children[at]

    def link(self, node: int, other: int) -> None:
        """Join two nodes by a link."""
        self._links.add((min(node, other), max(node, other)))

    def link_many(self, node: Ints, other: Ints) -> None:
        """Join pairs of nodes by links, shape (n,) each."""
        self._waiting.append(np.sort(np.stack([node, other], axis=1), axis=1))

    def has_edge(self, node: int, other: int) -> bool:
        """Return whether two nodes are joined, by a link or as child and parent."""
        while self._waiting:
            self._links.update(map(tuple, self._waiting.pop().tolist()))
        joined = self.parent[node] == other or self.parent[other] == node
        return joined or (min(node, other), max(node, other)) in self._links

    def cut(self, node: int, other: int) -> None:
        """Remove the link between two nodes, and the edge if one is the other's parent."""
        self._links.discard((min(node, other), max(node, other)))
        for child, up in ((node, other), (other, node)):
            if self.parent[child] == up:
                self._detach(child)

    def remove(self, node: int) -> None:
        """Remove a node; its children have no parent then."""
        for child in (node, *self.children()[node]):
            self._detach(child)
        self.removed.add(node)

    def _detach(self, node: int) -> None:
        up = self.parent[node]
        if up >= 0 and self._children is not None:
            self._children[up].discard(node)
        self.parent[node] = -1
        self.loose.add(node)

    def descends(self, node: int, ancestor: int) -> bool:
        """Return whether a node is another one, or descends from it."""
        while node >= 0 and node != ancestor:
            node = self.parent[node]
        return node == ancestor


def from_root(parent: Ints, known: int) -> Ints:
    """Return the rows of a tree from `known` on, each after its parent's.

    Args:
        parent: Row of each row's parent, -1 for a root, shape (n,).
        known: Rows that are left out.

    Raises:
        BrrtError: Parents form a circle.
    """
    ready = np.arange(len(parent)) < known
    fresh, order = np.arange(known, len(parent)), [np.empty(0, np.int64)]
    while len(fresh):
        now = (parent[fresh] < 0) | ready[parent[fresh]]
        if not now.any():
            raise BrrtError(f"parent: the parents of row {fresh[0]} lead to no root")
        order.append(fresh[now])
        ready[fresh[now]], fresh = True, fresh[~now]
    return np.concatenate(order)
