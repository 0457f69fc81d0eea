"""Whether the advice of `brrt explain` helps: cases, each over several seeds.

python benchmarks/advice.py            every case
python benchmarks/advice.py bugtrap    those with this in their name

For each case: how often it is solved, and its median work; then the same after following each
piece of advice, on the seeds that got it. Work is extensions and expansions, without smoothing.
"""

import sys
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from statistics import median
from typing import Any

import numpy as np

from brrt import BranchedRun, Recording, Run, Scenario, World
from brrt.explanation import Advice, explain

SEEDS = 10


def walled_off() -> World:
    """A goal within four walls without a gap."""
    boxes = [[60, 60, 95, 62], [60, 93, 95, 95], [60, 60, 62, 95], [93, 60, 95, 95]]
    start, goal = np.array([5.0, 5.0]), np.array([80.0, 80.0])
    sides = np.zeros(2), np.full(2, 100.0)
    return World("walled", *sides, boxes=np.array(boxes, float), start=start, goal=goal)


CASES: dict[str, tuple[dict[str, Any], World | None]] = {
    "narrow gap": ({"world": "gap2d:gap=1", "iterations": 3000}, None),
    "long passage": ({"world": "passage2d:gap=2", "iterations": 3000}, None),
    "long passage, long step": (
        {"world": "passage2d:gap=2", "iterations": 5000, "params": {"step": 20}}, None,
    ),
    "bug trap": ({"world": "bugtrap2d", "iterations": 2000}, None),
    "bug trap 3D": ({"world": "bugtrap3d", "iterations": 3000}, None),
    "walled-off goal": ({"iterations": 2000}, walled_off()),
    "tiny step": ({"world": "circles2d", "iterations": 2000, "params": {"step": 0.2}}, None),
    "small budget": ({"world": "maze2d", "iterations": 500}, None),
    "few iterations": ({"world": "squares2d:n=120,seed=4", "iterations": 300}, None),
    "few iterations, connect": ({"world": "squares2d:n=120,seed=4", "iterations": 100,
                                 "planner": "rrt-connect"}, None),
    "few iterations, arm": (
        {"world": "circles2d:n=14,size=20,min_radius=0.5,max_radius=1,seed=3", "robot": "chain",
         "start": (1.2, 0.5, -0.5), "goal": (-1.2, -0.5, 0.5), "planner": "rrt-connect",
         "iterations": 50}, None,
    ),
    "body too wide": ({"world": "passage2d:gap=6", "robot": "polygon:length=8,width=7",
                       "planner": "rrt-connect", "iterations": 2000}, None),
    "body too wide, room": ({"world": "polygons2d:n=25", "iterations": 5000,
                             "robot": "polygon:length=8,width=7"}, None),
    "body that fits": ({"world": "passage2d:gap=9", "robot": "polygon:length=8,width=7",
                        "iterations": 3000}, None),
    "unseen gap 3D": ({"world": "gap3d:gap=1", "iterations": 20_000}, None),
    "no goal bias": ({"world": "empty2d", "params": {"goal_bias": 0, "step": 2},
                      "iterations": 1000}, None),
    "greedy bias": ({"world": "enclosure2d", "params": {"goal_bias": 0.9},
                     "iterations": 2000}, None),
    "late passage": ({"world": "gap2d:gap=1", "iterations": 30_000}, None),
    "late bug trap": ({"world": "bugtrap2d", "iterations": 30_000}, None),
    "slow tree": ({"world": "maze2d", "iterations": 20_000}, None),
    "star, too long": ({"world": "circles2d:n=20", "planner": "rrt-star",
                        "iterations": 20_000}, None),
    "star, short": ({"world": "circles2d:n=60", "planner": "rrt-star", "iterations": 1500}, None),
    "star, gap": ({"world": "gap2d:gap=1", "planner": "rrt-star", "iterations": 3000}, None),
    "lrta, bug trap": ({"world": "bugtrap2d", "planner": "lrta-star",
                        "params": {"cell": 2}}, None),
    "lrta, few iterations": ({"world": "bugtrap2d", "planner": "lrta-star",
                              "iterations": 500}, None),
    "a-star, few iterations": ({"world": "maze2d", "planner": "a-star", "iterations": 300}, None),
    "a-star, coarse cells": ({"world": "passage2d:gap=2", "planner": "a-star",
                              "params": {"cell": 7.5}}, None),
}  # fmt: skip


def follow(advice: Advice, recording: Recording, world: World | None) -> dict[str, Any]:
    """Follow advice for a recording; return the metrics, the recorded part of a branch included."""
    if advice.branch is not None:
        return BranchedRun(recording, **advice.branch).execute().as_dict()
    assert advice.scenario is not None  # noqa: S101 - commands that plan nothing are not followed
    return Run(advice.scenario, world=world).execute().as_dict()


def work(metrics: Mapping[str, Any]) -> int:
    """Return the number of extensions and expansions."""
    return int(metrics["nodes"] + metrics["rejects"] + metrics["expanded"])


def summary(name: str, runs: Sequence[Mapping[str, Any]]) -> str:
    """Sum up the metrics of runs in a line."""
    solved = [metrics for metrics in runs if metrics["solved"]]
    costs = f"  cost {median(m['path_cost'] for m in solved):8.5g}" if solved else ""
    effort = median(work(metrics) for metrics in runs)
    return f"{name:34} {len(solved):3} of {len(runs):2} solved  work {effort:9,.0f}{costs}"


def lines(case: str) -> Iterator[str]:
    """Run a case with each seed, follow all advice, and sum up."""
    values, world = CASES[case]
    before, after = [], defaultdict(list)
    for seed in range(SEEDS):
        scenario = Scenario(seed=seed, **values)
        recording = Run(scenario, world=world).record()
        metrics = recording.result or {}
        before.append(metrics)
        for advice in explain(recording).advice:
            after[_changes(scenario, advice)].append((metrics, recording, advice))
    yield summary(case, before)
    for changes, given in after.items():
        if given[0][2].suffix != ".mcap":
            yield f"   {changes}: {len(given)} times"
            continue
        yield summary("   where advised: " + changes[:18], [metrics for metrics, _, _ in given])
        done = [follow(advice, recording, world) for _, recording, advice in given]
        yield summary("   " + changes, done)


def _changes(scenario: Scenario, advice: Advice) -> str:
    """Name what advice changes."""
    if advice.branch is not None:
        return ", ".join([*advice.branch["settings"], *advice.branch["params"]]) + " (continued)"
    if advice.scenario is None:
        return " ".join(advice.words[:3])
    old, new = scenario.as_dict(), advice.scenario.as_dict()
    names = [name for name in new if name != "params" and new[name] != old[name]]
    names += [name for name in new["params"] if new["params"][name] != old["params"].get(name)]
    return ", ".join(str(new["planner"]) if name == "planner" else name for name in names)


if __name__ == "__main__":
    for name in CASES:
        if all(part in name for part in sys.argv[1:]):
            print("\n".join(lines(name)), flush=True)
