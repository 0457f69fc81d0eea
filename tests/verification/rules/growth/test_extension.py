"""Recordings that break rules about how trees grow."""

from collections.abc import Callable

import numpy as np

from brrt import Kind
from brrt.events import Reason
from tests.support.cases import (
    GROWTH,
    Case,
    Doctored,
    altered,
    check_found,
    doctored,
    first,
    planned,
    run_of,
    short,
)
from tests.support.doctoring import dropped

SMALLER = {"planner": "bi-rrt", "params": {"turn": "smaller", "step": 4}, "seed": 3}
COIN = {"planner": "bi-rrt", "params": {"turn": "coin", "step": 2}, "seed": 3}
FAILED = {Reason.COLLISION, Reason.NO_PROGRESS}


def second_nearest(case: Case) -> Case:
    """Give a leaf another parent within a step, with its right cost."""
    edges = case.log[Kind.EDGE]
    for row in range(len(edges) - 1, 1, -1):
        if row in edges["parent"]:
            continue
        far = np.linalg.norm(edges["q"][:row] - edges["q"][row], axis=1)
        for parent in np.flatnonzero(far < 5.0).tolist():
            if parent != edges["parent"][row]:
                cost = edges["cost"][parent] + far[parent]
                other = case.edit(Kind.EDGE, row, parent=parent, cost=cost)
                if other.broken() == {"steering"}:
                    return other
    raise AssertionError


def not_reported(case: Case) -> Case:
    """Drop a rejection by which tree 1 has aimed at a node of tree 0."""
    rejects, samples = case.log[Kind.REJECT], case.log[Kind.SAMPLE]
    turn = samples["tree"][np.searchsorted(samples["seq"], rejects["seq"]) - 1]
    of_other = (rejects["tree"] == 1) & (turn != 1)
    rows = np.flatnonzero(of_other & np.isin(rejects["reason"], list(FAILED)))
    return case.drop(Kind.REJECT, int(rows[0]))


def older_node(case: Case) -> Case:
    """State that a link to a node before the newest is blocked."""
    rejects, edges = case.log[Kind.REJECT], case.log[Kind.EDGE]
    row = first(rejects, reason=Reason.LINK_BLOCKED)
    return case.edit(Kind.REJECT, row, node=0, q=edges["q"][1])


def unseen_link(case: Case) -> Case:
    """Drop the rejection of a link between the newest nodes."""
    return case.drop(Kind.REJECT, first(case.log[Kind.REJECT], reason=Reason.LINK_BLOCKED))


def older_link(case: Case) -> Case:
    """Link the node before the newest."""
    links, edges = case.log[Kind.CONNECT], case.log[Kind.EDGE]
    mine = edges[(edges["tree"] == 0) & (edges["seq"] < links["seq"][-1])]
    return case.edit(Kind.CONNECT, -1, node=int(mine["node"][-2]))


DOCTORED: list[Doctored] = [
    ("turns", "", lambda: run_of(**SMALLER).judged_by("growth", turn="alternate"), set()),
    ("turns", "", lambda: planned("rrt-connect").judged_by("growth", turn="smaller"), set()),
    ("turns", "", lambda: run_of(**COIN).judged_by("growth", turn="alternate"), {"link attempts"}),
    ("steering", "", lambda: second_nearest(planned("rrt")), set()),
    ("steering", "", lambda: planned("rrt").edit(Kind.SAMPLE, 20, q=[50.0, 90.0]), set()),
    ("steering", "", lambda: planned("rrt-star").edit(Kind.SAMPLE, 20, q=[50.0, 90.0]), set()),
    ("steering", "", lambda: planned("rrt-connect").edit(Kind.SAMPLE, 3, q=[50.0, 90.0]), set()),
    ("steering", "", lambda: planned("bi-rrt-star").edit(Kind.SAMPLE, 9, q=[50.0, 90.0]), set()),
    ("steering", "", lambda: planned("rrt").judged_by("growth", slices=2), {"extensions"}),
    ("goal attempts", "", lambda: planned("rrt").judged_by(line_of_sight=True), set()),
    ("link attempts", "must not follow", lambda: altered(dropped, "rrt-connect", Kind.REJECT, 0),
     GROWTH),
    ("link attempts", "", lambda: planned("rrt-connect").judged_by("growth", links="extend"),
     set()),
    ("link attempts", "", lambda: planned("bi-rrt").judged_by("growth", links="connect"), set()),
    ("link attempts", "", lambda: planned("rrt-connect").judged_by("growth", connects=True),
     set()),
    ("link attempts", "", lambda: planned("rrt-connect").judged_by("growth", always_links=True),
     set()),
    ("link attempts", "", lambda: not_reported(planned("rrt-connect")), set()),
    ("link attempts", "", lambda: not_reported(planned("bi-rrt-star")), {"extensions"}),
    ("meetings", "not newest", lambda: older_node(short("blocked")), {"reasons", "rejections"}),
    ("meetings", "", lambda: unseen_link(short("blocked")), set()),
    ("meetings", "", lambda: older_link(short("blocked")), {"links", "link costs",
     "links free", "paths in trees", "paths reported"}),
    ("meetings", "", lambda: short("blocked").judged_by(link=60.0), set()),
]  # fmt: skip


@doctored(DOCTORED)
def test_doctored_recordings_are_found(
    rule: str, message: str, make: Callable[[], Case], also: set[str]
) -> None:
    """By the rule that they break."""
    check_found(rule, message, make, also)
