"""Travel in time: a run at any instant, and the history of a node, against a slow twin."""

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from brrt import BrrtError, Events, Kind, Metrics, Recording, Scenario, forest, read, snapshot
from brrt.events import Reason
from brrt.replay.cell_history import CellHistory
from brrt.replay.history_records import NodeHistory
from tests.conftest import Result, recorded
from tests.support.logs import split

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


def recording(scenario: Scenario, size: int = 100) -> Recording:
    """A recording of a scenario, in memory."""
    run, log = recorded(scenario)
    parts = split(log, size)
    return Recording(run.manifest, run.problem.world, lambda: iter(parts), None)


@settings(max_examples=40)
@given(data=st.data())
def test_a_moment_is_the_log_up_to_it(data: st.DataObject) -> None:
    """Whatever names the instant: trees, figures and path are those of the events until then."""
    scenario = data.draw(st.sampled_from([STAR, PAIR, WALK]))
    run, log = recorded(scenario)
    name = data.draw(st.sampled_from(["event", "time", "iteration"]))
    last = len(log) if name != "iteration" else log.last.iteration
    at = data.draw(st.integers(0, last + 2))
    # Event n of a logical clock happens at n us.
    limits = {"event": {"seq": at}, "time": {"t": 1000 * at}, "iteration": {"iteration": at}}[name]
    given_: Any = at * 1e-6 if name == "time" else at
    moment = snapshot(recording(scenario, data.draw(st.integers(5, 400))), **{name: given_})
    part = log.until(**limits)
    metrics = Metrics(run.manifest)
    metrics.write(part)
    for each in data.draw(st.permutations(["forest", "metrics", "events", "best_path"])):
        if each == "events":
            assert len(moment.events) == len(part)
            assert all((moment.events[kind]["seq"] == part[kind]["seq"]).all() for kind in Kind)
        elif each == "metrics":
            assert moment.metrics.as_dict() == metrics.as_dict()
        elif each == "forest":
            expected = forest(part)
            assert moment.forest.keys() == expected.keys()
            for number, tree in expected.items():
                assert np.array_equal(moment.forest[number].parent, tree.parent)
                assert np.array_equal(moment.forest[number].cost, tree.cost)
        elif moment.best_path is None:
            assert not len(part[Kind.PATH])
        else:
            cost, waypoints = moment.best_path
            final = part[Kind.PATH][-1]
            assert cost == final["cost"]
            assert np.array_equal(waypoints, final["waypoints"])


def test_no_more_is_read_than_is_needed() -> None:
    """Nothing before something is asked for, and then no batch behind the one that ends it."""
    run, log = recorded(STAR)
    parts, taken = split(log, 50), []

    def batches() -> Iterator[Events]:
        for i, part in enumerate(parts):
            taken.append(i)
            yield part

    whole = Recording(run.manifest, run.problem.world, batches, None)
    moment = snapshot(whole, event=120)
    assert taken == []
    assert len(moment.forest[0]) > 10
    assert taken == [0, 1, 2]
    taken.clear()
    assert len(moment.events) == 121
    assert taken == [0, 1, 2]
    taken.clear()
    # From here on it is in memory.
    assert moment.metrics.as_dict()["events"] == 121
    assert taken == []


@pytest.mark.parametrize(
    "wrong",
    [{"time": -1}, {"time": float("nan")}, {"event": 1.5}, {"iteration": -1}, {"time": 1e30},
     {"time": 1, "event": 1}, {"time": "1ms"}, {"event": True}, {"iteration": [3]}],
)  # fmt: skip
def test_an_instant_that_is_none(wrong: dict[str, Any]) -> None:
    """It is refused before anything is read."""
    with pytest.raises(BrrtError):
        snapshot(recording(STAR), **wrong)


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


def _turns(log: Events, number: int, node: int) -> tuple[Naive, list[tuple[Any, ...]]]:
    """Play a tree's events; return it, and each change of the node's cost or parent."""
    events = [e for k in (Kind.EDGE, Kind.REWIRE) for e in log[k] if e["tree"] == number]
    tree, turns = Naive(), []
    for event in sorted(events, key=lambda event: int(event["seq"])):
        rewires = "q" not in event.dtype.names and len(tree.q) > node
        before = (tree.parent[event["node"]], tree.cost(node)) if rewires else None
        tree.apply(event)
        if before is not None:
            after = tree.cost(node)
            if event["node"] == node or abs(after - before[1]) > 1e-9:
                turns.append((int(event["seq"]), int(event["node"]), *before, after))
    return tree, turns


@settings(max_examples=30)
@given(data=st.data())
def test_a_nodes_history_is_what_happened_to_it(data: st.DataObject) -> None:
    """Birth, rewires, ancestors' rewires, costs, descendants and rejections, at any instant."""
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
    naive, turns = _turns(part, number, node)
    assert found.born.event == edges["seq"][node]
    assert (found.born_parent, found.born_cost) == (edges["parent"][node], edges["cost"][node])
    told = sorted(found.rewires + found.follows, key=lambda turn: turn.when.event)
    assert [(t.when.event, t.node, t.old_parent) for t in told] == [t[:3] for t in turns]
    assert np.allclose([(t.before, t.after) for t in told], [t[3:] for t in turns], rtol=1e-12)
    assert all(turn.node == node for turn in found.rewires)
    assert (found.parent, found.lineage) == (naive.parent[node], naive.lineage(node))
    assert found.cost == pytest.approx(naive.cost(node), rel=1e-12)
    everyone = range(len(naive.q))
    assert found.children == [i for i in everyone if naive.parent[i] == node]
    assert found.descendants == sum(node in naive.lineage(i)[:-1] for i in everyone)
    rejects = part[Kind.REJECT]
    mine = rejects[(rejects["node"] == node) & (rejects["tree"] == number)]
    assert [each.when.event for each in found.rejects] == mine["seq"].tolist()
    for each, row in zip(found.rejects, mine, strict=True):
        # What the planner turned down for a collision hits something.
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


def test_nodes_of_the_path_know_it() -> None:
    """Each waypoint is a node, and the history says which waypoint."""
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
    """Looks, lessons and visits of every cell are the log's, and estimates never fall."""
    _, log = recorded(WALK)
    run = recording(WALK)
    for cell in np.unique(log[Kind.EXPAND]["cell"])[::7].tolist():
        found = snapshot(run).node(cell)
        assert isinstance(found, CellHistory)
        for kind, told in (
            (Kind.EXPAND, [look.when.event for look in found.looks]),
            (Kind.HEURISTIC, [lesson.when.event for lesson in found.lessons]),
            (Kind.MOVE, [visit.event for visit in found.visits]),
        ):
            assert told == log[kind]["seq"][log[kind]["cell"] == cell].tolist()
        steps = [found.distance, *(lesson.after for lesson in found.lessons)]
        assert steps == sorted(steps)
        assert [lesson.before for lesson in found.lessons] == steps[:-1]
        assert found.estimate == steps[-1]


def test_node_on_the_command_line(brrt: Command) -> None:
    """For people and as JSON, which is what Python has."""
    brrt("plan", "--planner", "bi-rrt-star", "--iterations", 200, "--out", "a.mcap")
    moment = snapshot(read(Path("a.mcap")), iteration=150)
    node = int(moment.events[Kind.REWIRE]["node"][moment.events[Kind.REWIRE]["tree"] == 1][-1])
    at = ("--at-iteration", 150)
    done = brrt("replay", "a.mcap", "--node", node, "--tree", "goal", *at, "--json")
    assert done.json == moment.node(node, 1).as_dict()
    assert brrt("replay", "a.mcap", "--node", node, "--tree", 1, *at, "--json").json == done.json
    told = brrt("replay", "a.mcap", "--node", node, "--tree", "goal", *at)
    assert (told.code, told.err) == (0, "")
    assert f"{node} of tree 1 (goal)" in told.out
    assert "rewired" in told.out
    late = brrt("replay", "a.mcap", "--node", 0, "--at", "1000s")
    assert late.err.startswith("brrt: the recording ends at")
    brrt("plan", "--planner", "lrta-star", "--world", "empty2d:size=5", "--out", "b.mcap")
    assert "estimate" in brrt("replay", "b.mcap", "--node", 0).out


def test_the_event_of_an_instant_is_told(brrt: Command) -> None:
    """The event itself to its last digit, and the ten at most ahead of it; within 80 columns."""
    brrt("plan", "--planner", "rrt-star", "--iterations", 200, "--out", "a.mcap")
    log = read(Path("a.mcap")).events()
    chosen = [int(log[kind]["seq"][-1]) for kind in (Kind.EDGE, Kind.REWIRE, Kind.PHASE)]
    for seq in (0, 4, *chosen):
        told = brrt("replay", "a.mcap", "--at-event", seq).out.split(f"event {seq:,}")[1]
        told = told.partition(":")[2]
        numbers = [
            int(n) for n in re.findall(r"^ +(\d+)  [a-z]", told.replace(",", ""), re.MULTILINE)
        ]
        assert numbers == list(range(max(0, seq - 9), seq + 1))
        assert max(map(len, told.splitlines())) <= 80
    q = log[Kind.EDGE]["q"][-1].tolist()
    told = " ".join(brrt("replay", "a.mcap", "--at-event", chosen[0]).out.split())
    assert all(repr(x) in told for x in q)
    late = brrt("replay", "a.mcap", "--at-event", len(log) + 5)
    assert f"event {len(log) - 1:,} and the events before it" in late.out


@pytest.mark.parametrize(
    ("args", "message"),
    [
        (["--node", "999"], "tree 0 (start) has the nodes 0 to "),
        (["--node", "-1"], "and no node -1"),
        (["--node", "1", "--tree", "goal"], "tree 1 (goal) has no nodes by then; there is tree 0"),
        (["--node", "1", "--tree", "gaol"], "--tree must be start, goal or a number"),
        (["--tree", "goal"], "add --node"),
        (["--node", "1", "--text"], "--node goes with --at"),
    ],
)
def test_bad_nodes_are_one_line(args: list[str], message: str, brrt: Command) -> None:
    """Exit code 2 and a line that says what there is."""
    brrt("plan", "--out", "a.mcap", "--seed", 3)
    done = brrt("replay", "a.mcap", *args)
    assert (done.code, done.out) == (2, "")
    assert message in done.err
    assert done.err.count("\n") == 1


def test_bad_cells_are_one_line(brrt: Command) -> None:
    """The same on a lattice, which has no trees."""
    brrt("plan", "--planner", "a-star", "--world", "empty2d:size=5", "--out", "a.mcap")
    done = brrt("replay", "a.mcap", "--node", 10**6)
    assert (done.code, done.err.count("\n")) == (2, 1)
    assert "numbered from 0 to " in done.err
    done = brrt("replay", "a.mcap", "--node", 1, "--tree", 1)
    assert "has cells and no trees" in done.err
