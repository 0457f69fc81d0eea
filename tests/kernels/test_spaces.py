"""The compiled spaces of robots with bodies: motion checks, metrics, and agreement with numpy."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from brrt import BrrtError, World, make_robot, make_world
from brrt.kernels import space as kernels
from brrt.kernels.jit import config, kernel
from brrt.kernels.kdtree import insert, nearest, rooted_kdtree
from brrt.kernels.spaces import SPACES, make_space
from brrt.robots import ROBOTS, Point, Polygon, Robot
from tests.support import naive
from tests.support.bodies import BODIES, MAKERS, random_edges, random_world

Floats = NDArray[np.float64]

FEW = settings(max_examples=3 if config.DISABLE_JIT else 25, deadline=None)
SLICES = 100
EDGES = 3 if config.DISABLE_JIT else 60
EMPTY = World("empty", np.zeros(2), np.full(2, 10.0))


@kernel
def all_free(space: Any, A: Floats, B: Floats, free: NDArray[np.bool_]) -> None:
    """Check the motion from each row of A to the same row of B."""
    for i in range(len(A)):
        free[i] = kernels.segment_free(space, A, i, B, i)


@kernel
def all_measured(space: Any, A: Floats, B: Floats, out: Floats) -> None:
    """Distance, measure and lower bound of the measure from each row of A to the same row of B.

    A row of B has a box around its configuration after it: least, then greatest corner.
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
    """Insert all points, then find the nearest one to each query."""
    for node in range(1, len(points)):
        insert(tree, space, points, node, 0)
    for i in range(len(Q)):
        found[i] = nearest(tree, space, Q, i, 0)


def free(robot: Robot, world: World, A: Floats, B: Floats) -> NDArray[np.bool_]:
    """Whether each motion is free, by the kernels."""
    found = np.zeros(len(A), np.bool_)
    all_free(make_space(robot, world), A, B, found)
    return found


@BODIES
@FEW
@given(st.integers(0, 2**32))
def test_motions_against_a_dense_twin(kind: str, seed: int) -> None:
    """At each hundredth of a free motion the twin is free; a motion with a clearance is free."""
    rng = np.random.default_rng(seed)
    world, robot = random_world(rng, 4), MAKERS[kind](rng)
    A, B = random_edges(rng, robot, world, EDGES)
    for a, b, is_free in zip(A, B, free(robot, world, A, B), strict=True):
        Q = naive.densified(robot, a, b, SLICES)
        clearance = naive.clearance(world, robot, Q).min()
        where = (a.tolist(), b.tolist(), world.to_json(), robot.to_json())
        if is_free:
            assert clearance > 0, where
            continue
        body = np.concatenate(naive.moving_body(robot, Q), axis=1)
        furthest = np.linalg.norm(np.diff(body, axis=0), axis=2).max()
        # Between two samples no point comes nearer than half the move of the fastest vertex, and
        # the distance of two shapes is at least half of their separation along the axes.
        assert clearance <= 2 * furthest + 1e-4, where


@BODIES
@FEW
@given(st.integers(0, 2**32))
def test_configurations_agree(kind: str, seed: int) -> None:
    """A motion of no length, `collision` and the twin agree, except within the margin."""
    rng = np.random.default_rng(seed)
    world, robot = random_world(rng, 4), MAKERS[kind](rng)
    A, _ = random_edges(rng, robot, world, EDGES)
    far = naive.clearance(world, robot, A)
    for q, is_free, gap in zip(A, free(robot, world, A, A), far, strict=True):
        assert (robot.collision(world, q) is None) == (gap > 0) or gap < 1e-9
        assert is_free == (gap > 0) or gap < 1e-3


@BODIES
def test_motions_that_end_in_an_obstacle_are_refused(kind: str) -> None:
    """At either end."""
    rng = np.random.default_rng(7)
    for _ in range(2 if config.DISABLE_JIT else 20):
        world, robot = random_world(rng), MAKERS[kind](rng)
        A, B = random_edges(rng, robot, world, EDGES)
        for one, other in ((A, B), (B, A)):
            found = free(robot, world, one, other)
            assert not (found & (naive.clearance(world, robot, one) == 0)).any()


@BODIES
def test_the_grid_misses_no_obstacle(kind: str) -> None:
    """Checks against each obstacle alone give the same results as against all in one grid."""
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
    """Ten samples of the motion would miss the line segment."""
    wall = np.array([[5.0, 0.0], [5.0, 10.0]])
    world = World("wall", np.zeros(2), np.full(2, 10.0), polygons=(wall,))
    robot = Polygon(0.2, 0.2)
    A, B = np.array([[1.0, 5.0, 0.0]]), np.array([[9.0, 5.0, 0.0]])
    assert not free(robot, world, A, B).any()
    assert free(robot, world, A, A).all()
    assert free(robot, world, B, B).all()


def test_turning_on_the_spot_between_close_walls() -> None:
    """A rod longer than the slot is wide cannot turn in it; a shorter one can."""
    walls = tuple(np.array([[0.0, y], [10.0, y]]) for y in (4.0, 6.0))
    world = World("slot", np.zeros(2), np.full(2, 10.0), polygons=walls)
    lying, turned = np.array([[5.0, 5.0, 0.0]]), np.array([[5.0, 5.0, -3.14]])
    assert not free(Polygon(3.0, 0.1), world, lying, turned).any()
    assert free(Polygon(1.9, 0.1), world, lying, turned).all()


@BODIES
@FEW
@given(st.integers(0, 2**32))
def test_metric_axioms(kind: str, seed: int) -> None:
    """Zero, symmetry and the triangle inequality; the kernel's bits equal numpy's."""
    rng = np.random.default_rng(seed)
    world, robot = EMPTY, MAKERS[kind](rng)
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
@given(st.integers(0, 2**32), st.floats(0, 1))
def test_interpolation_is_linear_in_the_metric(kind: str, seed: int, part: float) -> None:
    """The distances to both ends are in proportion to the part; angles are in range."""
    rng = np.random.default_rng(seed)
    world, robot = EMPTY, MAKERS[kind](rng)
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


@BODIES
def test_box_measure_is_a_lower_bound(kind: str) -> None:
    """Of every configuration in a box, with angles that wrap."""
    rng = np.random.default_rng(3)
    for _ in range(3 if config.DISABLE_JIT else 50):
        world, robot = EMPTY, MAKERS[kind](rng)
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
    """The k-d tree finds what brute force finds, also where angles wrap."""
    rng = np.random.default_rng(seed)
    world, robot = EMPTY, MAKERS[kind](rng)
    space = make_space(robot, world)
    points = rng.uniform(space.lower, space.upper, (200, len(space.lower)))
    Q = rng.uniform(space.lower, space.upper, (100, len(space.lower)))
    found = np.zeros(len(Q), np.int64)
    all_nearest(space, rooted_kdtree(points[:1], len(points)), points, Q, found)
    for q, node in zip(Q, found, strict=True):
        far = robot.distance(points, q)
        assert far[node] == far.min()


def test_motions_of_links_that_must_not_touch() -> None:
    """A motion is refused if two links that are not neighbours touch, and only if they must not."""
    world = make_world("circles2d:n=0,size=20")
    A, B = np.array([[0.0, 1.57, 1.57, 1.57]]), np.array([[0.0, 1.57, 1.57, -1.57]])
    for self_collision in (False, True):
        spec = f"chain:links=4,length=2,width=0.2,self_collision={self_collision}".lower()
        assert free(make_robot(spec).resolved(world), world, A, B).all() != self_collision


@pytest.mark.parametrize("kind", [kind for kind, robot in ROBOTS.items() if not robot.opaque])
def test_every_robot_has_a_space_with_its_bounds(kind: str) -> None:
    """Of numbers that kernels can compile for; samples are drawn between them."""
    robot = ROBOTS[kind]().resolved(EMPTY)
    assert type(robot) in SPACES
    space, (lower, upper) = make_space(robot, EMPTY), robot.bounds(EMPTY)
    assert (space.lower, space.upper) == (tuple(lower.tolist()), tuple(upper.tolist()))
    assert len(lower) == robot.dof(EMPTY)


def test_a_robot_without_a_space_cannot_plan() -> None:
    """The error names the registry; one that extends another has the space of that."""

    class Other(Robot):
        kind = "other"

    class Extended(Point):
        kind = "extended"

    with pytest.raises(BrrtError, match=r"robot other has no .* brrt.kernels.spaces.SPACES"):
        make_space(Other(), EMPTY)  # type: ignore[abstract]
    assert type(make_space(Extended(), EMPTY)) is type(make_space(Point(), EMPTY))
