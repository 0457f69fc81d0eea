"""Figures of trees, followed batch by batch, against the forest rebuilt at once."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from brrt import Events, Kind, RecordingError, Scenario, forest
from brrt.replay.forest import depth_of
from brrt.replay.tree_stats import TreeFigures, TreeStats
from brrt.robots import Point
from tests.conftest import recorded
from tests.support.logs import split

GROWS = Scenario(world="circles2d:n=40,seed=3", seed=7, planner="bi-rrt", clock="logical")
REWIRES = replace(GROWS, planner="rrt-star", iterations=600)
BOTH = replace(GROWS, planner="bi-rrt-star", iterations=300)


def followed(batches: list[Events]) -> list[TreeFigures]:
    """Follow the trees."""
    growth = TreeStats(Point().distance)
    for batch in batches:
        growth.write(batch)
    return growth.figures()


@pytest.mark.parametrize("scenario", [GROWS, REWIRES, BOTH], ids=lambda s: str(s.planner))
@settings(max_examples=12)
@given(data=st.data())
def test_figures_are_the_forests(scenario: Scenario, data: st.DataObject) -> None:
    """At any instant, and whatever the batches, the figures are those of the trees."""
    _, log = recorded(scenario)
    part = log.until(seq=data.draw(st.integers(0, len(log) - 1)))
    found = followed(split(part, data.draw(st.integers(5, 900))))
    trees = forest(part)
    assert [figures.tree for figures in found] == list(trees)
    for figures in found:
        tree = trees[figures.tree]
        assert figures[1:4] == (len(tree), tree.leaves, tree.depth)
        assert figures.greatest_cost == pytest.approx(tree.cost.max(), rel=1e-12)


@settings(max_examples=20)
@given(seed=st.integers(0, 2**32), n=st.integers(1, 30_000), near=st.sampled_from([1, 40, 10**6]))
def test_depth_of_trees_larger_than_a_block(seed: int, n: int, near: int) -> None:
    """Depth against one node after another; the order of the nodes does not matter."""
    rng = np.random.default_rng(seed)
    back = rng.integers(1, near + 1, n)
    parent = np.maximum(np.arange(n) - back, 0)
    parent[0] = -1
    depths = [0] * n
    for node, above in enumerate(parent.tolist()):
        depths[node] = depths[above] + 1 if node else 0
    assert depth_of(parent) == max(depths)
    names = rng.permutation(n)
    shuffled = np.empty(n, np.int64)
    shuffled[names] = np.where(parent < 0, -1, names[parent])
    assert depth_of(shuffled) == max(depths)


def test_wrong_trees_are_refused() -> None:
    """A gap, a parent that is not there, and a rewire of what is not there."""
    _, log = recorded(GROWS)
    for name, value, words in (
        ("node", 9, "joins tree 0 as its node"),
        ("parent", 10**6, "which does not exist"),
    ):
        edges = log[Kind.EDGE].copy()
        row = np.flatnonzero(edges["tree"] == 0)[5]
        edges[name][row] = value
        with pytest.raises(RecordingError, match=words):
            followed([Events(2, {Kind.EDGE: edges})])
    _, log = recorded(REWIRES)
    rewires = log[Kind.REWIRE].copy()
    rewires["node"][0] = 10**6
    with pytest.raises(RecordingError, match="rewired before it exists"):
        followed([Events(2, {**log.tables, Kind.REWIRE: rewires})])
