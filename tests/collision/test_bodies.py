"""How the parts of bodies move: velocities and bounds against many places of a motion."""

from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from brrt.collision.bodies import Body, Bounds, Poses, towards
from brrt.collision.convex import Complex
from brrt.collision.motions import Obstacles, all_clear, first_hits
from brrt.robots import Chain
from tests.support import naive
from tests.support.bodies import random_chain, random_edges, random_polygon, random_world

PLACES = 401
KINDS = pytest.mark.parametrize("kind", ["polygon", "chain"])


class Motion(NamedTuple):
    """A body at many places of a motion, vertices and velocities with shape (k, places, parts)."""

    body: Body
    step: np.ndarray[tuple[int, int], np.dtype[np.float64]]
    poses: Poses
    vertices: Complex
    velocity: Complex
    bounds: Bounds


def motion_of(kind: str, seed: int) -> Motion:
    """A random motion of a random robot."""
    rng = np.random.default_rng(seed)
    robot = random_polygon(rng) if kind == "polygon" else random_chain(rng, int(rng.integers(1, 9)))
    dof = len(robot.joints) if isinstance(robot, Chain) else 3
    a, b = rng.uniform(-3, 3, (2, 1, dof))
    body, step = Body(robot, dof), towards(robot, a, b)
    part = np.linspace(0, 1, PLACES)[:, None]
    poses = body.poses(a + part * step, np.broadcast_to(step, (PLACES, dof)))
    places, parts = (x.reshape(-1) for x in np.mgrid[:PLACES, : len(body.hulls)])
    placed = body.placed(poses, places, parts)
    shape = (-1, PLACES, len(body.hulls))
    return Motion(
        body, step, poses, placed.vertices.reshape(shape), placed.velocity.reshape(shape),
        body.bounds(a, b, step),
    )  # fmt: skip


def check(points: Complex, move: float, bend: float) -> None:
    """Check bounds of the way and the acceleration of points, shape (k, places)."""
    steps = np.diff(points, axis=1)
    assert np.abs(steps).sum(axis=1).max() <= move + 1e-9
    assert np.abs(np.diff(steps, axis=1)).max() * (PLACES - 1) ** 2 <= bend * (1 + 1e-6) + 1e-6


@KINDS
@settings(max_examples=40)
@given(seed=st.integers(0, 2**32))
def test_velocities_and_bounds(kind: str, seed: int) -> None:
    """Velocities are those of differences; nothing moves farther or turns sharper than bounds."""
    m = motion_of(kind, seed)
    central = (m.vertices[:, 2:] - m.vertices[:, :-2]) * (PLACES - 1) / 2
    speed = max(1.0, float(np.abs(m.velocity).max()))
    np.testing.assert_allclose(m.velocity[:, 1:-1], central, atol=0.01 * speed**3)
    for part in range(len(m.body.hulls)):
        check(m.vertices[:, :, part], m.bounds.move[0, part], m.bounds.bend[0, part])


@settings(max_examples=40)
@given(seed=st.integers(0, 2**32))
def test_links_as_seen_from_others(seed: int) -> None:
    """The frame of the first link of a pair turns; there the second one keeps to its bounds."""
    m = motion_of("chain", seed)
    seen = m.body.pair_bounds(m.step)
    for pair, (i, j) in enumerate(m.body.pairs.tolist()):
        there = (m.vertices[:, :, j] - m.poses.at[:, i]) / m.poses.turn[:, i]
        check(there, seen.move[0, pair], seen.bend[0, pair])


@settings(max_examples=6)
@given(seed=st.integers(0, 2**32))
def test_long_chains(seed: int) -> None:
    """Ten links, whose motions are long and bent, against many places along the way."""
    rng = np.random.default_rng(seed)
    robot, world = random_chain(rng, 10), random_world(rng, 3)
    a, b = random_edges(rng, robot, world, 8)
    hits = first_hits(Obstacles(world), robot, a, b)
    clear = all_clear(Obstacles(world), robot, a, b)
    for start, end, hit, alone in zip(a, b, hits, clear, strict=True):
        least = naive.clearance(world, robot, naive.densified(robot, start, end, 300)).min()
        assert least > 0 or hit >= 0 or not alone
        assert least >= 1e-6 or not alone
        if hit >= 0:
            assert least < 0.5 * float(robot.distance(start, end)) / 300 * len(start) + 1e-9
