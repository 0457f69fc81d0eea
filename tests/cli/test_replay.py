"""The fold: trees and figures from events alone, and where two logs part."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from brrt import Events, Kind, Metrics, RecordingError, Scenario, first_difference, forest
from tests.conftest import recorded

SCENARIO = Scenario(world="circles2d:n=40,seed=3", seed=7, clock="logical")


def cut(log: Events, size: int) -> list[Events]:
    """Cut a log into batches of so many events."""
    ends = range(size - 1, len(log) + size, size)
    firsts = [0, *(end + 1 for end in ends)]
    return [
        Events(log.dof, {k: t[np.searchsorted(t["seq"], first) :] for k, t in part.tables.items()
                         if len(t) > np.searchsorted(t["seq"], first)})
        for first, part in zip(firsts, (log.until(seq=end) for end in ends), strict=False)
    ]  # fmt: skip


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


def test_metrics_are_a_fold() -> None:
    """Whatever the batches, the figures are the same, and they are the log's."""
    run, log = recorded(SCENARIO)
    figures = []
    for size in (13, 70, 10_000):
        metrics = Metrics(run.manifest)
        for batch in cut(log, size):
            metrics.write(batch)
        figures.append(metrics.as_dict())
    assert figures[0] == figures[1] == figures[2]
    assert figures[0]["events"] == len(log)
    assert figures[0]["samples"] == len(log[Kind.SAMPLE]) == figures[0]["iterations"]
    path = np.array(figures[0]["smoothed_path"])
    length = sum(float(np.linalg.norm(b - a)) for a, b in pairwise(path))
    assert figures[0]["smoothed_cost"] == pytest.approx(length, rel=1e-12)
    assert figures[0]["moves"] == len(path) - 1


@settings(max_examples=60, deadline=None)
@given(data=st.data())
def test_first_difference_is_the_first(data: st.DataObject) -> None:
    """One field of one event is changed: exactly that event is found, whatever the batches."""
    _, log = recorded(SCENARIO)
    kind = data.draw(st.sampled_from([k for k in Kind if len(log[k])]))
    table = log[kind].copy()
    row = data.draw(st.integers(0, len(table) - 1))
    name = data.draw(st.sampled_from([n for n in table.dtype.names or () if n not in ("seq", "t")]))
    value = np.copy(table[name][row])
    changed = np.asarray(value + 1 if value.dtype != bool else ~value)
    if name in ("name", "status", "source", "reason", "stage"):
        changed = np.asarray(1 - min(int(value), 1))
    table[name][row] = changed
    other = Events(log.dof, {**log.tables, kind: table})
    sizes = [data.draw(st.integers(20, 500)) for _ in range(2)]
    found = first_difference(cut(log, sizes[0]), cut(other, sizes[1]))
    if np.array_equal(value, changed):
        assert found is None
        return
    assert found is not None
    assert found.seq == table["seq"][row]
    assert found.left is not None
    assert name in str(found)


def test_times_do_not_count() -> None:
    """The clock is no part of what a run did."""
    _, log = recorded(SCENARIO)
    later = {k: t.copy() for k, t in log.tables.items()}
    for table in later.values():
        table["t"] += 12345
    assert first_difference([log], [Events(2, later)]) is None


def test_an_end_is_a_difference() -> None:
    """A log that stops early parts at its end, from either side."""
    _, log = recorded(SCENARIO)
    short = log.until(seq=40)
    one, two = first_difference([log], [short]), first_difference([short], [log])
    assert one is not None
    assert two is not None
    assert (one.seq, two.seq) == (41, 41)
    assert "the second log has ended" in str(one)
    assert "the first log has ended" in str(two)
    assert first_difference([], []) is None


def test_other_kind_and_other_dimension() -> None:
    """A different kind of event, or a different robot, is said as such."""
    _, log = recorded(SCENARIO)
    _, other = recorded(Scenario(world="circles2d:n=40,seed=3", seed=8, clock="logical"))
    found = first_difference([log], [other])
    assert found is not None
    assert found.seq == 2
    _, solid = recorded(Scenario(world="boxes3d", seed=8, clock="logical"))
    found = first_difference([log], [solid])
    assert found is not None
    assert "dof 2 against 3" in str(found)
