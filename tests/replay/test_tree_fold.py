"""The fold of costs and the cost history, against a twin that walks up to the root each time."""

from dataclasses import dataclass, field

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from brrt.replay.cost_history import CostHistory
from brrt.replay.tree_fold import (
    CYCLE,
    DETACHED,
    NO_NODE,
    NO_PARENT,
    VALID,
    TreeChanges,
    fold_costs,
)

Floats = NDArray[np.float64]


@dataclass
class Twin:
    """A tree in dictionaries; costs are summed from the root on, anew each time."""

    parent: dict[int, int] = field(default_factory=dict)
    length: dict[int, float] = field(default_factory=dict)
    root: dict[int, float] = field(default_factory=dict)

    def cost(self, node: int) -> float:
        """Cost of a node; nan where it does not exist."""
        if node not in self.parent:
            return np.nan
        if self.parent[node] < 0:
            return self.root[node]
        return self.cost(self.parent[node]) + self.length[node]

    def descends(self, node: int, root: int) -> bool:
        """Whether a node is `root` or below it."""
        return node == root or (node >= 0 and self.descends(self.parent[node], root))

    def change(
        self, node: int, parent: int, stated: float, joins: bool, length: float
    ) -> tuple[float, float, int]:
        """Make a change; return the parent's cost, the node's cost before, and the verdict."""
        if joins:
            self.parent[node], self.root[node] = -1, stated
            if parent < 0 or parent == node or parent not in self.parent:
                return np.nan, np.nan, VALID if parent < 0 else NO_PARENT
        elif node not in self.parent:
            return np.nan, np.nan, NO_NODE
        elif parent == DETACHED:
            before = self.cost(node)
            self.parent[node], self.root[node] = -1, np.inf
            return np.nan, before, VALID
        elif parent not in self.parent:
            return np.nan, np.nan, NO_PARENT
        above, before = self.cost(parent), np.nan if joins else self.cost(node)
        if not joins and self.descends(parent, node):
            return above, before, CYCLE
        self.parent[node] = parent
        self.length[node] = length
        if np.isnan(length):
            self.length[node] = 0.0 if np.isinf(above) else stated - above
        return above, before, VALID


@st.composite
def logs(draw: st.DrawFn) -> tuple[TreeChanges, Floats | None]:
    """Changes of a tree, some of which cannot be made, and lengths, some of them below 0."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    m, broken = draw(st.integers(1, 80)), 0.1 * draw(st.booleans())
    joins = rng.random(m) < rng.random()
    count = np.cumsum(joins)
    node = np.where(joins, count - 1, (rng.random(m) * count).astype(int))
    parent = (rng.random(m) * (count - joins)).astype(int) - (count == joins)
    node = np.where(~joins & (rng.random(m) < broken), rng.integers(-2, m, m), node)
    parent = np.where(rng.random(m) < broken, rng.integers(-2, m, m), parent)
    detached = ~joins & (rng.random(m) < 0.2 * draw(st.booleans()))
    parent = np.where(detached, DETACHED, parent).astype(np.int32)
    stated = np.where(detached, np.inf, 9 * rng.random(m))
    changes = TreeChanges(np.cumsum(rng.integers(1, 3, m)), node, parent, stated, joins)
    length = rng.random(m) - draw(st.sampled_from([0.0, 0.3]))
    return changes, draw(st.sampled_from([None, length]))


def rows(changes: TreeChanges, some: slice) -> TreeChanges:
    """Some of the changes."""
    seq, node, parent, stated, joins = changes
    return TreeChanges(seq[some], node[some], parent[some], stated[some], joins[some])


@given(logs())
def test_fold_is_the_twin(log: tuple[TreeChanges, Floats | None]) -> None:
    """Bit for bit: costs at each change, verdicts, and the tree at the end."""
    changes, length = log
    found, twin = fold_costs(changes, length), Twin()
    measured = np.full(len(changes.seq), np.nan) if length is None else length
    each = zip(*(column.tolist() for column in (*changes[1:], measured)), strict=True)
    steps = [twin.change(*row) for row in each]
    for column, expected in zip(found[:3], zip(*steps, strict=True), strict=True):
        np.testing.assert_array_equal(column, expected)
    nodes = range(int(changes.joins.sum()))
    assert found.parent.tolist() == [twin.parent[node] for node in nodes]
    assert found.cost.tolist() == [twin.cost(node) for node in nodes]


@given(logs(), st.integers(0, 2**32))
def test_cost_history_is_the_fold_cut_short(
    log: tuple[TreeChanges, Floats | None], seed: int
) -> None:
    """A cost at a moment is that after the changes so far; it stays until the change stated."""
    changes, length = log
    full = fold_costs(changes, length)
    if length is None:
        known = np.where(np.isinf(full.parent_cost), 0.0, changes.stated - full.parent_cost)
        length = np.where(full.verdict == VALID, known, np.nan)
    history = CostHistory(changes, length, full.verdict == VALID)
    rng = np.random.default_rng(seed)
    seq = rng.integers(0, changes.seq[-1] + 3, 30)
    node = rng.integers(-1, len(full.cost) + 2, 30)
    cost, until = history.at(seq, node)
    m = len(changes.seq)
    ends = [fold_costs(rows(changes, slice(i)), length[:i]) for i in range(m + 1)]
    for s, k, found, last in zip(seq, node.tolist(), cost, until.tolist(), strict=True):
        first = int(np.searchsorted(changes.seq, s, side="right"))
        costs = [end.cost[k] if 0 <= k < len(end.cost) else np.nan for end in ends]
        np.testing.assert_equal(found, costs[first])
        if not np.isnan(found):
            assert first <= last <= m
            assert set(costs[first : last + 1]) == {found}


@pytest.mark.parametrize("order", [[0, 2, 1, 3], [3, 2, 1, 0]])
def test_nodes_that_join_out_of_order(order: list[int]) -> None:
    """The fold ends, and gives each change a verdict, even where a node has children too early."""
    node, parent = np.array([*order, 0]), np.array([1, 2, 3, 0, 3])
    changes = TreeChanges(np.arange(5), node, parent, np.zeros(5), np.arange(5) < 4)
    found = fold_costs(changes, np.ones(5))
    assert len(found.verdict) == 5
    assert np.isfinite(found.cost).all()
