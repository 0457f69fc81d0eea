"""Graphs and pruning: the fold against a twin in dictionaries, at any instant."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from brrt import BrrtError, Kind, Memory, forest
from brrt.events import Events
from brrt.replay.forest import Tree
from brrt.replay.graph import GraphFold, as_forest
from brrt.replay.tree_stats import TreeStats
from brrt.robots import Point
from tests.support.graphs import Twin, random_graph

DISTANCE = Point().distance


@st.composite
def graphs(draw: st.DrawFn) -> Memory:
    """Random graphs with pruning."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    return random_graph(rng, draw(st.integers(0, 60)))


def compare(tree: Tree, twin: Twin) -> None:
    """A tree is the twin's."""
    alive = np.setdiff1d(np.arange(len(tree)), tree.removed).tolist()
    assert alive == sorted(twin.parent)
    assert [int(tree.parent[node]) for node in alive] == [twin.parent[node] for node in alive]
    np.testing.assert_allclose(tree.cost[alive], [twin.cost(node) for node in alive], atol=1e-9)
    links = {
        frozenset((int(row["node"]), int(row["other"]))): float(row["cost"]) for row in tree.links
    }
    assert links == twin.links
    for node in alive:
        ends = {other for pair in links if node in pair for other in pair - {node}}
        ends |= {other for other in alive if twin.parent[other] == node} | {twin.parent[node]}
        assert set(tree.neighbours(node).tolist()) == ends - {-1}


@given(graphs(), st.data())
def test_graph_is_the_twin_at_any_instant(memory: Memory, data: st.DataObject) -> None:
    """Nodes, parents, costs and links after every event, so that one can go back, too."""
    events = memory.events()
    until = events.until(seq=data.draw(st.integers(1, len(events))))
    trees = forest(until, DISTANCE)
    compare(trees[0], Twin.of(until))


@given(graphs())
def test_batches_make_no_difference(memory: Memory) -> None:
    """Batch by batch, edges and rewires are those of the whole log; so is the table of trees."""
    whole, fold, stats = memory.events(), GraphFold(), TreeStats(DISTANCE)
    parts = []
    for batch in memory.batches:
        parts.append(fold.take(batch))
        stats.write(batch)
    made, joined = as_forest(whole), Events.concat(2, parts)
    for kind in (Kind.EDGE, Kind.REWIRE):
        for name in made[kind].dtype.names or ():
            assert np.array_equal(made[kind][name], joined[kind][name])
    tree = forest(whole, DISTANCE)[0]
    (found,) = stats.figures()
    assert found.nodes == len(tree) - len(tree.removed)
    assert (found.leaves, found.links) == (tree.leaves, len(tree.links))
    finite = tree.cost[np.isfinite(tree.cost)]
    assert found.greatest_cost == pytest.approx(finite.max(initial=-np.inf))


@given(graphs(), st.integers(0, 2**32))
def test_removed_nodes_are_used_no_more(memory: Memory, seed: int) -> None:
    """An event that names one is an error that says so."""
    events, rng = memory.events(), np.random.default_rng(seed)
    removed = events[Kind.REMOVE]
    links = events[Kind.LINK]
    if not len(removed) or not len(links):
        return
    links = links.copy()
    row = int(rng.integers(len(links)))
    gone = removed[removed["seq"] < links["seq"][row]]
    if len(gone):
        links["other"][row] = gone["node"][0]
        with pytest.raises(BrrtError, match=rf"event {links['seq'][row]}: node .* was removed"):
            forest(Events(2, {**events.tables, Kind.LINK: links}))
