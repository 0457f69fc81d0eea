"""Random robots with bodies, worlds around them and motions for them."""

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from brrt import World
from brrt.robots import Chain, Polygon, Robot
from brrt.robots.chain import Joint

Floats = NDArray[np.float64]


def convex(rng: np.random.Generator, size: float) -> Floats:
    """A line segment or a convex polygon near the origin, round or thin."""
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
    """Links of any shape, some joints without limits."""
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
    """Motions from tiny to across the space, some of them along few coordinates."""
    lower, upper = robot.bounds(world)
    A = rng.uniform(lower, upper, (n, len(lower)))
    far = 10.0 ** rng.uniform(-3, 0, (n, 1)) * (rng.random(A.shape) < 0.8)
    B = A + far * (rng.uniform(lower, upper, A.shape) - A)
    return A, B
