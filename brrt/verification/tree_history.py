"""All that happens to one tree, with its costs at every moment."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from brrt.events import Events, Kind, Table
from brrt.replay.cost_history import CostHistory
from brrt.replay.forest import exists
from brrt.replay.tree_fold import VALID, CostFold, Distance, TreeChanges, fold_costs, of_tree

Floats = NDArray[np.float64]
Ints = NDArray[np.signedinteger[Any]]
Flags = NDArray[np.bool_]

_CHUNK = 1 << 18


def _in_order(table: Table) -> Table:
    """Return events by number; the table itself where it is in order, as logs should be."""
    if (np.diff(table["seq"]) >= 0).all():
        return table
    return table[np.argsort(table["seq"], kind="stable")]


@dataclass(frozen=True, eq=False)
class TreeHistory:
    """The edges and rewires of a tree, and what a fold finds of each.

    Attributes:
        number: The tree's number.
        edges: Its edges; node n is the n-th.
        rewires: Its rewires.
        changes: Both, in the order of the log.
        length: Length of the edge that each change makes, nan for roots, shape (m,).
        fold: Costs at each change, and whether it can be made.
    """

    number: int
    edges: Table
    rewires: Table
    changes: TreeChanges
    length: Floats
    fold: CostFold

    @classmethod
    def of(cls, number: int, events: Events, distance: Distance) -> Self:
        """Fold the tree of a number; vertices, cuts and removals are edges and rewires here.

        Args:
            number: The tree's number.
            events: What `as_forest` returns.
            distance: The robot's metric.
        """
        tables = (of_tree(events[kind], number) for kind in (Kind.EDGE, Kind.REWIRE))
        edges, rewires = map(_in_order, tables)
        changes = TreeChanges.of(edges, rewires)
        length = changes.lengths(np.asarray(edges["q"]), distance)
        return cls(number, edges, rewires, changes, length, fold_costs(changes, length))

    def __len__(self) -> int:
        return len(self.edges)

    @property
    def q(self) -> Floats:
        """Configurations of the nodes, shape (n, dof)."""
        return np.asarray(self.edges["q"])

    def of_edges(self, column: NDArray[Any]) -> NDArray[Any]:
        """Return the values of edges from a column of all changes."""
        return column[self.changes.joins] if len(self.rewires) else column

    def of_rewires(self, column: NDArray[Any]) -> NDArray[Any]:
        """Return the values of rewires from a column of all changes."""
        return column[~self.changes.joins] if len(self.rewires) else column[:0]

    @cached_property
    def connected(self) -> Flags:
        """Which changes can be made and have a parent, shape (m,)."""
        return np.asarray((self.fold.verdict == VALID) & (self.changes.parent >= 0))

    @cached_property
    def new_cost(self) -> Floats:
        """Costs that the changes lead to by the parent's cost and the distance, shape (m,)."""
        return self.fold.parent_cost + self.length

    @cached_property
    def stated_before(self) -> Floats:
        """What the last event of its node stated as its cost, nan for the first one, shape (m,)."""
        order = np.argsort(self.changes.node, kind="stable")
        node, stated = self.changes.node[order], self.changes.stated[order]
        found = np.full(len(order), np.nan)
        found[order[1:]] = np.where(node[1:] == node[:-1], stated[:-1], np.nan)
        return found

    def parents(self, seq: Ints, node: Ints) -> Ints:
        """Return the parents of nodes right before events, -1 without one, shape (k,)."""
        count = np.searchsorted(self.changes.seq, seq, side="left")
        change = self._history.latest(node, count)
        parent = np.where(change >= 0, self.changes.parent[change], -1)
        return np.asarray(np.maximum(parent, -1))

    def exist(self, seq: Ints, node: Ints) -> Flags:
        """Return which nodes exist at events, removed or not, shape (k,)."""
        return exists(node, seq, self.edges["seq"])

    def chunks(self) -> Iterator[slice]:
        """Yield slices of the edges, of which there may be millions."""
        for first in range(0, len(self.edges), _CHUNK):
            yield slice(first, min(first + _CHUNK, len(self.edges)))

    @cached_property
    def _history(self) -> CostHistory:
        return CostHistory(self.changes, self.length, self.fold.verdict == VALID)

    def costs(self, seq: Ints, node: Ints) -> Floats:
        """Return what nodes cost after events, nan where they do not exist yet, shape (k,)."""
        if len(self.rewires):
            return self._history.at(seq, node)[0]
        exist = (node >= 0) & (node < np.searchsorted(self.edges["seq"], seq, side="right"))
        cost = np.full(len(node), np.nan)
        cost[exist] = self.fold.cost[node[exist]]
        return cost
