"""The trees at any instant: a fold over the edges and rewires of a log."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrt.errors import LogError
from brrt.events import Events, Kind, Table
from brrt.replay.ledger import (
    CIRCLE,
    NO_NODE,
    NO_PARENT,
    SOUND,
    Changes,
    Distance,
    changes,
    edge_lengths,
    fold,
)

_BLOCK = 1 << 13
"""Nodes whose depths are found together."""


@dataclass(frozen=True, slots=True, eq=False)
class Tree:
    """One tree; row n of each array belongs to node n.

    Attributes:
        q: Configurations, shape (n, dof).
        parent: Parents, -1 for a root, shape (n,).
        cost: Costs-to-come, shape (n,).
        born: `seq` of the event that made the node, shape (n,).
    """

    q: NDArray[np.float64]
    parent: NDArray[np.int32]
    cost: NDArray[np.float64]
    born: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.parent)

    @property
    def leaves(self) -> int:
        """Nodes that are nobody's parent."""
        return leaves_of(self.parent)

    @property
    def depth(self) -> int:
        """Edges from the root to the deepest node."""
        return depth_of(self.parent)

    def path_to(self, node: int) -> NDArray[np.float64]:
        """Configurations from the root to a node, shape (m, dof).

        Raises:
            LogError: The parents do not lead to a root.
        """
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
                raise LogError(f"node {lineage[-1]} has the parent {above}, which is not there")
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


def leaves_of(parent: NDArray[np.signedinteger[Any]]) -> int:
    """Count the nodes that are nobody's parent, shape (n,)."""
    has_child = np.zeros(len(parent), np.bool_)
    has_child[parent[parent >= 0]] = True
    return len(parent) - int(has_child.sum())


def depth_of(parent: NDArray[np.signedinteger[Any]]) -> int:
    """Count the edges from the root to the deepest node, shape (n,).

    Raises:
        LogError: A node is its own ancestor.
    """
    if (parent < np.arange(len(parent))).all():
        return _depth_in_order(parent)
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
    return int(steps.max(initial=0))


def _depth_in_order(parent: NDArray[np.signedinteger[Any]]) -> int:
    """Do the same where parents come before their children, in blocks that a cache can hold."""
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
        here = np.where(above >= 0, depth[above] + 1, 0) + steps
        depth[first : first + _BLOCK] = here
    return int(depth.max(initial=0))


def forest(events: Events, distance: Distance | None = None) -> Mapping[int, Tree]:
    """Rebuild the trees as they stand after the given events.

    Cut the log with `Events.until` for an earlier instant. Where a node was rewired, the costs of
    its descendants follow; a log does not state those.

    Args:
        events: From the first event on.
        distance: The robot's metric, on rows of configurations (`Point().distance`), to compute
            the lengths of the edges of trees that rewire. By default they are what the log states
            less the parent's cost then, so costs are right to about depth roundings. Trees that
            only grow keep the costs that the log states.

    Raises:
        LogError: A tree's nodes are not numbered 0, 1, 2 ... in order, or a rewire names
            a node that is not there, or closes a circle.
    """
    edges, rewired = events[Kind.EDGE], set(np.unique(events[Kind.REWIRE]["tree"]).tolist())
    trees = {}
    for number in sorted(set(np.unique(edges["tree"]).tolist()) | rewired):
        rows = edges[edges["tree"] == number]
        check_numbers(rows, number, 0)
        tree = Tree(rows["q"], rows["parent"], rows["cost"], rows["seq"])
        trees[number] = (
            _rewired(tree, changes(events, number), distance) if (number in rewired) else tree
        )
    return trees


def _rewired(tree: Tree, made: Changes, distance: Distance | None) -> Tree:
    """Make the changes to a tree that so far has the parents that its nodes were born with."""
    length = None
    if distance is not None:
        length = edge_lengths(tree.q, made, distance)
    ledger = fold(made, length)
    check_made(made, ledger.verdict)
    return Tree(tree.q, ledger.parent.astype(np.int32), ledger.cost, tree.born)


def check_numbers(rows: Table, tree: int, first: int) -> None:
    """See that the edges of a tree number its nodes on from `first`.

    Raises:
        LogError: They do not.
    """
    wrong = np.flatnonzero(rows["node"] != np.arange(first, first + len(rows)))
    if len(wrong):
        at = int(wrong[0])
        row = rows[at]
        raise LogError(
            f"event {row['seq']}: node {row['node']} joins tree {tree} as its node {first + at}"
        )


def check_made(made: Changes, verdict: NDArray[np.uint8]) -> None:
    """See that all changes of a tree could be made.

    Raises:
        LogError: One could not.
    """
    wrong = np.flatnonzero(verdict != SOUND)
    if len(wrong):
        i = int(wrong[0])
        node, parent = int(made.node[i]), int(made.parent[i])
        why = {
            NO_PARENT: f"node {node} gets parent {parent}, which is not there",
            NO_NODE: f"node {node} is rewired before it is there",
            CIRCLE: f"with parent {parent}, node {node} is its own ancestor",
        }[int(verdict[i])]
        raise LogError(f"event {made.seq[i]}: {why}")
