"""The trees and graphs at any instant: a fold over the edges, rewires and links of a log."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from brrt.errors import LogError
from brrt.events import Events, Kind, Table
from brrt.replay.graph import (
    LINK_DTYPE,
    NEVER,
    as_forest,
    links_after,
    removal_times,
    uses_of_removed,
)
from brrt.replay.tree_fold import (
    CYCLE,
    DETACHED,
    NO_NODE,
    NO_PARENT,
    VALID,
    Distance,
    Floats,
    Ints,
    TreeChanges,
    Verdicts,
    fold_costs,
    of_tree,
    sum_lengths,
    trees_in,
)

_BLOCK = 1 << 13
"""Nodes whose depths are found together."""


@dataclass(frozen=True, slots=True, eq=False)
class Tree:
    """One tree or graph; row n of each array belongs to node n.

    Attributes:
        q: Configurations, shape (n, dof).
        parent: Parents, -1 for a node without one, shape (n,).
        cost: Costs-to-come, infinite for nodes that no root is above, shape (n,).
        born: `seq` of the event that made the node, shape (n,).
        links: Edges beside those to parents: `seq`, `node`, `other` and `cost`, shape (m,).
        removed: Numbers of nodes that were removed, in order; their rows remain.
    """

    q: NDArray[np.float64]
    parent: NDArray[np.int32]
    cost: NDArray[np.float64]
    born: NDArray[np.int64]
    links: Table = field(default_factory=lambda: np.empty(0, LINK_DTYPE))
    removed: NDArray[np.int64] = field(default_factory=lambda: np.empty(0, np.int64))

    def __len__(self) -> int:
        return len(self.parent)

    @property
    def leaves(self) -> int:
        """Nodes without children, as far as they are not removed."""
        return leaves_of(self.parent) - len(self.removed)

    def linked(self, node: int) -> Table:
        """Return the links of a node; see `links`."""
        own: Table = self.links[(self.links["node"] == node) | (self.links["other"] == node)]
        return own

    def neighbours(self, node: int) -> NDArray[np.int64]:
        """Return the nodes that an edge joins with a node: parent, children, links; in order."""
        links = self.linked(node)
        parent = self.parent[node : node + 1]
        parts = parent[parent >= 0], np.flatnonzero(self.parent == node)
        ends = np.where(links["node"] == node, links["other"], links["node"])
        return np.unique(np.concatenate([*parts, ends]).astype(np.int64))

    @property
    def depth(self) -> int:
        """Edges from the root to the deepest node."""
        return depth_of(self.parent)

    def path_to(self, node: int) -> Floats:
        """Configurations from the root to a node, shape (m, dof); see `lineage`."""
        return self.q[self.lineage(node)]

    def lineage(self, node: int) -> list[int]:
        """Nodes from the root to a node.

        Raises:
            LogError: The parents do not lead to a root.
        """
        lineage = [node]
        while self.parent[lineage[-1]] >= 0:
            above = int(self.parent[lineage[-1]])
            if above >= len(self):
                raise LogError(f"node {lineage[-1]} has the parent {above}, which does not exist")
            lineage.append(above)
            if len(lineage) > len(self):
                raise LogError(f"node {node} is its own ancestor")
        return lineage[::-1]

    def below(self, node: int) -> NDArray[np.int64]:
        """Nodes that a node is an ancestor of, level by level, shape (m,).

        Raises:
            LogError: The node is its own ancestor.
        """
        children = np.argsort(self.parent, kind="stable")
        parents = self.parent[children]
        found, level, total = [np.empty(0, np.int64)], np.array([node]), 0
        while total <= len(self):
            first = np.searchsorted(parents, level, side="left")
            count = np.searchsorted(parents, level, side="right") - first
            before = np.cumsum(count) - count
            level = children[np.repeat(first - before, count) + np.arange(count.sum())]
            if not len(level):
                return np.concatenate(found)
            found.append(level)
            total += len(level)
        raise LogError(f"node {node} is its own ancestor")


def leaves_of(parent: Ints) -> int:
    """Count the nodes without children; `parent` has shape (n,)."""
    has_child = np.zeros(len(parent), np.bool_)  # `np.bincount` takes twice as long
    has_child[parent[parent >= 0]] = True
    return int((~has_child).sum())


def depth_of(parent: Ints) -> int:
    """Count the edges from the root to the deepest node; `parent` has shape (n,).

    Raises:
        LogError: A node is its own ancestor.
    """
    if (parent < np.arange(len(parent))).all():
        return _depth_in_order(parent)
    return int(depths(parent).max(initial=0))


def depths(parent: Ints) -> NDArray[np.int64]:
    """Count the edges from the root to each node, shape (n,).

    Raises:
        LogError: A node is its own ancestor.
    """
    up = parent.copy()
    # Each round halves what is left of every way up: log2(depth) rounds.
    steps = (up >= 0).astype(np.int64)
    while (up >= 0).any():
        on_way = np.flatnonzero(up >= 0)
        above = up[on_way]
        steps[on_way] += steps[above]
        up[on_way] = up[above]
        if steps.max() > len(parent):
            raise LogError("a node is its own ancestor")
    return steps


def _depth_in_order(parent: Ints) -> int:
    """Do the same where parents precede their children, in blocks that fit into a cache."""
    depth = np.empty(len(parent), np.int32)
    for first in range(0, len(parent), _BLOCK):
        outside = parent[first : first + _BLOCK]
        # How far it is up to the first node whose parent is not in the block, and which one it is.
        own = np.arange(len(outside))
        top = np.where(outside >= first, outside - first, own)
        steps = (top != own).astype(np.int32)
        while steps[top].any():
            steps += steps[top]
            top = top[top]
        above = outside[top]
        depth[first : first + _BLOCK] = np.where(above >= 0, depth[above] + 1, 0) + steps
    return int(depth.max(initial=0))


def forest(events: Events, distance: Distance | None = None) -> Mapping[int, Tree]:
    """Rebuild the trees, or graphs, as they are after the given events.

    Cut the log with `Events.until` for an earlier instant. Where a node was rewired, the costs of
    its descendants follow; a log does not state those.

    Args:
        events: From the first event on.
        distance: The robot's metric, on rows of configurations (`Point().distance`), to measure
            the edges of trees that rewire. By default their lengths are what the log states less
            the parent's cost then: costs are right to about depth roundings, and it takes longer.
            Trees that only grow keep the costs that the log states.

    Raises:
        LogError: A tree's nodes are not numbered 0, 1, 2 ... in order, or a rewire or a link names
            a node that does not exist, or a rewire closes a cycle.
    """
    made = as_forest(events)
    edges, rewires = made[Kind.EDGE], made[Kind.REWIRE]
    trees = {}
    for number in trees_in(edges, rewires, events[Kind.LINK]):
        rows, rewired = of_tree(edges, number), of_tree(rewires, number)
        check_numbers(rows, number, 0)
        check_removed(events, number)
        parent, cost = rows["parent"], rows["cost"]
        if len(rewired) or made is not events:
            changes = TreeChanges.of(rows, rewired)
            parent, cost = _after(changes, rows["q"], distance)
        check_links(events, number, rows["seq"])
        removed = np.flatnonzero(removal_times(events, number, len(rows)) < NEVER)
        links = links_after(events, number)
        trees[number] = Tree(rows["q"], parent, cost, rows["seq"], links, removed)
    return trees


def _after(changes: TreeChanges, q: Floats, distance: Distance | None) -> tuple[Ints, Floats]:
    """Return the parents and costs after all changes, shape (n,) each."""
    if distance is not None:
        check_verdicts(changes, changes.existence())
        parent = np.full(len(q), -1, np.int32)
        parent[changes.node] = changes.parent  # of several changes of a node the last one counts
        stated = np.where(parent == DETACHED, np.inf, changes.stated[changes.joins])
        parent = np.maximum(parent, -1)
        try:
            return parent, final_costs(parent, stated, q, distance)
        except LogError:  # the fold names the event
            pass
    found = fold_costs(changes)
    check_verdicts(changes, found.verdict)
    return found.parent, found.cost


def final_costs(parent: Ints, stated: Floats, q: Floats, distance: Distance) -> Floats:
    """Measure the costs-to-come of a tree's nodes, shape (n,).

    Args:
        parent: Parents, below 0 for a root, shape (n,).
        stated: Costs, which count for roots, shape (n,).
        q: Configurations, shape (n, dof).
        distance: The robot's metric.

    Raises:
        LogError: A node is its own ancestor.
    """
    order = np.argsort(depths(parent), kind="stable")
    length = np.zeros(len(parent))
    below = np.flatnonzero(parent >= 0)
    length[below] = distance(q[parent[below]], q[below])
    return sum_lengths(parent, length, stated, order)


def check_numbers(rows: Table, tree: int, first: int) -> None:
    """Raise `LogError` unless the edges of a tree number its nodes on from `first`."""
    wrong = np.flatnonzero(rows["node"] != np.arange(first, first + len(rows)))
    if len(wrong):
        at = int(wrong[0])
        row = rows[at]
        raise LogError(
            f"event {row['seq']}: node {row['node']} joins tree {tree} as its node {first + at}"
        )


def check_removed(events: Events, tree: int) -> None:
    """Raise `LogError` if an event names a node of a tree after its removal."""
    for row, node in uses_of_removed(events, tree):
        raise LogError(f"event {row['seq']}: node {node} of tree {tree} was removed before")


def check_links(events: Events, tree: int, born: Ints) -> None:
    """Raise `LogError` unless links join nodes that exist.

    Args:
        events: The log.
        tree: Number of the tree.
        born: Number of the event that made each of its nodes, shape (n,).
    """
    links = of_tree(events[Kind.LINK], tree)
    for name in ("node", "other"):
        missing = np.flatnonzero(~exists(links[name], links["seq"], born))
        if len(missing):
            row = links[missing[0]]
            raise LogError(f"event {row['seq']}: a link to node {row[name]}, which does not exist")


def exists(node: Ints, seq: Ints, born: Ints) -> NDArray[np.bool_]:
    """Return which nodes exist at events, removed or not, shape (m,); `born` as `check_links`."""
    known = (node >= 0) & (node < len(born))
    known[known] = born[node[known]] < seq[known]
    return np.asarray(known)


def check_verdicts(changes: TreeChanges, verdict: Verdicts) -> None:
    """Raise `LogError` unless all changes of a tree can be made; it names the first that cannot."""
    wrong = np.flatnonzero(verdict != VALID)
    if len(wrong):
        i = int(wrong[0])
        why = reason(int(changes.node[i]), int(changes.parent[i]), int(verdict[i]))
        raise LogError(f"event {changes.seq[i]}: {why}")


def reason(node: int, parent: int, verdict: int) -> str:
    """Return why a change cannot be made, in words."""
    return {
        NO_PARENT: f"node {node} gets parent {parent}, which does not exist",
        NO_NODE: f"node {node} is rewired before it exists",
        CYCLE: f"with parent {parent}, node {node} is its own ancestor",
    }[verdict]
