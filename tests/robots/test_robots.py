"""Robots with bodies: what is called free is free, metrics are metrics, files read back."""

import json
import math
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numba.core import config as _config
from numpy.typing import NDArray

from brrt import BrrtError, Run, Scenario, World, make_world
from brrt.kernels import space as kernels
from brrt.kernels.jit import kernel
from brrt.kernels.kdtree import insert, nearest, rooted_kdtree
from brrt.kernels.spaces import make_space
from brrt.robots import ROBOTS, Chain, Point, Polygon, Robot, make_robot, robot_from_json
from brrt.robots.chain import Joint
from tests.conftest import Result
from tests.support import naive

config: Any = _config
Floats = NDArray[np.float64]

REAL = Path(__file__).parents[3] / "shared" / "worlds" / "robots"
FEW = settings(max_examples=3 if config.DISABLE_JIT else 25, deadline=None)
SLICES = 100
EDGES = 3 if config.DISABLE_JIT else 60


@kernel
def all_free(space: Any, A: Floats, B: Floats, free: NDArray[np.bool_]) -> None:
    """Check the motion from each row of A to the same row of B."""
    for i in range(len(A)):
        free[i] = kernels.segment_free(space, A, i, B, i)


@kernel
def all_measured(space: Any, A: Floats, B: Floats, out: Floats) -> None:
    """Measure from each row of A to the same row of B: distances, then lower bounds.

    B has a box around each configuration on its right: least, greatest.
    """
    d = len(space.lower)
    for i in range(len(A)):
        out[i, 0] = kernels.distance(space, A, i, B, i)
        out[i, 1] = kernels.measure(space, A, i, B, i)
        out[i, 2] = kernels.box_measure(space, B[:, d:], i, A, i)


@kernel
def all_between(space: Any, A: Floats, B: Floats, part: float, out: Floats) -> None:
    """Interpolate from each row of A to the same row of B."""
    for i in range(len(A)):
        kernels.interpolate(space, A, i, B, i, part, out, i)


@kernel
def all_nearest(space: Any, tree: Any, points: Floats, Q: Floats, found: NDArray[np.int64]) -> None:
    """Enter all points, then look up the nearest of each query."""
    for node in range(1, len(points)):
        insert(tree, space, points, node, 0)
    for i in range(len(Q)):
        found[i] = nearest(tree, space, Q, i, 0)


def free(robot: Robot, world: World, A: Floats, B: Floats) -> NDArray[np.bool_]:
    """Whether each motion is free, by the kernels."""
    found = np.zeros(len(A), np.bool_)
    all_free(make_space(robot, world), A, B, found)
    return found


def convex(rng: np.random.Generator, size: float) -> Floats:
    """A line segment or a convex polygon, round or thin, somewhere about the origin."""
    k = int(rng.integers(2, 8))
    angles = np.sort((np.arange(k) + rng.uniform(-0.3, 0.3, k)) * 2 * np.pi / k)
    stretch = size * 10.0 ** rng.uniform(-1.5, 0, 2)
    turn = rng.uniform(0, np.pi)
    x, y = stretch[0] * np.cos(angles), stretch[1] * np.sin(angles)
    z = (x + 1j * y) * np.exp(1j * turn) + size * complex(*rng.uniform(-1, 1, 2)) * rng.random()
    return np.stack([z.real, z.imag], axis=1)


def random_world(rng: np.random.Generator, most: int = 8) -> World:
    """Balls, boxes, polygons and line segments in and around [0, 10]^2."""
    balls, boxes, polygons = rng.integers(0, most, 3)
    corners = rng.uniform(-1, 11, (boxes, 2))
    sides = 10.0 ** rng.uniform(-2, 0.3, (boxes, 2)) * (rng.random((boxes, 2)) < 0.9)
    return World(
        "random",
        np.zeros(2),
        np.full(2, 10.0),
        np.hstack([rng.uniform(-1, 11, (balls, 2)), 10.0 ** rng.uniform(-3, 0.2, (balls, 1))]),
        np.hstack([corners, corners + sides]),
        polygons=tuple(convex(rng, 1.5) + rng.uniform(-1, 11, 2) for _ in range(polygons)),
    )


def random_polygon(rng: np.random.Generator) -> Polygon:
    """One to three parts."""
    return Polygon(parts=tuple(convex(rng, 1.0) for _ in range(rng.integers(1, 4))))


def random_chain(rng: np.random.Generator, joints: int = 3) -> Chain:
    """Links of any shape; limits, or none."""
    made = []
    for _ in range(joints):
        low, high = np.sort(rng.uniform(-3, 3, 2))
        limits = None if rng.random() < 0.3 else (float(low), float(high) + 0.1)
        made.append(Joint(tuple(rng.uniform(-1, 1, 2).tolist()), convex(rng, 0.8), limits))
    x, y = rng.uniform(3, 7, 2).tolist()
    crossing = bool(rng.integers(2))
    return Chain(joints, self_collision=crossing, base_x=x, base_y=y, joints=tuple(made))


MAKERS: dict[str, Callable[[np.random.Generator], Robot]] = {
    "polygon": random_polygon,
    "chain": random_chain,
}
BODIES = pytest.mark.parametrize("kind", MAKERS)


def random_edges(
    rng: np.random.Generator, robot: Robot, world: World, n: int
) -> tuple[Floats, Floats]:
    """Motions of any length from tiny to across the space, some along one coordinate."""
    lower, upper = robot.bounds(world)
    A = rng.uniform(lower, upper, (n, len(lower)))
    far = 10.0 ** rng.uniform(-3, 0, (n, 1)) * (rng.random(A.shape) < 0.8)
    B = A + far * (rng.uniform(lower, upper, A.shape) - A)
    return A, B


# What is called free is free


@BODIES
@FEW
@given(st.integers(0, 2**32))
def test_a_free_motion_is_free_at_any_finer_resolution(kind: str, seed: int) -> None:
    """A hundredth of each motion at a time, by another formula, nothing touches."""
    rng = np.random.default_rng(seed)
    world, robot = random_world(rng, 4), MAKERS[kind](rng)
    A, B = random_edges(rng, robot, world, EDGES)
    for a, b, said in zip(A, B, free(robot, world, A, B), strict=True):
        if said:
            Q = naive.densified(robot, a, b, SLICES)
            assert naive.clearance(world, robot, Q).min() > 0, (world.to_json(), robot.to_json())


@BODIES
@FEW
@given(st.integers(0, 2**32))
def test_no_free_motion_is_refused(kind: str, seed: int) -> None:
    """Where every hundredth keeps a distance, and so does all between, the kernel says so too."""
    rng = np.random.default_rng(seed)
    world, robot = random_world(rng, 3), MAKERS[kind](rng)
    A, B = random_edges(rng, robot, world, EDGES)
    for a, b, said in zip(A, B, free(robot, world, A, B), strict=True):
        Q = naive.densified(robot, a, b, SLICES)
        body = np.concatenate(naive.moving_body(robot, Q), axis=1)
        furthest = np.linalg.norm(np.diff(body, axis=0), axis=2).max()
        # Between two samples nothing comes nearer than half the way of the fastest vertex, and
        # the space between two shapes is at least half of what separating axes say of corners.
        if naive.clearance(world, robot, Q).min() > 2 * furthest + 1e-4:
            assert said, (a.tolist(), b.tolist(), world.to_json(), robot.to_json())


@BODIES
@FEW
@given(st.integers(0, 2**32))
def test_configurations_agree(kind: str, seed: int) -> None:
    """A motion that goes nowhere, `collision` and the twin agree, but for the margin."""
    rng = np.random.default_rng(seed)
    world, robot = random_world(rng, 4), MAKERS[kind](rng)
    A, _ = random_edges(rng, robot, world, EDGES)
    far = naive.clearance(world, robot, A)
    for q, said, gap in zip(A, free(robot, world, A, A), far, strict=True):
        assert (robot.collision(world, q) is None) == (gap > 0) or gap < 1e-9
        assert said == (gap > 0) or gap < 1e-3


@BODIES
def test_motions_that_end_in_an_obstacle_are_refused(kind: str) -> None:
    """Whichever end it is."""
    rng = np.random.default_rng(7)
    for _ in range(2 if config.DISABLE_JIT else 20):
        world, robot = random_world(rng), MAKERS[kind](rng)
        A, B = random_edges(rng, robot, world, EDGES)
        for one, other in ((A, B), (B, A)):
            said = free(robot, world, one, other)
            assert not (said & (naive.clearance(world, robot, one) == 0)).any()


@BODIES
def test_the_grid_overlooks_nothing(kind: str) -> None:
    """Each obstacle alone, and all together in one grid, give the same answers."""
    rng = np.random.default_rng(11)
    world, robot = make_world("circles2d:n=12,size=10,max_radius=1,min_radius=0.1"), None
    more = make_world("polygons2d:n=12,size=10,max_radius=1,min_radius=0.1,seed=5")
    boxes = make_world("boxes2d:n=12,size=10,max_side=1,min_side=0.1,seed=6").boxes
    both = World("all", world.lower, world.upper, world.balls, boxes, polygons=more.polygons)
    robot = MAKERS[kind](rng)
    A, B = random_edges(rng, robot, both, EDGES * 5)
    alone = np.ones(len(A), np.bool_)
    for ball in both.balls:
        single = World("one", both.lower, both.upper, balls=ball[None])
        alone &= free(robot, single, A, B)
    for box in both.boxes:
        alone &= free(robot, World("one", both.lower, both.upper, boxes=box[None]), A, B)
    for polygon in both.polygons:
        single = World("one", both.lower, both.upper, polygons=(polygon,))
        alone &= free(robot, single, A, B)
    assert (free(robot, both, A, B) == alone).all()
    assert alone.any()
    assert not alone.all()


def test_a_thin_wall_between_two_free_ends() -> None:
    """What ten slices a motion would miss: a line segment in the way of a fast body."""
    wall = np.array([[5.0, 0.0], [5.0, 10.0]])
    world = World("wall", np.zeros(2), np.full(2, 10.0), polygons=(wall,))
    robot = Polygon(0.2, 0.2)
    A, B = np.array([[1.0, 5.0, 0.0]]), np.array([[9.0, 5.0, 0.0]])
    assert not free(robot, world, A, B).any()
    assert free(robot, world, A, A).all()
    assert free(robot, world, B, B).all()


def test_turning_on_the_spot_between_close_walls() -> None:
    """A rod fits lengthwise and crosswise through nothing in between."""
    walls = tuple(np.array([[0.0, y], [10.0, y]]) for y in (4.0, 6.0))
    world = World("slot", np.zeros(2), np.full(2, 10.0), polygons=walls)
    lying, turned = np.array([[5.0, 5.0, 0.0]]), np.array([[5.0, 5.0, -3.14]])
    assert not free(Polygon(3.0, 0.1), world, lying, turned).any()
    assert free(Polygon(1.9, 0.1), world, lying, turned).all()


# Metrics


@BODIES
@FEW
@given(st.integers(0, 2**32))
def test_metric_axioms(kind: str, seed: int) -> None:
    """Zero to itself, symmetric, the triangle inequality; the kernel's equals numpy's."""
    rng = np.random.default_rng(seed)
    world, robot = World("empty", np.zeros(2), np.full(2, 10.0)), MAKERS[kind](rng)
    space = make_space(robot, world)
    a, b, c = rng.uniform(space.lower, space.upper, (3, 50, len(space.lower)))
    ab, ba, bc, ac = (robot.distance(*pair) for pair in ((a, b), (b, a), (b, c), (a, c)))
    assert (robot.distance(a, a) == 0).all()
    np.testing.assert_allclose(ab, ba, rtol=1e-12)
    assert (ac <= (ab + bc) * (1 + 1e-9)).all()
    out = np.empty((50, 3))
    all_measured(space, a, np.hstack([b, b, b]), out)
    assert out[:, 0].tobytes() == ab.tobytes()
    assert (out[:, 2] <= out[:, 1]).all()


@BODIES
@FEW
@given(st.integers(0, 2**32))
def test_no_vertex_moves_farther_than_its_bound(kind: str, seed: int) -> None:
    """In a motion of length 1 no point of a polygon moves farther than 1, of n links than n."""
    rng = np.random.default_rng(seed)
    world, robot = World("empty", np.zeros(2), np.full(2, 10.0)), MAKERS[kind](rng)
    links = len(robot.joints) if isinstance(robot, Chain) else 1
    for a, b in zip(*random_edges(rng, robot, world, 20), strict=True):
        body = np.concatenate(naive.moving_body(robot, naive.densified(robot, a, b, 20)), axis=1)
        way = np.linalg.norm(np.diff(body, axis=0), axis=2).sum(axis=0).max()
        assert way <= robot.distance(a, b) * links * (1 + 1e-9) + 1e-12


@BODIES
@FEW
@given(st.integers(0, 2**32), st.floats(0, 1))
def test_interpolation_is_linear_in_the_metric(kind: str, seed: int, part: float) -> None:
    """The way so far and the way to go share the whole in proportion; angles stay in range."""
    rng = np.random.default_rng(seed)
    world, robot = World("empty", np.zeros(2), np.full(2, 10.0)), MAKERS[kind](rng)
    space = make_space(robot, world)
    a, b = rng.uniform(space.lower, space.upper, (2, 50, len(space.lower)))
    middle, whole = np.empty_like(a), robot.distance(a, b)
    all_between(space, a, b, part, middle)
    np.testing.assert_allclose(robot.distance(a, middle), part * whole, atol=1e-9)
    np.testing.assert_allclose(robot.distance(middle, b), (1 - part) * whole, atol=1e-9)
    assert (middle >= space.lower).all()
    assert (middle <= space.upper).all()
    for k in range(50):
        own = robot.interpolate(a[k], b[k], part)
        np.testing.assert_allclose(robot.distance(own, middle[k]), 0, atol=1e-9)


def test_angles_wrap_the_short_way_round() -> None:
    """From just below pi to just above -pi is a small step, and the same back."""
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
    world = World("empty", np.zeros(2), np.full(2, 10.0))
    a, b = np.array([3.1]), np.array([-3.1])
    endless = Chain(1, length=1.0, width=0.0, wrap=True).resolved(world)
    limited = Chain(1, length=1.0, width=0.0, limit=math.pi).resolved(world)
    assert endless.distance(a, b) == pytest.approx(2 * math.pi - 6.2)
    assert limited.distance(a, b) == pytest.approx(6.2)


@BODIES
def test_box_measure_is_a_lower_bound(kind: str) -> None:
    """For anything in a box, angles that wrap included."""
    rng = np.random.default_rng(3)
    for _ in range(3 if config.DISABLE_JIT else 50):
        world, robot = World("empty", np.zeros(2), np.full(2, 10.0)), MAKERS[kind](rng)
        space = make_space(robot, world)
        low, high = robot.bounds(world)
        ends = np.sort(rng.uniform(low, high, (2, 200, len(low))), axis=0)
        inside = rng.uniform(ends[0], ends[1])
        inside = np.where(rng.random(inside.shape) < 0.3, ends[0], inside)
        out = np.empty((200, 3))
        all_measured(space, rng.uniform(low, high, inside.shape), np.hstack([inside, *ends]), out)
        assert (out[:, 2] <= out[:, 1]).all()


@BODIES
@FEW
@given(st.integers(0, 2**32))
def test_nearest_neighbours_in_the_metric(kind: str, seed: int) -> None:
    """The k-d tree finds what brute force finds, across the seam of the angles too."""
    rng = np.random.default_rng(seed)
    world, robot = World("empty", np.zeros(2), np.full(2, 10.0)), MAKERS[kind](rng)
    space = make_space(robot, world)
    points = rng.uniform(space.lower, space.upper, (200, len(space.lower)))
    Q = rng.uniform(space.lower, space.upper, (100, len(space.lower)))
    found = np.zeros(len(Q), np.int64)
    all_nearest(space, rooted_kdtree(points[:1], len(points)), points, Q, found)
    for q, node in zip(Q, found, strict=True):
        far = robot.distance(points, q)
        assert far[node] == far.min()


@pytest.mark.parametrize("kind", ROBOTS)
def test_volume_of_the_unit_ball(kind: str) -> None:
    """As counted by drawing from a box around the ball."""
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
    """The body as the twin sees it; a picture shows a polygon's reference point, a chain's tip."""
    rng = np.random.default_rng(9)
    world, robot = World("empty", np.zeros(2), np.full(2, 10.0)), MAKERS[kind](rng)
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
    """And the default limits are a quarter turn either way."""
    world = make_world("circles2d:n=0,size=20")
    arm = make_robot("chain:links=3,length=2,width=1").resolved(world)
    assert isinstance(arm, Chain)
    lefts = [part[:, 0].min() for part in arm.outline(np.zeros(3))]
    np.testing.assert_allclose(lefts, [10.0, 12.0, 14.0])
    assert all(joint.limits == (-math.pi / 2, math.pi / 2) for joint in arm.joints)
    why = arm.collision(world, np.array([0.0, 1.6, 0.0]))
    assert why == "has joint 2 at 1.6, beyond its limits -1.5708 to 1.5708"


def test_links_that_are_not_neighbours_may_be_told_to_keep_apart() -> None:
    """A square spiral of four links closes on itself."""
    world = make_world("circles2d:n=0,size=20")
    q, turned = np.array([0.0, 1.57, 1.57, 1.57]), np.array([0.0, 1.57, 1.57, -1.57])
    proud, shy = (
        make_robot(f"chain:links=4,length=2,width=0.2,self_collision={word}")
        for word in ("false", "true")
    )
    assert proud.resolved(world).collision(world, q) is None
    assert shy.resolved(world).collision(world, q) == "has links 1 and 4 touch each other"
    assert shy.resolved(world).collision(world, turned) is None
    ends = np.array([q]), np.array([turned])
    assert free(proud.resolved(world), world, *ends).all()
    assert not free(shy.resolved(world), world, *ends).any()


# Names and files


@BODIES
def test_a_robot_reads_back_from_its_file(kind: str) -> None:
    """To the same definition and the same body."""
    rng = np.random.default_rng(13)
    for _ in range(20):
        robot = MAKERS[kind](rng)
        again = robot_from_json(robot.to_json())
        assert again.to_json() == robot.to_json()
        q = rng.uniform(-1, 1, 3)
        for one, other in zip(robot.outline(q), again.outline(q), strict=True):
            assert one.tobytes() == other.tobytes()


def test_every_robot_knows_its_name() -> None:
    """The registry and the files call it the same."""
    assert all(robot.kind == name for name, robot in ROBOTS.items())
    assert robot_from_json(Point().to_json()) == Point()


HEAD = {"schema": "brrt.robot", "version": 1}
SQUARE = [[0, 0], [1, 0], [1, 1], [0, 1]]
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
def test_bad_files_say_what_is_wrong(name: str, tmp_path: Path) -> None:
    """One line that names the file, the field and the value."""
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
def test_bad_use_says_what_is_wrong(name: str, brrt: Callable[..., Result]) -> None:
    """One line, code 2."""
    args, expected = BAD_USE[name]
    done = brrt("plan", "--no-record", *args)
    assert done.code == 2
    assert expected in done.err


# Runs


ROOM = "circles2d:n=6,size=20,max_radius=1.5,seed=1"


def check_path(run: Run, path: Floats) -> None:
    """A path leads from start to goal and is free by the twin, at a hundredth of each motion."""
    problem = run.problem
    np.testing.assert_array_equal(path[0], problem.start)
    np.testing.assert_array_equal(path[-1], problem.goal)
    for a, b in naive.motions(path):
        Q = naive.densified(problem.robot, np.asarray(a), np.asarray(b), SLICES)
        assert naive.clearance(problem.world, problem.robot, Q).min() > 0


RUNS = {
    "polygon": Scenario(world=ROOM, robot="polygon:length=2,width=1"),
    "chain": Scenario(
        world="circles2d:n=3,size=20,max_radius=1,seed=2", robot="chain:links=3,width=0.3",
        start=(0.0, 0.5, 0.5), goal=(-1.0, -1.0, 1.0),
    ),
}  # fmt: skip


@BODIES
def test_a_run_from_end_to_end(kind: str) -> None:
    """Raw and smoothed paths are free; the cost is the length in the robot's metric."""
    run = Run(RUNS[kind])
    figures = run.execute().as_dict()
    assert figures["solved"]
    for name in ("path", "smoothed"):
        path = np.array(figures["path" if name == "path" else "smoothed_path"])
        check_path(run, path)
        cost = run.problem.robot.distance(path[:-1], path[1:]).sum()
        assert figures[f"{name}_cost"] == pytest.approx(cost)


@BODIES
def test_kernels_are_plain_python(kind: str) -> None:
    """Uncompiled, they do the same, bit for bit."""
    scenario = json.dumps(RUNS[kind].as_dict() | {"iterations": 40})
    program = (
        "import sys, json; from brrt import Memory, Run, Scenario;"
        "run, log = Run(Scenario.parse(json.loads(sys.argv[1]))), Memory();"
        "run.execute([log]);"
        "print([event['q'].tobytes().hex() for kind in ('EDGE', 'REJECT')"
        " for event in log.events()[__import__('brrt').Kind[kind]]])"
    )
    said = [
        subprocess.run(
            [sys.executable, "-c", program, scenario],
            env={**os.environ, "NUMBA_DISABLE_JIT": word},
            capture_output=True, text=True, check=True,
        ).stdout
        for word in ("0", "1")
    ]  # fmt: skip
    assert said[0] == said[1]
    assert len(said[0]) > 100


def test_a_recording_needs_no_robot_file(brrt: Callable[..., Result]) -> None:
    """The robot's definition stands in the manifest, and a scenario finds the file beside it."""
    Path("robot.json").write_text(Polygon(2.0, 1.0).to_json())
    Path("run.toml").write_text(f'world = "{ROOM}"\nrobot = "robot.json"\n')
    Path("elsewhere").mkdir()
    planned = brrt("plan", "run.toml", "--json", "--out", "elsewhere/run.mcap")
    assert planned.code == 0
    Path("robot.json").unlink()
    replayed = brrt("replay", "elsewhere/run.mcap", "--json")
    assert replayed.json == planned.json
    assert brrt("replay", "elsewhere/run.mcap", "--rrd", "run.rrd").code == 0


# Real input, and the classic experiments


needs_real = pytest.mark.skipif(not REAL.is_dir(), reason="no real robots here")
EXAMPLES = [
    path
    for path in sorted((Path(__file__).parents[2] / "examples").glob("*.toml"))
    if Scenario.load(path).robot != "point"
]


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_examples(path: Path) -> None:
    """Each is solved, but for the one that cannot be."""
    run = Run(Scenario.load(path))
    figures = run.execute().as_dict()
    assert figures["solved"] == ("unreachable" not in path.stem)
    if figures["solved"]:
        check_path(run, np.array(figures["path"]))
        check_path(run, np.array(figures["smoothed_path"]))


def real_scenario(folder: Path, name: str) -> Scenario:
    """Translate one of the real experiments into files of ours."""
    data = json.loads((REAL / "polygon_and_chain.json").read_text())
    given, (x0, y0, x1, y1) = data["worlds"][name], data["region"]
    polygons = [
        (np.array(obstacle["polygon"], float) + obstacle["at"]).tolist()
        for obstacle in given["obstacles"]
    ]
    world = World("real", np.array([x0, y0]), np.array([x1, y1]), polygons=tuple(polygons))
    robot = {key: value for key, value in given["robot"].items() if key != "kind"}
    (folder / "robot.json").write_text(
        json.dumps({**HEAD, "kind": given["robot"]["kind"], **robot})
    )
    world.save(folder / "world.json")
    return Scenario(
        world=str(folder / "world.json"), robot=str(folder / "robot.json"),
        start=tuple(given["start"]), goal=tuple(given["goal"]),
    )  # fmt: skip


@needs_real
@pytest.mark.parametrize("name", ["robot_world", "robot_arm_world"])
def test_real_experiments(name: str, tmp_path: Path) -> None:
    """Planned, and free by the twin."""
    run = Run(real_scenario(tmp_path, name))
    figures = run.execute().as_dict()
    assert figures["solved"]
    check_path(run, np.array(figures["path"]))
    check_path(run, np.array(figures["smoothed_path"]))


@needs_real
@pytest.mark.parametrize("links", [3])
def test_horn(links: int, tmp_path: Path) -> None:
    """A chain of line segments among line segments, joints without limits, links kept apart."""
    data = json.loads((REAL / f"horn_{links:02}.json").read_text())
    length = data["link_length"]
    joints = tuple(
        Joint((length if i else 0.0, 0.0), np.array([[0.0, 0.0], [length, 0.0]]), None)
        for i in range(links)
    )
    x, y = data["base"]
    robot = Chain(links, self_collision=True, base_x=x, base_y=y, joints=joints)
    walls = tuple(np.array(segment).reshape(2, 2) for segment in data["segments"])
    World("horn", np.full(2, -1.2), np.full(2, 1.2), polygons=walls).save(tmp_path / "world.json")
    (tmp_path / "robot.json").write_text(robot.to_json())
    run = Run(
        Scenario(
            world=str(tmp_path / "world.json"), robot=str(tmp_path / "robot.json"),
            start=tuple(data["start"]), goal=tuple(data["goal"]),
            params={"step": 0.3}, iterations=2_000_000,
        )
    )  # fmt: skip
    figures = run.execute().as_dict()
    assert figures["solved"]
    check_path(run, np.array(figures["path"]))
