"""The nodes of a recorded tree, for numbers and costs that the caller leaves out."""

from array import array
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from brrt.errors import BrrtError

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


class Nodes:
    """The nodes of a tree.

    Args:
        dof: Numbers in a configuration.

    Attributes:
        parent: Their parents; -1 for a root.
        cost: Their costs now.
        rows: For `Recorder.tree`: number of the node in each row of the caller's arrays.
    """

    def __init__(self, dof: int) -> None:
        self._dof = dof
        self._q, self.parent, self.cost = array("d"), array("q"), array("d")
        # The children of each node; None until a rewire needs them.
        self._children: list[set[int]] | None = None
        self.rows = np.empty(0, np.int64)

    def __len__(self) -> int:
        return len(self.parent)

    @property
    def q(self) -> Floats:
        """Their configurations, shape (n, dof)."""
        return np.array(self._q).reshape(-1, self._dof)

    def place(self, node: int) -> Sequence[float]:
        """Return the configuration of a node."""
        return self._q[node * self._dof : (node + 1) * self._dof]

    def join(self, q: Sequence[float], parent: int, cost: float) -> None:
        """Add a node."""
        self._q.extend(q)
        self.parent.append(parent)
        self.cost.append(cost)
        if self._children is not None:
            self._children.append(set())
            if parent >= 0:
                self._children[parent].add(len(self.parent) - 1)

    def join_many(self, q: Floats, parent: Ints, cost: Floats) -> None:
        """Add nodes."""
        for column, values in ((self._q, q), (self.parent, parent), (self.cost, cost)):
            column.frombytes(np.ascontiguousarray(values).tobytes())
        self._children = None

    def move(self, node: int, parent: int, cost: float) -> None:
        """Give a node another parent; its descendants' costs follow."""
        if self._children is None:
            self._children = [set() for _ in self.parent]
            for child, up in enumerate(self.parent):
                if up >= 0:
                    self._children[up].add(child)
        if self.parent[node] >= 0:
            self._children[self.parent[node]].discard(node)
        self._children[parent].add(node)
        self.parent[node] = parent
        change, below = cost - self.cost[node], [node]
        while below:
            at = below.pop()
            self.cost[at] += change
            below += self._children[at]

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
