"""The history of a node of a graph: links, checked motions, lost parents, its removal."""

import json
from pathlib import Path

import pytest

from brrt import read, record, snapshot
from brrt.replay.node_history import NodeHistory
from tests.support.graphs import WORLD


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """A graph with a node, 1, that gets links and loses them, a parent, and itself."""
    with record(tmp_path / "g.mcap", world=WORLD) as rec:
        rec.edge([1, 1])  # event 1
        assert rec.vertex([4, 5]) == 1
        rec.vertex([1, 5])
        rec.check(0, 1)
        rec.check(1, None, 0.5, q=[9, 9])  # event 5
        rec.rewire(1, 0)
        rec.link(1, 2)
        rec.rewire(2, 1)  # event 8
        rec.cut(1, 2)
        rec.link(2, 1, cost=8)  # event 10
        rec.cut(1)
        rec.remove(1)  # event 12
    return tmp_path / "g.mcap"


def test_history_of_a_graph(path: Path) -> None:
    """At the end everything is gone; before, it is there."""
    run = read(path)
    node = snapshot(run).node(1)
    assert isinstance(node, NodeHistory)
    assert [(link.other, link.cost) for link in node.links] == [(2, 8.0)]
    assert [link.gone and link.gone.event for link in node.links] == [12]
    assert node.removed is not None
    assert [(each.node, each.other, each.part) for each in node.checks] == [(0, 1, 1), (1, -1, 0.5)]
    changes = [(each.old_parent, each.parent, each.when.event) for each in node.rewires]
    assert changes == [(-1, 0, 6), (0, -1, 11)]
    assert node.lineage == [1]
    text = json.dumps(node.as_dict(), allow_nan=False)
    assert json.loads(text)["born_cost"] is None
    earlier = snapshot(run, event=9).node(2)
    assert isinstance(earlier, NodeHistory)
    assert [link.gone and link.gone.event for link in earlier.links] == [9]
    assert [(each.old_parent, each.parent) for each in earlier.rewires] == [(-1, 1), (1, -1)]
    assert snapshot(run, event=8).forest[0].neighbours(1).tolist() == [0, 2]


def test_links_of_an_instant(path: Path) -> None:
    """Links that are cut are there before."""
    run = read(path)
    counts = [len(snapshot(run, event=event).forest[0].links) for event in (6, 7, 9, 10, 12)]
    assert counts == [0, 1, 0, 1, 0]
    metrics = snapshot(run).metrics.as_dict()
    keys = ("nodes", "edges", "vertices", "graph_edges", "cuts", "removals", "checks")
    assert [metrics[key] for key in keys] == [2, 1, 2, 2, 2, 1, 2]
