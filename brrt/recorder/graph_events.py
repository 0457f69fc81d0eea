"""The events of graphs and of pruning, as the recorder takes them."""

import math
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brrt.errors import BrrtError
from brrt.events import Kind
from brrt.recorder.nodes import Nodes
from brrt.recorder.values import (
    configuration,
    configurations,
    cost_of,
    costs_of,
    fraction,
    fractions,
)
from brrt.robots import Robot

Ints = NDArray[np.int64]


class GraphEvents:
    """Methods of `Recorder` for nodes without edges, links, removals and checked motions."""

    _lock: AbstractContextManager[bool]
    _robot: Robot
    _dof: int
    _iteration: int
    _nodes: Callable[[int], Nodes]
    _node: Callable[..., int]
    _node_rows: Callable[..., Ints]
    _far: Callable[[Sequence[float], Sequence[float]], float]
    _put: Callable[..., None]
    _put_many: Callable[..., None]

    def vertex(self, q: ArrayLike, *, node: int | None = None, tree: int = 0) -> int:
        """Record that a node joined without an edge, and return its number.

        It is numbered with the nodes of `edge`, and has no cost until `rewire` gives it a parent.

        Args:
            q: Its configuration, shape (dof,).
            node: Its number, to check: nodes of a tree are numbered 0, 1, 2 ...
            tree: 0 grows from the start, 1 from the goal.
        """
        values = configuration(q, self._dof)
        with self._lock:
            nodes = self._nodes(tree)
            number = len(nodes.parent)
            if node is not None and node != number:
                raise BrrtError(f"node of tree {tree} must be {number}, its next, not {node!r:.60}")
            self._put(Kind.VERTEX, 0.0, values, tree, number)
            nodes.join_vertex(values)
            return number

    def link(self, node: int, other: int, *, cost: float | None = None, tree: int = 0) -> None:
        """Record an edge of a graph, which leads both ways and changes no parent.

        Args:
            node: Number of a node.
            other: Number of another node of the same tree.
            cost: Its cost, which replaces that of an earlier link; by default the distance.
            tree: 0 grows from the start, 1 from the goal.
        """
        with self._lock:
            nodes, at, to = self._nodes(tree), *self._pair(node, other, tree)
            if cost is not None:
                total = cost_of(cost)
            else:
                total = self._far(nodes.place(at), nodes.place(to))
            self._put(Kind.LINK, total, None, tree, at, to)
            nodes.link(at, to)

    def cut(self, node: int, other: int | None = None, *, tree: int = 0) -> None:
        """Record that an edge was removed: the link of two nodes, or the edge to a parent.

        A node whose edge to its parent is cut has no parent; it and its descendants have no cost.

        Args:
            node: Number of one end.
            other: Number of the other end; by default the node's parent.
            tree: 0 grows from the start, 1 from the goal.
        """
        with self._lock:
            nodes, at = self._nodes(tree), self._node("node", node, tree)
            if other is None and nodes.parent[at] < 0:
                raise BrrtError(f"other must be given: node {at} of tree {tree} has no parent")
            to = nodes.parent[at] if other is None else self._node("other", other, tree)
            if not nodes.has_edge(at, to):
                raise BrrtError(f"other must be joined to node {at} of tree {tree}; {to} is not")
            self._put(Kind.CUT, 0.0, None, tree, at, to)
            nodes.cut(at, to)

    def remove(self, node: int, *, tree: int = 0) -> None:
        """Record that a node was removed with all its edges; its number stays unused."""
        with self._lock:
            at = self._node("node", node, tree)
            self._put(Kind.REMOVE, 0.0, None, tree, at)
            self._nodes(tree).remove(at)

    def check(
        self,
        node: int | None,
        other: int | None = None,
        part: float = 1.0,
        *,
        q: ArrayLike | None = None,
        tree: int = 0,
    ) -> None:
        """Record that a motion was checked for collisions.

        Args:
            node: Number of the node at which it begins; None if it begins at none.
            other: Number of the node at which it ends; None if it ends at none.
            part: How much of it is free, from 0 to 1 for all of it; True and False for all and not.
            q: The configuration at which it ends, shape (dof,); by default that of `other`.
            tree: 0 grows from the start, 1 from the goal.
        """
        free = fraction("part", part)
        values = None if q is None else configuration(q, self._dof)
        with self._lock:
            at = -1 if node is None else self._node("node", node, tree)
            to = -1 if other is None else self._node("other", other, tree)
            if values is None:
                if to < 0:
                    raise BrrtError("q must be given for a motion that ends at no node")
                values = self._nodes(tree).place(to)
            self._put(Kind.CHECK, free, values, tree, at, to)

    def vertices(self, q: ArrayLike, *, tree: int = 0) -> Ints:
        """Record that nodes joined without edges, shape (n, dof); return their numbers."""
        rows = configurations("q", q, self._dof)
        with self._lock:
            nodes = self._nodes(tree)
            numbers = len(nodes) + np.arange(len(rows))
            fields = {"tree": tree, "node": numbers, "q": rows}
            self._put_many(Kind.VERTEX, len(rows), fields, self._iteration)
            nodes.join_vertices(rows)
            return numbers

    def links(
        self, node: ArrayLike, other: ArrayLike, *, cost: ArrayLike | None = None, tree: int = 0
    ) -> None:
        """Record edges of a graph, shape (n,) each; see `link`."""
        with self._lock:
            nodes = self._nodes(tree)
            at = self._node_rows("node", node, np.size(node), tree)
            to = self._node_rows("other", other, len(at), tree)
            if (at == to).any():
                raise BrrtError(f"other must not be the node itself, {at[at == to][0]}")
            if cost is None:
                total = self._robot.distance(nodes.places(at), nodes.places(to))
            else:
                total = costs_of(cost, len(at))
            fields = {"tree": tree, "node": at, "other": to, "cost": total}
            self._put_many(Kind.LINK, len(at), fields, self._iteration)
            nodes.link_many(at, to)

    def cuts(self, node: ArrayLike, other: ArrayLike, *, tree: int = 0) -> None:
        """Record that edges were removed, shape (n,) each; see `cut`."""
        with self._lock:
            at = self._node_rows("node", node, np.size(node), tree)
            to = self._node_rows("other", other, len(at), tree)
            for pair in zip(at.tolist(), to.tolist(), strict=True):
                self.cut(*pair, tree=tree)

    def removes(self, node: ArrayLike, *, tree: int = 0) -> None:
        """Record that nodes were removed, shape (n,); see `remove`."""
        with self._lock:
            for at in self._node_rows("node", node, np.size(node), tree).tolist():
                self.remove(at, tree=tree)

    def checks(
        self,
        node: ArrayLike,
        other: ArrayLike,
        part: ArrayLike = 1.0,
        *,
        q: ArrayLike | None = None,
        tree: int = 0,
    ) -> None:
        """Record that motions were checked; see `check`.

        Args:
            node: Numbers of the nodes at which they begin, -1 for none, shape (n,).
            other: Numbers of the nodes at which they end, -1 for none, shape (n,).
            part: How much of each is free, shape (n,), or one for all.
            q: Configurations at which they end, shape (n, dof); by default those of `other`.
            tree: 0 grows from the start, 1 from the goal.
        """
        with self._lock:
            nodes, low = self._nodes(tree), -1
            at = self._node_rows("node", node, np.size(node), tree, low)
            to = self._node_rows("other", other, len(at), tree, low if q is not None else 0)
            free = fractions("part", part, len(at))
            ends = nodes.places(to) if q is None else configurations("q", q, self._dof)
            if len(ends) != len(at):
                raise BrrtError(f"q must have {len(at)} rows, not {len(ends)}")
            fields = {"tree": tree, "node": at, "other": to, "part": free, "q": ends}
            self._put_many(Kind.CHECK, len(at), fields, self._iteration)

    def _pair(self, node: int, other: int, tree: int) -> tuple[int, int]:
        """Return two nodes of a tree, which differ."""
        at, to = self._node("node", node, tree), self._node("other", other, tree)
        if at == to:
            raise BrrtError(f"other must not be the node itself, {at}")
        return at, to

    def _known_cost(self, nodes: Nodes, node: int) -> float:
        """Return the cost-to-come of a parent.

        Raises:
            BrrtError: It has none, since no root is above it.
        """
        cost = nodes.cost_of(node)
        if math.isinf(cost):
            raise BrrtError(f"cost must be given: parent {node} has none, for no root is above it")
        return cost
