"""Recordings that break the rule about robots that search one cell ahead."""

from collections.abc import Callable

from brrt import Kind
from tests.support.cases import (
    SEARCH,
    Case,
    Doctored,
    altered,
    check_found,
    doctored,
    moved,
    on,
    short,
)
from tests.support.doctoring import dropped

OTHERS = {"choices", "estimates", "estimates admissible", "best first", "expansions"}


def blocked_move(case: Case) -> Case:
    """Reject what the robot then moves to."""
    moves, expand = case.log[Kind.MOVE], case.log[Kind.EXPAND]
    return case.edit(Kind.REJECT, 0, node=int(expand["cell"][0]), q=moves["q"][0])


def estimate(more: float) -> Callable[[], Case]:
    """Raise the first estimate by too much or too little."""
    return lambda: short("one trial").shift(Kind.HEURISTIC, 0, "h", more)


DOCTORED: list[Doctored] = [
    ("choices", "", on("walk", blocked_move), {"rejections", "neighbours", "limits"}),
    ("choices", "without a search", lambda: altered(dropped, "lrta-star", Kind.EXPAND, 5), SEARCH),
    ("choices", "without a search", lambda: altered(dropped, "lrta-star", Kind.EXPAND, -1),
     SEARCH),
    ("choices", "was not expanded", lambda: moved("lrta-star", Kind.HEURISTIC, 1, 4.0), SEARCH),
    ("choices", "", estimate(0.5), OTHERS),
    ("choices", "", estimate(-0.01), OTHERS),
    ("choices", "", lambda: short("one trial").drop(Kind.HEURISTIC, 0), OTHERS),
]  # fmt: skip


@doctored(DOCTORED)
def test_doctored_recordings_are_found(
    rule: str, message: str, make: Callable[[], Case], also: set[str]
) -> None:
    """By the rule that they break."""
    check_found(rule, message, make, also)
