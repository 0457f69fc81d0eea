"""How close RRT* comes to the optimum, in worlds whose shortest path has a closed form.

    python benchmarks/optimality.py [--seeds 20] [--step 20] [--most 64000]

For each world and planner the table shows the cost of the best path after so many iterations, in
per cent above the optimum: the median over the seeds, and how many of them had a path where these
are not all. A run of n iterations is the beginning of any longer one, so each seed is run once.
"""

import argparse
import math
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from brrt import Run, Scenario, World
from brrt.events import Kind

ITERATIONS = (1000, 4000, 16_000, 64_000, 256_000)
PLANNERS: Mapping[str, tuple[str, dict[str, Any]]] = {
    "rrt-star": ("rrt-star", {}),
    "rrt-star, informed": ("rrt-star", {"informed": True}),
    "bi-rrt-star": ("bi-rrt-star", {}),
    "bi-rrt-star, informed": ("bi-rrt-star", {"informed": True}),
}


@dataclass(frozen=True)
class Case:
    """A world between whose start and goal the shortest path is known."""

    name: str
    world: World
    optimum: float

    def save(self, folder: Path) -> str:
        """Write the world to a file; return its path."""
        path = folder / f"{self.name.replace(' ', '-')}.json"
        self.world.save(path)
        return str(path)


def cases() -> list[Case]:
    """An empty world, a box and a ball in the way, in the plane and in space; all 100 wide."""
    found = []
    for dim in (2, 3):
        start, goal = np.full(dim, 50.0), np.full(dim, 50.0)
        start[0], goal[0] = 10.0, 90.0
        # The box reaches beyond the bounds in z, and less far up than down: one way is shorter.
        box = np.array([40.0, 30.0, -1.0][:dim] + [60.0, 65.0, 101.0][:dim])
        around_box = 2 * math.hypot(30, 15) + 20
        ball = np.array([50.0] * dim + [20.0])
        # Two tangents from 40 away, and the arc between where they touch.
        around_ball = 2 * math.sqrt(40**2 - 20**2) + 20 * (math.pi - 2 * math.acos(20 / 40))
        bounds = np.zeros(dim), np.full(dim, 100.0)
        ends: dict[str, Any] = {"start": start, "goal": goal}
        found += [
            Case(f"{dim}D empty", World("empty", *bounds, **ends), 80.0),
            Case(f"{dim}D box", World("box", *bounds, boxes=box[None], **ends), around_box),
            Case(f"{dim}D ball", World("ball", *bounds, balls=ball[None], **ends), around_ball),
        ]
    return found


def costs(
    world: str,
    planner: str,
    params: Mapping[str, Any],
    seed: int,
    iterations: tuple[int, ...] = ITERATIONS,
) -> list[float]:
    """Cost of the best path after so many iterations each; infinite where there is none."""
    scenario = Scenario(
        world=world, planner=planner, params=params, seed=seed, smooth=False, clock="logical",
        iterations=max(iterations),
    )  # fmt: skip
    paths = [
        (int(path["iteration"]), float(path["cost"]))
        for batch in Run(scenario).events()
        if Kind.PATH in batch.counts
        for path in batch[Kind.PATH]
    ]
    return [min((cost for i, cost in paths if i <= n), default=math.inf) for n in iterations]


def main() -> None:
    """Measure every case and print a table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--step", type=float)
    parser.add_argument("--most", type=int, default=64_000, help="iterations of the longest runs")
    options = parser.parse_args()
    marks = tuple(n for n in ITERATIONS if n <= options.most)
    heads = "".join(f"{n:>16,}" for n in marks)
    print(f"{'median excess, %':18}{'optimum':>9}  {'iterations':22}{heads}")
    with tempfile.TemporaryDirectory() as name:
        for case in cases():
            world = case.save(Path(name))
            for title, (planner, params) in PLANNERS.items():
                given = {**params, "step": options.step}
                seeds = range(options.seeds)
                runs = np.array([costs(world, planner, given, s, marks) for s in seeds])
                excess = 100 * (np.median(runs, axis=0) / case.optimum - 1)
                solved = np.isfinite(runs).sum(axis=0)
                cells = [
                    f"{e:.2f}" + ("" if n == options.seeds else f" ({n}/{options.seeds})")
                    for e, n in zip(excess, solved, strict=True)
                ]
                row = "".join(f"{cell:>16}" for cell in cells)
                print(f"{case.name:18}{case.optimum:9.3f}  {title:22}{row}", flush=True)


if __name__ == "__main__":
    main()
