"""Verify random runs of every planner, robot and world.

    python benchmarks/soak.py [--runs 3000] [--seed 0] [--folder soak]

Run n is drawn from seed + n, so any of them can be drawn again: `--seed S --runs 1`. The rules are
those of `brrt verify`. A finding is printed with the command that makes the run; the exit code is
then 1. Robots and worlds that need a file are kept in the folder.

Rules about draws falsely accuse at most one recording in a million, which no soak can see; so each
run is also judged by them with a rate of false alarms of one in 20, and the share of accused runs
is printed. If it is above that by more than chance, the exit code is 1.
"""

import argparse
import sys
import time
from collections import Counter
from dataclasses import replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from brrt import Recording, Run, Scenario, verify
from brrt.verification import e_process
from brrt.verification.rules import long_run
from tests.support.scenarios import LINKS, PLANNERS, ROBOTS, command, draw

LINE = "{:14} {:10} {:>7} {:>7} {:>10} {:>9}"
EVERY = 100
LOOSE = 0.05
"""A rate of false alarms that a soak can see."""


def robot_of(run: Run) -> str:
    """Name the column of a run."""
    problem = run.problem
    if problem.robot.kind == "point":
        return f"point {problem.world.dim}D"
    return f"chain {problem.dof}" if problem.robot.kind == "chain" else "polygon"


def judge(scenario: Scenario, counts: dict[tuple[str, str], Counter[str]]) -> list[str]:
    """Run a scenario and count what became of it; return what it breaks."""
    run = Run(scenario)
    recording = run.record()
    log = recording.events()
    # A cut log keeps the same promises, but for those of the end.
    part = log.until(seq=scenario.seed % len(log))
    cut = replace(recording, batches=lambda: [part], result=None)
    results = [("", verify(recording).results)]
    results += [(f"cut to {len(part)} events: ", verify(cut).results)]
    broken = [
        f"{which}{result.rule}: event {found.seq}: {found.message} ({result.broken} such)"
        for which, some in results
        for result in some
        for found in result.findings[:1]
    ]
    count = counts.setdefault((scenario.planner, robot_of(run)), Counter())
    count.update(runs=1, solved=(recording.result or {})["solved"], events=len(log))
    count.update(findings=sum(result.broken for _, some in results for result in some))
    count.update(accused=accused(recording))
    return broken


def accused(recording: Recording) -> bool:
    """Whether rules about draws are broken at a rate of false alarms of one in 20."""
    rate, e_process.FALSE_ALARM = e_process.FALSE_ALARM, LOOSE
    try:
        return not verify(recording, rules=long_run.RULES).holds
    finally:
        e_process.FALSE_ALARM = rate


def main() -> int:
    """Run them all; print a table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--runs", type=int, default=3000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--folder", type=Path, default=Path("soak"))
    args = parser.parse_args()
    args.folder.mkdir(parents=True, exist_ok=True)
    counts: dict[tuple[str, str], Counter[str]] = {}
    began, bad = time.perf_counter(), 0
    for n in range(args.runs):
        scenario = draw(args.seed + n, args.folder)
        try:
            broken = judge(scenario, counts)
        except Exception as error:  # noqa: BLE001 - a crash is a finding, too
            broken = [f"{type(error).__name__}: {error}"]
        if broken:
            bad += 1
            print(f"\n--seed {args.seed + n}: {command(scenario)}")
            print("\n".join(f"  {line}" for line in broken), flush=True)
        if n % EVERY == EVERY - 1:
            took = time.perf_counter() - began
            print(f"{n + 1:,} runs in {took:.0f} s, {bad} with findings", flush=True)
    show(counts)
    alarms = sum(count["accused"] for count in counts.values())
    most = args.runs * LOOSE + 5 * (args.runs * LOOSE * (1 - LOOSE)) ** 0.5
    print(f"draws of {alarms:,} runs are accused at one false alarm in {1 / LOOSE:.0f}")
    print(f"{args.runs:,} runs, {bad} with findings; links: {', '.join(map(str, LINKS))}")
    return int(bad > 0 or alarms > most)


def show(counts: dict[tuple[str, str], Counter[str]]) -> None:
    """Print a line for each planner with each robot."""
    print(LINE.format("planner", "robot", "runs", "solved", "events", "findings"))
    total: Counter[str] = Counter()
    for planner in PLANNERS:
        for robot in ROBOTS:
            if (planner, robot) in counts:
                count = counts[planner, robot]
                total += count
                show_line(planner, robot, count)
    show_line("all", "", total)


def show_line(planner: str, robot: str, count: Counter[str]) -> None:
    """Print a line."""
    figures = [f"{count[name]:,}" for name in ("runs", "solved", "events", "findings")]
    print(LINE.format(planner, robot, *figures))


if __name__ == "__main__":
    sys.exit(main())
