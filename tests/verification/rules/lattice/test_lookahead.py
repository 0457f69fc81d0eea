"""Recordings that break rules about robots that search several cells ahead."""

from collections.abc import Callable

import numpy as np

from brrt import Kind
from tests.support.cases import SEARCH, Case, Doctored, check_found, doctored, first, short


def ahead(lookahead: int) -> Case:
    """Judge a run with a lookahead of 12 by another one."""
    return short("ahead").judged_by("lattice", lookahead=lookahead)


def shorter_move(case: Case) -> Case:
    """Search again a cell before the frontier."""
    expands, moves = case.log[Kind.EXPAND], case.log[Kind.MOVE]
    begins = expands["seq"][expands["parent"] < 0]
    last = np.searchsorted(moves["seq"], begins[1]) - 1
    row = first(expands, seq=int(begins[1]))
    return case.edit(Kind.EXPAND, row, cell=moves["cell"][last - 1], q=moves["q"][last - 1])


def costlier(row: int) -> Callable[[], Case]:
    """Reach a cell at more cost."""
    return lambda: short("ahead").shift(Kind.EXPAND, row, "cost", 0.5)


def learned(more: float) -> Callable[[], Case]:
    """Raise an estimate by too much or too little."""
    return lambda: short("ahead").shift(Kind.HEURISTIC, 8, "h", more)


DOCTORED: list[Doctored] = [
    ("lookahead", "the lookahead is 24", lambda: ahead(24), {"best first"}),
    ("lookahead", "the lookahead is 6", lambda: ahead(6), {"best first"}),
    ("lookahead", "which the last one expanded", lambda: shorter_move(short("ahead")), {*SEARCH,
     "best first", "shortest paths"}),
    ("learning", "the cells around it allow", learned(0.5), set()),
    ("learning", "the cells around it allow", learned(-0.01), set()),
    ("learning", "", lambda: short("ahead").drop(Kind.HEURISTIC, 8), SEARCH),
    ("learning", "", lambda: short("ahead").drop(Kind.REJECT, 21), {"neighbours"}),
    ("frontier moves", "the least is", lambda: short("ahead").drop(Kind.REJECT, 6), {"neighbours",
     "learning"}),
    ("frontier moves", "the least is", costlier(50), {"expansions"}),
    ("frontier moves", "to a cell that is", costlier(41), {"expansions", "best first"}),
]  # fmt: skip


@doctored(DOCTORED)
def test_doctored_recordings_are_found(
    rule: str, message: str, make: Callable[[], Case], also: set[str]
) -> None:
    """By the rule that they break."""
    check_found(rule, message, make, also)


def test_planners_may_learn_otherwise() -> None:
    """If their contract does not state that they back estimates up."""
    case = learned(0.5)().judged_by("lattice", backs_up=False)
    assert case.broken() == set()
