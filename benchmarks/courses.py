"""Compare LRTA* and RRT on seven maps of a planning course with a published run in slow Python.

    python benchmarks/courses.py MAPS [--runs 5]

MAPS is a folder with course maps in the boundary/block format and their queries.json. LRTA* plans
each move as it makes it (cells of 0.5, 6 neighbours, one cell of lookahead); RRT plans a path that
is then executed in moves of at most 1, unsmoothed as in the published run. The time is the median
planning time of the runs, for RRT with different seeds; all events are recorded in memory. Charged
moves follow the published run's rule: one move for every deadline of 2 s that planning took.
"""

import argparse
import json
from pathlib import Path
from statistics import median
from typing import Any

from brrt import Memory, Run, Scenario

PUBLISHED = {
    "tower": ((6.677, 1508, 754), (3.78, 375, 42.09)),
    "window": ((0.052, 76, 37.99), (1.16, 667, 33.14)),
    "room": ((2.375, 200, 100), (0.564, 125, 15.37)),
    "monza": ((12.89, 3794, 1897), (81.06, 647, 108.4)),
    "single_cube": ((0.015, 27, 13.755), (0.914, 171, 13.05)),
    "maze": ((80.3, 14572, 7286), (442.5, 1614, 133.6)),
    "flappy_bird": ((0.22, 245, 122.9), (1.491, 400, 38.33)),
}
"""Seconds, moves and path length, of LRTA* and of RRT."""

PLANNERS = ("lrta-star", "rrt")


def course(maps: Path, name: str, planner: str, seed: int = 0) -> Scenario:
    """Make the scenario of a map and a planner."""
    start, goal = json.loads((maps / "queries.json").read_text())["queries"][name]
    return Scenario(
        world=str(maps / f"{name}.txt"), start=tuple(start), goal=tuple(goal), planner=planner,
        seed=seed, smooth=False, execute=planner != "lrta-star",
    )  # fmt: skip


def measure(maps: Path, name: str, planner: str, runs: int) -> dict[str, Any]:
    """Run a planner several times; return the median of each metric."""
    found = []
    for seed in range(runs):
        figures = Run(course(maps, name, planner, seed)).execute([Memory()]).as_dict()
        if not figures["solved"]:
            print(f"{name}: {planner} found no path with seed {seed}")
            continue
        found.append(figures)
    names = ("plan_time_s", "moves", "path_cost", "charged_moves", "deadline_misses")
    return {key: median(each[key] for each in found) for key in names}


def main() -> None:
    """Print the table as Markdown."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("maps", type=Path, help="folder with the maps and queries.json")
    parser.add_argument("--runs", type=int, default=5)
    options = parser.parse_args()
    print(
        "| map | planner | s | moves | length | charged | published: s / moves / length | times |"
    )
    print("| --- | --- | --- | --- | --- | --- | --- | --- |")
    for name, published in PUBLISHED.items():
        for planner, (seconds, moves, length) in zip(PLANNERS, published, strict=True):
            ours = measure(options.maps, name, planner, options.runs)
            factor = seconds / ours["plan_time_s"]
            print(
                f"| {name} | {planner} | {ours['plan_time_s']:.4f} | {ours['moves']:,.0f} "
                f"| {ours['path_cost']:.2f} | {ours['charged_moves']:,.0f} "
                f"| {seconds} / {moves:,} / {length:g} | {factor:,.0f} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
