"""Trees as graphs: networkx, and GraphML read back by it."""

from dataclasses import replace
from pathlib import Path

import networkx as nx
import numpy as np
import pytest

from brrt import Kind, Recording, read, snapshot
from brrt.exports.graphs import write_graphml
from tests.support.recordings import RECORDINGS


def golden(name: str) -> Recording:
    """A golden recording."""
    return read(RECORDINGS / f"{name}.mcap")


@pytest.mark.parametrize(
    "name", ["circles2d-rrt-star", "polygons2d-polygon", "boxes3d-bi-rrt-star"]
)
def test_trees_and_links(name: str) -> None:
    """Edges lead from parents to children with their lengths; links join the trees."""
    recording = golden(name)
    robot = recording.robot()
    for limits in ({"iteration": 20}, {}):
        graph, run = recording.to_networkx(**limits), snapshot(recording, **limits)
        edges = {
            (number, node): (number, parent)
            for number, tree in run.forest.items()
            for node, parent in enumerate(tree.parent.tolist())
        }
        assert set(graph) == edges.keys()
        found = {b: a for a, b, kind in graph.edges(data="kind") if kind == "edge"}
        assert found == {node: parent for node, parent in edges.items() if parent[1] >= 0}
        links = {(a[1], b[1]) for a, b, kind in graph.edges(data="kind") if kind == "link"}
        table = run.events[Kind.CONNECT]
        assert links == set(zip(table["node"].tolist(), table["other"].tolist(), strict=True))
        for (tree, node), values in graph.nodes(data=True):
            q = [values[f"q_{each}"] for each in robot.coordinates(recording.world)]
            assert q == run.forest[tree].q[node].tolist()
            assert values["cost"] == run.forest[tree].cost[node]
        for a, b, length in graph.edges(data="length"):
            q, r = (run.forest[tree].q[node] for tree, node in (a, b))
            assert length == float(robot.distance(q, r))
        assert graph.graph["planner"] == recording.manifest.scenario.planner


def test_cells_of_a_search() -> None:
    """Each expanded cell is a node, below the cell that it was reached from last."""
    for name in ("squares2d-a-star", "boxes3d-lrta-star"):
        recording = golden(name)
        graph, table = recording.to_networkx(), recording.events()[Kind.EXPAND]
        assert {node for _, node in graph} == set(table["cell"].tolist())
        last = {int(row["cell"]): row for row in table}
        for (_, a), (_, b) in graph.edges:
            assert last[b]["parent"] == a
            assert graph.nodes[0, b]["cost"] == last[b]["cost"]


@pytest.mark.parametrize("name", ["circles2d-rrt-star", "boxes3d-bi-rrt-star", "squares2d-a-star"])
def test_graphml_is_read_back_bit_for_bit(name: str, tmp_path: Path) -> None:
    """Networkx reads the graph that `to_networkx` makes."""
    recording, path = golden(name), tmp_path / "g.graphml"
    for limits in ({"iteration": 50}, {}):
        count = write_graphml(snapshot(recording, **limits), path)
        graph, found = recording.to_networkx(**limits), nx.read_graphml(path)
        assert len(found) == len(graph) == count
        assert found.graph.items() >= graph.graph.items()
        assert dict(found.nodes(data=True)) == {
            f"{tree}:{node}": values for (tree, node), values in graph.nodes(data=True)
        }
        named = {
            (f"{a[0]}:{a[1]}", f"{b[0]}:{b[1]}"): values for a, b, values in graph.edges(data=True)
        }
        assert {(a, b): values for a, b, values in found.edges(data=True)} == named
    assert [each.name for each in tmp_path.iterdir()] == ["g.graphml"]


def test_texts_and_numbers_that_xml_must_escape(tmp_path: Path) -> None:
    """Controls become escapes, markup is escaped, and numbers may be infinite."""
    recording, path = golden("circles2d-rrt"), tmp_path / "g.graphml"
    scenario = replace(recording.manifest.scenario, planner='a<b>&"c"\x1b\x00\ufffe\ud800')
    events = recording.events()
    edges = events[Kind.EDGE].copy()
    edges["cost"][1:4] = [np.inf, -np.inf, np.nan]
    events.tables[Kind.EDGE] = edges  # type: ignore[index]
    recording = replace(
        recording, manifest=replace(recording.manifest, scenario=scenario), batches=lambda: [events]
    )
    write_graphml(snapshot(recording), path)
    found = nx.read_graphml(path)
    assert found.graph["planner"] == 'a<b>&"c"\\x1b\\x00?\\ud800'
    costs = [found.nodes[f"0:{node}"]["cost"] for node in (1, 2, 3)]
    assert str(costs) == "[inf, -inf, nan]"
