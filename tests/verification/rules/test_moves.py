"""Recordings that break rules about moves."""

from collections.abc import Callable

import numpy as np

from brrt import Kind
from tests.support.cases import (
    SEARCH,
    Case,
    Doctored,
    altered,
    change,
    check_found,
    doctored,
    on,
    shifted,
    short,
)
from tests.support.doctoring import dropped, swapped


def detour(case: Case) -> Case:
    """Report a trial that went another way."""
    path = case.log[Kind.PATH]["waypoints"][0]
    return case.edit(Kind.PATH, 0, waypoints=np.insert(path, 1, path[0], axis=0))


DOCTORED: list[Doctored] = [
    ("moves", "", on("march", shifted(Kind.MOVE, "step", 7, 1)), set()),
    ("moves", "", on("walk", shifted(Kind.MOVE, "trial", 0, 5)), {"move costs", "move lengths",
     "lattice moves", "choices", "paths walked"}),
    ("move costs", "", on("march", shifted(Kind.MOVE, "cost", -1, 1e-6)), set()),
    ("move lengths", "", on("march", lambda c: c.edit(Kind.MOVE, -1,
     q=c.log[Kind.MOVE]["q"][-2] + 5.0)), {"move costs", "arrival", "moves along path",
     "move counts"}),
    ("moves free", "", on("march", lambda c: c.with_ball(c.log[Kind.MOVE]["q"][50])),
     {"paths free"}),
    ("arrival", "", on("march", lambda c: c.drop(Kind.MOVE, -1)), set()),
    ("arrival", "the last move ends at", lambda: altered(dropped, "executed", Kind.MOVE, -1),
     set()),
    ("paths walked", "not where the robot went", lambda: detour(short("lrta-star")), set()),
    ("paths walked", "arrived before", lambda: altered(swapped, "lrta-star", Kind.PATH), SEARCH),
    ("paths walked", "of 2 trials arrived", lambda: altered(dropped, "lrta-star", Kind.PATH, -1),
     set()),
    ("paths walked", "continues after its path", lambda: change("lrta-star", Kind.MOVE, {"trial":
     1}, trial=0), {*SEARCH, "moves", "move costs", "move lengths", "moves free"}),
    ("moves along path", "", on("march", lambda c: c.edit(Kind.PATH, 0,
     waypoints=c.log[Kind.PATH]["waypoints"][0][[0, 2]])), {"path costs", "move counts"}),
    ("move counts", "", on("march", lambda c: c.with_scenario(max_move=7.0)), set()),
]  # fmt: skip


@doctored(DOCTORED)
def test_doctored_recordings_are_found(
    rule: str, message: str, make: Callable[[], Case], also: set[str]
) -> None:
    """By the rule that they break."""
    check_found(rule, message, make, also)
