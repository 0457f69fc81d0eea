"""Clean runs keep every promise; each rule finds the log that was doctored against it."""

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from brrt import Events, Kind, Manifest, McapSink, Memory, Problem, Run, Scenario, World, check
from brrt.events import Phase, Reason, Status, table_dtype
from brrt.planners import make_planner
from brrt.replay.metrics import Metrics
from brrt.scenario.contract import Contract, Near
from brrt.verification import RULES, examine
from tests.conftest import Result, result_of
from tests.support import scenarios
from tests.support.toys import TOYS

PLANNERS = ("rrt", "rrt-connect", "bi-rrt", "rrt-star", "bi-rrt-star", "lrta-star", "a-star")
"""Registered planners under test."""


@dataclass(frozen=True)
class Evidence:
    """What the checks look at; doctoring makes a new one."""

    manifest: Manifest
    world: World
    log: Events
    contract: Contract | None
    figures: Mapping[str, Any] | None = None

    def broken(self) -> set[str]:
        """Names of the rules that find something."""
        case = self.manifest, self.world, self.log, self.contract
        results = examine(*case, figures=self.figures)
        for result in results:
            assert result.broken >= len(result.findings) > 0 or not result.broken
            assert all(found.rule == result.rule and found.message for found in result.findings)
        return {result.rule for result in results if result.broken}

    def edit(self, kind: Kind, row: int, **fields: Any) -> "Evidence":
        """Change fields of one event."""
        table = self.log[kind].copy()
        for name, value in fields.items():
            table[name][row] = value
        return replace(self, log=Events(self.log.dof, {**self.log.tables, kind: table}))

    def add(self, kind: Kind, **fields: Any) -> "Evidence":
        """Put one more event right before the end of planning."""
        ends = self.log[Kind.PHASE]
        end = ends[(ends["name"] == Phase.PLAN) & (ends["status"] != Status.BEGIN)][0]
        event = np.zeros(1, table_dtype(kind, self.log.dof))
        event["t"], event["seq"], event["iteration"] = end["t"], end["seq"], end["iteration"]
        for name, value in fields.items():
            event[name][0] = value
        tables = {k: t.copy() for k, t in self.log.tables.items()}
        for table in tables.values():
            later = table["seq"] >= end["seq"]
            table["seq"][later] += 1
            table["t"][later] += 1
        both = np.concatenate([tables.get(kind, event[:0]), event])
        tables[kind] = both[np.argsort(both["seq"])]
        return replace(self, log=Events(self.log.dof, tables))

    def drop(self, kind: Kind, row: int) -> "Evidence":
        """Leave out one event; the others close up."""
        gone = self.log[kind][row]["seq"]
        tables = {k: t[t["seq"] != gone].copy() for k, t in self.log.tables.items()}
        for table in tables.values():
            table["seq"][table["seq"] > gone] -= 1
        return replace(self, log=Events(self.log.dof, {k: t for k, t in tables.items() if len(t)}))

    def state(self, name: str, value: Any) -> "Evidence":
        """Put another figure down at the end."""
        metrics = Metrics(self.manifest)
        metrics.write(self.log)
        figures = json.loads(json.dumps(metrics.as_dict()))
        assert name in figures
        return replace(self, figures={**figures, name: value})

    def with_ball(self, where: Any) -> "Evidence":
        """Put a tiny ball there."""
        ball = [[*np.asarray(where, float), 1e-5]]
        balls = np.concatenate([self.world.balls, ball])
        return replace(self, world=replace(self.world, balls=balls))

    def scenario(self, **changed: Any) -> "Evidence":
        """Change what the manifest says of the scenario."""
        return replace(
            self,
            manifest=replace(self.manifest, scenario=replace(self.manifest.scenario, **changed)),
        )

    def state_contract(self, **fields: Any) -> "Evidence":
        """Change the contract that the manifest states."""
        assert self.manifest.contract is not None
        contract = replace(self.manifest.contract, **fields)
        return replace(self, manifest=replace(self.manifest, contract=contract))


@cache
def evidence(name: str) -> Evidence:
    """A clean run: of a planner of brrt's, or of a toy."""
    memory, toy = Memory(), TOYS.get(name)
    n = 40 if toy is None else 0 if name == "march" else 15
    # Seed 3 makes each of them find a path, and the star rewire.
    scenario = Scenario(
        world=f"circles2d:n={n},seed=3", planner=name if toy is None else f"toy-{name}", seed=3,
        iterations=100 if toy is not None else 1000,
        smooth=toy is None or name == "pair",
        clock="logical",
    )  # fmt: skip
    run = Run(scenario, planner=toy)
    run.execute([memory])
    contract = None if toy is None else toy.contract(run.problem)
    return Evidence(run.manifest, run.problem.world, memory.events(), contract)


@pytest.mark.parametrize("name", [*PLANNERS, *TOYS])
def test_clean_runs_have_no_findings(name: str) -> None:
    """What a planner does well is not held against it."""
    assert evidence(name).broken() == set()


@pytest.mark.parametrize("name", list(TOYS))
@pytest.mark.parametrize("seed", range(4))
def test_toys_have_no_findings(name: str, seed: int) -> None:
    """The same in other worlds, on other seeds."""
    n, memory = 0 if name == "march" else 12, Memory()
    scenario = Scenario(
        world=f"{'boxes2d' if seed % 2 else 'circles2d'}:n={n},seed={seed}",
        planner=f"toy-{name}", seed=seed, iterations=60, smooth=name != "march",
    )  # fmt: skip
    run = Run(scenario, planner=TOYS[name])
    run.execute([memory])
    contract = TOYS[name].contract(run.problem)
    assert check(run.manifest, run.problem.world, memory.events(), contract) == []
    assert check(run.manifest, run.problem.world, memory.events()) == []


@settings(max_examples=50, deadline=None)  # benchmarks/soak.py looks at thousands
@given(
    seed=st.integers(0, 2**32),
    planner=st.sampled_from(scenarios.PLANNERS),
    body=st.sampled_from(["polygon", "chain 3"]),
    solid=st.booleans(),
)
def test_contracts_hold(
    seed: int, planner: str, body: str, solid: bool, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """Whatever world, robot, seed and settings: no finding, nor where the log is cut."""
    point = ("point 2D", "point 3D")[seed % 2]
    robot = body if solid and planner in scenarios.TREES else point
    scenario = scenarios.draw(seed, tmp_path_factory.getbasetemp(), planner, robot)
    memory, run = Memory(), Run(scenario)
    run.execute([memory])
    log = memory.events()
    found = check(run.manifest, run.problem.world, log)
    assert found == [], scenarios.command(scenario)
    for part in (log.until(seq=seed % len(log)), log.until(seq=-1)):
        for result in examine(run.manifest, run.problem.world, part, cut=True):
            assert not result.broken, (result.findings, scenarios.command(scenario))


def leaf(case: Evidence) -> int:
    """The newest node without children that no path and no rewire knows of."""
    edges = case.log[Kind.EDGE]
    used = set(edges["parent"].tolist())
    for kind, name in ((Kind.REWIRE, "node"), (Kind.REWIRE, "parent"), (Kind.CONNECT, "node")):
        used |= set(case.log[kind][name].tolist())
    used |= set(case.log[Kind.CONNECT]["other"].tolist())
    places = {tuple(q) for path in case.log[Kind.PATH]["waypoints"] for q in path.tolist()}
    free = [
        row
        for row, edge in enumerate(edges)
        if edge["node"] not in used
        and tuple(edge["q"].tolist()) not in places
        and edge["tree"] == 0
    ]
    return free[-1]


def on_edge(case: Evidence) -> Evidence:
    """A ball in the middle of a leaf's edge."""
    edges = case.log[Kind.EDGE]
    edge = edges[leaf(case)]
    return case.with_ball((edge["q"] + edges["q"][edge["parent"]]) / 2)


def doctored_edge(**fields: Any) -> Callable[[Evidence], Evidence]:
    """Change fields of a leaf's edge."""
    return lambda case: case.edit(Kind.EDGE, leaf(case), **fields)


def dearer_edge(case: Evidence) -> Evidence:
    """A cost that is off by a millionth."""
    row = leaf(case)
    return case.edit(Kind.EDGE, row, cost=case.log[Kind.EDGE]["cost"][row] + 1e-6)


def rewired(case: Evidence, node: int, parent: int, more: float = 0.0) -> Evidence:
    """One more rewire, its cost right but for `more`."""
    tree = _costs(case)
    q = case.log[Kind.EDGE]["q"]
    cost = tree[parent] + float(np.linalg.norm(q[node] - q[parent])) + more
    return case.add(Kind.REWIRE, tree=0, node=node, parent=parent, cost=cost)


def _costs(case: Evidence) -> Any:
    from brrt import forest

    return forest(case.log)[0].cost


def dearer_rewire(case: Evidence) -> Evidence:
    """A rewire to a parent that is near and free, but makes the node dearer."""
    q = case.log[Kind.EDGE]["q"]
    apart = np.linalg.norm(q[:, None] - q, axis=2)
    for node, parent in np.argwhere((apart > 0) & (apart < 12)).tolist():
        other = rewired(case, node, parent)
        if other.broken() == {"rewires gain"}:
            return other
    raise AssertionError


def on_rewire(case: Evidence) -> Evidence:
    """A ball in the middle of the edge of a rewire that nothing else runs along."""
    q = case.log[Kind.EDGE]["q"]
    for rewire in case.log[Kind.REWIRE]:
        other = case.with_ball((q[rewire["node"]] + q[rewire["parent"]]) / 2)
        if other.broken() == {"rewires free"}:
            return other
    raise AssertionError


def moved_waypoint(row: int, which: int) -> Callable[[Evidence], Evidence]:
    """A path whose waypoint is elsewhere."""

    def edit(case: Evidence) -> Evidence:
        path = case.log[Kind.PATH]["waypoints"][row].copy()
        path[which] += 0.25
        return case.edit(Kind.PATH, row, waypoints=path)

    return edit


def plus(kind: Kind, name: str, row: int, more: float) -> Callable[[Evidence], Evidence]:
    """A field that is off."""
    return lambda case: case.edit(kind, row, **{name: case.log[kind][name][row] + more})


def promise(**fields: Any) -> Callable[[Evidence], Evidence]:
    """Another contract."""

    def change(case: Evidence) -> Evidence:
        base = case.contract or make_planner(case.manifest.scenario).contract(
            Problem.of(case.manifest.scenario, case.world)
        )
        return replace(case, contract=replace(base, **fields))

    return change


def on_path(case: Evidence) -> Evidence:
    """A ball on the smoothed path."""
    path = case.log[Kind.PATH]["waypoints"][-1]
    return case.with_ball((path[0] + path[1]) / 2)


def lattice_of(case: Evidence, **fields: Any) -> Evidence:
    """Another lattice in the contract."""
    assert case.contract is not None
    assert case.contract.lattice is not None
    return promise(lattice=replace(case.contract.lattice, **fields))(case)


def bad_h(case: Evidence) -> Evidence:
    """An estimate that is far too high, of a cell from which the goal was reached, in the end."""
    row = len(case.log[Kind.HEURISTIC]) - 1
    return plus(Kind.HEURISTIC, "h", row, 1000.0)(case)


def falling_h(case: Evidence) -> Evidence:
    """An estimate below the distance to the goal."""
    return case.edit(Kind.HEURISTIC, len(case.log[Kind.HEURISTIC]) - 1, h=0.5)


def foolish(case: Evidence) -> Evidence:
    """A rejection too many or too few: the robot moved into what was found blocked."""
    moves, expand = case.log[Kind.MOVE], case.log[Kind.EXPAND]
    return case.edit(Kind.REJECT, 0, node=int(expand["cell"][0]), q=moves["q"][0])


def shortcut_row(case: Evidence, accepted: bool) -> int:
    """A shortcut that was or was not accepted."""
    return int(np.flatnonzero(case.log[Kind.SHORTCUT]["accepted"] == accepted)[0])


DOCTORED: list[tuple[str, str, Callable[[Evidence], Evidence], set[str]]] = [
    ("numbering", "rrt", plus(Kind.PHASE, "seq", -1, 5), set()),
    ("times", "rrt", plus(Kind.EDGE, "t", 5, -5000), set()),
    ("times", "rrt", plus(Kind.EDGE, "iteration", 5, -1000), {"budget", "iterations"}),
    ("phases", "rrt", lambda c: c.drop(Kind.PHASE, -1), set()),
    ("phases", "rrt", lambda c: c.edit(Kind.PHASE, 1, status=Status.BEGIN), {"outcome"}),
    ("phases", "rrt", lambda c: c.edit(Kind.PHASE, 3, name=77), set()),
    ("phases", "rrt", lambda c: c.drop(Kind.PHASE, 0), {"phase contents"}),
    ("names", "rrt", lambda c: c.edit(Kind.SAMPLE, 3, source=99), set()),
    ("figures", "rrt", lambda c: c.state("path_cost", 1.0), set()),
    ("figures", "rrt", lambda c: c.state("path_cost", None), set()),
    ("figures", "rrt-star", lambda c: c.state("solved", False), set()),
    ("figures", "lrta-star", lambda c: c.state("moves", 7), set()),
    ("figures", "a-star", lambda c: c.state("path", [[0.0, 0.0]]), set()),
    ("contract", "rrt", lambda c: c.state_contract(stops=None), set()),
    ("contract", "rrt-star", lambda c: c.state_contract(draws=None), set()),
    ("outcome", "rrt", lambda c: c.edit(Kind.PHASE, 1, status=Status.ITERATION_LIMIT),
     {"endings"}),
    ("outcome", "march", lambda c: c.drop(Kind.PATH, 0), {"moves along path"}),
    ("budget", "rrt", lambda c: c.scenario(iterations=3), set()),
    ("budget", "rrt", lambda c: c.scenario(shortcuts=3), set()),
    ("endings", "rrt-star", lambda c: c.edit(Kind.PHASE, 1, status=Status.SOLVED), set()),
    ("endings", "rrt-star", lambda c: c.edit(Kind.PHASE, 1, status=Status.TIME_LIMIT), set()),
    ("endings", "rrt-star", lambda c: c.scenario(iterations=2000), set()),
    ("endings", "rrt-star", lambda c: c.scenario(time=9.0, clock="real").edit(
        Kind.PHASE, 1, status=Status.TIME_LIMIT), set()),
    ("bounds", "rrt", lambda c: c.edit(Kind.SAMPLE, 1, q=[-3.0, 5.0]), {"samples", "steering"}),
    ("bounds", "rrt", lambda c: c.edit(Kind.SAMPLE, 1, q=[np.nan, 5.0]), {"samples", "steering"}),
    ("samples", "rrt", lambda c: c.edit(
        Kind.SAMPLE, int((c.log[Kind.SAMPLE]["source"] == 1).argmax()), q=[5.0, 5.0]),
     {"steering"}),
    ("nodes", "rrt", doctored_edge(parent=10**6), set()),
    ("nodes", "rrt", doctored_edge(node=10**6), set()),
    ("roots", "rrt", doctored_edge(parent=-1, cost=0.0), set()),
    ("roots", "star", lambda c: c.edit(Kind.EDGE, 0, parent=0), {"nodes"}),
    ("edge lengths", "rrt", promise(step=4.9), {"steering"}),
    ("edge costs", "rrt", dearer_edge, set()),
    ("edges free", "rrt", on_edge, set()),
    ("rewires", "star", lambda c: c.add(Kind.REWIRE, node=leaf(c), parent=leaf(c)), set()),
    ("rewires", "star", lambda c: c.add(Kind.REWIRE, node=leaf(c), parent=10**6), set()),
    ("rewires", "star", lambda c: c.add(Kind.REWIRE, node=-7, parent=0), set()),
    ("rewires", "star", lambda c: c.add(Kind.REWIRE, tree=9, node=0, parent=0), set()),
    ("rewire costs", "star", lambda c: rewired(
        c, leaf(c), int(c.log[Kind.EDGE]["parent"][leaf(c)]), 1e-6), set()),
    ("rewires gain", "star", dearer_rewire, set()),
    ("rewires near", "star", promise(near=Near(1.0, 1.0, 2)), set()),
    ("rewires free", "star", on_rewire, set()),
    ("links", "pair", plus(Kind.CONNECT, "cost", 0, 1e-6), set()),
    ("links", "pair", promise(link=0.01), set()),
    ("links", "pair", lambda c: c.edit(Kind.CONNECT, 0, other=10**6), {"paths in trees"}),
    ("path ends", "star", moved_waypoint(-1, -1), {"path costs", "paths in trees"}),
    ("path ends", "star", moved_waypoint(-1, 0), {"path costs", "paths in trees"}),
    ("path ends", "march", lambda c: c.edit(Kind.PATH, 0, waypoints=np.empty((0, 2))),
     {"path costs", "moves along path"}),
    ("paths free", "rrt", on_path, {"shortcuts"}),
    ("path costs", "star", plus(Kind.PATH, "cost", -1, 1e-6), set()),
    ("paths improve", "star", lambda c: c.add(
        Kind.PATH, stage=2, cost=c.log[Kind.PATH]["cost"][-1],
        waypoints=c.log[Kind.PATH]["waypoints"][-1]), set()),
    ("paths in trees", "pair", lambda c: c.drop(Kind.CONNECT, 0), set()),
    ("shortcuts", "rrt", lambda c: c.edit(
        Kind.SHORTCUT, shortcut_row(c, accepted=False), i=-4), set()),
    ("shortcuts", "rrt", lambda c: plus(
        Kind.SHORTCUT, "cost", shortcut_row(c, accepted=False), 5.0)(c), set()),
    ("smoothed", "rrt", lambda c: c.edit(
        Kind.SHORTCUT, shortcut_row(c, accepted=True), accepted=False), {"shortcuts"}),
    ("moves", "march", plus(Kind.MOVE, "step", 7, 1), set()),
    ("moves", "walk", plus(Kind.MOVE, "trial", 0, 5),
     {"move costs", "move lengths", "lattice moves", "choices", "paths walked"}),
    ("move costs", "march", plus(Kind.MOVE, "cost", -1, 1e-6), set()),
    ("move lengths", "march", lambda c: c.edit(
        Kind.MOVE, -1, q=c.log[Kind.MOVE]["q"][-2] + 5.0),
     {"move costs", "arrival", "moves along path"}),
    ("moves free", "march", lambda c: c.with_ball(c.log[Kind.MOVE]["q"][50]), {"paths free"}),
    ("arrival", "march", lambda c: c.drop(Kind.MOVE, -1), set()),
    ("moves along path", "march", lambda c: c.edit(
        Kind.PATH, 0, waypoints=c.log[Kind.PATH]["waypoints"][0][[0, 2]]), {"path costs"}),
    ("cells on lattice", "walk", lambda c: c.edit(
        Kind.EXPAND, 3, q=c.log[Kind.EXPAND]["q"][3] + 0.1), {"expansions"}),
    ("cells keep their numbers", "walk", plus(Kind.EXPAND, "cell", 3, 999), {"choices"}),
    ("cells keep their numbers", "walk", lambda c: c.edit(Kind.EXPAND, 3, cell=-3), {"choices"}),
    ("expansions", "walk", lambda c: c.edit(Kind.EXPAND, 3, parent=0), {"best first"}),
    ("expansions", "walk", plus(Kind.EXPAND, "cost", 3, 1.0), set()),
    ("estimates", "walk", falling_h, {"choices"}),
    ("estimates admissible", "walk", bad_h, {"choices"}),
    ("lattice moves", "walk", lambda c: lattice_of(c, epsilon=5.0), {"choices", "neighbours"}),
    ("choices", "walk", foolish, {"rejections", "neighbours", "limits"}),
    ("rejections", "rrt", lambda c: c.edit(
        Kind.REJECT, 0, node=0, q=c.log[Kind.EDGE]["q"][0] + 0.01), {"steering"}),
    ("rejections", "rrt", lambda c: c.edit(Kind.REJECT, 0, node=10**6), set()),
    ("rejections", "a-star", lambda c: c.edit(
        Kind.REJECT, -1, node=0, q=c.log[Kind.EXPAND]["q"][0]), {"neighbours"}),
    ("limits", "rrt", lambda c: c.edit(Kind.REJECT, 0, reason=Reason.LIMITS),
     {"extensions", "reasons"}),
]  # fmt: skip


BODIES = {
    "polygon": Scenario(
        world="circles2d:n=25,seed=3", robot="polygon:length=6,width=3", seed=3, clock="logical",
        iterations=1000,
    ),
    "chain": Scenario(
        world="circles2d:n=12,seed=2,max_radius=4",
        robot="chain:links=3,length=9,width=1,self_collision=true,limit=3",
        start=(0.0, 0.5, 0.5), goal=(-2.0, -1.0, 1.0), clock="logical", iterations=1000,
    ),
    "endless": Scenario(
        world="circles2d:n=12,seed=2,max_radius=4",
        robot="chain:links=3,length=9,width=1,wrap=true",
        start=(0.0, 0.5, 0.5), goal=(-2.0, -1.0, 1.0), clock="logical", iterations=1000,
    ),
}  # fmt: skip
"""Runs of robots with bodies."""

FREE = {"edges free", "paths free", "shortcuts"}
LENGTHS = {"edge lengths", "edge costs", "steering"}


@cache
def body_evidence(name: str) -> Evidence:
    """A clean run of a robot with a body."""
    memory, run = Memory(), Run(BODIES[name])
    run.execute([memory])
    return Evidence(run.manifest, run.problem.world, memory.events(), None)


@pytest.mark.parametrize("name", BODIES)
def test_clean_runs_of_bodies_have_no_findings(name: str) -> None:
    """And there is something to find fault with: edges, rejections, a path."""
    case = body_evidence(name)
    assert case.broken() == set()
    assert all(len(case.log[kind]) > 2 for kind in (Kind.EDGE, Kind.REJECT))
    assert len(case.log[Kind.PATH])


def body_hit(case: Evidence) -> Evidence:
    """A tiny ball in the last part of the body, in the middle of a leaf's edge."""
    row = leaf(case)
    edges, robot = case.log[Kind.EDGE], case.manifest.make_robot().resolved(case.world)
    a, b = edges["q"][edges["parent"][row]], edges["q"][row]
    return case.with_ball(robot.outline(robot.interpolate(a, b, 0.5))[-1].mean(axis=0))


def posed(*numbers: float | None) -> Callable[[Evidence], Evidence]:
    """A leaf elsewhere: numbers of its configuration that are not None."""

    def edit(case: Evidence) -> Evidence:
        q = case.log[Kind.EDGE]["q"][leaf(case)].copy()
        for k, number in enumerate(numbers):
            q[k] = q[k] if number is None else number
        return doctored_edge(q=q)(case)

    return edit


def emptied(case: Evidence) -> Evidence:
    """Without obstacles, so that only the bounds are in the way."""
    return replace(case, world=replace(case.world, balls=np.empty((0, 3))))


DOCTORED_BODIES: list[tuple[str, str, Callable[[Evidence], Evidence], str, set[str]]] = [
    ("edges free", "polygon", body_hit, "hits ball", FREE),
    ("edges free", "chain", body_hit, "hits ball", FREE),
    ("edges free", "polygon", posed(None, 1.0), "hits", LENGTHS),
    ("edges free", "polygon", lambda c: posed(1.0, 50.0, 0.0)(emptied(c)), "hits the bounds",
     LENGTHS | {"rejections"}),
    ("edges free", "chain", posed(0.0, 2.9, 2.9), "hits the robot itself", LENGTHS),
    ("bounds", "polygon", posed(None, None, np.pi), "edge at", FREE | LENGTHS),
    ("bounds", "polygon", posed(None, None, -4.0), "edge at", FREE | LENGTHS),
    ("bounds", "chain", posed(None, 3.01), "edge at", FREE | LENGTHS),
    ("bounds", "endless", posed(None, np.pi), "edge at", FREE | LENGTHS),
    ("bounds", "endless", posed(3.2), "edge at", FREE | LENGTHS),
    ("rejections", "polygon", lambda c: c.edit(
        Kind.REJECT, 0, node=0, q=c.log[Kind.EDGE]["q"][0]), "is clear", {"steering"}),
    ("rejections", "chain", lambda c: c.edit(
        Kind.REJECT, 0, node=0, q=c.log[Kind.EDGE]["q"][0]), "is clear", {"steering"}),
]  # fmt: skip


@pytest.mark.parametrize(
    ("rule", "name", "doctor", "message", "also"),
    DOCTORED_BODIES,
    ids=[f"{name} {rule} {i}" for i, (rule, name, *_) in enumerate(DOCTORED_BODIES)],
)
def test_doctored_bodies_are_found(
    rule: str, name: str, doctor: Callable[[Evidence], Evidence], message: str, also: set[str]
) -> None:
    """As with points, for what only bodies can do."""
    case = doctor(body_evidence(name))
    found = check(case.manifest, case.world, case.log)
    assert any(finding.rule == rule and message in finding.message for finding in found), found
    assert {finding.rule for finding in found} <= {rule} | also


@pytest.mark.parametrize("name", ["polygon", "chain"])
@pytest.mark.parametrize("gap", [1e-7, 1e-4])
def test_a_refusal_needs_a_reason(name: str, gap: float) -> None:
    """What stays clear by 1e-7 of the map may be refused; what stays clear by 1e-4 may not."""
    case = body_evidence(name)
    robot = case.manifest.make_robot().resolved(case.world)
    q = case.log[Kind.EDGE]["q"][0]
    part = robot.outline(q)[-1]
    radius, corner = 1e-3, part[0]
    out = corner - part.mean(axis=0)
    centre = corner + out / np.hypot(*out) * (radius + gap * case.world.extent)
    alone = replace(case.world, balls=np.array([[*centre, radius]]))
    refused = np.array([[*q]])
    from brrt.collision.motions import Obstacles, all_clear, first_hits

    assert all_clear(Obstacles(alone), robot, refused, refused).tolist() == [gap > 1e-5]
    assert first_hits(Obstacles(alone), robot, refused, refused).tolist() == [-1]


def test_what_verify_says_as_json(brrt: Callable[..., Result]) -> None:
    """Names and types that programs may rely on; each rule stands there, examined or not."""
    brrt("plan", "--world", "circles2d:n=5", "--out", "run.mcap")
    done = brrt("verify", "run.mcap", "--json")
    assert done.code == 0
    shape = {"holds": bool, "planner_known": bool, "cut": bool, "events": int, "rules": list}
    assert {name: type(value) for name, value in done.json.items()} == shape
    assert done.json["holds"]
    names = [rule.__name__.replace("_", " ") for rule in RULES]
    assert [rule["rule"] for rule in done.json["rules"]] == names
    for rule in done.json["rules"]:
        assert {name: type(value) for name, value in rule.items()} == {
            "rule": str, "promise": str, "examined": int, "broken": int, "findings": list,
        }  # fmt: skip


def test_what_verify_says_to_people(brrt: Callable[..., Result]) -> None:
    """A line a rule, no longer than a terminal; --long writes the promises out."""
    brrt("plan", "--world", "circles2d:n=5", "--out", "run.mcap")
    done, long = brrt("verify", "run.mcap"), brrt("verify", "run.mcap", "--long")
    assert done.code == long.code == 0
    lines = done.out.splitlines()
    assert max(map(len, lines)) <= 80
    assert all("holds" in line for line in lines[:-1])
    assert lines[-1] == f"all {len(lines) - 1} rules hold"
    assert (RULES[0].__doc__ or "").partition("\n")[0] in long.out


def test_broken_rules_come_first(brrt: Callable[..., Result], tmp_path: Path) -> None:
    """With what they found, and exit code 1."""
    case = evidence("rrt").edit(Kind.SAMPLE, 1, q=[-3.0, 5.0])
    sink = McapSink(tmp_path / "bad.mcap", case.manifest, case.world)
    sink.write(case.log)
    sink.close(result_of(case.manifest, case.log))
    done = brrt("verify", tmp_path / "bad.mcap")
    assert done.code == 1
    assert "BROKEN" in done.out.splitlines()[0]
    assert "sample at (-3, 5)" in done.out
    assert done.out.splitlines()[-1].endswith(" broken")


def test_a_cut_file_is_judged_as_far_as_it_goes(brrt: Callable[..., Result]) -> None:
    """Without --partial it is refused; what is promised of the end is left out."""
    brrt(
        "plan", "--planner", "rrt-star", "--world", "circles2d:n=20", "--iterations", "20000",
        "--no-smooth", "--out", "run.mcap",
    )  # fmt: skip
    whole = Path("run.mcap").read_bytes()
    Path("cut.mcap").write_bytes(whole[: len(whole) * 2 // 3])
    refused = brrt("verify", "cut.mcap")
    assert refused.code == 2
    assert "with --partial" in refused.err
    done = brrt("verify", "cut.mcap", "--partial", "--json")
    assert done.code == 0
    assert done.json["cut"]
    assert done.json["events"] > 1000
    assert brrt("verify", "run.mcap", "--partial", "--json").json["cut"] is False


@pytest.mark.parametrize(
    ("rule", "name", "doctor", "also"),
    DOCTORED,
    ids=[f"{rule} {i}" for i, (rule, *_) in enumerate(DOCTORED)],
)
def test_doctored_logs_are_found(
    rule: str, name: str, doctor: Callable[[Evidence], Evidence], also: set[str]
) -> None:
    """A log that breaks a rule is found by it; by others only where they cannot help it."""
    broken = doctor(evidence(name)).broken()
    assert rule in broken
    assert broken - {rule} <= also


def test_every_rule_has_a_doctored_log() -> None:
    """Whoever adds a rule adds what it is for."""
    from tests.verification import (
        test_extension,
        test_rewiring,
        test_sampling,
        test_search,
        test_sequence,
    )

    names = {rule.__name__.replace("_", " ") for rule in RULES}
    files = (test_sequence, test_sampling, test_extension, test_rewiring, test_search)
    others = (file.DOCTORED for file in files)
    assert names == {rule for rule, *_ in [*DOCTORED, *chain(*others)]}
    assert all((rule.__doc__ or "").strip() for rule in RULES)


@settings(max_examples=100, deadline=None)
@given(data=st.data())
def test_no_log_makes_a_check_fail(data: st.DataObject) -> None:
    """Whatever stands in a field, checks find or do not find; they never crash."""
    case = evidence(data.draw(st.sampled_from([*PLANNERS, *TOYS])))
    for _ in range(data.draw(st.integers(1, 4))):
        kind = data.draw(st.sampled_from([k for k in Kind if len(case.log[k])]))
        table = case.log[kind]
        row = data.draw(st.integers(0, len(table) - 1))
        name = data.draw(st.sampled_from(table.dtype.names or ()))
        values: st.SearchStrategy[Any]
        if name == "waypoints":
            values = st.lists(st.tuples(st.floats(), st.floats()), max_size=4).map(
                lambda rows: np.array(rows, float).reshape(-1, 2)
            )
        elif table[name].dtype.kind == "f":
            values = st.floats()
        else:
            info = np.iinfo(table[name].dtype) if table[name].dtype != bool else None
            values = st.booleans() if info is None else st.integers(int(info.min), int(info.max))
        case = case.edit(kind, row, **{name: data.draw(values)})
    case.broken()
