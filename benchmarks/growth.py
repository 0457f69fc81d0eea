"""How the cost of an iteration of RRT grows with the tree and with the world.

    python benchmarks/growth.py [--nodes 1000000]

Times come from the recording's own clock, events kept nowhere. `log` is what growth like the
logarithm, from the first row on, would give; the bar is that no row costs more.
"""

import argparse
import math
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from brrt import Events, Kind, Run, Scenario, World, make_world
from brrt.planners.base.stop import Stop
from brrt.recording import Result

OBSTACLES = (100, 1_000, 10_000, 100_000)
COVERED = 0.1
"""Part of the map that obstacles cover, whatever their number."""


class Pace:
    """A sink that keeps when a tree had so many nodes, and after how many iterations."""

    def __init__(self, stop: Stop, marks: list[int]) -> None:
        self._stop, self._marks, self._nodes = stop, marks, 0
        self.rows: list[tuple[int, int, int]] = []

    def write(self, events: Events) -> None:
        """Take a batch; end the run once the last mark is reached."""
        self._nodes += events.counts.get(Kind.EDGE, 0)
        self.rows.append((self._nodes, events.last.iteration, events.last.t))
        self._stop.interrupted = self._nodes >= self._marks[-1]

    def close(self, result: Result | None) -> None:
        """Nothing to release."""


def by_nodes(world: str, marks: list[int]) -> Iterator[tuple[int, float]]:
    """Yield microseconds an iteration around each number of nodes."""
    run = Run(
        Scenario(
            world=world, smooth=False, iterations=10**9, params={"goal_bias": 0.0, "step": 0.01}
        ),
        batch=2048,
    )
    pace = Pace(run.stop, marks)
    run.execute([pace])
    nodes, iterations, t = np.array(pace.rows).T
    for mark in marks:
        i, j = np.searchsorted(nodes, (0.8 * mark, mark))
        j = min(max(int(j), int(i) + 1), len(nodes) - 1)
        yield mark, float(t[j] - t[i]) / float(iterations[j] - iterations[i]) / 1e3


def caged(dim: int, folder: Path) -> str:
    """Write a map of size 1 with 20 balls and walls around the goal; return its file."""
    generator = "circles2d" if dim == 2 else "spheres3d"
    base = make_world(f"{generator}:n=20,size=1,min_radius=0.01,max_radius=0.05")
    assert base.goal is not None  # noqa: S101 - generators give one
    walls = []
    for axis in range(dim):
        for side in (-0.02, 0.02):
            low, high = base.goal - 0.02, base.goal + 0.02
            low[axis] = high[axis] = base.goal[axis] + side
            walls.append(np.concatenate([low, high]))
    path = folder / f"caged{dim}d.json"
    ends = (base.start, base.goal)
    World(path.stem, base.lower, base.upper, base.balls, np.array(walls), *ends).save(path)
    return str(path)


def by_obstacles(world: Callable[[int], str], step: float) -> Iterator[tuple[int, float]]:
    """Yield microseconds an iteration in worlds with more and more obstacles."""
    for m in OBSTACLES:
        params: dict[str, Any] = {"goal_bias": 0.0, "step": step, "goal_test": "step"}
        run = Run(Scenario(world=world(m), smooth=False, iterations=50_000, params=params))
        figures = run.execute().as_dict()
        yield m, figures["plan_time_s"] / figures["iterations"] * 1e6


def squares(m: int) -> str:
    """Squares that cover a tenth of a map of size 100."""
    side = 100 * math.sqrt(COVERED / m)
    return f"squares2d:n={m},size=100,min_side={side:.4g},max_side={side:.4g},seed=1"


def spheres(m: int) -> str:
    """Spheres that cover a tenth of a map of size 100."""
    radius = 100 * (COVERED / m * 3 / (4 * math.pi)) ** (1 / 3)
    return f"spheres3d:n={m},size=100,min_radius={radius:.4g},max_radius={radius:.4g},seed=1"


def show(name: str, unit: str, rows: Iterator[tuple[int, float]]) -> None:
    """Print a curve beside the logarithm's."""
    print(f"\n{name}\n{unit:>12}{'us/iteration':>14}{'ratio':>8}{'log':>7}")
    first: tuple[int, float] | None = None
    for n, us in rows:
        first = first or (n, us)
        log = math.log(n) / math.log(first[0])
        print(f"{n:12,}{us:14.3f}{us / first[1]:8.2f}{log:7.2f}", flush=True)


def main() -> None:
    """Measure and print every curve."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--nodes", type=int, default=1_000_000)
    most = parser.parse_args().nodes
    marks = [n for n in (1_000, 10_000, 100_000, 300_000, 1_000_000) if n <= most]
    with tempfile.TemporaryDirectory() as name:
        for dim in (2, 3):
            world = caged(dim, Path(name))
            show(f"rrt, {dim}D, by the size of the tree", "nodes", by_nodes(world, marks))
    show("rrt, 2D, by obstacles", "squares", by_obstacles(squares, 1.0))
    show("rrt, 3D, by obstacles", "spheres", by_obstacles(spheres, 1.0))


if __name__ == "__main__":
    main()
