"""Robots in numpy: metrics, outlines, names, files and error messages."""

import json
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from brrt import BrrtError, World, make_world
from brrt.robots import ROBOTS, Chain, Point, Polygon, make_robot, robot_from_json
from tests.conftest import Result
from tests.support import naive
from tests.support.bodies import BODIES, MAKERS, random_edges

Floats = NDArray[np.float64]

FEW = settings(max_examples=25, deadline=None)
EMPTY = World("empty", np.zeros(2), np.full(2, 10.0))


# Metrics


@BODIES
@FEW
@given(st.integers(0, 2**32))
def test_no_vertex_moves_farther_than_its_bound(kind: str, seed: int) -> None:
    """In a motion of length 1 no point of a polygon moves more than 1, of n links more than n."""
    rng = np.random.default_rng(seed)
    world, robot = EMPTY, MAKERS[kind](rng)
    links = len(robot.joints) if isinstance(robot, Chain) else 1
    for a, b in zip(*random_edges(rng, robot, world, 20), strict=True):
        body = np.concatenate(naive.moving_body(robot, naive.densified(robot, a, b, 20)), axis=1)
        moved = np.linalg.norm(np.diff(body, axis=0), axis=2).sum(axis=0).max()
        assert moved <= robot.distance(a, b) * links * (1 + 1e-9) + 1e-12


def test_angles_wrap_the_short_way_round() -> None:
    """The distance between just below pi and just above -pi is small, in both directions."""
    robot = Polygon(4.0, 2.0)
    a, b = np.array([5.0, 5.0, 3.1]), np.array([5.0, 5.0, -3.1])
    small = (2 * math.pi - 6.2) * math.hypot(2, 1)
    assert robot.distance(a, b) == pytest.approx(small)
    assert robot.distance(b, a) == robot.distance(a, b)
    assert abs(robot.interpolate(a, b, 0.5)[2]) == pytest.approx(math.pi)
    assert robot.canonical(np.array([0.0, 0.0, math.pi]))[2] == -math.pi
    assert robot.canonical(np.array([0.0, 0.0, 7.0]))[2] == pytest.approx(7 - 2 * math.pi)


def test_a_joint_without_limits_wraps_and_one_with_limits_does_not() -> None:
    """The same angles are near for one chain and far for the other."""
    world = EMPTY
    a, b = np.array([3.1]), np.array([-3.1])
    endless = Chain(1, length=1.0, width=0.0, wrap=True).resolved(world)
    limited = Chain(1, length=1.0, width=0.0, limit=math.pi).resolved(world)
    assert endless.distance(a, b) == pytest.approx(2 * math.pi - 6.2)
    assert limited.distance(a, b) == pytest.approx(6.2)


@pytest.mark.parametrize("kind", ROBOTS)
def test_volume_of_the_unit_ball(kind: str) -> None:
    """As estimated by samples from a box around the ball."""
    rng = np.random.default_rng(5)
    world = World("empty", np.zeros(2), np.full(2, 100.0))
    robot = MAKERS[kind](rng) if kind in MAKERS else Point()
    dof = robot.dof(world)
    # The extent of the ball along each coordinate, from the distance of a small step.
    halves = 0.01 / np.array([robot.distance(np.zeros(dof), 0.01 * e) for e in np.eye(dof)])
    scale = 0.01 if kind != "point" else 1.0
    drawn = rng.uniform(-halves, halves, (200_000, dof)) * scale
    inside = robot.distance(np.zeros(dof), drawn) <= scale
    volume = inside.mean() * np.prod(2 * halves)
    assert volume == pytest.approx(robot.unit_ball_volume(world), rel=0.02)


# Bodies


@BODIES
def test_outline_and_places(kind: str) -> None:
    """The outline is the twin's; pictures show a polygon's reference point and a chain's tip."""
    rng = np.random.default_rng(9)
    world, robot = EMPTY, MAKERS[kind](rng)
    Q, _ = random_edges(rng, robot, world, 20)
    moved = naive.moving_body(robot, Q)
    for i, q in enumerate(Q):
        for part, twin in zip(robot.outline(q), moved, strict=True):
            np.testing.assert_allclose(part, twin[i], atol=1e-12)
    places = robot.places(Q)
    if kind == "polygon":
        np.testing.assert_array_equal(places, Q[:, :2])
    arm = Chain(3, length=2.0, width=0.5).resolved(world)
    np.testing.assert_allclose(arm.places(np.zeros((1, 3))), [[11.0, 5.0]])
    bent = arm.places(np.array([[np.pi / 2, np.pi / 2, -np.pi / 2]]))
    np.testing.assert_allclose(bent, [[3.0, 9.0]])


def test_all_links_point_right_at_zero() -> None:
    """The default limits are a quarter turn either way."""
    world = make_world("circles2d:n=0,size=20")
    arm = make_robot("chain:links=3,length=2,width=1").resolved(world)
    assert isinstance(arm, Chain)
    lefts = [part[:, 0].min() for part in arm.outline(np.zeros(3))]
    np.testing.assert_allclose(lefts, [10.0, 12.0, 14.0])
    assert all(joint.limits == (-math.pi / 2, math.pi / 2) for joint in arm.joints)
    why = arm.collision(world, np.array([0.0, 1.6, 0.0]))
    assert why == "has joint 2 at 1.6, beyond its limits -1.57079 to 1.57079 (the default)"


def test_self_collision() -> None:
    """Four links that close to a square; only the first and the last touch."""
    world = make_world("circles2d:n=0,size=20")
    q, turned = np.array([0.0, 1.57, 1.57, 1.57]), np.array([0.0, 1.57, 1.57, -1.57])
    without, with_check = (
        make_robot(f"chain:links=4,length=2,width=0.2,self_collision={word}").resolved(world)
        for word in ("false", "true")
    )
    assert without.collision(world, q) is None
    assert with_check.collision(world, q) == "has links 1 and 4 touch each other"
    assert with_check.collision(world, turned) is None


# Names and files


@BODIES
def test_a_robot_reads_back_from_its_file(kind: str) -> None:
    """With the same definition and the same body."""
    rng = np.random.default_rng(13)
    for _ in range(20):
        robot = MAKERS[kind](rng)
        again = robot_from_json(robot.to_json())
        assert again.to_json() == robot.to_json()
        q = rng.uniform(-1, 1, 3)
        for one, other in zip(robot.outline(q), again.outline(q), strict=True):
            assert one.tobytes() == other.tobytes()


def test_kinds_are_the_names_of_the_registry() -> None:
    """And of files."""
    assert all(robot.kind == name for name, robot in ROBOTS.items())
    assert robot_from_json(Point().to_json()) == Point()


HEAD = {"schema": "brrt.robot", "version": 1}
SQUARE = [[0, 0], [1, 0], [1, 1], [0, 1]]


def circle(vertices: int) -> list[list[float]]:
    """Return a regular polygon."""
    turns = np.linspace(0, 2 * np.pi, vertices, endpoint=False)
    return [[float(np.cos(turn)), float(np.sin(turn))] for turn in turns]


JOINT = {"offset": [0, 0], "link": SQUARE}
CHAIN = {**HEAD, "kind": "chain", "base": [0, 0]}
BAD_FILES = {
    "not JSON": ("{", "not a JSON robot"),
    "a world": ({"schema": "brrt.world"}, 'the field "schema" must be "brrt.robot"'),
    "newer": ({**HEAD, "version": 2}, "robot version 2 is not 1; update brrt"),
    "kind": ({**HEAD, "kind": "polgon"}, "unknown kind of robot 'polgon'; did you mean 'polygon'"),
    "no parts": ({**HEAD, "kind": "polygon"}, 'the field "polygons" of the robot is missing'),
    "empty": ({**HEAD, "kind": "polygon", "polygons": []}, "polygons must be a list of one or"),
    "bent": (
        {**HEAD, "kind": "polygon", "polygons": [SQUARE, [[0, 0], [4, 0], [1, 1], [0, 4]]]},
        "polygons[1] is not convex at (1, 1); split it into convex polygons",
    ),
    "parts": (
        {**HEAD, "kind": "polygon", "polygons": [SQUARE] * 10_001},
        "polygons has 10,001 parts, and may have at most 10,000; make the body of fewer",
    ),
    "vertices": (
        {**HEAD, "kind": "polygon", "polygons": [SQUARE, circle(1001)]},
        "polygons[1] has 1,001 vertices, and may have at most 1,000; leave some out",
    ),
    "3D": ({**HEAD, "kind": "polygon", "polygons": [[[0, 0, 0], [1, 0, 0]]]}, "a pair of numbers"),
    "typo": ({**HEAD, "kind": "polygon", "polygons": [SQUARE], "colour": 1}, "field 'colour'"),
    "base": ({**CHAIN, "base": [0], "joints": [JOINT]}, "base must be 2 finite numbers, not [0]"),
    "joints": ({**CHAIN, "joints": []}, "joints must be a list of 1 to 64 joints"),
    "offset": (
        {**CHAIN, "joints": [JOINT, {"offset": ["a", 0], "link": SQUARE}]},
        "joints[1] offset must be 2 finite numbers, not ['a', 0]",
    ),
    "limits": ({**CHAIN, "joints": [{**JOINT, "limits": [1, -1]}]}, "joints[0] limits 1, -1 must"),
    "flag": ({**CHAIN, "joints": [JOINT], "self_collision": 1}, "self_collision must be true or"),
    "point": ({**HEAD, "kind": "point", "polygons": []}, "unknown parameter of robot point"),
}


@pytest.mark.parametrize("name", BAD_FILES)
def test_bad_files(name: str, tmp_path: Path) -> None:
    """The message is one line with the file, the field and the value."""
    content, expected = BAD_FILES[name]
    path = tmp_path / "robot.json"
    path.write_text(content if isinstance(content, str) else json.dumps(content))
    with pytest.raises(BrrtError) as error:
        make_robot(str(path))
    assert expected in str(error.value)
    assert str(error.value).startswith(str(path))
    assert "\n" not in str(error.value)


BAD_USE = {
    "name": (("--robot", "polgon"), "unknown robot 'polgon'; did you mean 'polygon'?"),
    "parameter": (("--robot", "polygon:lenth=3"), "unknown parameter of robot polygon 'lenth'"),
    "value": (("--robot", "chain:links=0"), "links must be at least 1, not 0"),
    "no pair": (("--robot", "chain:3"), "robot chain:3: '3' must read name=value"),
    "no file": (("--robot", "gone.json"), "gone.json: No such file"),
    "3D": (("--robot", "polygon", "--world", "boxes3d"), "moves in the plane, but world boxes3d"),
    "numbers": (
        ("--robot", "polygon", "--start", "5,5"),
        "start 5,5: 2 given; a configuration here has 3 numbers: x,y,theta",
    ),
    "no start": (("--robot", "chain"), "robot chain; give --start theta1,theta2,theta3"),
    "limits": (
        ("--robot", "chain", "--world", "circles2d:n=0", "--start", "2,0,0", "--goal", "0,0,0"),
        "start 2,0,0 has joint 1 at 2, beyond its limits",
    ),
    "walls": (
        ("--robot", "polygon", "--world", "circles2d:n=0", "--start", "1,5,0"),
        "start 1,5,0 reaches the bounds",
    ),
}


@pytest.mark.parametrize("name", BAD_USE)
def test_bad_arguments(name: str, brrt: Callable[..., Result]) -> None:
    """The message is one line, the exit code 2."""
    args, expected = BAD_USE[name]
    done = brrt("plan", "--no-record", *args)
    assert done.code == 2
    assert expected in done.err
