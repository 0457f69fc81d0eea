"""Whether recordings of OMPL's planners in Python are what the planners did.

    python benchmarks/ompl_fidelity.py [--runs 112] [--seconds 0.3]

Runs all planners in four worlds. For each planner: runs, those that were solved, those whose
rebuilt graph equals OMPL's PlannerData, findings of `verify` (the validity checker keeps a margin,
so each would be false), and recordings that replay to their own figures, equal themselves and are
explained. The last columns compare a run read at growing intervals with the same one read in each
iteration: edges and rewires that are kept, and those of them in the same iteration.
"""

import argparse
import os
import sys
import tempfile
from collections import Counter
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))

import brrt
from tests.support.ompl_problems import (
    PLANNERS,
    iterations,
    planner_graph,
    point_setup,
    recorded_graph,
)

WORLDS = ("circles2d:n=30,seed=4", "rooms2d", "spheres3d:n=20,seed=2", "forest2d:seed=3")

_GRAPHS = ("PRM", "PRMstar")
"""Planners that a condition in Python blocks."""

_ITERATIONS = 800
"""Of the runs that are compared."""


def request(planner: str, seconds: float) -> Any:
    """Return how long to plan: half of the planners stop at a path, and others would not."""
    return seconds if planner in _GRAPHS else iterations(int(10_000 * seconds))


def run(planner: str, world: brrt.World, seed: int, seconds: float, path: Path) -> Counter[str]:
    """Record a run; return what is true of it."""
    setup = point_setup(planner, world, seed=seed, step=0.08 * world.extent)
    found = Counter(runs=1)
    try:
        with brrt.ompl.record(setup, path, world=world, seed=seed):
            setup.solve(request(planner, seconds))
    except brrt.BrrtError as error:
        print(f"  {planner} in {world.name}, seed {seed}: {error}", file=sys.stderr)
        found["unrecorded"] = 1
        return found
    recording = brrt.read(path)
    found["solved"] = int(setup.getProblemDefinition().hasExactSolution())
    found["equal"] = int(recorded_graph(recording) == planner_graph(setup, world.dim))
    verification = brrt.verify(recording)
    found["findings"] = sum(result.broken for result in verification.results)
    same = brrt.compare(recording, recording).equal
    metrics = brrt.metrics(recording).as_dict()
    read = same and metrics == recording.result
    found["read"] = int(read and bool(str(brrt.explain(recording)) and brrt.transcript(recording)))
    found["events"] = len(recording.events())
    return found


def kept(planner: str, world: brrt.World, folder: Path) -> tuple[float, float] | None:
    """Return the shares of edges and rewires that are kept, and in the same iteration."""
    if planner in (*_GRAPHS, "AORRTC"):
        return None
    logs = []
    for exact in (True, False):
        setup = point_setup(planner, world, seed=5, step=0.08 * world.extent)
        path = folder / f"{exact}.mcap"
        with brrt.ompl.record(setup, path, world=world, exact=exact):
            setup.solve(iterations(_ITERATIONS))
        logs.append(motions(brrt.read(path)))
    every, seen = logs
    pairs, at = (Counter(tuple(motion[k:]) for motion in every) for k in (1, 0))
    same = sum((pairs & Counter(motion[1:] for motion in seen)).values())
    same_iteration = sum((at & Counter(seen)).values())
    return same / len(every), same_iteration / len(every)


def motions(recording: brrt.Recording) -> list[tuple[Any, ...]]:
    """Return iteration, child and parent of each edge and rewire."""
    events, found = recording.events(), []
    places = {}
    for kind in (brrt.Kind.EDGE, brrt.Kind.VERTEX):
        for event in events[kind]:
            places[int(event["tree"]), int(event["node"])] = tuple(event["q"].tolist())
    for kind in (brrt.Kind.EDGE, brrt.Kind.REWIRE):
        for event in events[kind]:
            ends = (int(event["node"]), int(event["parent"]))
            if ends[1] >= 0:
                child, parent = (places[int(event["tree"]), node] for node in ends)
                found.append((int(event["iteration"]), child, parent))
    return found


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=112)
    parser.add_argument("--seconds", type=float, default=0.3)
    given = parser.parse_args()
    worlds = [brrt.make_world(name) for name in WORLDS]
    seeds = max(1, round(given.runs / len(PLANNERS) / len(worlds)))
    print(f"{'':16} runs solved equal findings  read  events   kept  same iteration")
    whole: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run.mcap"
        for planner in PLANNERS:
            found: Counter[str] = Counter()
            for world in worlds:
                for seed in range(1, seeds + 1):
                    found += run(planner, world, seed, given.seconds, path)
            shares = kept(planner, worlds[0], Path(folder))
            texts = ["", ""] if shares is None else [f"{share:.1%}" for share in shares]
            print(row(planner, found) + f"{texts[0]:>7} {texts[1]:>15}", flush=True)
            whole += found
    print(row("all", whole))
    wrong = whole["runs"] - whole["unrecorded"] - whole["equal"] + whole["findings"]
    sys.stdout.flush()
    os._exit(wrong > 0)  # OMPL's Python module else prints what it takes for leaks


def row(name: str, found: Counter[str]) -> str:
    """Return a row of the table."""
    keys = ("runs", "solved", "equal", "findings", "read", "events")
    widths = (4, 6, 5, 8, 5, 7)
    cells = [f"{found[key]:{width}}" for key, width in zip(keys, widths, strict=True)]
    return f"{name:16} " + " ".join(cells)


if __name__ == "__main__":
    main()
