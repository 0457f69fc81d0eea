"""Ours with recording on against OMPL's C++, side by side in one run.

    python benchmarks/planners.py [first] [rate] [cost] [valid] [--seeds 30] [--maps FOLDER]

first: time to the first solution of RRT, RRT-Connect and the variants of bidirectional RRT.
rate:  iterations a second of RRT* over 20,000 iterations.
cost:  cost of the best path of RRT* after 0.1, 0.3 and 1 second.
valid: paths of RRT that are free by an exact check; OMPL's with its default resolution.

Needs g++ and OMPL's headers (Debian: libompl-dev): the peer is ompl_peer.cpp beside this file.
FOLDER holds maze.txt and monza.txt in the boundary/block format; without it they are left out.
Both sides get the same world, step, goal bias and exact motion check; the figure is the time
from the start of planning to the path. Ours is taken from the recording's own clock while every
event goes to an MCAP file; compiled kernels are loaded before, as the peer is compiled before.
"""

import argparse
import json
import math
import shutil
import statistics
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from brrt import Events, Kind, McapSink, Problem, Run, Scenario, World, read, verify
from brrt.formats.background import BackgroundSink
from brrt.recording import Result

PEER = Path(__file__).with_name("ompl_peer.cpp")


@dataclass(frozen=True)
class Case:
    """A query, and the ratio to OMPL's time that RRT and RRT-Connect are held to."""

    name: str
    world: str
    step: float
    bars: tuple[float, float]
    start: tuple[float, ...] | None = None
    goal: tuple[float, ...] | None = None


GENERATED = [
    Case("2D, 500 squares", "squares2d:n=500,size=1000,min_side=18,max_side=48", 50.0, (0.5, 0.6)),
    Case("3D, 200 boxes", "boxes3d:n=200,size=100,min_side=3,max_side=6", 5.0, (1.0, 1.5)),
]

VARIANTS: dict[str, dict[str, Any]] = {
    "extend, extend": {},
    "connect, connect": {"grow": "connect", "link": "connect"},
    "smaller grows": {"link": "connect", "turn": "smaller"},
    "coin": {"link": "connect", "turn": "coin"},
    "always link": {"link": "connect", "always_link": True},
}
"""Bidirectional variants, held to twice the time of our RRT-Connect."""

TIMES_S = (0.1, 0.3, 1.0)


def maps(folder: Path | None) -> list[Case]:
    """The two large maps, where they are at hand."""
    if folder is None:
        return []
    maze, monza = (str(folder / f"{name}.txt") for name in ("maze", "monza"))
    return [
        Case("maze", maze, 1.0, (0.5, 0.6), (0.0, 0.0, 1.0), (12.0, 12.0, 5.0)),
        Case("monza", monza, 1.0, (0.5, 0.6), (0.5, 1.0, 4.9), (3.8, 1.0, 0.1)),
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


Peer = list[dict[str, Any]]


@dataclass(frozen=True)
class Bench:
    """Where everything is.

    Attributes:
        program: The peer.
        folder: For worlds and recordings.
        seeds: Runs of each planner.
    """

    program: Path
    folder: Path
    seeds: int

    def export(self, case: Case) -> Path:
        """Write a case's world for the peer."""
        problem = Problem.of(Scenario(world=case.world, start=case.start, goal=case.goal))
        path = self.folder / "world.txt"
        export(path, problem.world, problem.start, problem.goal)
        return path

    def theirs(self, case: Case, planner: str, seeds: range, *limit: str) -> Peer:
        """OMPL's runs."""
        world = str(self.folder / "world.txt")
        command = [str(self.program), world, planner, "--range", str(case.step)]
        command += ["--goal-bias", "0.05", *(limit or ("--time", "60"))]
        command += ["--seeds", str(len(seeds)), "--first-seed", str(seeds.start)]
        out = subprocess.run(command, capture_output=True, text=True, check=True).stdout
        runs = [json.loads(line) for line in out.splitlines()]
        loose = "--check" in limit
        assert loose or all(r["exact_valid"] or not r["solved"] for r in runs)  # noqa: S101
        assert limit or all(r["solved"] for r in runs), case.name  # noqa: S101
        return runs

    def ours(
        self, case: Case, seed: int, planner: str, **settings: Any
    ) -> tuple[dict[str, Any], "Paths"]:
        """One of our runs, recorded to a file, and its paths once more for us."""
        settings["params"] = {"step": case.step, **settings.get("params", {})}
        scenario = Scenario(
            world=case.world, start=case.start, goal=case.goal, seed=seed, smooth=False,
            planner=planner, **settings,
        )  # fmt: skip
        run, kept = Run(scenario), Paths()
        file = McapSink(self.folder / "run.mcap", run.manifest, run.problem.world)
        figures = run.execute([BackgroundSink(file), kept]).as_dict()
        return figures, kept

    def solve_ms(self, case: Case, seed: int, planner: str, **settings: Any) -> float:
        """Milliseconds that one of our runs takes to its path."""
        figures, _ = self.ours(case, seed, planner, **settings)
        assert figures["solved"], (case.name, planner, seed)  # noqa: S101
        return float(figures["plan_time_s"]) * 1e3

    def first(self, case: Case, planner: str) -> tuple[float, float]:
        """Medians of both in ms, run in turns, so that a machine that slows down slows both."""
        theirs, ours = list[float](), list[float]()
        for begin in range(0, self.seeds, 5):
            turn = range(begin, min(begin + 5, self.seeds))
            theirs += [run["ms"] for run in self.theirs(case, planner, turn)]
            ours += [self.solve_ms(case, seed, planner) for seed in turn]
        return statistics.median(theirs), statistics.median(ours)


class Paths:
    """A sink that keeps when each path was found, in s since planning began, and what it costs."""

    def __init__(self) -> None:
        self.found: list[tuple[float, float]] = []
        self._began = 0

    def write(self, events: Events) -> None:
        """Take a batch."""
        if self._began == 0 and Kind.PHASE in events.counts:
            self._began = int(events[Kind.PHASE]["t"][0])
        if Kind.PATH in events.counts:
            table = events[Kind.PATH]
            times = ((table["t"] - self._began) / 1e9).tolist()
            self.found += zip(times, table["cost"].tolist(), strict=True)

    def close(self, result: Result | None) -> None:
        """Nothing to release."""

    def cost_at(self, seconds: float) -> float:
        """Cost of the best path by then."""
        return min((cost for t, cost in self.found if t <= seconds), default=math.inf)


def first(bench: Bench, cases: list[Case]) -> None:
    """Time to the first solution."""
    print(f"{'first solution, ms':44}{'OMPL':>10}{'brrt':>10}{'ratio':>8}{'bar':>6}")
    for case in cases:
        bench.export(case)
        ours = math.nan
        for planner, bar in zip(("rrt", "rrt-connect"), case.bars, strict=True):
            theirs, ours = bench.first(case, planner)
            row(f"{case.name}: {planner}", theirs, ours, bar)
        for name, params in VARIANTS.items():
            times = [bench.solve_ms(case, s, "bi-rrt", params=params) for s in range(bench.seeds)]
            row(f"{case.name}: bi-rrt, {name} *", ours, statistics.median(times), 2)
    print("* against our rrt-connect")


def row(name: str, theirs: float, ours: float, bar: float) -> None:
    """Print one comparison."""
    print(f"{name:44}{theirs:10.3f}{ours:10.3f}{ours / theirs:8.2f}{bar:6.2g}", flush=True)


def rate(bench: Bench, cases: list[Case]) -> None:
    """Iterations of RRT* a second."""
    print(f"{'RRT*, 20,000 iterations, 1/s':44}{'OMPL':>10}{'brrt':>10}{'ratio':>8}{'bar':>6}")
    for case in cases:
        bench.export(case)
        runs = bench.theirs(case, "rrt-star", range(1), "--iterations", "20000")
        theirs = 20_000e3 / runs[0]["ms"]
        for params in ({}, {"informed": True}):
            times = [
                bench.ours(case, s, "rrt-star", iterations=20_000, params=params)[0]["plan_time_s"]
                for s in range(min(bench.seeds, 10))
            ]
            ours = 20_000 / statistics.median(times)
            name = f"{case.name}: rrt-star{', informed' if params else ''}"
            print(f"{name:44}{theirs:10.0f}{ours:10.0f}{ours / theirs:8.1f}    10", flush=True)


def cost(bench: Bench, cases: list[Case]) -> None:
    """Cost of RRT*'s best path after so many seconds."""
    heads = "".join(f"{f'{t:g} s':>10}" for t in TIMES_S)
    print(f"{'median cost of the best path after':44}{heads}")
    seeds = range(min(bench.seeds, 15))
    limit = ("--time", str(TIMES_S[-1]))
    for case in cases:
        bench.export(case)
        for planner in ("rrt-star", "informed-rrt-star"):
            runs = bench.theirs(case, planner, seeds, *limit)
            costs = [
                [
                    min((c for ms, c in r["progress"] if ms <= t * 1e3), default=math.inf)
                    for r in runs
                ]
                for t in TIMES_S
            ]
            cost_row(f"{case.name}: OMPL {planner}", costs)
        for name, params in (
            ("rrt-star", {}), ("rrt-star", {"informed": True}),
            ("bi-rrt-star", {}), ("bi-rrt-star", {"informed": True}),
        ):  # fmt: skip
            found = [bench.ours(case, s, name, time=TIMES_S[-1], params=params)[1] for s in seeds]
            costs = [[paths.cost_at(t) for paths in found] for t in TIMES_S]
            cost_row(f"{case.name}: brrt {name}{', informed' if params else ''}", costs)


def cost_row(name: str, costs: list[list[float]]) -> None:
    """Print medians."""
    print(f"{name:44}" + "".join(f"{statistics.median(c):10.2f}" for c in costs), flush=True)


def valid(bench: Bench, cases: list[Case]) -> None:
    """Paths of RRT that are free."""
    print(f"{'free paths of RRT':44}{'OMPL':>10}{'brrt':>10}")
    for case in cases:
        bench.export(case)
        seeds = range(bench.seeds)
        runs = bench.theirs(case, "rrt", seeds, "--time", "60", "--check", "resolution")
        theirs = sum(run["exact_valid"] for run in runs)
        ours = 0
        for seed in seeds:
            bench.ours(case, seed, "rrt")
            recording = read(bench.folder / "run.mcap")
            ours += verify(recording).holds
        print(f"{case.name:44}{theirs:7}/{len(seeds)}{ours:7}/{len(seeds)}", flush=True)


PARTS = {"first": first, "rate": rate, "cost": cost, "valid": valid}


def main() -> None:
    """Measure every case and print a table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("parts", nargs="*", help="all by default")
    parser.add_argument("--seeds", type=int, default=30)
    parser.add_argument("--maps", type=Path)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        bench = Bench(build(Path(name)), Path(name), options.seeds)
        for part in options.parts or PARTS:
            cases = GENERATED if part == "cost" else GENERATED + maps(options.maps)
            PARTS[part](bench, cases)


if __name__ == "__main__":
    main()
