"""Recordings that break rules about single samples."""

from collections.abc import Callable

import pytest

from brrt import Kind
from brrt.events import Source
from brrt.scenario.contract import Draws
from tests.support.cases import (
    Case,
    Doctored,
    Edit,
    change,
    check_found,
    doctored,
    on,
    planned,
    run_of,
    short,
)
from tests.verification.rules.test_long_run import informed, log_of, reused


def source(row: int, value: Source) -> Edit:
    """Change the source of a sample."""
    return lambda case: case.edit(Kind.SAMPLE, row, source=value)


DOCTORED: list[Doctored] = [
    ("samples", "", on("rrt", lambda c: c.edit(Kind.SAMPLE,
     int((c.log[Kind.SAMPLE]["source"] == 1).argmax()), q=[5.0, 5.0])), {"steering"}),
    ("samples", "exactly the goal", lambda: change("rrt", Kind.SAMPLE, {"source": Source.GOAL},
     source=Source.UNIFORM), set()),
    ("sources", "", lambda: source(3, Source.OTHER_TREE)(planned("rrt")), set()),
    ("sources", "", lambda: source(3, Source.INFORMED)(planned("rrt-star")), {"informed samples"}),
    ("sources", "", lambda: source(-1, Source.UNIFORM)(informed()), set()),
    ("sources", "", lambda: source(3, Source.OTHER_TREE)(planned("rrt-connect")),
     {"link attempts"}),
    ("sources", "", lambda: planned("rrt").judged_by(draws=Draws(goal_bias=0.0)), set()),
    ("informed samples", "", lambda: informed(lambda q: q * [1, 0] + [0, 1.0]),
     {"uniform informed draws", "steering"}),
    ("informed nodes", "", lambda: short("informed").edit(Kind.EDGE, -1, q=[1.0, 99.0]),
     {"steering", "edge costs", "edge lengths", "edges free"}),
    ("repeated draws", "was drawn before, by event", lambda: log_of(200, reused), set()),
]  # fmt: skip


@doctored(DOCTORED)
def test_doctored_recordings_are_found(
    rule: str, message: str, make: Callable[[], Case], also: set[str]
) -> None:
    """By the rule that they break."""
    check_found(rule, message, make, also)


@pytest.mark.parametrize("apart", [0.0, 1e-14, 1e-9])
def test_a_goal_at_the_start_leaves_few_informed_samples(apart: float) -> None:
    """The ellipsoid then holds few numbers, so samples repeat without a fault."""
    goal = (50.0 + apart, 50.0)
    case = run_of(
        world="empty2d", planner="rrt-star", start=(50.0, 50.0), goal=goal, smooth=False,
        params={"informed": True, "step": 5.0}, iterations=1500,
    )  # fmt: skip
    assert len(case.log[Kind.PATH])
    assert case.broken() == set()
