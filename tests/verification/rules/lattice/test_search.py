"""Recordings that break rules about the order of a search."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from brrt import Kind, verify
from brrt.events import Status
from tests.support.cases import (
    SEARCH,
    Case,
    Doctored,
    altered,
    change,
    check_found,
    doctored,
    moved,
    run_of,
    short,
)
from tests.support.doctoring import doubled, dropped


def dearer(case: Case) -> Case:
    """Raise the costs of half of the cells, so that the order remains."""
    table = case.log[Kind.EXPAND].copy()
    table["cost"][len(table) // 2 :] += 8.0
    return replace(case, log=replace(case.log, tables={**case.log.tables, Kind.EXPAND: table}))


def swapped(case: Case) -> Case:
    """Swap two cells, those with the greatest difference."""
    table = case.log[Kind.EXPAND].copy()
    f = table["cost"] + np.linalg.norm(table["q"] - case.manifest.goal, axis=1)
    row = 1 + int(np.argmax(np.diff(f)[1:]))
    for name in ("cell", "parent", "cost", "q"):
        table[name][[row, row + 1]] = table[name][[row + 1, row]]
    return replace(case, log=replace(case.log, tables={**case.log.tables, Kind.EXPAND: table}))


def given_up(case: Case) -> Case:
    """End a search half-way, as if there were no path."""
    end = int(case.log[Kind.EXPAND]["seq"][40])
    tables: dict[Kind, np.ndarray] = {}
    for kind, table in case.log.tables.items():
        if kind is not Kind.PATH:
            kept = (table["seq"] <= end) | (kind is Kind.PHASE)
            tables[kind] = table[kept].copy()
    tables[Kind.PHASE]["status"][-1] = Status.NO_PATH
    return replace(case, log=replace(case.log, tables=tables))


def longer_moves(case: Case) -> Case:
    """Judge by a move with which the goal is in reach much earlier."""
    return case.judged_by("lattice", max_move=40.0)


DOCTORED: list[Doctored] = [
    ("neighbours", "rejected again", lambda: altered(doubled, "a-star", Kind.REJECT, 1), SEARCH),
    ("neighbours", "no neighbour of the last", lambda: change("a-star", Kind.REJECT, 3, node=0),
     SEARCH),
    ("neighbours", "no neighbour of the last", lambda: moved("ahead", Kind.REJECT, 3, 1.0),
     SEARCH),
    ("neighbours", "out of reach but not rejected", lambda: altered(dropped, "a-star", Kind.REJECT,
     3), SEARCH),
    ("neighbours", "out of reach but not rejected", lambda: altered(dropped, "ahead", Kind.REJECT,
     3), SEARCH),
    ("best first", "", lambda: swapped(short("a-star")), {"expansions", "shortest paths"}),
    ("best first", "", lambda: swapped(short("ahead")), {"expansions"}),
    ("shortest paths", "", lambda: dearer(short("a-star")), {"expansions"}),
    ("search exhausted", "", lambda: given_up(short("a-star")), {"numbering", "cell numbers",
     "iterations"}),
    ("goal reached", "", lambda: longer_moves(short("a-star")), set()),
    ("goal reached", "", lambda: longer_moves(short("one trial")), set()),
    ("goal reached", "the motion to the goal is", lambda: short("a-star").judged_by("lattice",
     max_move=0.1), set()),
]  # fmt: skip


@doctored(DOCTORED)
def test_doctored_recordings_are_found(
    rule: str, message: str, make: Callable[[], Case], also: set[str]
) -> None:
    """By the rule that they break."""
    check_found(rule, message, make, also)


@pytest.mark.parametrize("name", ["a-star", "one trial", "ahead"])
def test_clean_runs_are_not_accused(name: str) -> None:
    """The runs that are doctored above."""
    assert short(name).broken() == set()


def test_no_path_is_proved() -> None:
    """Cells so large that none leads through a passage."""
    params = {"cell": 7.5}
    case = run_of(world="passage2d:gap=3", planner="a-star", smooth=False, params=params)
    results = {each.rule: each for each in verify(case.recording()).results}
    assert case.log[Kind.PHASE]["status"][-1] == Status.NO_PATH
    assert results["search exhausted"].examined > 0
    assert not results["search exhausted"].broken
