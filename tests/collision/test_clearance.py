"""Where motions hit first and how near they come, against many places along each."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from brrt.collision.clearance import CLOSE, clearances, first_contacts
from brrt.collision.motions import Obstacles, first_hits
from brrt.robots import Chain, Point
from brrt.worlds import World
from tests.support import naive
from tests.support.bodies import BODIES, MAKERS, random_edges, random_world

Floats = NDArray[np.float64]

PLACES = 300


def from_point(world: World, Q: Floats) -> Floats:
    """Distances of points, shape (n, d), from the nearest obstacle."""
    d, far = world.dim, np.full(len(Q), np.inf)
    for *centre, radius in world.balls:
        far = np.minimum(far, np.linalg.norm(Q - centre, axis=1) - radius)
    for box in world.boxes:
        off = np.maximum(0, np.maximum(box[:d] - Q, Q - box[d:]))
        far = np.minimum(far, np.linalg.norm(off, axis=1))
    for polygon in world.polygons:
        far = np.minimum(far, naive.hull_distance(Q[:, None], polygon[None]))
    return far


@settings(max_examples=40)
@given(st.integers(0, 2**32), st.sampled_from([2, 3]))
def test_clearance_of_points(seed: int, dim: int) -> None:
    """It is the least distance along the motion, and is attained at the place that is named."""
    rng = np.random.default_rng(seed)
    world = random_world(rng)
    if dim == 3:
        low = rng.uniform(0, 9, (5, 3))
        balls = np.hstack([rng.uniform(0, 10, (5, 3)), rng.uniform(0, 1, (5, 1))])
        boxes = np.hstack([low, low + rng.uniform(0, 2, (5, 3))])
        world = World("", np.zeros(3), np.full(3, 10.0), balls, boxes)
    obstacles = Obstacles(world)
    a, b = rng.uniform(0, 10, (2, 20, dim))
    free = np.flatnonzero(first_hits(obstacles, Point(), a, b) < 0)
    found = clearances(obstacles, Point(), a[free], b[free])
    for i, part, other, distance in zip(free, *found, strict=True):
        Q = a[i] + np.linspace(0, 1, PLACES + 1)[:, None] * (b[i] - a[i])
        least = from_point(world, Q).min()
        assert (other < 0) == (distance == np.inf) == (not len(obstacles))
        if other >= 0:
            assert least - np.linalg.norm(b[i] - a[i]) / PLACES <= distance <= least + 1e-9
            there = from_point(world, (a[i] + part * (b[i] - a[i]))[None])[0]
            assert abs(there - distance) < 1e-9


@BODIES
@settings(max_examples=8)
@given(seed=st.integers(0, 2**32))
def test_clearance_of_bodies(kind: str, seed: int) -> None:
    """It is within its tolerance of the least distance, bounds included."""
    rng = np.random.default_rng(seed)
    robot, world = MAKERS[kind](rng), random_world(rng, 4)
    if isinstance(robot, Chain):
        robot = replace(robot, self_collision=False)
    a, b = random_edges(rng, robot, world, 12)
    obstacles = Obstacles(world)
    free = np.flatnonzero(first_hits(obstacles, robot, a, b) < 0)
    found = clearances(obstacles, robot, a[free], b[free])
    for i, part, other, distance in zip(free, *found, strict=True):
        least = naive.clearance(world, robot, naive.densified(robot, a[i], b[i], PLACES)).min()
        spacing = float(robot.distance(a[i], b[i])) / PLACES * a.shape[1]
        assert least - spacing - 1e-9 <= distance <= least / (1 - CLOSE) + 1e-9
        ends = naive.densified(robot, a[i], b[i], 1)
        there = naive.clearance(world, robot, (ends[0] + part * (ends[1] - ends[0]))[None])[0]
        assert abs(there - distance) < 1e-7
        assert 0 <= other <= obstacles.bounds


@pytest.mark.parametrize("kind", ["point", *MAKERS])
@settings(max_examples=8)
@given(seed=st.integers(0, 2**32))
def test_first_contacts(kind: str, seed: int) -> None:
    """A motion is free until there, and touches the named thing there."""
    rng = np.random.default_rng(seed)
    world = random_world(rng, 6)
    robot = Point() if kind == "point" else MAKERS[kind](rng)
    a, b = random_edges(rng, robot, world, 20)
    obstacles = Obstacles(world)
    hits = first_hits(obstacles, robot, a, b)
    rows = np.flatnonzero(hits >= 0)
    found = first_contacts(obstacles, robot, a[rows], b[rows], hits[rows])
    for i, part, other, _ in zip(rows, *found, strict=True):
        ends = naive.densified(robot, a[i], b[i], 1)
        step = ends[1] - ends[0]
        there = (a[i] + part * step)[None]
        gaps = from_point(world, there) if kind == "point" else naive.clearance(world, robot, there)
        assert gaps[0] < 1e-6
        before = a[i] + part * (1 - 1e-3) * step
        alone = first_hits(obstacles, robot, a[[i]], before[None])
        assert part == 0 or alone[0] < 0
        assert 0 <= other <= obstacles.itself


def test_the_first_obstacle_is_named() -> None:
    """It is the one that is met first, whatever its number."""
    balls = np.array([[8.0, 5, 1], [5, 5, 1], [2, 9, 0.5]])
    world = World("", np.zeros(2), np.full(2, 10.0), balls)
    obstacles, a, b = Obstacles(world), np.array([[1.0, 5]]), np.array([[9.9, 5]])
    assert first_hits(obstacles, Point(), a, b).tolist() == [0]
    found = first_contacts(obstacles, Point(), a, b, np.array([0]))
    assert found.other.tolist() == [1]
    assert a[0, 0] + found.part[0] * 8.9 == pytest.approx(4)
    inside = first_contacts(obstacles, Point(), np.array([[5.0, 5]]), b, np.array([0]))
    assert (inside.part[0], inside.other[0]) == (0, 1)
