"""The table of trees: how many nodes and leaves, how deep, and the greatest cost."""

from collections import Counter
from typing import Any, NamedTuple

import numpy as np

from brrt.events import Events, Kind
from brrt.replay.forest import check_numbers, check_verdicts, depth_of, final_costs, leaves_of
from brrt.replay.tree_fold import Distance, TreeChanges, of_tree, trees_in


class TreeFigures(NamedTuple):
    """One row of the table.

    Attributes:
        tree: Number of the tree.
        nodes: Nodes.
        leaves: Nodes without children.
        depth: Edges from the root to the deepest node.
        greatest_cost: The greatest cost-to-come.
    """

    tree: int
    nodes: int
    leaves: int
    depth: int
    greatest_cost: float


class TreeStats:
    """A sink that keeps what the table needs: 12 bytes a node, and its configuration."""

    def __init__(self, distance: Distance) -> None:
        self._distance = distance
        self._nodes: Counter[int] = Counter()
        self._parts: dict[int, list[tuple[Any, ...]]] = {}  # columns, batch by batch

    def write(self, events: Events) -> None:
        """Take a batch.

        Raises:
            LogError: A tree's nodes are not numbered 0, 1, 2 ... in order, or a node gets a parent
                that does not exist, or is rewired before it exists.
        """
        for tree in trees_in(events[Kind.EDGE], events[Kind.REWIRE]):
            edges, rewires = (of_tree(events[kind], tree) for kind in (Kind.EDGE, Kind.REWIRE))
            nodes = self._nodes[tree]
            check_numbers(edges, tree, nodes)
            changes = TreeChanges.of(edges, rewires, nodes)
            check_verdicts(changes, changes.existence(nodes))
            self._nodes[tree] += len(edges)
            kept = (edges[name].copy() for name in ("parent", "cost", "q"))
            rewired = np.stack([rewires["node"], rewires["parent"]], axis=1)
            self._parts.setdefault(tree, []).append((*kept, rewired))

    def figures(self) -> list[TreeFigures]:
        """Return the row of each tree.

        Raises:
            LogError: A node is its own ancestor.
        """
        found = []
        for tree, parts in sorted(self._parts.items()):
            parents, costs, places, rewired = zip(*parts, strict=True)
            parent, cost = np.concatenate(parents), np.concatenate(costs)
            node, new = np.concatenate(rewired).T
            if len(node):
                parent[node] = new  # of several rewires of a node the last one counts
                cost = final_costs(parent, cost, np.concatenate(places), self._distance)
            greatest = float(cost.max(initial=-np.inf))
            shape = len(parent), leaves_of(parent), depth_of(parent)
            found.append(TreeFigures(tree, *shape, greatest))
        return found
