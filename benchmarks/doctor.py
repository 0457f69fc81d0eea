"""Change correct recordings, one event at a time, and count how many changes are found.

    python benchmarks/doctor.py [--runs 70] [--each 3] [--seed 0] [--robot KIND] [--show X.WAY]

Runs are drawn as by benchmarks/soak.py, those of 60 to 2,500 events. In each a random event of
each kind is doctored in each way: a number off by a thousandth, another node, tree, source,
reason, stage or status, the iteration before or after; or the event is dropped, duplicated, or
swapped with the next one, and the others are numbered anew, so that numbers and times are right.
It prints a table: for each kind and way, how many of the changed logs break a rule. Not all are
wrong: a planner may have drawn another sample that leads to the same edge.

`--show edge.parent` prints those of a cell of the table that no rule found, with the command.
"""

import argparse
import sys
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from brrt import Events, Kind, Memory, Recording, Run, Scenario, verify
from tests.support.doctoring import doctors
from tests.support.scenarios import PLANNERS, ROBOTS, SEARCHES, command, draw

LEAST, MOST = 60, 2500
"""Events of runs that are doctored."""


def found(run: Run, log: Events) -> bool:
    """Whether a log breaks any rule."""
    return not verify(Recording(run.manifest, run.problem.world, lambda: [log], {})).holds


def runs(
    seed: int, count: int, planners: list[str], robot: str | None, folder: Path
) -> Iterator[tuple[Run, Events]]:
    """Yield runs that are neither short nor long, as many of each planner."""
    for n in range(count):
        while True:
            planner = planners[n % len(planners)]
            body = robot is not None and not robot.startswith("point")
            kind = None if planner in SEARCHES and body else robot
            scenario = draw(seed, folder, planner, kind)
            seed += 1
            memory, run = Memory(), Run(replace(scenario, clock="logical"))
            run.execute([memory])
            log = memory.events()
            if LEAST <= len(log) <= MOST:
                yield run, log
                break


def show(scenario: Scenario, kind: Kind, row: int, before: Events, after: Events) -> None:
    """Print a changed log that breaks no rule."""
    print(f"{command(scenario)}\n  {kind.label} {row}: {before[kind][row]}")
    if len(before[kind]) == len(after[kind]):
        print(f"  {' ' * len(kind.label)} now: {after[kind][row]}")


def main() -> int:
    """Change all runs; print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--runs", type=int, default=70)
    parser.add_argument("--each", type=int, default=3, help="events of each kind, for each way")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--planner", choices=PLANNERS, action="append")
    parser.add_argument("--robot", choices=ROBOTS)
    parser.add_argument("--show", help="kind and way, as in edge.parent")
    parser.add_argument("--folder", type=Path, default=Path("doctor"))
    args = parser.parse_args()
    args.folder.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng(args.seed)
    counts: dict[tuple[Kind, str], Counter[str]] = {}
    planners = args.planner or list(PLANNERS)
    for run, log in runs(args.seed, args.runs, planners, args.robot, args.folder):
        for kind, way, doctor in doctors(log):
            wanted = f"{kind.label}.{way}"
            if args.show not in (None, wanted):
                continue
            for row in rng.integers(0, len(log[kind]), args.each).tolist():
                other = doctor(log, kind, row, rng)
                if other is None:
                    continue
                known = found(run, other)
                counts.setdefault((kind, way), Counter()).update(all=1, found=known)
                if args.show and not known:
                    show(run.manifest.scenario, kind, row, log, other)
    for kind in Kind:
        cells = [
            f"{way} {count['found']}/{count['all']}"
            for (of, way), count in counts.items()
            if of is kind
        ]
        if cells:
            print(f"{kind.label:10} {'  '.join(cells)}", flush=True)
    total = sum(counts.values(), Counter())
    print(f"{total['found']:,} of {total['all']:,} are found")
    return 0


if __name__ == "__main__":
    sys.exit(main())
