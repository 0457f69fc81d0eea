"""Recordings that break rules about phases and endings."""

from collections.abc import Callable

from brrt import Kind
from brrt.events import Stage, Status
from tests.support.cases import (
    Case,
    Doctored,
    altered,
    change,
    check_found,
    doctored,
    first,
    on,
    short,
)
from tests.support.doctoring import dropped, swapped

DOCTORED: list[Doctored] = [
    ("phases", "", on("rrt", lambda c: c.drop(Kind.PHASE, -1)), set()),
    ("phases", "", on("rrt", lambda c: c.edit(Kind.PHASE, 1, status=Status.BEGIN)), {"outcome"}),
    ("phases", "", on("rrt", lambda c: c.edit(Kind.PHASE, 3, name=77)), set()),
    ("phases", "", on("rrt", lambda c: c.drop(Kind.PHASE, 0)), {"phase contents"}),
    ("phase contents", "shortcut outside of all phases", lambda: altered(swapped, "rrt",
     Kind.PHASE, 2), {"smoothed", "phases", "iterations"}),
    ("phase contents", "path within phase plan", lambda: change("rrt", Kind.PATH, 0,
     stage=Stage.SMOOTHED), {"outcome", "smoothed", "shortcuts", "random pairs"}),
    ("phase contents", "move outside of all phases", lambda: altered(swapped, "executed",
     Kind.MOVE, -1), {"phases", "endings"}),
    ("outcome", "", on("rrt", lambda c: c.edit(Kind.PHASE, 1, status=Status.ITERATION_LIMIT)),
     {"endings"}),
    ("outcome", "", on("march", lambda c: c.drop(Kind.PATH, 0)), {"moves along path"}),
    ("budget", "", on("rrt", lambda c: c.with_scenario(iterations=3)), set()),
    ("budget", "", on("rrt", lambda c: c.with_scenario(shortcuts=3)), set()),
    ("budget", "draws", lambda: short("rrt").with_scenario(draws=2), set()),
    ("endings", "", on("rrt-star", lambda c: c.edit(Kind.PHASE, 1, status=Status.SOLVED)), set()),
    ("endings", "", on("rrt-star", lambda c: c.edit(Kind.PHASE, 1, status=Status.TIME_LIMIT)),
     set()),
    ("endings", "", on("rrt-star", lambda c: c.with_scenario(iterations=2000)), set()),
    ("endings", "", on("rrt-star", lambda c: c.with_scenario(time=9.0,
     clock="real").edit(Kind.PHASE, 1, status=Status.TIME_LIMIT)), set()),
    ("endings", "which only a search can prove", lambda: change("rrt-star", Kind.PHASE, 1,
     status=Status.NO_PATH), {"outcome"}),
    ("endings", "planning ended as done", lambda: change("rrt-star", Kind.PHASE, 1,
     status=Status.DONE), {"outcome"}),
    ("endings", "can only end as done", lambda: change("rrt", Kind.PHASE, -1,
     status=Status.TIME_LIMIT), set()),
    ("endings", "shortcut attempts were made", lambda: altered(dropped, "rrt", Kind.SHORTCUT,
     first(short("rrt").log[Kind.SHORTCUT], accepted=0)), {"random pairs"}),
]  # fmt: skip


@doctored(DOCTORED)
def test_doctored_recordings_are_found(
    rule: str, message: str, make: Callable[[], Case], also: set[str]
) -> None:
    """By the rule that they break."""
    check_found(rule, message, make, also)
