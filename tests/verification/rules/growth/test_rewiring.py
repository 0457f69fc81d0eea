"""Recordings that break rules about the choice of parents, and what follows from it."""

from collections.abc import Callable

from brrt import Kind
from brrt.scenario.contract import Near
from tests.support.cases import Case, Doctored, check_found, doctored, planned, run_of, short

STAR = {"planner": "rrt-star", "seed": 3, "iterations": 500, "smooth": False}


def without(kind: Kind, only: str, case: Case) -> Case:
    """Drop an event, one that breaks only this rule."""
    for row in range(len(case.log[kind]) - 1, -1, -1):
        other = case.drop(kind, row)
        if other.broken() == {only}:
            return other
    raise AssertionError


def wider(case: Case) -> Case:
    """Judge by a larger radius."""
    return case.judged_by(near=Near(1e9, 40.0, 2))


def narrower(case: Case) -> Case:
    """Judge by a radius that holds the nearest nodes, but not all parents."""
    return case.judged_by(near=Near(1e9, 3.0, 2))


DOCTORED: list[Doctored] = [
    ("parents", "others are near", lambda: narrower(short("rrt-star")), {"rewirings",
     "rewires near"}),
    ("parents", "", lambda: wider(planned("rrt-star")), {"rewirings"}),
    ("parents", "", lambda: wider(planned("bi-rrt-star")), {"rewirings"}),
    ("parents", "", lambda: without(Kind.REJECT, "parents", run_of(**STAR)), set()),
    ("rewirings", "", lambda: wider(planned("rrt-star")), {"parents"}),
    ("rewirings", "", lambda: without(Kind.REWIRE, "rewirings", run_of(**STAR)), set()),
    ("paths reported", "", lambda: without(Kind.PATH, "paths reported", run_of(**STAR)), set()),
    ("paths reported", "", lambda: without(Kind.PATH, "paths reported", short("blocked")), set()),
]  # fmt: skip


@doctored(DOCTORED)
def test_doctored_recordings_are_found(
    rule: str, message: str, make: Callable[[], Case], also: set[str]
) -> None:
    """By the rule that they break."""
    check_found(rule, message, make, also)


def test_clean_runs_are_not_accused() -> None:
    """The runs that are doctored above."""
    for case in (run_of(**STAR), short("blocked")):
        assert case.broken() == set()
