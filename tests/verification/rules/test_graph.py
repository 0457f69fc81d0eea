"""Recordings that break rules about graphs and pruning, and honest ones that do not."""

import tracemalloc
from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from brrt import Events, Kind, Memory, Recorder, Scenario, Verification, verify
from brrt.events import Table
from brrt.scenario.contract import Contract, Growth, Near
from brrt.scenario.manifest import Manifest, made_by
from brrt.scenario.query import Query
from brrt.worlds import make_world
from tests.support.cases import Case, Doctored, Edit, check_found, doctored, shifted
from tests.support.doctoring import doctors
from tests.support.graph_planners import PLANNERS

GRAPH = {"paths in trees", "graph edges free", "removals"}
"""Rules that may be broken together with others."""


@cache
def recorded(name: str) -> Case:
    """A run of one of the example planners, which states an empty contract."""
    world = make_world("circles2d:n=30,seed=4")
    scenario = Scenario(world=world.name, planner=name, seed=1, smooth=False)
    query, memory = Query.of(scenario, world), Memory()
    with Recorder(memory, query) as rec:
        PLANNERS[name](rec, world, np.random.default_rng(1))
    manifest = Manifest(
        scenario, tuple(query.start), tuple(query.goal), 2, 2, 0, made_by(), contract=Contract()
    )
    return Case(manifest, world, memory.events())


def on(name: str, edit: Edit) -> Callable[[], Case]:
    """Edit a run of `recorded`."""
    return lambda: edit(recorded(name))


def row_of(table: Table, chosen: np.ndarray) -> int:
    """The first row that is chosen."""
    return int(np.flatnonzero(chosen)[0])


def on_link(case: Case) -> Case:
    """Put a ball on the first edge of the graph."""
    q, link = case.log[Kind.VERTEX]["q"], case.log[Kind.LINK][0]
    return case.with_ball(q[[link["node"], link["other"]]].mean(axis=0))


def off_path(case: Case) -> Case:
    """Leave out the links of the path's first node."""
    path, q = case.log[Kind.PATH]["waypoints"][0], case.log[Kind.VERTEX]["q"]
    node = row_of(case.log[Kind.VERTEX], (q == path[1]).all(axis=1))
    links = case.log[Kind.LINK]
    for row in np.flatnonzero((links["node"] == node) | (links["other"] == node))[::-1].tolist():
        case = case.drop(Kind.LINK, row)
    return case


def check_of(case: Case, free: bool) -> int:
    """The row of the first check of two nodes that is free, or not."""
    checks = case.log[Kind.CHECK]
    return row_of(checks, ((checks["part"] == 1) == free) & (checks["node"] >= 0))


def late_link(case: Case) -> Case:
    """Link a node after its removal."""
    gone = int(case.log[Kind.REMOVE]["node"][0])
    q = case.log[Kind.VERTEX]["q"]
    return case.add(Kind.LINK, node=0, other=gone, cost=np.linalg.norm(q[0] - q[gone]))


def late_child(case: Case) -> Case:
    """Let a node join below one that was removed."""
    gone = int(case.log[Kind.REMOVE]["node"][0])
    edges = case.log[Kind.EDGE]
    far = float(np.linalg.norm(edges["q"][gone] - edges["q"][-1]))
    return case.add(
        Kind.EDGE, node=len(edges), parent=gone, q=edges["q"][-1], cost=edges["cost"][gone] + far
    )


DOCTORED: list[Doctored] = [
    ("graph edges", "a link of", on("prm", lambda c: c.edit(Kind.LINK, 3, other=10_000)), GRAPH),
    ("graph edges", "a link of", on("prm", lambda c: c.edit(Kind.LINK, 3, tree=1)), GRAPH),
    ("graph edges", "", on("prm", lambda c: c.edit(Kind.LINK, 3, other=c.log[Kind.LINK]["node"][3],
     cost=0)), GRAPH),
    ("graph edge costs", "costs", on("prm", shifted(Kind.LINK, "cost", 5, 1e-6)), set()),
    ("graph edges free", "the edge to node", on("prm", on_link), {"checks free", "paths free"}),
    ("cuts", "have no edge then", on("lazy-prm", lambda c: c.edit(Kind.CUT, 0, other=0)), GRAPH),
    ("cuts", "", on("lazy-prm", lambda c: c.edit(Kind.CUT, 0, node=-1)), GRAPH),
    ("cuts", "", on("pruning", lambda c: c.add(Kind.CUT, node=1, other=1)), set()),
    ("removals", "does not exist", on("lazy-prm", lambda c: c.edit(Kind.REMOVE, 0, node=10_000)),
     set()),
    ("removals", "was removed before", on("lazy-prm", late_link), set()),
    ("removals", "was removed before", on("pruning", late_child), {"edge costs", "edges free"}),
    ("checks", "is elsewhere", on("prm", shifted(Kind.CHECK, "other", 9, 1)), {"checks free",
     "checks blocked", *GRAPH}),
    ("checks", "does not exist", on("prm", lambda c: c.edit(Kind.CHECK, 9, node=10_000)), GRAPH),
    ("checks", "", on("prm", lambda c: c.edit(Kind.CHECK, 9, tree=1)), GRAPH),
    ("checks free", "a motion hits", on("prm", lambda c: c.edit(Kind.CHECK, check_of(c, free=False),
     part=1)), set()),
    ("checks blocked", "all of it is clear", on("prm", lambda c: c.edit(Kind.CHECK, check_of(c,
     free=True), part=0.5)), set()),
    ("paths in trees", "", on("prm", off_path), set()),
]  # fmt: skip


@doctored(DOCTORED)
def test_doctored_recordings_are_found(
    rule: str, message: str, make: Callable[[], Case], also: set[str]
) -> None:
    """By the rule that they break."""
    check_found(rule, message, make, also)


def judged(case: Case) -> Verification:
    """What verify finds."""
    return verify(case.recording(), contract=case.contract)


@pytest.mark.parametrize("name", sorted(PLANNERS))
def test_example_planners_are_honest(name: str) -> None:
    """No rule accuses a graph of a cycle, nor a tree of what was pruned."""
    found = judged(recorded(name))
    assert found.findings == []
    held = {result.rule for result in found.results if result.examined}
    assert {"nodes", "paths in trees", "paths free"} <= held


def test_what_was_not_checked_is_said() -> None:
    """A lazy planner's edges count as free once they were checked."""
    found = judged(recorded("lazy-prm")).not_judged
    (reason,) = [why for why, names in found.items() if "graph edges free" in names]
    assert "edges of the graph that no check found free" in reason
    assert any("that begin at no node" in why for why in found)


def test_growth_of_pruned_trees_is_not_judged() -> None:
    """Rules about growth know edges and rewires only; they say what they leave out."""
    case = recorded("pruning")
    assert "near" not in str(judged(case).findings)
    near = Near(gamma=50.0, longest=18.0, dof=2)
    found = verify(case.recording(), contract=Contract(near=near, growth=Growth(links=None)))
    assert found.findings == []
    (names,) = [names for why, names in found.not_judged.items() if "change the trees" in why]
    assert {"parents", "rewirings", "paths reported", "steering"} <= set(names)


@given(st.sampled_from(sorted(PLANNERS)), st.integers(0, 2**32))
@settings(max_examples=40)
def test_no_graph_makes_a_rule_fail(name: str, seed: int) -> None:
    """Whatever the events say, there are findings and no exceptions."""
    case, rng = recorded(name), np.random.default_rng(seed)
    log = case.log
    for _ in range(3):
        kind, _, doctor = rng.choice(np.array(list(doctors(log)), object))
        log = doctor(log, kind, int(rng.integers(len(log[kind]))), rng) or log
    for kind in (Kind.LINK, Kind.CUT, Kind.REMOVE, Kind.CHECK):
        if len(log[kind]) and rng.random() < 0.5:
            table = log[kind].copy()
            table["node"][rng.integers(len(table))] = rng.choice([-1, 0, 7, 10_000, 2**31 - 1])
            table["tree"][rng.integers(len(table))] = rng.integers(0, 3)
            log = Events(log.dof, {**log.tables, kind: table})
    assert str(judged(replace(case, log=log)))


def test_a_removed_node_of_a_great_number_takes_little_memory() -> None:
    """Nothing is as long as the greatest number of a node that an event names."""
    case = recorded("lazy-prm")
    log = case.edit(Kind.REMOVE, 0, node=2**31 - 1).log
    tracemalloc.start()
    try:
        assert not judged(replace(case, log=log)).holds
        assert tracemalloc.get_traced_memory()[1] < 64 << 20
    finally:
        tracemalloc.stop()
