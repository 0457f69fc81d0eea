"""The table of trees: how many nodes and leaves, how deep, and the greatest cost."""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brrt.events import Events, Kind, Table
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
        self._trees: dict[int, _Columns] = {}

    def write(self, events: Events) -> None:
        """Take a batch.

        Raises:
            LogError: A tree's nodes are not numbered 0, 1, 2 ... in order, or a node gets a parent
                that does not exist, or is rewired before it exists.
        """
        edges, rewires = events[Kind.EDGE], events[Kind.REWIRE]
        for number in trees_in(edges, rewires):
            tree = self._trees.setdefault(number, _Columns(number))
            tree.write(*(of_tree(table, number) for table in (edges, rewires)))

    def figures(self) -> list[TreeFigures]:
        """Return the row of each tree.

        Raises:
            LogError: A node is its own ancestor.
        """
        return [self._trees[number].figures(self._distance) for number in sorted(self._trees)]


@dataclass(slots=True)
class _Columns:
    """Columns of a tree's edges and rewires, batch by batch."""

    number: int
    nodes: int = 0
    parents: list[NDArray[np.int32]] = field(default_factory=list)
    costs: list[NDArray[np.float64]] = field(default_factory=list)
    places: list[NDArray[np.float64]] = field(default_factory=list)
    rewires: list[NDArray[np.int32]] = field(default_factory=list)

    def write(self, edges: Table, rewires: Table) -> None:
        """Take the tree's events of a batch."""
        check_numbers(edges, self.number, self.nodes)
        changes = TreeChanges.of(edges, rewires, self.nodes)
        check_verdicts(changes, changes.existence(self.nodes))
        self.nodes += len(edges)
        for column, name in ((self.parents, "parent"), (self.costs, "cost"), (self.places, "q")):
            column.append(edges[name].copy())
        self.rewires.append(np.stack([rewires["node"], rewires["parent"]]))

    def figures(self, distance: Distance) -> TreeFigures:
        """Return the row of the table."""
        parent, cost = np.concatenate(self.parents), np.concatenate(self.costs)
        node, new = np.concatenate(self.rewires, axis=1)
        if len(node):
            parent[node] = new  # of several rewires of a node the last one counts
            cost = final_costs(parent, cost, np.concatenate(self.places), distance)
        greatest = float(cost.max(initial=-np.inf))
        return TreeFigures(self.number, len(parent), leaves_of(parent), depth_of(parent), greatest)
