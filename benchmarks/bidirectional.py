"""One tree against two: how much sooner there is a path, and what it is worth.

    python benchmarks/bidirectional.py [--seeds 30]

Medians over the seeds, each a world of its own: iterations and milliseconds to the path, its
cost before and after smoothing as a multiple of rrt's raw cost, and its movements.
"""

import argparse
from statistics import median

from brrt import Run, Scenario

WORLDS = (
    "circles2d:n=50,seed={}",
    "squares2d:n=500,size=1000,min_side=18,max_side=48,seed={}",
    "spheres3d:n=40,seed={}",
    "boxes3d:n=200,size=100,min_side=3,max_side=6,seed={}",
)
PLANNERS = ("rrt", "bi-rrt", "rrt-connect")


def main() -> None:
    """Measure every world and print a table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seeds", type=int, default=30)
    seeds = range(parser.parse_args().seeds)
    heads = "".join(f"{head:>12}" for head in ("iterations", "ms", "raw", "smoothed", "moves"))
    print(f"{'median':14}{'planner':12}{heads}{'-> smoothed':>13}")
    for world in WORLDS:
        unit = 0.0
        for planner in PLANNERS:
            runs = [
                Run(Scenario(world=world.format(seed), planner=planner, seed=seed))
                for seed in seeds
            ]
            solved = [f for f in (run.execute().as_dict() for run in runs) if f["solved"]]
            raw = median(f["path_cost"] for f in solved)
            unit = unit or raw
            cells = [
                f"{median(f['iterations'] for f in solved):.0f}",
                f"{1e3 * median(f['plan_time_s'] for f in solved):.3f}",
                f"{raw / unit:.2f}",
                f"{median(f['smoothed_cost'] for f in solved) / unit:.2f}",
                f"{median(len(f['path']) - 1 for f in solved):.0f}",
            ]
            row = "".join(f"{cell:>12}" for cell in cells)
            moves = median(f["moves"] for f in solved)
            of = "" if len(solved) == len(seeds) else f"  ({len(solved)} of {len(seeds)} solved)"
            print(f"{world.split(':')[0]:14}{planner:12}{row}{moves:13.0f}{of}", flush=True)


if __name__ == "__main__":
    main()
