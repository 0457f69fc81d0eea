"""Searches on a lattice: logs that were doctored against the order in which cells are looked at."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from brrt import Kind, Problem
from brrt.events import Status
from brrt.planners import make_planner
from brrt.verification import examine
from tests.verification.test_rules import Evidence, evidence, promise
from tests.verification.test_sampling import run_of

WIDE = {"planner": "a-star", "world": "circles2d:n=25,seed=3", "smooth": False}
A_STAR = WIDE | {"params": {"epsilon": 4.0, "max_move": 6.0}}
WALK = WIDE | {"planner": "lrta-star", "params": {"epsilon": 4.0, "max_move": 6.0}}
AHEAD = WALK | {"params": {"epsilon": 4.0, "max_move": 6.0, "lookahead": 12}}


def dearer(case: Evidence) -> Evidence:
    """Cells that were reached by a way round, all of them, so that the order stays."""
    table = case.log[Kind.EXPAND].copy()
    table["cost"][len(table) // 2 :] += 8.0
    return replace(case, log=replace(case.log, tables={**case.log.tables, Kind.EXPAND: table}))


def swapped(case: Evidence) -> Evidence:
    """Two cells in the wrong order: those with the greatest difference."""
    table = case.log[Kind.EXPAND].copy()
    f = table["cost"] + np.linalg.norm(table["q"] - case.manifest.goal, axis=1)
    row = 1 + int(np.argmax(np.diff(f)[1:]))
    for name in ("cell", "parent", "cost", "q"):
        table[name][[row, row + 1]] = table[name][[row + 1, row]]
    return replace(case, log=replace(case.log, tables={**case.log.tables, Kind.EXPAND: table}))


def given_up(case: Evidence) -> Evidence:
    """A search that ends half-way and says that there is no path."""
    end = int(case.log[Kind.EXPAND]["seq"][40])
    tables: dict[Kind, np.ndarray] = {}
    for kind, table in case.log.tables.items():
        if kind is not Kind.PATH:
            kept = (table["seq"] <= end) | (kind is Kind.PHASE)
            tables[kind] = table[kept].copy()
    tables[Kind.PHASE]["status"][-1] = Status.NO_PATH
    return replace(case, log=replace(case.log, tables=tables))


def longer_arm(case: Evidence) -> Evidence:
    """The goal would have been in reach much earlier."""
    base = make_planner(case.manifest.scenario).contract(
        Problem.of(case.manifest.scenario, case.world)
    )
    assert base.lattice is not None
    return promise(lattice=replace(base.lattice, max_move=40.0))(case)


def estimate(more: float) -> Callable[[], Evidence]:
    """The first estimate that was raised, by too much or too little."""

    def doctor() -> Evidence:
        case = run_of(**WALK)
        h = case.log[Kind.HEURISTIC]["h"][0]
        return case.edit(Kind.HEURISTIC, 0, h=h + more)

    return doctor


ALL = {"choices", "estimates", "estimates admissible", "best first", "expansions"}

DOCTORED: list[tuple[str, Callable[[], Evidence], set[str]]] = [
    ("best first", lambda: swapped(run_of(**A_STAR)), {"expansions", "shortest ways"}),
    ("best first", lambda: swapped(run_of(**AHEAD)), {"expansions"}),
    ("shortest ways", lambda: dearer(run_of(**A_STAR)), {"expansions"}),
    ("nothing left", lambda: given_up(run_of(**A_STAR)), {
        "numbering", "cells keep their numbers", "iterations"}),
    ("goal taken", lambda: longer_arm(run_of(**A_STAR)), set()),
    ("goal taken", lambda: longer_arm(run_of(**WALK)), set()),
    ("choices", estimate(0.5), ALL),
    ("choices", estimate(-0.01), ALL),
    ("choices", lambda: run_of(**WALK).drop(Kind.HEURISTIC, 0), ALL),
]  # fmt: skip


@pytest.mark.parametrize(
    ("rule", "doctored", "also"), DOCTORED, ids=[f"{r} {i}" for i, (r, *_) in enumerate(DOCTORED)]
)
def test_doctored_searches_are_found(
    rule: str, doctored: Callable[[], Evidence], also: set[str]
) -> None:
    """As in test_checks."""
    broken = doctored().broken()
    assert rule in broken
    assert broken - {rule} <= also


def test_clean_runs_are_not_accused() -> None:
    """Of what the doctored ones are made from; and where there is no path, all was looked at."""
    for scenario in (A_STAR, WALK, AHEAD):
        assert run_of(**scenario).broken() == set()
    assert evidence("walk").broken() == set()


def test_no_path_is_proved() -> None:
    """Cells so large that the goal is out of reach of all of them."""
    case = run_of(planner="a-star", smooth=False, params={"epsilon": 60.0, "max_move": 0.0})
    results = {t.rule: t for t in examine(case.manifest, case.world, case.log)}
    assert case.log[Kind.PHASE]["status"][-1] == Status.NO_PATH
    assert results["nothing left"].examined > 0
    assert not results["nothing left"].broken
