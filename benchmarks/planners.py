"""Time to the first solution, ours with recording on against OMPL's C++, side by side in one run.

    python benchmarks/planners.py [--seeds 30] [--maps FOLDER]

Needs g++ and OMPL's headers (Debian: libompl-dev): the peer is ompl_peer.cpp beside this file.
FOLDER holds maze.txt and monza.txt in the boundary/block format; without it they are left out.
Both planners get the same world, step, goal bias and exact motion check; the figure is the time
from the start of planning to the path. Ours is taken from the recording's own clock while every
event goes to an MCAP file; compiled kernels are loaded before, as the peer is compiled before.
"""

import argparse
import json
import shutil
import statistics
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from brrt import McapSink, Run, Scenario, World
from brrt.recording.background import Background

PEER = Path(__file__).with_name("ompl_peer.cpp")


@dataclass(frozen=True)
class Case:
    """A query, and the ratio to OMPL's time that it is held to."""

    name: str
    world: str
    step: float
    bar: float
    start: tuple[float, ...] | None = None
    goal: tuple[float, ...] | None = None


GENERATED = [
    Case("2D, 500 squares", "squares2d:n=500,size=1000,min_side=18,max_side=48", 50.0, 0.5),
    Case("3D, 200 boxes", "boxes3d:n=200,size=100,min_side=3,max_side=6", 5.0, 1.0),
]


def maps(folder: Path | None) -> list[Case]:
    """The two large maps, where they are at hand."""
    if folder is None:
        return []
    maze, monza = (str(folder / f"{name}.txt") for name in ("maze", "monza"))
    return [
        Case("maze", maze, 1.0, 0.5, (0.0, 0.0, 1.0), (12.0, 12.0, 5.0)),
        Case("monza", monza, 1.0, 0.5, (0.5, 1.0, 4.9), (3.8, 1.0, 0.1)),
    ]


def build(folder: Path) -> Path:
    """Compile the peer."""
    compiler, program = shutil.which("g++"), folder / "ompl_peer"
    if compiler is None:
        sys.exit("benchmarks: there is no g++; the peer is C++")
    flags = subprocess.run(
        ["pkg-config", "--cflags-only-I", "ompl", "eigen3"],  # noqa: S607
        capture_output=True, text=True, check=True,
    ).stdout.split()  # fmt: skip
    command = [compiler, "-O3", "-march=native", "-std=c++17", str(PEER), "-o", str(program)]
    subprocess.run([*command, *flags, "-lompl"], check=True)
    return program


def export(path: Path, world: World, start: np.ndarray, goal: np.ndarray) -> None:
    """Write a world and its query as the peer reads them."""

    def line(word: str, *parts: np.ndarray) -> str:
        return " ".join([word, *(repr(float(x)) for part in parts for x in part)])

    lines = [f"dim {world.dim}", line("bounds", world.lower, world.upper)]
    lines += [line("ball", ball) for ball in world.balls]
    lines += [line("box", box) for box in world.boxes]
    lines += [line("start", start), line("goal", goal)]
    path.write_text("\n".join(lines) + "\n")


def theirs(program: Path, world: Path, case: Case, seeds: range) -> list[float]:
    """Milliseconds of each of OMPL's runs."""
    command = [str(program), str(world), "rrt", "--range", str(case.step), "--goal-bias", "0.05"]
    command += ["--seeds", str(len(seeds)), "--first-seed", str(seeds.start), "--time", "60"]
    out = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    runs = [json.loads(line) for line in out.splitlines()]
    assert all(r["solved"] and r["exact_valid"] for r in runs), case.name  # noqa: S101
    return [r["ms"] for r in runs]


def ours(case: Case, folder: Path, seeds: range) -> list[float]:
    """Milliseconds of each of our runs, everything recorded; prepared first, as the peer is."""
    prepared = []
    for seed in seeds:
        scenario = Scenario(
            world=case.world, start=case.start, goal=case.goal, seed=seed, smooth=False,
            params={"step": case.step, "goal_bias": 0.05},
        )  # fmt: skip
        run = Run(scenario)
        sink = McapSink(folder / f"{seed}.mcap", run.manifest, run.problem.world)
        prepared.append((run, Background(sink)))
    all_figures = [run.execute([sink]).as_dict() for run, sink in prepared]
    assert all(figures["solved"] for figures in all_figures), case.name  # noqa: S101
    return [float(figures["plan_time_s"]) * 1e3 for figures in all_figures]


def main() -> None:
    """Measure every case and print a table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seeds", type=int, default=30)
    parser.add_argument("--maps", type=Path)
    options = parser.parse_args()
    print(f"{'RRT, first solution, ms':26}{'OMPL':>10}{'brrt':>10}{'ratio':>8}{'bar':>6}")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        program = build(folder)
        for case in GENERATED + maps(options.maps):
            measure(case, program, folder, options.seeds)


def measure(case: Case, program: Path, folder: Path, seeds: int) -> None:
    """Run both on one world, in turns, so that a machine that slows down slows both."""
    problem = Scenario(world=case.world, start=case.start, goal=case.goal).make_problem()
    world = folder / "world.txt"
    export(world, problem.world, problem.start, problem.goal)
    peer, mine = list[float](), list[float]()
    for first in range(0, seeds, 5):
        turn = range(first, min(first + 5, seeds))
        peer += theirs(program, world, case, turn)
        mine += ours(case, folder, turn)
    a, b = statistics.median(peer), statistics.median(mine)
    print(f"{case.name:26}{a:10.3f}{b:10.3f}{b / a:8.2f}{case.bar:6.2g}", flush=True)


if __name__ == "__main__":
    main()
