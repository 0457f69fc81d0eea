"""Doctor sound recordings, one event at a time, and see which share of the lies is found.

    python benchmarks/doctor.py [--runs 70] [--each 3] [--seed 0] [--planner NAME] [--show EVENT.WAY]

Runs are drawn as benchmarks/soak.py draws them, those that say between 60 and 2,500 events. In each
a random event of each kind is doctored in each way: a number off by a thousandth, another node,
tree, source, reason, stage or status, the iteration before or after; or the event is dropped, told
twice, or told after the next one, the others closing up, so that numbers and times are as they
should be. It prints a table: for each kind and way, how many of the doctored logs `verify` finds
fault with. Not all are lies: a planner may have drawn another sample that leads to the same edge.

`--show edge.parent` prints those of a cell of the table that nobody found, with the run's command.
"""

import argparse
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from brrt import Events, Kind, Memory, Run, Scenario
from brrt.events import FIELDS, Field
from brrt.replay.checks import examine
from tests.scenarios import PLANNERS, command, draw

LEAST, MOST = 60, 2500
"""Events of runs that are doctored."""

OFF = 1e-3
"""Part by which a number is off."""

Doctor = Callable[[Events, Kind, int, np.random.Generator], Events | None]
"""Changes the event of this kind and row; None where there is nothing to change."""


def field_doctor(field: Field) -> Doctor:
    """Change a field of an event to something else that it may say."""

    def doctor(log: Events, kind: Kind, row: int, rng: np.random.Generator) -> Events | None:
        table = log[kind].copy()
        old = table[field.name][row]
        new = other_value(log, field, kind, old, rng)
        if new is None:
            return None
        table[field.name][row] = new
        return Events(log.dof, {**log.tables, kind: table})

    return doctor


def other_value(log: Events, field: Field, kind: Kind, old: Any, rng: np.random.Generator) -> Any:
    """Return what a field might say as well, or None."""
    if field.choices is not None:
        return rng.choice([int(choice) for choice in field.choices if choice != old])
    if field.type == "bool":
        return not old
    if field.name == "tree":
        return 1 - old if Kind.CONNECT in log.tables or kind is Kind.SAMPLE else None
    if field.type == "float64":
        return old * (1 + rng.choice([-OFF, OFF])) if old else OFF
    if field.type.startswith("q"):
        q = np.array(old, np.float64)
        if not q.size:
            return None
        at = tuple(rng.integers(0, n) for n in q.shape)
        q[at] += rng.choice([-OFF, OFF]) * max(abs(q[at]), 1.0)
        return q
    known = np.setdiff1d(log[kind][field.name], [old])
    return rng.choice(known) if len(known) else None


def other_iteration(
    log: Events, kind: Kind, row: int, rng: np.random.Generator
) -> Events | None:
    """Say that an event belongs to the iteration before or after."""
    table = log[kind].copy()
    table["iteration"][row] = max(0, table["iteration"][row] + rng.choice([-1, 1]))
    if table["iteration"][row] == log[kind]["iteration"][row]:
        return None
    return Events(log.dof, {**log.tables, kind: table})


def dropped(log: Events, kind: Kind, row: int, rng: np.random.Generator) -> Events:  # noqa: ARG001
    """Leave an event out; the others close up."""
    gone = log[kind]["seq"][row]
    tables = {k: t[t["seq"] != gone].copy() for k, t in log.tables.items()}
    for table in tables.values():
        table["seq"][table["seq"] > gone] -= 1
    return Events(log.dof, {k: t for k, t in tables.items() if len(t)})


def doubled(log: Events, kind: Kind, row: int, rng: np.random.Generator) -> Events:  # noqa: ARG001
    """Tell of an event twice, one right after the other; what follows is a nanosecond later."""
    seq = log[kind]["seq"][row]
    tables = {k: t.copy() for k, t in log.tables.items()}
    for table in tables.values():
        later = table["seq"] > seq
        table["seq"][later] += 1
        table["t"][later] += 1
    again = tables[kind][row : row + 1].copy()
    again["seq"] += 1
    again["t"] += 1
    tables[kind] = np.insert(tables[kind], row + 1, again)
    return Events(log.dof, tables)


def swapped(
    log: Events, kind: Kind, row: int, rng: np.random.Generator  # noqa: ARG001
) -> Events | None:
    """Tell of an event after the next one; each keeps its iteration, times and numbers rise."""
    first = log[kind]["seq"][row]
    tables = {k: t.copy() for k, t in log.tables.items()}
    pair = [
        (k, int(at[0]))
        for seq in (first, first + 1)
        for k, t in tables.items()
        if len(at := np.flatnonzero(t["seq"] == seq))
    ]
    if len(pair) < 2:
        return None
    (a, i), (b, j) = pair
    for name in ("seq", "t"):
        one, two = int(tables[a][name][i]), int(tables[b][name][j])
        tables[a][name][i], tables[b][name][j] = two, one
    if a == b:
        tables[a] = tables[a][np.argsort(tables[a]["seq"])]
    return Events(log.dof, tables)


WAYS: dict[str, Doctor] = {
    "dropped": dropped, "doubled": doubled, "swapped": swapped, "iteration": other_iteration,
}  # fmt: skip


def doctors(log: Events) -> Iterator[tuple[Kind, str, Doctor]]:
    """Yield the ways in which a log can be doctored."""
    for kind in log.tables:
        for field in FIELDS[kind]:
            yield kind, field.name, field_doctor(field)
        for name, doctor in WAYS.items():
            yield kind, name, doctor


def found(run: Run, log: Events) -> bool:
    """Whether any rule finds fault with a log."""
    return any(tally.broken for tally in examine(run.manifest, run.problem.world, log))


def runs(seed: int, count: int, planners: list[str], folder: Path) -> Iterator[tuple[Run, Events]]:
    """Yield runs that are neither short nor long, as many of each planner."""
    for n in range(count):
        while True:
            scenario = draw(seed, folder, planners[n % len(planners)])
            seed += 1
            memory, run = Memory(), Run(replace(scenario, clock="logical"))
            run.execute([memory])
            log = memory.events()
            if LEAST <= len(log) <= MOST:
                yield run, log
                break


def show(scenario: Scenario, kind: Kind, row: int, before: Events, after: Events) -> None:
    """Print a log that nobody found fault with."""
    print(f"{command(scenario)}\n  {kind.label} {row}: {before[kind][row]}")
    if len(before[kind]) == len(after[kind]):
        print(f"  {' ' * len(kind.label)} now: {after[kind][row]}")


def main() -> int:
    """Doctor them all; print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--runs", type=int, default=70)
    parser.add_argument("--each", type=int, default=3, help="events of each kind, for each way")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--planner", choices=PLANNERS, action="append")
    parser.add_argument("--show", help="kind and way, as in edge.parent")
    parser.add_argument("--folder", type=Path, default=Path("doctor"))
    args = parser.parse_args()
    args.folder.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng(args.seed)
    counts: dict[tuple[Kind, str], Counter[str]] = {}
    for run, log in runs(args.seed, args.runs, args.planner or list(PLANNERS), args.folder):
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
