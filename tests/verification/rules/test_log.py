"""Recordings that break rules about any log."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from brrt import Claims, Kind
from tests.support.cases import (
    FREE,
    GROWTH,
    LENGTHS,
    SEARCH,
    Case,
    Doctored,
    change,
    check_found,
    doctored,
    moved,
    on,
    on_body,
    posed,
    shifted,
    short,
)

DOCTORED: list[Doctored] = [
    ("numbering", "", on("rrt", shifted(Kind.PHASE, "seq", -1, 5)), set()),
    ("times", "", on("rrt", shifted(Kind.EDGE, "t", 5, -5000)), set()),
    ("times", "", on("rrt", shifted(Kind.EDGE, "iteration", 5, -1000)), {"budget", "iterations"}),
    ("names", "", on("rrt", lambda c: c.edit(Kind.SAMPLE, 3, source=99)), set()),
    ("names", "unknown reason", lambda: change("rrt", Kind.REJECT, 3, reason=99), GROWTH),
    ("names", "unknown stage", lambda: change("rrt", Kind.PATH, 0, stage=99), {"paths improve"}),
    ("metrics", "", on("rrt", lambda c: c.with_metric("path_cost", 1.0)), set()),
    ("metrics", "", on("rrt", lambda c: c.with_metric("path_cost", None)), set()),
    ("metrics", "", on("rrt-star", lambda c: c.with_metric("solved", False)), set()),
    ("metrics", "", on("lrta-star", lambda c: c.with_metric("moves", 7)), set()),
    ("metrics", "", on("a-star", lambda c: c.with_metric("path", [[0.0, 0.0]])), set()),
    ("bounds", "", on("rrt", lambda c: c.edit(Kind.SAMPLE, 1, q=[-3.0, 5.0])), {"samples",
     "steering"}),
    ("bounds", "", on("rrt", lambda c: c.edit(Kind.SAMPLE, 1, q=[np.nan, 5.0])), {"samples",
     "steering"}),
    ("bounds", "edge at", on_body("polygon", posed(None, None, np.pi)), FREE | LENGTHS),
    ("bounds", "edge at", on_body("polygon", posed(None, None, -4.0)), FREE | LENGTHS),
    ("bounds", "edge at", on_body("chain", posed(None, 3.01)), FREE | LENGTHS),
    ("bounds", "edge at", on_body("wrapping", posed(None, np.pi)), FREE | LENGTHS),
    ("bounds", "edge at", on_body("wrapping", posed(3.2)), FREE | LENGTHS),
    ("bounds", "edge at", lambda: moved("rrt", Kind.EDGE, -1, 500.0), {*GROWTH, "edges free",
     "paths in trees"}),
    ("bounds", "expand at", lambda: moved("a-star", Kind.EXPAND, -1, 500.0), SEARCH),
    ("bounds", "heuristic at", lambda: moved("lrta-star", Kind.HEURISTIC, 0, 500.0), SEARCH),
    ("bounds", "move at", lambda: moved("executed", Kind.MOVE, 1, 500.0), {"move costs",
     "move lengths", "moves along path", "moves free", "move counts"}),
    ("bounds", "waypoint 1 at", lambda: change("rrt", Kind.PATH, 0,
     waypoints=np.insert(short("rrt").log[Kind.PATH]["waypoints"][0], 1, [-9.0, 4.0], axis=0)),
     {"path costs", "paths in trees", "shortcuts", "smoothed", "random pairs", "paths free"}),
    ("contract", "", on("rrt", lambda c: c.with_stated(stops=None)), set()),
    ("contract", "", on("rrt-star", lambda c: c.with_stated(draws=None)), set()),
    ("contract", "the recording claims edges: assumed", on("rrt", lambda c: replace(c,
     manifest=replace(c.manifest, claims=Claims(edges="assumed")))), set()),
]  # fmt: skip


@doctored(DOCTORED)
def test_doctored_recordings_are_found(
    rule: str, message: str, make: Callable[[], Case], also: set[str]
) -> None:
    """By the rule that they break."""
    check_found(rule, message, make, also)
