"""Plan with bugs on purpose, and count which of them `brrt verify` finds.

    python benchmarks/mutants.py [NAME ...] [--jobs 2] [--folder FOLDER] [--show]

Each mutant in `benchmarks/mutants/*.toml` replaces a text in a file of a copy of the package, which
then plans the runs that it names, with kernels as plain Python. The recordings are verified by the
package itself, without `--rerun`, and compared with those of the unchanged copy: a mutant is
effective in the runs whose log, metrics or contract differ. A mutant states

- `rules`: the rules that have to find it, each in at least one run;
- `draws`: within how many samples the first of them has to, where the rule is about frequencies;
- or `hidden`: why no rule can find it.

The exit code is 1 if a mutant is not found as stated, if it has no effect, if the text to replace
does not occur exactly once, or if a promise in docs/promises.md has no mutant. Names select the
mutants whose name or file contains one of them. `--show` prints the first finding of every rule.
"""

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import tomllib
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import brrt
from brrt import (
    Kind,
    McapSink,
    Recording,
    RecordingError,
    Run,
    Scenario,
    World,
    first_difference,
    read,
    verify,
)
from brrt.verification.rules import graph

ROOT = Path(__file__).parents[1]
TABLES = Path(__file__).parent / "mutants"
DAMAGED = "damaged"
"""In place of a rule: the file cannot be read, since no event can be so."""

LINE = "{:54} {:>9}  {:44} {:>7} {:>6}"
TIMEOUT_S = 300


@dataclass(frozen=True)
class Mutant:
    """A bug; see above."""

    name: str
    file: str
    old: str
    new: str
    runs: list[str]
    rules: tuple[str, ...] = ()
    draws: int | None = None
    hidden: str | None = None

    def apply(self, package: Path) -> None:
        """Make the replacement in a copy of the package.

        Raises:
            ValueError: The old text does not occur exactly once.
        """
        path = package / self.file
        text = path.read_text("utf-8")
        if text.count(self.old) != 1:
            raise ValueError(
                f"{self.name}: the old text occurs {text.count(self.old)} times in {self.file}"
            )
        path.write_text(text.replace(self.old, self.new), "utf-8")


@dataclass
class Judged:
    """What became of a mutant.

    Attributes:
        effective: Runs that differ.
        alone: Effective runs in which no rule has a finding.
        found: For each rule that has findings, the events and the samples up to the first one.
        messages: The first finding of each rule.
    """

    effective: int
    alone: list[str]
    found: dict[str, tuple[int, int]]
    messages: dict[str, str]


def mutants() -> list[Mutant]:
    """Read all mutants."""
    tables = [tomllib.loads(path.read_text("utf-8")) for path in sorted(TABLES.glob("*.toml"))]
    entries = [entry for table in tables for entry in table.get("mutant", ())]
    return [Mutant(**{**entry, "rules": tuple(entry.get("rules", ()))}) for entry in entries]


def plan(folder: Path, names: list[str]) -> None:
    """Plan runs by the package that is imported, each into a recording in the folder."""
    table = tomllib.loads((TABLES / "runs.toml").read_text("utf-8"))
    for name in names:
        entry = {"clock": "logical", **table["runs"][name]}
        world = entry.pop("walls", None)
        own = World(name, **table["worlds"][world]) if world else None
        run = Run(Scenario.parse(entry), world=own, batch=512)
        run.execute([McapSink(folder / f"{name}.mcap", run.manifest, run.problem.world)])


def plan_with(mutant: Mutant | None, folder: Path, names: list[str]) -> str | None:
    """Plan runs in another process, by a copy of the package; return what fails."""
    package = folder / "brrt"
    shutil.copytree(ROOT / "brrt", package)
    if mutant is not None:
        mutant.apply(package)
    environment = {**os.environ, "PYTHONPATH": str(folder), "NUMBA_DISABLE_JIT": "1"}
    command = [sys.executable, str(Path(__file__)), "--plan", str(folder), *names]
    try:
        done = subprocess.run(
            command, env=environment, capture_output=True, text=True, check=False, timeout=TIMEOUT_S
        )
    except subprocess.TimeoutExpired:
        return f"it does not end within {TIMEOUT_S} s"
    shutil.rmtree(package)
    return done.stderr.strip().splitlines()[-1] if done.returncode else None


def differs(a: Recording, b: Recording) -> bool:
    """Whether two runs of a scenario differ in their events, metrics or contract."""
    same = a.result == b.result and a.manifest.contract == b.manifest.contract
    same = same and a.manifest.scenario.clock == "logical"
    if not same or first_difference(a.batches(), b.batches()) is not None:
        return True
    ours, theirs = a.events(), b.events()  # the difference above ignores times
    return any((table["t"] != theirs[kind]["t"]).any() for kind, table in ours.tables.items())


def judge(mutant: Mutant, folder: Path, base: Path) -> Judged:
    """Verify the runs of a mutant."""
    judged = Judged(0, [], {}, {})
    for name in mutant.runs:
        recording = read(folder / f"{name}.mcap")
        try:
            if not differs(recording, read(base / f"{name}.mcap")):
                continue
            log = recording.events()
        except RecordingError as error:
            judged.effective += 1
            judged.found[DAMAGED], judged.messages[DAMAGED] = (0, 0), f"{name}: {error}"
            continue
        judged.effective += 1
        verification = verify(recording)
        if verification.holds:
            judged.alone.append(name)
        samples = log[Kind.SAMPLE]["seq"]
        for result in verification.results:
            if not result.broken:
                continue
            first = min(result.findings, key=lambda found: found.seq % (1 << 62))  # -1: at the end
            at = first.seq if first.seq >= 0 else len(log) - 1
            reached = at + 1, int((samples <= at).sum())
            judged.found[result.rule] = min(judged.found.get(result.rule, reached), reached)
            judged.messages.setdefault(result.rule, f"{name}: event {at}: {first.message}")
    return judged


def wrong(mutant: Mutant, judged: Judged) -> str | None:
    """Return how the outcome differs from what the mutant states."""
    missing = [rule for rule in mutant.rules if rule not in judged.found]
    if not judged.effective:
        return "it has no effect in its runs"
    if mutant.hidden is not None:
        return f"it is found by {', '.join(judged.found)}" if judged.found else None
    if missing or not mutant.rules:
        others = ", ".join(judged.found) or "none"
        return f"not found by {', '.join(missing) or 'a rule that it states'}; found by: {others}"
    needed = judged.found[mutant.rules[0]][1]
    if mutant.draws is not None and needed > mutant.draws:
        return f"found after {needed:,} draws, not {mutant.draws:,}"
    return None


def show(mutant: Mutant, judged: Judged) -> None:
    """Print the line of a mutant."""
    others = [rule for rule in judged.found if rule not in mutant.rules]
    more = f" and {len(others)} more" if others else ""
    events, draws = judged.found[mutant.rules[0]] if mutant.rules else ("", "")
    names = "hidden" if mutant.hidden is not None else ", ".join(mutant.rules) + more
    effective = f"{judged.effective} of {len(mutant.runs)}"
    print(LINE.format(mutant.name, effective, names, events, draws), flush=True)


def promises() -> dict[str, set[str]]:
    """Return the rules of each promise in docs/promises.md that the package's planners can break.

    None of them makes a graph; tests doctor the logs of those that do.
    """
    text = (ROOT / "docs/promises.md").read_text("utf-8").partition("\n## ")[0]
    rows = [line.strip("| ").split(" | ") for line in text.splitlines() if line.startswith("| ")]
    found = {row[0]: {name.strip(" `") for name in row[1].split(",")} for row in rows}
    others = {"---", "rules", *(rule.name for rule in graph.RULES)}
    return {promise: rules for promise, rules in found.items() if not rules <= others}


def campaign(chosen: list[Mutant], folder: Path, jobs: int, *, verbose: bool) -> int:
    """Run mutants; print the table; return how many are not as stated."""
    base, bad, counts = folder / "unchanged", 0, Counter[str]()
    shutil.rmtree(folder, ignore_errors=True)
    base.mkdir(parents=True)
    names = sorted({name for mutant in chosen for name in mutant.runs})
    failed = plan_with(None, base, names)
    if failed is not None:
        raise ValueError(f"without a mutant: {failed}")
    alarms = [name for name in names if not verify(read(base / f"{name}.mcap")).holds]
    if alarms:
        raise ValueError(f"without a mutant: rules have findings in {', '.join(alarms)}")
    print(LINE.format("mutant", "effective", "found by", "events", "draws"))
    folders = [folder / f"{n}" for n in range(len(chosen))]
    with ThreadPoolExecutor(jobs) as pool:
        planned = pool.map(plan_with, chosen, folders, [mutant.runs for mutant in chosen])
        for mutant, where, failure in zip(chosen, folders, planned, strict=True):
            judged = Judged(0, [], {}, {}) if failure else judge(mutant, where, base)
            problem = failure or wrong(mutant, judged)
            shutil.rmtree(where)
            counts.update(mutants=1, effective=judged.effective > 0, found=bool(judged.found))
            counts.update(hidden=mutant.hidden is not None, runs=judged.effective)
            counts.update(alone=len(judged.alone))
            if problem is None:
                show(mutant, judged)
            else:
                bad += 1
                print(f"{mutant.name}: NOT AS STATED: {problem}", flush=True)
            if judged.alone and mutant.hidden is None:
                print(f"    no finding in {', '.join(judged.alone)}", flush=True)
            for rule, message in judged.messages.items() if verbose else ():
                print(f"    {rule}: {message}", flush=True)
    print(", ".join(f"{count:,} {name}" for name, count in counts.items()))
    return bad


def main() -> int:
    """Run the chosen mutants."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("names", nargs="*", help="parts of names; all mutants by default")
    parser.add_argument("--plan", type=Path, help=argparse.SUPPRESS)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--folder", type=Path, default=Path(tempfile.gettempdir()) / "mutants")
    parser.add_argument("--show", action="store_true")
    args = parser.parse_args()
    if args.plan is not None:
        if Path(brrt.__file__).parents[1] != args.plan.resolve():
            raise ImportError(f"brrt is imported from {brrt.__file__}, not from {args.plan}")
        plan(args.plan, args.names)
        return 0
    every = mutants()
    chosen = [
        mutant
        for mutant in every
        if not args.names or any(part in f"{mutant.name} {mutant.file}" for part in args.names)
    ]
    bad = campaign(chosen, args.folder, args.jobs, verbose=args.show)
    judged = {rule for mutant in every for rule in mutant.rules}
    bare = [promise for promise, rules in promises().items() if not rules & judged]
    for promise in bare:
        print(f"no mutant breaks the promise: {promise}")
    unused = set().union(*promises().values()) - judged
    print(f"rules that no mutant states: {', '.join(sorted(unused)) or 'none'}")
    return int(bad > 0 or bool(bare))


if __name__ == "__main__":
    sys.exit(main())
