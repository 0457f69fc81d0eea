"""Trees in figures: how large, how deep, how dear; configurations are not kept."""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brrt.errors import LogError
from brrt.events import Events, Kind, Table
from brrt.replay.forest import check_made, check_numbers, depth_of, leaves_of
from brrt.replay.ledger import Changes, Standing, merged


class TreeFigures(NamedTuple):
    """What a tree comes to.

    Attributes:
        tree: Its number.
        nodes: Nodes.
        leaves: Nodes that are nobody's parent.
        depth: Edges from the root to the deepest node.
        greatest_cost: The greatest cost-to-come.
    """

    tree: int
    nodes: int
    leaves: int
    depth: int
    greatest_cost: float


class TreeStats:
    """A sink that follows the trees, at 12 bytes a node, and 48 where edges are rewired."""

    def __init__(self) -> None:
        self._trees: dict[int, _Growing] = {}

    def write(self, events: Events) -> None:
        """Take in a batch.

        Raises:
            LogError: A tree's nodes are not numbered 0, 1, 2 ... in order, or a rewire
                cannot be made.
        """
        edges, rewires = events[Kind.EDGE], events[Kind.REWIRE]
        for number in sorted({*_trees_in(edges), *_trees_in(rewires)}):
            tree = self._trees.setdefault(number, _Growing(number))
            tree.write(*(_rows_of(table, number) for table in (edges, rewires)))

    def figures(self) -> list[TreeFigures]:
        """Return the figures of each tree.

        Raises:
            LogError: A node is its own ancestor, or its parent is not there.
        """
        return [self._trees[number].figures() for number in sorted(self._trees)]


def _trees_in(table: Table) -> list[int]:
    return np.flatnonzero(np.bincount(table["tree"])).tolist()


def _rows_of(table: Table, tree: int) -> Table:
    """Return the events of one tree; they are not copied where that is all of them."""
    mine = table["tree"] == tree
    return table if mine.all() else table[mine]


@dataclass(slots=True)
class _Growing:
    """One tree: columns of its edges, up to the first rewire."""

    number: int
    nodes: int = 0
    parents: list[NDArray[np.int32]] = field(default_factory=list)
    costs: list[NDArray[np.float64]] = field(default_factory=list)
    standing: Standing | None = None

    def write(self, edges: Table, rewires: Table) -> None:
        """Take in its events of a batch."""
        check_numbers(edges, self.number, self.nodes)
        first, self.nodes = self.nodes, self.nodes + len(edges)
        if self.standing is None and not len(rewires):
            self.parents.append(edges["parent"].copy())
            self.costs.append(edges["cost"].copy())
            return
        if self.standing is None:
            self.standing = Standing()
            self._change(self._so_far(first))
            self.parents, self.costs = [], []
        self._change(merged(edges, rewires, first))

    def _so_far(self, nodes: int) -> Changes:
        parent, cost = (np.concatenate([[], *parts]) for parts in (self.parents, self.costs))
        count = np.arange(nodes)
        return Changes(count, count, parent.astype(np.int64), cost, np.ones(nodes, np.bool_))

    def _change(self, made: Changes) -> None:
        assert self.standing is not None  # noqa: S101 - the caller's
        check_made(made, self.standing.change(made))

    def figures(self) -> TreeFigures:
        if self.standing is None:
            parent, cost = np.concatenate(self.parents), np.concatenate(self.costs)
        else:
            parent, cost = self.standing.parent.astype(np.int32), self.standing.cost
        if len(parent) and parent.max() >= len(parent):
            raise LogError(
                f"tree {self.number}: node {int(parent.argmax())} has parent {int(parent.max())}, "
                f"which is not there"
            )
        greatest = float(cost.max(initial=-np.inf))
        return TreeFigures(self.number, len(parent), leaves_of(parent), depth_of(parent), greatest)
