"""Recordings that break rules about rejections."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from brrt import Kind
from brrt.collision.motions import Obstacles, all_clear, first_hits
from brrt.events import Reason
from tests.support.cases import (
    GROWTH,
    Case,
    Doctored,
    body,
    change,
    check_found,
    doctored,
    on,
    on_body,
)

DOCTORED: list[Doctored] = [
    ("rejections", "", on("rrt", lambda c: c.edit(Kind.REJECT, 0, node=0,
     q=c.log[Kind.EDGE]["q"][0] + 0.01)), {"steering"}),
    ("rejections", "", on("rrt", lambda c: c.edit(Kind.REJECT, 0, node=10**6)), set()),
    ("rejections", "", on("a-star", lambda c: c.edit(Kind.REJECT, -1, node=0,
     q=c.log[Kind.EXPAND]["q"][0])), {"neighbours"}),
    ("rejections", "is clear", on_body("polygon", lambda c: c.edit(Kind.REJECT, 0, node=0,
     q=c.log[Kind.EDGE]["q"][0])), {"steering"}),
    ("rejections", "is clear", on_body("chain", lambda c: c.edit(Kind.REJECT, 0, node=0,
     q=c.log[Kind.EDGE]["q"][0])), {"steering"}),
    ("reasons", "cannot be rejected for near blocked", lambda: change("rrt", Kind.REJECT, 3,
     reason=Reason.NEAR_BLOCKED), GROWTH),
    ("reasons", "cannot be rejected for goal blocked", lambda: change("rrt", Kind.REJECT, 3,
     reason=Reason.GOAL_BLOCKED), GROWTH),
    ("reasons", "cannot be rejected for no gain", lambda: change("informed", Kind.REJECT, 0,
     reason=Reason.NO_GAIN), GROWTH),
    ("reasons", "is rejected for no progress", lambda: change("rrt", Kind.REJECT, 3,
     reason=Reason.NO_PROGRESS), GROWTH),
    ("reasons", "is not the other's newest node", lambda: change("rrt-connect", Kind.REJECT, 0,
     reason=Reason.LINK_BLOCKED), GROWTH),
    ("limits", "", on("rrt", lambda c: c.edit(Kind.REJECT, 0, reason=Reason.LIMITS)),
     {"extensions", "reasons"}),
    ("limits", "rejected for another reason", lambda: change("a-star", Kind.REJECT, {"reason":
     Reason.LIMITS}, reason=Reason.COLLISION), set()),
]  # fmt: skip


@doctored(DOCTORED)
def test_doctored_recordings_are_found(
    rule: str, message: str, make: Callable[[], Case], also: set[str]
) -> None:
    """By the rule that they break."""
    check_found(rule, message, make, also)


@pytest.mark.parametrize("name", ["polygon", "chain"])
@pytest.mark.parametrize("gap", [1e-7, 1e-4])
def test_a_rejection_needs_a_touch(name: str, gap: float) -> None:
    """What is clear by 1e-7 of the map may be rejected; what is clear by 1e-4 may not."""
    case = body(name)
    robot = case.manifest.make_robot().resolved(case.world)
    q = case.log[Kind.EDGE]["q"][0]
    part = robot.outline(q)[-1]
    radius, corner = 1e-3, part[0]
    out = corner - part.mean(axis=0)
    centre = corner + out / np.hypot(*out) * (radius + gap * case.world.extent)
    alone = replace(case.world, balls=np.array([[*centre, radius]]))
    rejected = np.array([[*q]])
    assert all_clear(Obstacles(alone), robot, rejected, rejected).tolist() == [gap > 1e-5]
    assert first_hits(Obstacles(alone), robot, rejected, rejected).tolist() == [-1]
