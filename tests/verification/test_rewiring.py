"""Trees that rewire: logs that were doctored against the choice of parents and what follows it."""

from collections.abc import Callable

import numpy as np
import pytest

from brrt import Kind
from brrt.events import Reason
from brrt.scenario.contract import Near
from tests.verification.test_rules import Evidence, evidence, promise
from tests.verification.test_sampling import run_of

STAR = {"planner": "rrt-star", "seed": 3, "iterations": 500, "smooth": False}
PAIR = STAR | {"planner": "bi-rrt-star", "params": {"step": 8, "connect_distance": 25}}


def without(kind: Kind, only: str, scenario: dict[str, object]) -> Evidence:
    """Leave out an event, one that breaks this rule alone."""
    case = run_of(**scenario)
    for row in range(len(case.log[kind]) - 1, -1, -1):
        other = case.drop(kind, row)
        if other.broken() == {only}:
            return other
    raise AssertionError


def unseen_link(case: Evidence) -> Evidence:
    """Nobody says that the newest nodes cannot be joined."""
    reasons = case.log[Kind.REJECT]["reason"]
    return case.drop(Kind.REJECT, int(np.flatnonzero(reasons == Reason.LINK_BLOCKED)[0]))


def older_link(case: Evidence) -> Evidence:
    """A link to the node before the newest, at its true cost."""
    links, edges = case.log[Kind.CONNECT], case.log[Kind.EDGE]
    mine = edges[(edges["tree"] == 0) & (edges["seq"] < links["seq"][-1])]
    return case.edit(Kind.CONNECT, -1, node=int(mine["node"][-2]))


WIDER = promise(near=Near(1e9, 40.0, 2))

DOCTORED: list[tuple[str, Callable[[], Evidence], set[str]]] = [
    ("parents", lambda: WIDER(evidence("rrt-star")), {"rewirings"}),
    ("parents", lambda: WIDER(evidence("bi-rrt-star")), {"rewirings"}),
    ("parents", lambda: without(Kind.REJECT, "parents", STAR), set()),
    ("rewirings", lambda: WIDER(evidence("rrt-star")), {"parents"}),
    ("rewirings", lambda: without(Kind.REWIRE, "rewirings", STAR), set()),
    ("paths told", lambda: without(Kind.PATH, "paths told", STAR), set()),
    ("paths told", lambda: without(Kind.PATH, "paths told", PAIR), set()),
    ("meetings", lambda: unseen_link(run_of(**PAIR)), set()),
    ("meetings", lambda: older_link(run_of(**PAIR)), {"links", "paths in trees", "paths told"}),
    ("meetings", lambda: promise(link=60.0)(run_of(**PAIR)), set()),
]  # fmt: skip


@pytest.mark.parametrize(
    ("rule", "doctored", "also"), DOCTORED, ids=[f"{r} {i}" for i, (r, *_) in enumerate(DOCTORED)]
)
def test_doctored_rewiring_is_found(
    rule: str, doctored: Callable[[], Evidence], also: set[str]
) -> None:
    """As in test_checks."""
    broken = doctored().broken()
    assert rule in broken
    assert broken - {rule} <= also


def test_clean_runs_are_not_accused() -> None:
    """Of what the doctored ones are made from."""
    for scenario in (STAR, PAIR):
        assert run_of(**scenario).broken() == set()
