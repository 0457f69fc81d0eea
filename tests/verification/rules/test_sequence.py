"""Recordings that break rules about the order of events."""

from collections.abc import Callable

from brrt import Kind
from brrt.events import Reason, Source
from tests.support.cases import (
    GROWTH,
    SEARCH,
    Case,
    Doctored,
    altered,
    change,
    check_found,
    doctored,
    short,
)
from tests.support.doctoring import doubled, dropped

DOCTORED: list[Doctored] = [
    ("iterations", "event of iteration 9; the log counts", lambda: change("rrt", Kind.SAMPLE, 9,
     iteration=9), {"times"}),
    ("iterations", "; the log counts", lambda: altered(dropped, "a-star", Kind.EXPAND, -1),
     SEARCH),
    ("iterations", "event of iteration 5; the log counts", lambda: change("lrta-star", Kind.MOVE,
     5, iteration=5), {"times"}),
    ("no duplicates", "the same reject", lambda: altered(doubled, "rrt", Kind.REJECT, 3), GROWTH),
    ("no duplicates", "the same rewire", lambda: altered(doubled, "rrt-star", Kind.REWIRE, 3),
     GROWTH),
    ("no duplicates", "the same connect", lambda: altered(doubled, "bi-rrt-star", Kind.CONNECT),
     GROWTH),
    ("extensions", "sample (uniform) is followed by sample", lambda: altered(dropped, "rrt",
     Kind.REJECT, 3), set()),
    ("extensions", "sample (goal) is followed by", lambda: change("rrt", Kind.SAMPLE, {"source":
     Source.GOAL}, tree=1), {"turns"}),
    ("extensions", "reject (collision) is followed by", lambda: change("rrt-star", Kind.REJECT,
     {"reason": Reason.NEAR_BLOCKED}, reason=Reason.COLLISION), GROWTH | {"parents", "rewirings"}),
    ("extensions", "a sample leads to", lambda: short("sliced").judged_by("growth", slices=4),
     {"steering"}),
]  # fmt: skip


@doctored(DOCTORED)
def test_doctored_recordings_are_found(
    rule: str, message: str, make: Callable[[], Case], also: set[str]
) -> None:
    """By the rule that they break."""
    check_found(rule, message, make, also)
