"""The history of a node, or of a cell, at any instant, against a slow twin."""

import re
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from brrt import Events, Kind, Scenario, read, snapshot
from brrt.events import Reason
from brrt.replay.cell_history import CellHistory
from brrt.replay.node_history import NodeHistory
from tests.conftest import Result, recorded
from tests.support.logs import recording

Command = Callable[..., Result]

STAR = Scenario(
    world="circles2d:n=40,seed=3", planner="rrt-star", iterations=250, seed=7, clock="logical"
)
PAIR = Scenario(
    world="circles2d:n=40,seed=3", planner="bi-rrt-star", iterations=120, seed=2, clock="logical"
)
WALK = Scenario(
    world="circles2d:n=12,size=20,max_radius=2,seed=3", planner="lrta-star", seed=2,
    params={"lookahead": 3, "trials": 2}, clock="logical",
)  # fmt: skip


@dataclass
class Naive:
    """A tree as it changes, event by event, its costs added up anew each time."""

    q: list[Any] = field(default_factory=list)
    parent: list[int] = field(default_factory=list)

    def lineage(self, node: int) -> list[int]:
        """Nodes from the root on."""
        above = self.parent[node]
        return [node] if above < 0 else [*self.lineage(above), node]

    def cost(self, node: int) -> float:
        """Lengths from the root on."""
        way = [self.q[i] for i in self.lineage(node)]
        return float(sum(np.linalg.norm(b - a) for a, b in pairwise(way)))

    def apply(self, event: Any) -> None:
        """Make one change."""
        if "q" in event.dtype.names:
            self.q.append(event["q"])
            self.parent.append(int(event["parent"]))
        else:
            self.parent[event["node"]] = int(event["parent"])


def _cost_changes(log: Events, number: int, node: int) -> tuple[Naive, list[tuple[Any, ...]]]:
    """Replay a tree's events; return it, and each change of the node's cost or parent."""
    events = [e for k in (Kind.EDGE, Kind.REWIRE) for e in log[k] if e["tree"] == number]
    tree, changes = Naive(), []
    for event in sorted(events, key=lambda event: int(event["seq"])):
        rewires = "q" not in event.dtype.names and len(tree.q) > node
        before = (tree.parent[event["node"]], tree.cost(node)) if rewires else None
        tree.apply(event)
        if before is not None:
            after = tree.cost(node)
            if event["node"] == node or abs(after - before[1]) > 1e-9:
                changes.append((int(event["seq"]), int(event["node"]), *before, after))
    return tree, changes


@settings(max_examples=30)
@given(data=st.data())
def test_the_history_of_a_node(data: st.DataObject) -> None:
    """Its parents, costs, rewires, subtree and rejections at any instant, against a slow twin."""
    scenario = data.draw(st.sampled_from([STAR, PAIR]))
    _, log = recorded(scenario)
    at = data.draw(st.integers(20, len(log) - 1))
    part = log.until(seq=at)
    number = data.draw(st.sampled_from(np.unique(part[Kind.EDGE]["tree"]).tolist()))
    edges = part[Kind.EDGE][part[Kind.EDGE]["tree"] == number]
    rewired = part[Kind.REWIRE]["node"][part[Kind.REWIRE]["tree"] == number].tolist()
    node = data.draw(st.sampled_from(rewired or [0]) | st.integers(0, len(edges) - 1))
    found = snapshot(recording(scenario, data.draw(st.integers(5, 400))), event=at).node(
        node, number
    )
    assert isinstance(found, NodeHistory)
    naive, expected = _cost_changes(part, number, node)
    assert found.born.event == edges["seq"][node]
    assert (found.born_parent, found.born_cost) == (edges["parent"][node], edges["cost"][node])
    changes = sorted(found.rewires + found.follows, key=lambda change: change.when.event)
    assert [(c.when.event, c.node, c.old_parent) for c in changes] == [c[:3] for c in expected]
    assert np.allclose(
        [(c.before, c.after) for c in changes], [c[3:] for c in expected], rtol=1e-12
    )
    assert all(change.node == node for change in found.rewires)
    assert (found.parent, found.lineage) == (naive.parent[node], naive.lineage(node))
    assert found.cost == pytest.approx(naive.cost(node), rel=1e-12)
    everyone = range(len(naive.q))
    assert found.children == [i for i in everyone if naive.parent[i] == node]
    assert found.descendants == sum(node in naive.lineage(i)[:-1] for i in everyone)
    rejects = part[Kind.REJECT]
    mine = rejects[(rejects["node"] == node) & (rejects["tree"] == number)]
    assert [each.when.event for each in found.rejects] == mine["seq"].tolist()
    for each, row in zip(found.rejects, mine, strict=True):
        # An extension that was rejected for a collision hits an obstacle.
        blocked = row["reason"] in (Reason.COLLISION, Reason.NEAR_BLOCKED, Reason.LINK_BLOCKED)
        assert (each.hit is not None) == blocked


def test_the_sample_is_the_one_that_was_followed() -> None:
    """A node of RRT* lies on the way from its nearest node to the last sample drawn."""
    _, log = recorded(STAR)
    samples = log[Kind.SAMPLE]
    for size in (7, 1000):
        run = recording(STAR, size)
        assert snapshot(run).node(0).sample is None  # type: ignore[union-attr]
        for node in range(1, 60, 7):
            found = snapshot(run).node(node)
            assert isinstance(found, NodeHistory)
            assert found.sample is not None
            before = samples[samples["seq"] < found.born.event][-1]
            assert found.sample.when.event == before["seq"]
            assert found.sample.q == before["q"].tolist()


def test_waypoints_are_nodes() -> None:
    """Each waypoint is a node, and the history has its number."""
    run, (_, log) = recording(STAR), recorded(STAR)
    raw = next(p for p in log[Kind.PATH][::-1] if p["stage"] != 1)["waypoints"]
    tree = snapshot(run).forest[0]
    for i, q in enumerate(raw):
        node = int(np.flatnonzero((tree.q == q).all(axis=1))[0])
        found = snapshot(run).node(node)
        assert isinstance(found, NodeHistory)
        assert found.paths["raw"] == i
        assert np.array_equal(tree.q[found.lineage], raw[: i + 1])


def test_a_cells_history() -> None:
    """Expansions, estimates and visits of each cell are the log's, and estimates never fall."""
    _, log = recorded(WALK)
    run = recording(WALK)
    for cell in np.unique(log[Kind.EXPAND]["cell"])[::7].tolist():
        found = snapshot(run).node(cell)
        assert isinstance(found, CellHistory)
        for kind, listed in (
            (Kind.EXPAND, [look.when.event for look in found.looks]),
            (Kind.HEURISTIC, [lesson.when.event for lesson in found.lessons]),
            (Kind.MOVE, [visit.event for visit in found.visits]),
        ):
            assert listed == log[kind]["seq"][log[kind]["cell"] == cell].tolist()
        steps = [found.distance, *(lesson.after for lesson in found.lessons)]
        assert steps == sorted(steps)
        assert [lesson.before for lesson in found.lessons] == steps[:-1]
        assert found.estimate == steps[-1]


def test_node_on_the_command_line(brrt: Command) -> None:
    """For people and as JSON, which is what Python has."""
    brrt("plan", "--planner", "bi-rrt-star", "--iterations", 200, "--out", "a.mcap")
    found = snapshot(read(Path("a.mcap")), iteration=150)
    node = int(found.events[Kind.REWIRE]["node"][found.events[Kind.REWIRE]["tree"] == 1][-1])
    at = ("--at-iteration", 150)
    done = brrt("replay", "a.mcap", "--node", node, "--tree", "goal", *at, "--json")
    assert done.json == found.node(node, 1).as_dict()
    assert brrt("replay", "a.mcap", "--node", node, "--tree", 1, *at, "--json").json == done.json
    shown = brrt("replay", "a.mcap", "--node", node, "--tree", "goal", *at)
    assert (shown.code, shown.err) == (0, "")
    assert f"{node} of tree 1 (goal)" in shown.out
    assert "rewired" in shown.out
    late = brrt("replay", "a.mcap", "--node", 0, "--at", "1000s")
    assert late.err.startswith("brrt: the recording ends at")
    brrt("plan", "--planner", "lrta-star", "--world", "empty2d:size=5", "--out", "b.mcap")
    assert "estimate" in brrt("replay", "b.mcap", "--node", 0).out


@pytest.mark.parametrize(
    ("planner", "args", "message"),
    [
        ("rrt", "--node 999", "tree 0 (start) has the nodes 0 to "),
        ("rrt", "--node -1", "node -1 does not exist at this instant: tree 0 (start) has"),
        (
            "rrt",
            "--node 1 --tree goal",
            "tree 1 (goal) has no nodes at this instant; trees with nodes: tree 0 (start)",
        ),
        ("rrt", "--node 1 --tree gaol", "--tree must be start, goal or the number of a tree"),
        ("rrt", "--tree goal", "add --node"),
        ("rrt", "--node 1 --text", "--node excludes --text"),
        ("a-star", "--node 1000000", "have the numbers 0 to "),
        ("a-star", "--node 1 --tree 1", "has cells and no trees; give no tree"),
    ],
)
def test_bad_nodes_are_one_line(planner: str, args: str, message: str, brrt: Command) -> None:
    """Exit code 2 and one line that names what exists: nodes, or cells of a lattice."""
    brrt("plan", "--planner", planner, "--world", "empty2d:size=5", "--out", "a.mcap")
    done = brrt("replay", "a.mcap", *args.split())
    assert (done.code, done.out) == (2, "")
    assert message in done.err
    assert done.err.count("\n") == 1


def test_rejections_left_out_add_up(brrt: Command) -> None:
    """Of many rejections, four and the last are listed; with those left out they are all."""
    brrt("plan", "--world", "gap2d:gap=1", "--iterations", 500, "--out", "run.mcap")
    node = int(np.bincount(read(Path("run.mcap")).events()[Kind.REJECT]["node"]).argmax())
    done = brrt("replay", "run.mcap", "--node", node).out
    total = re.search(r"(\d+) extensions? from this node", done)
    more = re.search(r"\.\.\. (\d+) more, the last:", done)
    assert total is not None
    assert more is not None
    listed = re.findall(r"^ +event ", done, re.MULTILINE)
    assert int(total[1]) == len(listed) + int(more[1])
