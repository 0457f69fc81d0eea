"""What is told, and in which order: logs that were doctored, by hand and at random.

Each entry names a rule and what it says, so that each thing that a rule finds has a log of its own.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from brrt import Events, Kind, Memory, Run, Scenario, check
from brrt.events import Reason, Source, Stage, Status, Table
from brrt.scenario.contract import Near
from tests.support.doctoring import doctors, doubled, dropped, swapped
from tests.verification.test_extension import growing
from tests.verification.test_rules import Evidence, promise
from tests.verification.test_sampling import run_of

RNG = np.random.default_rng(0)

LATTICE = {"world": "circles2d:n=25,seed=3", "smooth": False}
CELLS = {"epsilon": 4.0, "max_move": 6.0}
A_STAR = LATTICE | {"planner": "a-star", "params": CELLS}
WALK = LATTICE | {"planner": "lrta-star", "params": CELLS | {"trials": 2}}
AHEAD = LATTICE | {"planner": "lrta-star", "params": CELLS | {"lookahead": 12}}
STAR = {"planner": "rrt-star", "seed": 3, "iterations": 120}
PAIR = STAR | {"planner": "bi-rrt-star", "params": {"step": 8, "connect_distance": 25}}
BLOCKED = PAIR | {"iterations": 500, "smooth": False}
INFORMED = STAR | {"params": {"informed": True, "step": 9.0}, "iterations": 200}
SLICED = {"params": {"keep_intermediate": True, "slices": 3, "step": 9.0}, "seed": 3}
DONE = {"execute": True, "max_move": 5.0, "seed": 3}
RUNS: dict[str, dict[str, Any]] = {
    "rrt": {"seed": 3}, "sliced": SLICED, "rrt-connect": {"planner": "rrt-connect", "seed": 3},
    "bi-rrt": {"planner": "bi-rrt", "seed": 3}, "rrt-star": STAR, "bi-rrt-star": PAIR,
    "blocked": BLOCKED, "informed": INFORMED, "a-star": A_STAR, "lrta-star": WALK,
    "ahead": AHEAD, "executed": DONE,
}  # fmt: skip
"""Runs that logs are made from."""


def first(table: Table, **wanted: int) -> int:
    """The first row in which fields are so."""
    rows = np.ones(len(table), bool)
    for name, value in wanted.items():
        rows &= table[name] == value
    return int(np.flatnonzero(rows)[0])


@cache
def clean(run: str) -> Evidence:
    """A run, made once."""
    return run_of(**({"shortcuts": 20} | RUNS[run]))


def change(run: str, kind: Kind, where: dict[str, int] | int = 0, **fields: object) -> Evidence:
    """Change fields of the first event that is so, or of a row."""
    case = clean(run)
    row = where if isinstance(where, int) else first(case.log[kind], **where)
    return case.edit(kind, row, **fields)


def retold(how: Callable[..., Events | None], run: str, kind: Kind, row: int = 0) -> Evidence:
    """Leave an event out, tell it twice or after the next one."""
    case = clean(run)
    log = how(case.log, kind, range(len(case.log[kind]))[row], RNG)
    assert log is not None
    return replace(case, log=log)


def moved(run: str, kind: Kind, row: int, by: float) -> Evidence:
    """A configuration elsewhere."""
    case = clean(run)
    return case.edit(kind, row, q=case.log[kind]["q"][row] + by)


def other_start(case: Evidence) -> Evidence:
    """A trial that is said to have gone another way."""
    path = case.log[Kind.PATH]["waypoints"][0]
    return case.edit(Kind.PATH, 0, waypoints=np.insert(path, 1, path[0], axis=0))


def older_node(case: Evidence) -> Evidence:
    """A link that was found blocked, to a node that is not the newest."""
    rejects, edges = case.log[Kind.REJECT], case.log[Kind.EDGE]
    row = first(rejects, reason=Reason.LINK_BLOCKED)
    return case.edit(Kind.REJECT, row, node=0, q=edges["q"][1])


def costlier(case: Evidence) -> Evidence:
    """A smoothed path that costs more than what was smoothed."""
    row = first(case.log[Kind.PATH], stage=Stage.SMOOTHED)
    return case.edit(Kind.PATH, row, cost=1e3)


def without_raw(case: Evidence) -> Evidence:
    """A smoothed path, and none before it."""
    table = case.log[Kind.PATH]
    return case.drop(Kind.PATH, first(table, stage=Stage.RAW))


def far_parent(case: Evidence) -> Evidence:
    """A radius in which the nearest are, but not all parents."""
    return promise(near=Near(1e9, 3.0, 2))(case)


def two_cells(case: Evidence) -> Evidence:
    """A cell that is reached from one that is not around it, at the cost of the way."""
    table = case.log[Kind.EXPAND]
    row = len(table) - 1
    far = float(np.linalg.norm(table["q"][row] - table["q"][0]))
    return case.edit(Kind.EXPAND, row, parent=0, cost=far)


def between_cells(case: Evidence) -> Evidence:
    """A ball between a cell and its parent."""
    table = case.log[Kind.EXPAND]
    parent = table[table["cell"] == table["parent"][-1]][0]
    return case.with_ball((table["q"][-1] + parent["q"]) / 2)


MESS = {
    "steering", "rejections", "reasons", "sources", "link tries", "extensions", "meetings", "nodes",
    "times", "edge costs", "edge lengths", "iterations", "told once", "phase contents", "limits",
}  # fmt: skip
"""Rules about growth that may find fault with what breaks another one of them."""

SEARCH = {
    "best first", "expansions", "shortest ways", "nothing left", "neighbours", "choices", "limits",
    "estimates", "estimates admissible", "cells on lattice", "cells keep their numbers",
    "goal taken", "iterations", "times", "lattice moves", "paths walked", "rejections", "told once",
    "paths free", "outcome",
}  # fmt: skip
"""The same of searches."""

DOCTORED: list[tuple[str, str, Callable[[], Evidence], set[str]]] = [
    ("phase contents", "shortcut outside of all phases",
     lambda: retold(swapped, "rrt", Kind.PHASE, 2), {"smoothed", "phases", "iterations"}),
    ("phase contents", "path within phase plan",
     lambda: change("rrt", Kind.PATH, 0, stage=Stage.SMOOTHED), {
         "outcome", "smoothed", "shortcuts", "random pairs"}),
    ("phase contents", "move outside of all phases",
     lambda: retold(swapped, "executed", Kind.MOVE, -1), {"phases", "endings"}),
    ("iterations", "event of iteration 9; the log counts",
     lambda: change("rrt", Kind.SAMPLE, 9, iteration=9), {"times"}),
    ("iterations", "; the log counts", lambda: retold(dropped, "a-star", Kind.EXPAND, -1), SEARCH),
    ("iterations", "event of iteration 5; the log counts",
     lambda: change("lrta-star", Kind.MOVE, 5, iteration=5), {"times"}),
    ("told once", "the same reject", lambda: retold(doubled, "rrt", Kind.REJECT, 3), MESS),
    ("told once", "the same rewire", lambda: retold(doubled, "rrt-star", Kind.REWIRE, 3), MESS),
    ("told once", "the same connect", lambda: retold(doubled, "bi-rrt-star", Kind.CONNECT), MESS),
    ("extensions", "sample (uniform) is followed by sample",
     lambda: retold(dropped, "rrt", Kind.REJECT, 3), set()),
    ("extensions", "sample (goal) is followed by",
     lambda: change("rrt", Kind.SAMPLE, {"source": Source.GOAL}, tree=1), {"turns"}),
    ("extensions", "reject (collision) is followed by",
     lambda: change("rrt-star", Kind.REJECT, {"reason": Reason.NEAR_BLOCKED},
                    reason=Reason.COLLISION), MESS | {"parents", "rewirings"}),
    ("extensions", "nodes come of a sample", lambda: growing(slices=4)(
        clean("sliced")), {"steering"}),
    ("reasons", "is no reason for", lambda: change(
        "rrt", Kind.REJECT, 3, reason=Reason.NEAR_BLOCKED), MESS),
    ("reasons", "goal blocked is no reason", lambda: change(
        "rrt", Kind.REJECT, 3, reason=Reason.GOAL_BLOCKED), MESS),
    ("reasons", "no gain is no reason", lambda: change(
        "informed", Kind.REJECT, 0, reason=Reason.NO_GAIN), MESS),
    ("reasons", "is said to make no progress", lambda: change(
        "rrt", Kind.REJECT, 3, reason=Reason.NO_PROGRESS), MESS),
    ("reasons", "is not the other tree's newest node", lambda: change(
        "rrt-connect", Kind.REJECT, 0, reason=Reason.LINK_BLOCKED), MESS),
    ("meetings", "not the newest", lambda: older_node(clean("blocked")), {"reasons", "rejections"}),
    ("link tries", "is not due", lambda: retold(dropped, "rrt-connect", Kind.REJECT, 0), MESS),
    ("limits", "that is not said", lambda: change(
        "a-star", Kind.REJECT, {"reason": Reason.LIMITS}, reason=Reason.COLLISION), set()),
    ("samples", "the very goal", lambda: change(
        "rrt", Kind.SAMPLE, {"source": Source.GOAL}, source=Source.UNIFORM), set()),
    ("names", "no reason", lambda: change("rrt", Kind.REJECT, 3, reason=99), MESS),
    ("names", "no stage", lambda: change("rrt", Kind.PATH, 0, stage=99), {"paths improve"}),
    ("bounds", "edge at", lambda: moved("rrt", Kind.EDGE, -1, 500.0), {
        *MESS, "edges free", "paths in trees"}),
    ("bounds", "expand at", lambda: moved("a-star", Kind.EXPAND, -1, 500.0), SEARCH),
    ("bounds", "heuristic at", lambda: moved("lrta-star", Kind.HEURISTIC, 0, 500.0), SEARCH),
    ("bounds", "move at", lambda: moved("executed", Kind.MOVE, 1, 500.0), {
        "move costs", "move lengths", "moves along path", "moves free"}),
    ("bounds", "waypoint 1 at", lambda: change("rrt", Kind.PATH, 0, waypoints=np.insert(
        clean("rrt").log[Kind.PATH]["waypoints"][0], 1, [-9.0, 4.0], axis=0)), {
        "path costs", "paths in trees", "shortcuts", "smoothed", "random pairs", "paths free"}),
    ("budget", "draws", lambda: clean("rrt").scenario(draws=2), set()),
    ("endings", "which only a search can prove", lambda: change(
        "rrt-star", Kind.PHASE, 1, status=Status.NO_PATH), {"outcome"}),
    ("endings", "is said to be done", lambda: change(
        "rrt-star", Kind.PHASE, 1, status=Status.DONE), {"outcome"}),
    ("endings", "can only be done or interrupted", lambda: change(
        "rrt", Kind.PHASE, -1, status=Status.TIME_LIMIT), set()),
    ("endings", "attempts to smooth were made", lambda: retold(
        dropped, "rrt", Kind.SHORTCUT, first(clean("rrt").log[Kind.SHORTCUT], accepted=0)),
     {"random pairs"}),
    ("arrival", "the last move ends at", lambda: retold(dropped, "executed", Kind.MOVE, -1), set()),
    ("paths improve", "another path", lambda: retold(doubled, "rrt", Kind.PATH), {
        *MESS, "shortcuts"}),
    ("paths improve", "it is raw", lambda: change("rrt", Kind.PATH, 0, stage=Stage.IMPROVED), MESS),
    ("smoothed", "has told 0 paths", lambda: retold(dropped, "rrt", Kind.PATH, -1), {"endings"}),
    ("smoothed", "has told 2 paths", lambda: retold(doubled, "rrt", Kind.PATH, -1), set()),
    ("smoothed", "no path to smooth", lambda: without_raw(clean("rrt")), {
        "outcome", "shortcuts", "goal tries", *MESS}),
    ("smoothed", "more than", lambda: costlier(clean("rrt")), {"path costs"}),
    ("parents", "and others are near", lambda: far_parent(clean("rrt-star")), {
        "rewirings", "rewires near"}),
    ("paths walked", "not where the robot went", lambda: other_start(clean("lrta-star")), set()),
    ("paths walked", "had arrived before", lambda: retold(swapped, "lrta-star", Kind.PATH), SEARCH),
    ("paths walked", "of 2 trials arrived", lambda: retold(dropped, "lrta-star", Kind.PATH, -1),
     set()),
    ("paths walked", "goes on after its path", lambda: change(
        "lrta-star", Kind.MOVE, {"trial": 1}, trial=0), {
        *SEARCH, "moves", "move costs", "move lengths", "moves free"}),
    ("expansions", "again in one search", lambda: retold(
        doubled, "a-star", Kind.EXPAND, 5), SEARCH),
    ("expansions", "without a move", lambda: retold(doubled, "lrta-star", Kind.EXPAND, 5), SEARCH),
    ("expansions", "the robot is at", lambda: moved("lrta-star", Kind.EXPAND, 5, 4.0), SEARCH),
    ("expansions", "are no neighbours", lambda: two_cells(clean("a-star")), SEARCH),
    ("expansions", "motion between cells hits", lambda: between_cells(clean("a-star")), SEARCH),
    ("estimates", "after", lambda: retold(doubled, "lrta-star", Kind.HEURISTIC, 2), SEARCH),
    ("neighbours", "turned down again", lambda: retold(doubled, "a-star", Kind.REJECT, 1), SEARCH),
    ("neighbours", "no neighbour of the cell", lambda: change(
        "a-star", Kind.REJECT, 3, node=0), SEARCH),
    ("neighbours", "no neighbour of the cell", lambda: moved("ahead", Kind.REJECT, 3, 1.0), SEARCH),
    ("neighbours", "but out of reach", lambda: retold(dropped, "a-star", Kind.REJECT, 3), SEARCH),
    ("neighbours", "but out of reach", lambda: retold(dropped, "ahead", Kind.REJECT, 3), SEARCH),
    ("choices", "without a look around", lambda: retold(
        dropped, "lrta-star", Kind.EXPAND, 5), SEARCH),
    ("choices", "without a look around", lambda: retold(
        dropped, "lrta-star", Kind.EXPAND, -1), SEARCH),
    ("choices", "does not look", lambda: moved("lrta-star", Kind.HEURISTIC, 1, 4.0), SEARCH),
]  # fmt: skip


@pytest.mark.parametrize(
    ("rule", "says", "doctored", "also"),
    DOCTORED,
    ids=[f"{rule} {i}" for i, (rule, *_) in enumerate(DOCTORED)],
)
def test_doctored_acts_are_found(
    rule: str, says: str, doctored: Callable[[], Evidence], also: set[str]
) -> None:
    """As in test_checks, and by what the rule says."""
    case = doctored()
    found = check(case.manifest, case.world, case.log, case.contract)
    said = [finding.message for finding in found if finding.rule == rule]
    assert any(says in message for message in said), [(f.rule, f.message) for f in found]
    assert {finding.rule for finding in found} <= {rule} | also


HARMLESS = {
    ("phase", "status"),  # somebody may have interrupted it
    ("reject", "swapped"),  # cells around one are turned down in any order
    ("edge", "swapped"),  # roots
    ("shortcut", "i"), ("shortcut", "j"), ("shortcut", "swapped"),  # others may have been tried
    ("rewire", "swapped"), ("heuristic", "swapped"),  # the order in which costs are learnt
    ("path", "dropped"), ("connect", "dropped"), ("connect", "swapped"), ("heuristic", "h"),
    ("heuristic", "dropped"),
}  # fmt: skip
"""Kinds and ways of doctoring that may leave a log which another sound run would have."""


@pytest.mark.parametrize("name", sorted(set(RUNS) - {"blocked", "sliced", "informed"}))
def test_whatever_is_doctored_is_found(name: str) -> None:
    """One event at random of each kind, in each way; benchmarks/doctor.py does thousands."""
    case, rng = clean(name), np.random.default_rng(len(name))
    assert case.broken() == set()
    for kind, way, doctor in doctors(case.log):
        log = doctor(case.log, kind, int(rng.integers(0, len(case.log[kind]))), rng)
        if log is not None and (kind.label, way) not in HARMLESS:
            assert replace(case, log=log).broken(), (kind.label, way)


@pytest.mark.parametrize("planner", ["rrt", "rrt-connect", "bi-rrt", "rrt-star", "bi-rrt-star"])
@pytest.mark.parametrize("smooth", [True, False])
def test_trees_where_the_start_is_the_goal(planner: str, smooth: bool) -> None:
    """A path of one waypoint, told at once; nothing is held against it."""
    case = _at_home(planner=planner, smooth=smooth, execute=True)
    assert case.broken() == set()
    path = case.log[Kind.PATH]
    assert len(path["waypoints"][0]) == 1
    assert path["cost"][0] == 0.0


@pytest.mark.parametrize("params", [{}, {"lookahead": 5}, {"trials": 3}])
def test_robots_where_the_start_is_the_goal(params: dict[str, object]) -> None:
    """Each trial looks once, and its path is told for an arrival; an early one is missed."""
    case = _at_home(planner="lrta-star", params=params | {"epsilon": 4.0})
    assert case.broken() == set()
    raw = case.log[Kind.PATH]["stage"] == Stage.RAW
    assert len(case.log[Kind.EXPAND]) == raw.sum() == params.get("trials", 1)
    assert not len(case.log[Kind.MOVE])
    assert "paths walked" in case.drop(Kind.PATH, 0).broken()


def test_a_search_where_the_start_is_the_goal() -> None:
    """The first cell is the goal."""
    case = _at_home(planner="a-star", params={"epsilon": 4.0})
    assert case.broken() == set()
    assert len(case.log[Kind.EXPAND]) == 1
    assert case.drop(Kind.PATH, 0).broken() == {"outcome", "smoothed"}


def _at_home(**given: object) -> Evidence:
    """A run from a place to that place."""
    memory, here = Memory(), (20.0, 30.0)
    run = Run(Scenario(**({  # type: ignore[arg-type]
        "world": "circles2d:n=10,seed=3", "clock": "logical", "start": here, "goal": here,
        "iterations": 40,
    } | given)))  # fmt: skip
    run.execute([memory])
    return Evidence(run.manifest, run.problem.world, memory.events(), None)
