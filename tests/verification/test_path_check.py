"""Paths of any origin, judged alone."""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from brrt import BrrtError, Chain, Kind, Point, Polygon, World, check_path, read
from tests.support import naive
from tests.support.bodies import random_world
from tests.support.recordings import RECORDINGS

BALL = World("one", np.zeros(2), np.full(2, 10.0), np.array([[5.0, 5, 1]]))


@pytest.mark.parametrize(
    "name", ["circles2d-rrt", "polygons2d-polygon", "circles2d-chain", "boxes3d-bi-rrt-star"]
)
def test_paths_that_brrt_planned_hold(name: str) -> None:
    """Every path of a golden recording is free, as long as stated, and has the ends."""
    recording = read(RECORDINGS / f"{name}.mcap")
    manifest = recording.manifest
    for event in recording.events()[Kind.PATH]:
        check = check_path(
            event["waypoints"], world=recording.world, robot=recording.robot(),
            start=manifest.start, goal=manifest.goal,
        )  # fmt: skip
        assert check.holds
        assert check.length == pytest.approx(event["cost"], rel=1e-9)
        assert check.tightest is not None
        assert check.tightest.distance > 0


@settings(max_examples=40)
@given(st.integers(0, 2**32))
def test_hits_are_those_of_exact_fractions(seed: int) -> None:
    """For points in random worlds; the place is on the named obstacle."""
    rng = np.random.default_rng(seed)
    world = random_world(rng)
    q = rng.uniform(0, 10, (12, 2))
    check = check_path(q, world=world)
    hits = {hit.motion: hit for hit in check.hits}
    for i in range(11):
        if i in hits:
            assert naive.hits(world, q[i], q[i + 1])
        elif naive.hits(world, q[i], q[i + 1]):
            assert check.clearance[i] < 1e-6  # it is grazed
    assert check.holds == (not hits)


def test_a_hit_says_what_and_where() -> None:
    """Of a motion through a ball, and of one that begins in it."""
    check = check_path([[1, 5], [9, 5], [5, 5], [5, 9]], world=BALL)
    assert [hit.motion for hit in check.hits] == [0, 1, 2]
    assert {hit.obstacle for hit in check.hits} == {"ball 0"}
    assert check.hits[0].q == pytest.approx((4, 5))
    assert check.hits[0].part == pytest.approx(3 / 8)
    assert (check.hits[2].part, check.hits[2].q) == (0, (5, 5))
    assert check.clearance.tolist() == [0, 0, 0]
    assert check.tightest is None


def test_clearance_length_and_turns() -> None:
    """Of a path around a ball."""
    check = check_path([[1, 1], [9, 1], [9, 1], [9, 9]], world=BALL)
    assert check.holds
    assert check.length == 16
    assert check.turns is not None
    assert check.turns.sum == check.turns.sharpest == pytest.approx(math.pi / 2)
    assert check.turns.waypoint == 2
    assert check.clearance == pytest.approx([3, np.hypot(4, 4) - 1, 3])
    assert check.tightest is not None
    assert check.tightest.distance == pytest.approx(3)
    assert check.tightest.q == pytest.approx((5, 1), abs=1e-6)
    assert repr(check) == "<PathCheck of 4 waypoints in one: holds>"


def test_angles_go_the_short_way_round() -> None:
    """From 3.1 to -3.1 or to 3.18 a long body hardly turns; joints with limits turn all the way."""
    world = World("", np.zeros(2), np.full(2, 10.0), np.array([[5.0, 8, 1]]))
    body = Polygon(length=6, width=0.2)
    for angle in (-3.1, 2 * math.pi - 3.1, 3.18):
        check = check_path([[5, 5, 3.1], [5, 5, angle]], world=world, robot=body)
        assert check.holds
        assert check.turns is not None
        assert check.turns.sum == 0
    assert not check_path([[5, 5, 0.1], [5, 5, 3.0]], world=world, robot=body).holds
    arm = Chain(links=1, length=3, width=0, limit=3.14)
    assert check_path([[3.1], [-3.1]], world=world, robot=arm).hits
    assert check_path([[3.1], [-3.1]], world=world, robot=Chain(1, length=3, wrap=True)).holds


def test_bounds_and_limits() -> None:
    """The coordinate, its value and its limits are named; bodies also hit the bounds."""
    check = check_path([[5, 1], [5, -2], [11, 3]], world=BALL)
    assert [each[:3] for each in check.outside] == [(1, "y", -2), (2, "x", 11)]
    assert not check.holds
    assert not check.hits
    arm = check_path([[0.0, 0, 0], [0, 2, 0]], world=BALL, robot="chain:length=0.5,base_x=1")
    assert list(map(tuple, arm.outside)) == [(1, "theta2", 2, -math.pi / 2, math.pi / 2)]
    body = check_path([[3, 3, 0], [3, 9.5, 0]], world=BALL, robot="polygon:length=2,width=2")
    assert [hit.obstacle for hit in body.hits] == ["the bounds"]
    assert body.hits[0].part == pytest.approx(6 / 6.5)


def test_ends() -> None:
    """They equal start and goal, but for a tolerance in the robot's metric."""
    path = [[1, 1], [9, 1.01]]
    assert check_path(path, world=BALL, start=[1, 1]).holds
    check = check_path(path, world=BALL, start=[1, 1], goal=[9, 1])
    assert [(end.name, end.equal) for end in check.ends] == [("start", True), ("goal", False)]
    assert check.ends[1].distance == pytest.approx(0.01)
    assert not check.holds
    assert check_path(path, world=BALL, goal=[9, 1], tolerance=0.02).holds
    turned = [[1, 1, 0], [1, 1, 6]]
    body = Polygon(length=0.2, width=0.2)
    assert check_path(turned, world=BALL, robot=body, goal=[1, 1, 6 - 2 * math.pi]).holds


def test_a_single_waypoint() -> None:
    """It is a motion that stays."""
    assert check_path([[1, 1]], world=BALL).holds
    check = check_path([[5, 5]], world=BALL)
    assert [hit.part for hit in check.hits] == [0]
    assert check.at(0, 0.5).tolist() == [5, 5]


def test_a_world_without_obstacles() -> None:
    """There is no clearance, and JSON says so."""
    check = check_path([[1, 1, 1], [9, 9, 9]], world="empty3d")
    assert check.tightest is None
    data = check.as_dict()
    assert json.loads(json.dumps(data, allow_nan=False)) == data
    assert data["clearance"] is None
    assert data["motions"][0]["nearest"] is None


def test_wrong_arguments(tmp_path: Path) -> None:
    """Each error names the argument."""
    cases: tuple[tuple[dict[str, Any], str], ...] = (
        ({"q": [[1, 2, 3]]}, "path must be rows of 2 numbers: x, y"),
        ({"q": []}, "path must have 1 to 1,000,000 waypoints, not 0"),
        ({"q": [[1, math.nan]]}, "path must be finite numbers"),
        ({"q": tmp_path / "no.csv"}, "no.csv: No such file"),
        ({"start": [1]}, "start must be 2 numbers: x, y"),
        ({"robot": "lorry"}, "unknown robot 'lorry'"),
        ({"tolerance": -1}, "tolerance must be a number from 0 on, not -1"),
    )
    for wrong, text in cases:
        arguments: dict[str, Any] = {"q": [[1, 2]], "world": BALL, **wrong}
        with pytest.raises(BrrtError) as raised:
            check_path(**arguments)
        assert text in str(raised.value)
    with pytest.raises(BrrtError, match="waypoint 1: x is 2e\\+07, a million times the size"):
        check_path([[1, 1, 0], [2e7, 1, 0]], world=BALL, robot=Polygon())
    assert Point().collision(BALL, np.array([5.0, 5.0]))
