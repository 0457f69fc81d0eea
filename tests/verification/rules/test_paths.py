"""Recordings that break rules about paths."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from brrt import Kind
from brrt.events import Stage
from tests.support.cases import (
    GROWTH,
    Case,
    Doctored,
    Edit,
    altered,
    change,
    check_found,
    doctored,
    first,
    on,
    shifted,
    short,
)
from tests.support.doctoring import doubled, dropped


def moved_waypoint(row: int, which: int) -> Edit:
    """Move a waypoint."""

    def edit(case: Case) -> Case:
        path = case.log[Kind.PATH]["waypoints"][row].copy()
        path[which] += 0.25
        return case.edit(Kind.PATH, row, waypoints=path)

    return edit


def on_path(case: Case) -> Case:
    """Put a ball on the smoothed path."""
    path = case.log[Kind.PATH]["waypoints"][-1]
    return case.with_ball((path[0] + path[1]) / 2)


def costlier(case: Case) -> Case:
    """State a smoothed path that costs more than the one before."""
    return case.edit(Kind.PATH, first(case.log[Kind.PATH], stage=Stage.SMOOTHED), cost=1e3)


def without_raw(case: Case) -> Case:
    """Leave only the smoothed path."""
    return case.drop(Kind.PATH, first(case.log[Kind.PATH], stage=Stage.RAW))


def refusing(case: Case) -> Case:
    """Take away the obstacles that refused shortcuts hit."""
    return replace(case, world=replace(case.world, balls=case.world.balls[:0]))


def shortcut_row(case: Case, accepted: bool) -> int:
    """The first shortcut that was, or was not, accepted."""
    return first(case.log[Kind.SHORTCUT], accepted=accepted)


DOCTORED: list[Doctored] = [
    ("path ends", "", on("star", moved_waypoint(-1, -1)), {"path costs", "paths in trees"}),
    ("path ends", "", on("star", moved_waypoint(-1, 0)), {"path costs", "paths in trees"}),
    ("path ends", "", on("march", lambda c: c.edit(Kind.PATH, 0, waypoints=np.empty((0, 2)))),
     {"path costs", "moves along path"}),
    ("paths free", "", on("rrt", on_path), {"shortcuts"}),
    ("path costs", "", on("star", shifted(Kind.PATH, "cost", -1, 1e-6)), set()),
    ("paths improve", "", on("star", lambda c: c.add(Kind.PATH, stage=2,
     cost=c.log[Kind.PATH]["cost"][-1], waypoints=c.log[Kind.PATH]["waypoints"][-1])), set()),
    ("paths improve", "a second path", lambda: altered(doubled, "rrt", Kind.PATH), {*GROWTH,
     "shortcuts"}),
    ("paths improve", "not raw", lambda: change("rrt", Kind.PATH, 0, stage=Stage.IMPROVED),
     GROWTH),
    ("paths in trees", "", on("pair", lambda c: c.drop(Kind.CONNECT, 0)), set()),
    ("shortcuts", "", on("rrt", lambda c: c.edit(Kind.SHORTCUT, shortcut_row(c, accepted=False),
     i=-4)), set()),
    ("shortcuts", "", on("rrt", lambda c: shifted(Kind.SHORTCUT, "cost", shortcut_row(c,
     accepted=False), 5.0)(c)), set()),
    ("shortcuts", "nothing between", on("rrt", lambda c: c.edit(Kind.SHORTCUT, shortcut_row(c,
     accepted=False), j=c.log[Kind.SHORTCUT]["i"][shortcut_row(c, accepted=False)] + 1)), set()),
    ("shortcuts", "is clear", on("rrt", refusing), {"rejections", "reasons", "smoothed"}),
    ("smoothed", "", on("rrt", lambda c: c.edit(Kind.SHORTCUT, shortcut_row(c, accepted=True),
     accepted=False)), {"shortcuts"}),
    ("smoothed", "has reported 0 paths", lambda: altered(dropped, "rrt", Kind.PATH, -1),
     {"endings"}),
    ("smoothed", "has reported 2 paths", lambda: altered(doubled, "rrt", Kind.PATH, -1), set()),
    ("smoothed", "no path to smooth", lambda: without_raw(short("rrt")), {"outcome", "shortcuts",
     "goal attempts", *GROWTH}),
    ("smoothed", "more than", lambda: costlier(short("rrt")), {"path costs"}),
]  # fmt: skip


@doctored(DOCTORED)
def test_doctored_recordings_are_found(
    rule: str, message: str, make: Callable[[], Case], also: set[str]
) -> None:
    """By the rule that they break."""
    check_found(rule, message, make, also)
