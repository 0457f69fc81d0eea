"""Collision geometry, against exact fractions and against points along the motion."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from brrt.collision import obstacles as obstacles_module
from brrt.collision.motions import Obstacles, all_clear, first_hits, near_pairs
from brrt.robots import Point
from brrt.worlds import World
from tests.kernels.test_spaces import free
from tests.support import naive
from tests.support.bodies import BODIES, MAKERS, random_edges, random_world

Floats = NDArray[np.float64]

PLACES = 300
"""Places along a motion at which the twin measures."""


def world_of(rng: np.random.Generator, dim: int, n: int) -> World:
    """Boxes, some of them flat, and balls; coordinates are whole, so that much just touches."""
    low = rng.integers(0, 9, (n, dim)).astype(float)
    high = low + rng.integers(0, 3, (n, dim))
    balls = np.concatenate([rng.integers(0, 9, (n, dim)), rng.integers(0, 3, (n, 1))], axis=1)
    return World("", np.zeros(dim), np.full(dim, 10.0), balls, np.concatenate([low, high], axis=1))


@given(
    st.integers(0, 2**32), st.sampled_from([2, 3]), st.integers(1, 400), st.sampled_from([1, 50])
)
def test_near_is_every_pair_that_meets(seed: int, dim: int, n: int, batch: int) -> None:
    """Each once, whatever the sizes, touching included, and however many go at once."""
    rng = np.random.default_rng(seed)
    obstacles = Obstacles(world_of(rng, dim, int(rng.integers(1, 40))))
    low = rng.integers(-2, 12, (n, dim)).astype(float)
    high = low + rng.integers(0, 8, (n, dim)) // rng.integers(1, 8, (n, 1))
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(obstacles_module, "_CANDIDATES", batch)
        patched.setattr(obstacles_module, "_PAIRS", batch)
        found = [
            pair for i, j in near_pairs(low, high, obstacles) for pair in zip(i, j, strict=True)
        ]
    meet = (low[:, None] <= obstacles.upper) & (obstacles.lower <= high[:, None])
    expected = np.argwhere(meet.all(axis=2)).tolist()
    assert sorted(map(list, found)) == expected


@given(st.integers(0, 2**32), st.sampled_from([2, 3]))
def test_a_point_against_boxes_and_balls(seed: int, dim: int) -> None:
    """What is found is a hit, exactly; what goes in deeper than rounding is found."""
    rng = np.random.default_rng(seed)
    world, n = world_of(rng, dim, 6), 40
    a, b = (rng.integers(0, 10, (n, dim)) + rng.choice([0, 0.5, 0.37], (n, dim)) for _ in "ab")
    found = first_hits(Obstacles(world), Point(), a, b)
    for p, q, hit in zip(a, b, found, strict=True):
        if hit >= 0:
            assert naive.hits(world, p, q)
            continue
        deep = -1e-7
        fat = world.boxes[(world.boxes[:, dim:] > world.boxes[:, :dim]).all(axis=1)]
        assert not any(naive.segment_hits_box(p, q, box, deep) for box in fat)
        solid = world.balls[world.balls[:, dim] > 0]
        assert not any(naive.segment_hits_ball(p, q, ball, deep) for ball in solid)


def test_a_wall_without_thickness_stops_a_point() -> None:
    """Going through it is a hit, however thin it is; going along it elsewhere is none."""
    world = World("", np.zeros(2), np.full(2, 9.0), np.empty((0, 3)), np.array([[4.0, 1, 4, 8]]))
    a = np.array([[1.0, 2], [1, 2], [1, 8.5]])
    b = np.array([[7.0, 3], [3.9, 3], [7, 8.5]])
    assert first_hits(Obstacles(world), Point(), a, b).tolist() == [0, -1, -1]


@given(st.integers(0, 2**32))
def test_polygons_are_like_boxes(seed: int) -> None:
    """A box written as a polygon stops the same motions."""
    rng = np.random.default_rng(seed)
    low = rng.random((5, 2)) * 8
    boxes = np.concatenate([low, low + 0.2 + rng.random((5, 2))], axis=1)
    polygons = [box[[[0, 1], [2, 1], [2, 3], [0, 3]]] for box in boxes]
    a, b = rng.random((2, 60, 2)) * 10
    ends = np.zeros(2), np.full(2, 10.0)
    plain, other = World("", *ends, boxes=boxes), World("", *ends, polygons=tuple(polygons))
    one, two = (first_hits(Obstacles(world), Point(), a, b) for world in (plain, other))
    assert one.tolist() == two.tolist()


class Bar:
    """A thin bar that turns about its middle; the angle wraps."""

    opaque = False

    shape = np.array([[-1.0, -0.1], [1, -0.1], [1, 0.1], [-1, 0.1]])

    def outline(self, q: Floats) -> list[Floats]:
        """One rectangle."""
        c, s = np.cos(q[2]), np.sin(q[2])
        return [self.shape @ np.array([[c, s], [-s, c]]) + q[:2]]

    def canonical(self, q: Floats) -> Floats:
        """The same pose, its angle in range."""
        return np.array([q[0], q[1], (q[2] + np.pi) % (2 * np.pi) - np.pi])

    def distance(self, a: Floats, b: Floats) -> Floats:
        """Way of the middle, and of an end around it."""
        step = np.asarray(b) - np.asarray(a)
        turn = np.abs((step[..., 2] + np.pi) % (2 * np.pi) - np.pi)
        return np.asarray(np.hypot(step[..., 0], step[..., 1]) + np.hypot(1, 0.1) * turn)


@settings(max_examples=25)
@given(st.integers(0, 2**32))
def test_a_robot_with_an_outline(seed: int) -> None:
    """Against many places along the way, in the bar's own frame."""
    rng = np.random.default_rng(seed)
    balls = np.concatenate([rng.random((4, 2)) * 10, 0.3 + rng.random((4, 1))], axis=1)
    world = World("", np.full(2, -5.0), np.full(2, 15.0), balls, np.empty((0, 4)))
    a, b = rng.random((2, 20, 3)) * [10, 10, 2 * np.pi]
    found = first_hits(Obstacles(world), Bar(), a, b)
    step = b - a
    step[:, 2] = (step[:, 2] + np.pi) % (2 * np.pi) - np.pi
    for start, way, hit in zip(a, step, found, strict=True):
        gaps = []
        for part in np.linspace(0, 1, 400):
            x, y, angle = start + part * way
            c, s = np.cos(angle), np.sin(angle)
            local = (balls[:, :2] - [x, y]) @ np.array([[c, -s], [s, c]])
            outside = np.maximum(np.abs(local) - [1, 0.1], 0)
            gaps.append((np.hypot(*outside.T) - balls[:, 2]).min())
        assert (min(gaps) < 0.05) if hit >= 0 else (min(gaps) > -0.05)


def test_many_motions_and_obstacles_meet_each_other() -> None:
    """The broad phase leaves nothing out: the same as every pair by itself."""
    rng = np.random.default_rng(5)
    world = world_of(rng, 2, 100)
    a = rng.random((700, 2)) * 10
    b = a + rng.normal(scale=0.4, size=a.shape)
    found = first_hits(Obstacles(world), Point(), a, b)
    alone = [int(first_hits(Obstacles(world), Point(), a[[i]], b[[i]])[0]) for i in range(700)]
    assert found.tolist() == alone
    assert 100 < (found >= 0).sum() < 690


@BODIES
@settings(max_examples=40)
@given(seed=st.integers(0, 2**32))
def test_bodies_and_the_kernels(kind: str, seed: int) -> None:
    """What the kernels call free the checks find nothing in; what they refuse is not clear."""
    rng = np.random.default_rng(seed)
    robot, world = MAKERS[kind](rng), random_world(rng)
    a, b = random_edges(rng, robot, world, 100)
    obstacles, kernels = Obstacles(world), free(robot, world, a, b)
    assert (first_hits(obstacles, robot, a, b)[kernels] < 0).all()
    assert not all_clear(obstacles, robot, a, b)[~kernels].any()


@BODIES
@settings(max_examples=8)
@given(seed=st.integers(0, 2**32))
def test_bodies_along_the_way(kind: str, seed: int) -> None:
    """Against distances by another formula at many places of each motion."""
    rng = np.random.default_rng(seed)
    robot, world = MAKERS[kind](rng), random_world(rng, 4)
    a, b = random_edges(rng, robot, world, 20)
    hits = first_hits(Obstacles(world), robot, a, b)
    clear = all_clear(Obstacles(world), robot, a, b)
    for start, end, hit, alone in zip(a, b, hits, clear, strict=True):
        least = naive.clearance(world, robot, naive.densified(robot, start, end, PLACES)).min()
        # Between the checks' places a corner may be grazed: that is not proven clear either.
        assert least > 0 or hit >= 0 or not alone
        assert least >= 1e-6 or not alone
        if hit >= 0:
            assert least < 0.5 * float(robot.distance(start, end)) / PLACES * len(start) + 1e-9
