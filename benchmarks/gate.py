"""Measure the gate's rate of false alarms, and its power, by resampling runs of planners.

    python benchmarks/gate.py [--gates 4000] [--pool 40] [--seeds 20] [--case maze]

Each case runs a planner with many seeds, in one world or in many. Each gate draws 20 old and 20 new
runs from these, both runs of a pair from the same world, and judges cost (2 % allowed) and
iterations (10 % allowed) at alpha = 0.01. The rate of false alarms is measured for unchanged runs,
and for runs whose costs and iterations are higher by exactly the margins, where it is largest. The
power is measured for runs that are worse by more, in one metric or by lost paths.
"""

import argparse
import sys
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np

from brrt import BrrtError, Scenario
from brrt.testing.gate import judge
from brrt.testing.seed_metrics import SeedMetrics

ALPHA = 0.01
MARGINS = {"cost": 0.02, "iterations": 0.10}
WORSE = (1.05, 1.1, 1.15, 1.2, 1.3, 1.5, 2.0, 3.0)
LOST = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6)

Runs = list[list[Mapping[str, Any]]]
"""For each world, the metrics of many seeds."""

CASES: dict[str, tuple[Scenario, int]] = {
    "rrt, one world": (Scenario(world="circles2d:n=60,seed={w}"), 1),
    "rrt, a world a seed": (Scenario(world="circles2d:n=60,seed={w}"), 40),
    "rrt-connect, a maze a seed": (
        Scenario(world="maze2d:seed={w}", planner="rrt-connect"), 40,
    ),
    "rrt-star, one world": (
        Scenario(world="squares2d:n=40,seed={w}", planner="rrt-star", iterations=1500), 1,
    ),
    "rrt, sometimes no path": (Scenario(world="circles2d:n=60,seed={w}", iterations=1000), 1),
}  # fmt: skip


def pool(scenario: Scenario, worlds: int, size: int) -> Runs:
    """Run every world with many seeds."""
    size = size if worlds > 1 else 10 * size
    runs = []
    for number in range(1, worlds + 1):
        here = replace(scenario, world=scenario.world.format(w=number))
        runs.append(list(SeedMetrics.of(here, size).runs.values()))
    return runs


def share(
    runs: Runs,
    gates: int,
    seeds: int,
    change: Callable[[Mapping[str, Any], np.random.Generator], Any],
) -> float:
    """Return the share of gates that fail if the new runs are changed."""
    rng, failed = np.random.default_rng(1), 0
    for _ in range(gates):
        pairs = {}
        for seed in range(seeds):
            here = runs[rng.integers(len(runs))]
            a, b = rng.choice(len(here), 2, replace=False)
            pairs[seed] = here[a], change(here[b], rng)
        old, new = (
            SeedMetrics({seed: pair[side] for seed, pair in pairs.items()}, None, {})
            for side in (0, 1)
        )
        with suppress(BrrtError):  # too few old runs found a path to judge
            failed += not judge(new, old, alpha=ALPHA, name="gate", margins=MARGINS).passed
    return failed / gates


def scaled(**factors: float) -> Callable[..., Any]:
    """Return a change that multiplies metrics."""
    return lambda run, _: {name: value * factors.get(name, 1) for name, value in run.items()}


def losing(chance: float) -> Callable[..., Any]:
    """Return a change that loses paths with some probability."""
    return lambda run, rng: {**run, "solved": run["solved"] and rng.random() >= chance}


def main() -> int:
    """Measure; exit with 1 if false alarms are more frequent than stated."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--gates", type=int, default=4000)
    parser.add_argument(
        "--pool",
        type=int,
        default=40,
        help="runs for each world, tenfold for a single world",
    )
    parser.add_argument("--seeds", type=int, default=20, help="seeds of a gate")
    parser.add_argument("--case", default="", help="only cases whose name contains this")
    options = parser.parse_args()
    edge = scaled(**{name: 1 + margin for name, margin in MARGINS.items()})
    # Four standard deviations above a rate of alpha.
    most = ALPHA + 4 * np.sqrt(ALPHA * (1 - ALPHA) / options.gates)
    worst = 0.0
    for name, (scenario, worlds) in CASES.items():
        if options.case not in name:
            continue
        runs = pool(scenario, worlds, options.pool)
        solved = np.mean([run["solved"] for world in runs for run in world])
        found = [np.array([run["cost"] for run in w if run["solved"]]) for w in runs]
        spread = np.mean([each.std() / each.mean() for each in found if len(each) > 1])
        print(f"{name}: {solved:.0%} solved, costs of a world spread by {spread:.0%}")
        alarms = [share(runs, options.gates, options.seeds, each) for each in (scaled(), edge)]
        worst = max(worst, *alarms)
        print(f"  false alarms: {alarms[0]:.2%} unchanged, {alarms[1]:.2%} at the margins")
        few = max(1, options.gates // 8)
        for figure in MARGINS:
            powers = [
                f"{share(runs, few, options.seeds, scaled(**{figure: w})):.0%}" for w in WORSE
            ]
            rates = "  ".join(f"+{w - 1:.0%} {p}" for w, p in zip(WORSE, powers, strict=True))
            print(f"  {figure} found: {rates}")
        powers = [
            f"-{chance:.0%} {share(runs, few, options.seeds, losing(chance)):.0%}"
            for chance in LOST
        ]
        print("  lost paths found:", "  ".join(powers), flush=True)
    print(f"most false alarms: {worst:.2%}; stated: {ALPHA:.2%}, limit with chance: {most:.2%}")
    return int(worst > most)


if __name__ == "__main__":
    sys.exit(main())
