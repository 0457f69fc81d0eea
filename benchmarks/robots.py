"""Edge checks a second for robots with bodies, against 50 obstacles.

    python benchmarks/robots.py [--edges 20000] [--rounds 9]

Each edge leaves from a free configuration towards one drawn evenly, and is as long as a planner's
default step, 5 % of the map's side in the robot's metric; some are free, some collide. The figure
is the median of the rounds, on one core, kernels compiled before.
"""

import argparse
import statistics
import time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrt import Robot, World, make_robot, make_world
from brrt.kernels.jit import kernel
from brrt.kernels.space import segment_free
from brrt.kernels.spaces import make_space
from brrt.robots import Polygon

Floats = NDArray[np.float64]

BAR = 200_000
HOUSE = Polygon(
    parts=(
        np.array([[-2.5, -1.5], [2.5, -1.5], [2.5, 1.0], [-2.5, 1.0]]),
        np.array([[-1.5, 1.0], [1.5, 1.0], [0.0, 2.5]]),
    )
)
ROBOTS: dict[str, Robot] = {
    "rectangle 4 x 2": make_robot("polygon:length=4,width=2"),
    "house of 2 parts": HOUSE,
    "chain, 3 links": make_robot("chain:links=3"),
    "chain, 3 links, self-collision": make_robot("chain:links=3,self_collision=true"),
    "chain, 10 links, self-collision": make_robot("chain:links=10,self_collision=true"),
}
WORLDS = ("circles2d:max_radius=5", "boxes2d:max_side=8", "polygons2d:max_radius=5")


@kernel
def check_all(space: Any, A: Floats, B: Floats, free: NDArray[np.bool_]) -> None:
    """Check the motion from each row of A to the same row of B."""
    for i in range(len(A)):
        free[i] = segment_free(space, A, i, B, i)


def edges(robot: Robot, world: World, space: Any, n: int) -> tuple[Floats, Floats]:
    """Draw n edges."""
    rng = np.random.default_rng(0)
    lower, upper = np.array(space.lower), np.array(space.upper)
    A = np.empty((0, len(lower)))
    while len(A) < n:
        drawn = rng.uniform(lower, upper, (10 * n, len(lower)))
        free = np.zeros(len(drawn), np.bool_)
        check_all(space, drawn, drawn, free)
        A = np.concatenate([A, drawn[free]])
    A = A[:n]
    towards = rng.uniform(lower, upper, A.shape)
    part = np.minimum(1.0, 0.05 * world.extent / robot.distance(A, towards))
    ends = [robot.interpolate(a, b, p) for a, b, p in zip(A, towards, part, strict=True)]
    return A, np.array(ends)


def main() -> None:
    """Measure every robot in every world and print a table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--edges", type=int, default=20_000)
    parser.add_argument("--rounds", type=int, default=9)
    options = parser.parse_args()
    print(f"{'edge checks, 50 obstacles':34}{'world':26}{'free':>6}{'a second':>12}{'bar':>9}")
    for name, unsettled in ROBOTS.items():
        for spec in WORLDS:
            world = make_world(spec)
            robot = unsettled.resolved(world)
            space = make_space(robot, world)
            A, B = edges(robot, world, space, options.edges)
            free, times = np.zeros(len(A), np.bool_), []
            for _ in range(options.rounds):
                began = time.perf_counter()
                check_all(space, A, B, free)
                times.append(time.perf_counter() - began)
            rate = len(A) / statistics.median(times)
            print(f"{name:34}{spec:26}{free.mean():6.2f}{rate:12,.0f}{BAR:9,}", flush=True)


if __name__ == "__main__":
    main()
