"""Recordings that break rules about cells and estimates."""

from collections.abc import Callable

import numpy as np

from brrt import Kind
from tests.support.cases import (
    SEARCH,
    Case,
    Doctored,
    altered,
    check_found,
    doctored,
    moved,
    on,
    shifted,
    short,
)
from tests.support.doctoring import doubled


def too_high(case: Case) -> Case:
    """Raise an estimate far too much, of a cell from which the goal was reached in the end."""
    return case.shift(Kind.HEURISTIC, -1, "h", 1000.0)


def too_low(case: Case) -> Case:
    """State an estimate below the distance to the goal."""
    return case.edit(Kind.HEURISTIC, -1, h=0.5)


def two_cells(case: Case) -> Case:
    """Reach a cell from one that is no neighbour, at the cost of the distance."""
    table = case.log[Kind.EXPAND]
    row = len(table) - 1
    far = float(np.linalg.norm(table["q"][row] - table["q"][0]))
    return case.edit(Kind.EXPAND, row, parent=0, cost=far)


def between_cells(case: Case) -> Case:
    """Put a ball between a cell and its parent."""
    table = case.log[Kind.EXPAND]
    parent = table[table["cell"] == table["parent"][-1]][0]
    return case.with_ball((table["q"][-1] + parent["q"]) / 2)


DOCTORED: list[Doctored] = [
    ("cells on lattice", "", on("walk", lambda c: c.edit(Kind.EXPAND, 3,
     q=c.log[Kind.EXPAND]["q"][3] + 0.1)), {"expansions"}),
    ("cell numbers", "", on("walk", shifted(Kind.EXPAND, "cell", 3, 999)), {"choices",
     "lookahead"}),
    ("cell numbers", "", on("walk", lambda c: c.edit(Kind.EXPAND, 3, cell=-3)), {"choices",
     "lookahead"}),
    ("expansions", "", on("walk", lambda c: c.edit(Kind.EXPAND, 3, parent=0)), {"best first",
     "lookahead"}),
    ("expansions", "", on("walk", shifted(Kind.EXPAND, "cost", 3, 1.0)), set()),
    ("expansions", "again in one search", lambda: altered(doubled, "a-star", Kind.EXPAND, 5),
     SEARCH),
    ("expansions", "without a move", lambda: altered(doubled, "lrta-star", Kind.EXPAND, 5),
     SEARCH),
    ("expansions", "the robot is at", lambda: moved("lrta-star", Kind.EXPAND, 5, 4.0), SEARCH),
    ("expansions", "are not neighbours", lambda: two_cells(short("a-star")), SEARCH),
    ("expansions", "motion between cells hits", lambda: between_cells(short("a-star")), SEARCH),
    ("estimates", "", on("walk", too_low), {"choices"}),
    ("estimates", "after", lambda: altered(doubled, "lrta-star", Kind.HEURISTIC, 2), SEARCH),
    ("estimates admissible", "", on("walk", too_high), {"choices"}),
    ("lattice moves", "", on("walk", lambda c: c.judged_by("lattice", cell=5.0)), {"choices",
     "neighbours"}),
]  # fmt: skip


@doctored(DOCTORED)
def test_doctored_recordings_are_found(
    rule: str, message: str, make: Callable[[], Case], also: set[str]
) -> None:
    """By the rule that they break."""
    check_found(rule, message, make, also)
