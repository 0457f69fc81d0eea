"""The fold of trees that rewire, against a twin that walks every node up to its root."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from brrt import Events, Kind, RecordingError, Scenario, forest
from brrt.events import table_dtype
from brrt.robots import Point
from tests.conftest import recorded

Floats = NDArray[np.float64]
DISTANCE = Point().distance
SCENARIO = Scenario(world="circles2d:n=40,seed=3", seed=7, clock="logical")


class Twin:
    """Trees as lists; a cost is the way up to the root, summed anew each time."""

    def __init__(self) -> None:
        self.q: list[Floats] = []
        self.parent: list[int] = []

    def cost(self, node: int) -> float:
        """Length of the way from the root."""
        up = self.parent[node]
        if up < 0:
            return 0.0
        return self.cost(up) + float(np.sqrt(((self.q[node] - self.q[up]) ** 2).sum()))

    def ancestors(self, node: int) -> set[int]:
        """The node and all above it."""
        return {node} if self.parent[node] < 0 else {node} | self.ancestors(self.parent[node])


@st.composite
def logs(draw: st.DrawFn) -> tuple[Events, list[Twin]]:
    """Two trees that grow and rewire at random, with the costs that a planner would state."""
    seed, n = draw(st.integers(0, 2**32)), draw(st.integers(2, 60))
    rng = np.random.default_rng(seed)
    twins, edges, rewires = [Twin(), Twin()], [], []
    for seq in range(n):
        tree = int(rng.integers(2)) if seq >= 2 else seq
        twin, stamp = twins[tree], (seq, seq, seq, tree)
        if seq < 2 or rng.random() < 0.6:
            twin.q.append(rng.random(3))
            twin.parent.append(int(rng.integers(len(twin.parent))) if twin.parent else -1)
            node = len(twin.q) - 1
            edges.append((*stamp, node, twin.parent[node], twin.cost(node), twin.q[node]))
            continue
        node, parent = (int(x) for x in rng.integers(len(twin.q), size=2))
        if node not in twin.ancestors(parent) and twin.parent[node] >= 0:
            twin.parent[node] = parent
            rewires.append((*stamp, node, parent, twin.cost(node)))
    tables = {Kind.EDGE: edges, Kind.REWIRE: rewires}
    return Events(3, {k: np.array(t, table_dtype(k, 3)) for k, t in tables.items() if t}), twins


@given(logs(), st.booleans())
def test_fold_is_the_twin(log: tuple[Events, list[Twin]], measured: bool) -> None:
    """Parents and all costs, descendants' too, are those of the twin."""
    events, twins = log
    trees = forest(events, DISTANCE if measured else None)
    assert sorted(trees) == [0, 1]
    for number, twin in enumerate(twins):
        tree = trees[number]
        assert tree.parent.tolist() == twin.parent
        assert (tree.q == np.array(twin.q)).all()
        costs = [twin.cost(node) for node in range(len(twin.q))]
        np.testing.assert_allclose(tree.cost, costs, rtol=1e-12, atol=1e-12)
        assert tree.depth == max(len(twin.ancestors(node)) - 1 for node in range(len(twin.q)))


@given(logs(), st.integers(0, 60))
def test_an_instant_forgets_what_came_later(log: tuple[Events, list[Twin]], seq: int) -> None:
    """Parents as of an event are those that the last change up to it gave."""
    events, _ = log
    part = events.until(seq=seq)
    for number, tree in forest(part).items():
        parents = {}
        for kind in (Kind.EDGE, Kind.REWIRE):  # in this order: a node joins before it is rewired
            for row in part[kind][part[kind]["tree"] == number]:
                parents[int(row["node"])] = int(row["parent"])
        assert tree.parent.tolist() == [parents[node] for node in range(len(tree))]


def tree_of(*rewires: tuple[int, int]) -> Events:
    """A chain 0 - 1 - 2 - 3 of unit edges, then rewires (node, parent)."""
    edges = [(i, i, i, 0, i, i - 1, float(i), (float(i), 0.0)) for i in range(4)]
    more = [(4 + i, 4 + i, 4 + i, 0, *pair, 1.0) for i, pair in enumerate(rewires)]
    tables = {Kind.EDGE: edges, Kind.REWIRE: more}
    return Events(2, {k: np.array(t, table_dtype(k, 2)) for k, t in tables.items()})


def test_descendants_follow() -> None:
    """Node 2 moves up to the root by an edge said to be 1 long: node 3 comes 1 nearer."""
    assert forest(tree_of((2, 0)))[0].cost.tolist() == [0, 1, 1, 2]
    assert forest(tree_of((2, 0)), DISTANCE)[0].cost.tolist() == [0, 1, 2, 3]


@pytest.mark.parametrize(
    ("rewire", "message"),
    [
        ((1, 3), "event 4: with parent 3, node 1 is its own ancestor"),
        ((2, 2), "event 4: with parent 2, node 2 is its own ancestor"),
        ((2, 9), "event 4: node 2 gets parent 9, which does not exist"),
        ((2, -1), "event 4: node 2 gets parent -1, which does not exist"),
        ((9, 0), "event 4: node 9 is rewired before it exists"),
        ((-5, 0), "event 4: node -5 is rewired before it exists"),
    ],
)
def test_impossible_rewires(rewire: tuple[int, int], message: str) -> None:
    """What cannot be done is an error that names the event."""
    with pytest.raises(RecordingError, match=message):
        forest(tree_of(rewire))


def test_forest_is_the_planners_tree() -> None:
    """Parents come before children, costs add up, and the path lies in the tree."""
    _, log = recorded(SCENARIO)
    tree = forest(log)[0]
    assert len(tree) == len(log[Kind.EDGE])
    rest = np.arange(1, len(tree))
    assert tree.parent[0] == -1
    assert (tree.parent[1:] < rest).all()
    step = np.linalg.norm(tree.q[1:] - tree.q[tree.parent[1:]], axis=1)
    assert np.allclose(tree.cost[1:], tree.cost[tree.parent[1:]] + step, rtol=1e-12)
    raw = log[Kind.PATH][0]
    assert np.array_equal(tree.path_to(len(tree) - 1), raw["waypoints"])
    assert tree.cost[-1] == raw["cost"]


def test_forest_depth_and_leaves() -> None:
    """Depth and leaves, against walking every node up to the root."""
    _, log = recorded(SCENARIO)
    tree = forest(log)[0]
    depths = [len(tree.path_to(node)) - 1 for node in range(len(tree))]
    assert tree.depth == max(depths)
    assert tree.leaves == sum(node not in tree.parent for node in range(len(tree)))


def test_forest_at_any_instant_is_a_prefix() -> None:
    """Cut at any event, the forest holds the nodes that were there by then."""
    _, log = recorded(SCENARIO)
    for seq in range(0, len(log), 17):
        part = log.until(seq=seq)
        assert len(part) == seq + 1
        edges = part[Kind.EDGE]
        assert sum(len(t) for t in forest(part).values()) == len(edges)
        assert (edges["seq"] <= seq).all()


def test_forest_refuses_gaps_and_circles() -> None:
    """A node that is missing or its own ancestor is an error that names it."""
    _, log = recorded(SCENARIO)
    edges = log[Kind.EDGE].copy()
    edges["node"][5] = 9
    with pytest.raises(RecordingError, match="node 9 joins tree 0 as its node 5"):
        forest(Events(2, {Kind.EDGE: edges}))
    edges = log[Kind.EDGE].copy()
    edges["parent"][3] = 3
    tree = forest(Events(2, {Kind.EDGE: edges}))[0]
    with pytest.raises(RecordingError, match="its own ancestor"):
        tree.path_to(3)
    with pytest.raises(RecordingError, match="its own ancestor"):
        _ = tree.depth
