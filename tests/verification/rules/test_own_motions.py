"""Rules about planners whose motions are their own."""

from collections.abc import Callable
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from brrt import Kind
from tests.support.cases import Case, Doctored, check_found, doctored
from tests.support.foreign import case_of, recorded


@cache
def hybrid() -> Case:
    """A search with curved motions."""
    with TemporaryDirectory() as folder:
        return case_of(recorded("hybrid-a-star", Path(folder) / "run.mcap"))


def at_waypoint() -> Case:
    """A waypoint is moved into the box, which no edge is."""
    path = hybrid().log[Kind.PATH]["waypoints"][0].copy()
    path[len(path) // 2] = [9.0, 6.0, 0.0]
    waypoints = np.empty(1, object)
    waypoints[0] = path
    return hybrid().edit(Kind.PATH, 0, waypoints=waypoints[0])


DOCTORED: list[Doctored] = [
    ("configurations free", "edge ends in box",
     lambda: hybrid().edit(Kind.EDGE, 100, q=[9.0, 6.0, 0.0]), {"edge costs"}),
    ("configurations free", "is in box", at_waypoint, set()),
]  # fmt: skip


@doctored(DOCTORED)
def test_doctored_recordings_are_found(
    rule: str, message: str, make: Callable[[], Case], also: set[str]
) -> None:
    """By the rule that they break."""
    check_found(rule, message, make, also)
