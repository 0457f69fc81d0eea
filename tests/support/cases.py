"""Recordings in memory that tests of `verify` change by hand, and runs to make them from."""

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from brrt import Events, Kind, Manifest, Memory, Recording, Run, Scenario, World, verify
from brrt.events import Phase, Status, Table, table_dtype
from brrt.recording import Result
from brrt.scenario.contract import Contract
from tests.conftest import result_of
from tests.support.toys import TOYS


@dataclass(frozen=True)
class Case:
    """A recording, and the contract that it is judged by; a change makes another one."""

    manifest: Manifest
    world: World
    log: Events
    contract: Contract | None = None
    result: Result | None = None

    def recording(self) -> Recording:
        """The recording; without a result nothing is stored at its end, but it is whole."""
        result = {} if self.result is None else self.result
        return Recording(self.manifest, self.world, lambda: [self.log], result)

    def broken(self) -> set[str]:
        """Names of the rules that find something."""
        results = verify(self.recording(), contract=self.contract).results
        for result in results:
            assert result.broken >= len(result.findings) > 0 or not result.broken
            assert all(found.rule == result.rule and found.message for found in result.findings)
        return {result.rule for result in results if result.broken}

    def edit(self, kind: Kind, row: int, **fields: Any) -> "Case":
        """Change fields of one event."""
        table = self.log[kind].copy()
        for name, value in fields.items():
            table[name][row] = value
        return replace(self, log=Events(self.log.dof, {**self.log.tables, kind: table}))

    def shift(self, kind: Kind, row: int, name: str, more: float) -> "Case":
        """Add something to a field of one event."""
        return self.edit(kind, row, **{name: self.log[kind][name][row] + more})

    def add(self, kind: Kind, **fields: Any) -> "Case":
        """Add an event right before the end of planning."""
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

    def drop(self, kind: Kind, row: int) -> "Case":
        """Remove an event; later ones are numbered anew."""
        gone = self.log[kind][row]["seq"]
        tables = {k: t[t["seq"] != gone].copy() for k, t in self.log.tables.items()}
        for table in tables.values():
            table["seq"][table["seq"] > gone] -= 1
        return replace(self, log=Events(self.log.dof, {k: t for k, t in tables.items() if len(t)}))

    def without(self, *kinds: Kind) -> "Case":
        """Remove all events of some kinds; the others are numbered anew."""
        tables = {kind: t.copy() for kind, t in self.log.tables.items() if kind not in kinds}
        numbers = np.sort(np.concatenate([table["seq"] for table in tables.values()]))
        for table in tables.values():
            table["seq"] = np.searchsorted(numbers, table["seq"])
        return replace(self, log=Events(self.log.dof, tables))

    def with_metric(self, name: str, value: Any) -> "Case":
        """Store another metric at the end."""
        result = json.loads(json.dumps(result_of(self.manifest, self.log)))
        assert name in result
        return replace(self, result={**result, name: value})

    def with_ball(self, where: Any) -> "Case":
        """Add a tiny ball to the world."""
        ball = [[*np.asarray(where, float), 1e-5]]
        balls = np.concatenate([self.world.balls, ball])
        return replace(self, world=replace(self.world, balls=balls))

    def with_scenario(self, **changed: Any) -> "Case":
        """Change the scenario in the manifest."""
        scenario = replace(self.manifest.scenario, **changed)
        return replace(self, manifest=replace(self.manifest, scenario=scenario))

    def with_stated(self, **fields: Any) -> "Case":
        """Change the contract in the manifest."""
        assert self.manifest.contract is not None
        contract = replace(self.manifest.contract, **fields)
        return replace(self, manifest=replace(self.manifest, contract=contract))

    def judged_by(self, part: str = "", **fields: Any) -> "Case":
        """Change the contract that the recording is judged by, or fields of a part of it."""
        base = self.contract or self.manifest.contract
        assert base is not None
        if part:
            fields = {part: replace(getattr(base, part), **fields)}
        return replace(self, contract=replace(base, **fields))


Edit = Callable[[Case], Case]
Doctored = tuple[str, str, Callable[[], Case], set[str]]
"""A rule, part of a message of it, the recording that breaks it, and other rules that this may
break."""


def doctored(cases: Sequence[Doctored]) -> pytest.MarkDecorator:
    """Pass each case to a test."""
    ids = [f"{rule} {i}" for i, (rule, *_) in enumerate(cases)]
    return pytest.mark.parametrize(("rule", "message", "make", "also"), cases, ids=ids)


def check_found(rule: str, message: str, make: Callable[[], Case], also: set[str]) -> None:
    """Check that a rule finds what is wrong with a recording, and no others but those allowed."""
    case = make()
    found = verify(case.recording(), contract=case.contract).findings
    messages = [finding.message for finding in found if finding.rule == rule]
    assert any(message in each for each in messages), [(f.rule, f.message) for f in found]
    assert {finding.rule for finding in found} <= {rule} | also


PLANNERS = ("rrt", "rrt-connect", "bi-rrt", "rrt-star", "bi-rrt-star", "lrta-star", "a-star")
"""Registered planners."""


def _case(run: Run, contract: Contract | None = None) -> Case:
    memory = Memory()
    run.execute([memory])
    return Case(run.manifest, run.problem.world, memory.events(), contract)


@cache
def planned(name: str) -> Case:
    """A run of a registered planner, or of a toy, that finds a path."""
    toy = TOYS.get(name)
    n = 40 if toy is None else 0 if name == "march" else 15
    scenario = Scenario(
        world=f"circles2d:n={n},seed=3", planner=name if toy is None else f"toy-{name}", seed=3,
        iterations=100 if toy is not None else 1000, smooth=toy is None or name == "pair",
        clock="logical",
    )  # fmt: skip
    run = Run(scenario, planner=toy)
    return _case(run, None if toy is None else toy.contract(run.problem))


def on(name: str, edit: Edit) -> Callable[[], Case]:
    """Edit a run of `planned`."""
    return lambda: edit(planned(name))


def run_of(**given: Any) -> Case:
    """A run of a scenario."""
    return _case(Run(Scenario(**({"clock": "logical", "world": "circles2d:n=40,seed=3"} | given))))


_CELLS = {"cell": 4.0, "max_move": 6.0}
_LATTICE = {"world": "circles2d:n=25,seed=3", "smooth": False}
_STAR = {"planner": "rrt-star", "seed": 3, "iterations": 120}
_PAIR = _STAR | {"planner": "bi-rrt-star", "params": {"step": 8, "connect_distance": 25}}
SHORT: dict[str, dict[str, Any]] = {
    "rrt": {"seed": 3},
    "sliced": {"params": {"keep_intermediate": True, "slices": 3, "step": 9.0}, "seed": 3},
    "rrt-connect": {"planner": "rrt-connect", "seed": 3},
    "bi-rrt": {"planner": "bi-rrt", "seed": 3},
    "rrt-star": _STAR,
    "bi-rrt-star": _PAIR,
    "blocked": _PAIR | {"iterations": 500, "smooth": False},
    "informed": _STAR | {"params": {"informed": True, "step": 9.0}, "iterations": 200},
    "a-star": _LATTICE | {"planner": "a-star", "params": _CELLS},
    "lrta-star": _LATTICE | {"planner": "lrta-star", "params": _CELLS | {"trials": 2}},
    "one trial": _LATTICE | {"planner": "lrta-star", "params": _CELLS},
    "ahead": _LATTICE | {"planner": "lrta-star", "params": _CELLS | {"lookahead": 12}},
    "executed": {"execute": True, "max_move": 5.0, "seed": 3},
}
"""Scenarios of short runs."""


@cache
def short(name: str) -> Case:
    """A run of one of the `SHORT` scenarios."""
    return run_of(**({"shortcuts": 20} | SHORT[name]))


def first(table: Table, **wanted: int) -> int:
    """The first row in which fields have certain values."""
    rows = np.ones(len(table), bool)
    for name, value in wanted.items():
        rows &= table[name] == value
    return int(np.flatnonzero(rows)[0])


def change(run: str, kind: Kind, where: dict[str, int] | int = 0, **fields: object) -> Case:
    """Change fields of one event of a short run: of a row, or of the first event that matches."""
    case = short(run)
    row = where if isinstance(where, int) else first(case.log[kind], **where)
    return case.edit(kind, row, **fields)


def moved(run: str, kind: Kind, row: int, by: float) -> Case:
    """Move a configuration of a short run."""
    case = short(run)
    return case.edit(kind, row, q=case.log[kind]["q"][row] + by)


def altered(how: Callable[..., Events | None], run: str, kind: Kind, row: int = 0) -> Case:
    """Alter an event of a short run by a way of `tests.support.doctoring`."""
    case = short(run)
    log = how(case.log, kind, range(len(case.log[kind]))[row], np.random.default_rng(0))
    assert log is not None
    return replace(case, log=log)


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
    "wrapping": Scenario(
        world="circles2d:n=12,seed=2,max_radius=4",
        robot="chain:links=3,length=9,width=1,wrap=true",
        start=(0.0, 0.5, 0.5), goal=(-2.0, -1.0, 1.0), clock="logical", iterations=1000,
    ),
}  # fmt: skip
"""Scenarios of robots with bodies."""


@cache
def body(name: str) -> Case:
    """A run of one of the `BODIES`."""
    return _case(Run(BODIES[name]))


def on_body(name: str, edit: Edit) -> Callable[[], Case]:
    """Edit a run of `body`."""
    return lambda: edit(body(name))


def leaf(case: Case) -> int:
    """The row of the newest node without children that is on no path, link or rewire."""
    edges = case.log[Kind.EDGE]
    used = set(edges["parent"].tolist())
    for kind, name in ((Kind.REWIRE, "node"), (Kind.REWIRE, "parent"), (Kind.CONNECT, "node")):
        used |= set(case.log[kind][name].tolist())
    used |= set(case.log[Kind.CONNECT]["other"].tolist())
    places = {tuple(q) for path in case.log[Kind.PATH]["waypoints"] for q in path.tolist()}
    return [
        row
        for row, edge in enumerate(edges)
        if edge["node"] not in used
        and tuple(edge["q"].tolist()) not in places
        and edge["tree"] == 0
    ][-1]


def leaf_edge(**fields: Any) -> Edit:
    """Change fields of a leaf's edge."""
    return lambda case: case.edit(Kind.EDGE, leaf(case), **fields)


def posed(*numbers: float | None) -> Edit:
    """Move a leaf: to the numbers of a configuration that are not None."""

    def edit(case: Case) -> Case:
        q = case.log[Kind.EDGE]["q"][leaf(case)].copy()
        for k, number in enumerate(numbers):
            q[k] = q[k] if number is None else number
        return leaf_edge(q=q)(case)

    return edit


def shifted(kind: Kind, name: str, row: int, more: float) -> Edit:
    """Add something to a field."""
    return lambda case: case.shift(kind, row, name, more)


GROWTH = {
    "steering", "rejections", "reasons", "sources", "link attempts", "extensions", "meetings",
    "nodes", "times", "edge costs", "edge lengths", "iterations", "no duplicates",
    "phase contents", "limits",
}  # fmt: skip
"""Rules about growth that may be broken together with another one of them."""

SEARCH = {
    "best first", "expansions", "shortest paths", "search exhausted", "neighbours", "choices",
    "limits", "estimates", "estimates admissible", "cells on lattice", "cell numbers",
    "goal reached", "iterations", "times", "lattice moves", "paths walked", "rejections",
    "no duplicates", "paths free", "outcome", "lookahead", "learning", "frontier moves",
}  # fmt: skip
"""The same for searches."""

FREE = {"edges free", "paths free", "shortcuts"}
LENGTHS = {"edge lengths", "edge costs", "steering"}
"""The same for edges that are in the way of obstacles, or longer."""
