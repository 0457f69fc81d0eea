"""Forge recordings with right checksums, and state what each forgery gets.

    python benchmarks/forge.py [--seed 0] [--only TEXT] [--keep DIR]

Each attack changes five recordings: their container, manifest, world, log or result. Checksums,
indexes, counts and metrics are made anew, so that nothing but the attack is wrong. Each file is
given to `brrt replay`, `verify`, `explain` and `diff` (with the true recording). Whatever they say,
they must say it in one printable line or in a report, within 5 seconds and 1 GiB more memory than
before, without a traceback, without opening another file, without a process or a connection.

The table states for each attack how many files are refused, how many break a rule and which, and
how many pass. An attack (benchmarks/forgeries.py) may pass only if it states why. The exit code is
1 if another one passes, or if a command does anything else.
"""

import argparse
import contextlib
import io
import json
import os
import random
import resource
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))

from forgeries import ATTACKS, Attack, Base

from brrt import McapSink, Memory, Run, Scenario

SCENARIOS = {
    "rrt": Scenario(world="circles2d:n=40", seed=7),
    "bi-rrt in 3D": Scenario(world="boxes3d:n=60", seed=1, planner="bi-rrt"),
    "rrt-star": Scenario(world="circles2d", seed=2, planner="rrt-star", iterations=600),
    "lrta-star": Scenario(world="circles2d:n=20", seed=3, planner="lrta-star"),
    "polygon": Scenario(world="boxes2d:n=30", seed=4, planner="rrt", robot="polygon"),
}
PATIENCE_S, MEMORY, SHOWN = 5.0, 1 << 30, 40
OUTSIDE = ("os.exec", "os.posix_spawn", "os.system", "pickle.find_class", "socket.connect",
           "subprocess.Popen", "shutil.rmtree", "os.remove", "os.rename")  # fmt: skip


@dataclass
class Tally:
    """What the files of one attack got."""

    got: Counter[str] = field(default_factory=Counter)
    said: Counter[str] = field(default_factory=Counter)
    rules: Counter[str] = field(default_factory=Counter)


SCRIPT = next(iter(entry_points(group="console_scripts", name="brrt"))).load()


def command(*args: object) -> tuple[int, str]:
    """Run `brrt` in this process; return its exit code and its output."""
    said = io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
        try:
            SCRIPT([str(arg) for arg in args])
        except SystemExit as ended:
            return int(ended.code or 0), said.getvalue()
    return 0, said.getvalue()


class Watch:
    """Notes what a process does besides reading the recordings that it is given."""

    def __init__(self, *known: Path) -> None:
        ours = [*map(str, known), *sys.path, sys.prefix, sys.base_prefix]
        self.known = [*map(os.path.realpath, ours), "/proc", "/sys", "/dev/null", "/usr/lib"]
        self.seen: list[str] = []
        self.active = False
        sys.addaudithook(self._note)

    def _note(self, event: str, args: tuple[Any, ...]) -> None:
        if not self.active:
            return
        if event == "open" and isinstance(args[0], str | bytes):
            name = os.path.realpath(os.fsdecode(args[0]))
            if not any(name.startswith(known) for known in self.known):
                self.seen.append(f"opens {name}")
        elif event in OUTSIDE:
            self.seen.append(f"{event} {args[0]!r:.80}")


def _stop(_signal: int, _frame: object) -> None:
    raise TimeoutError("took too long")


def judge(path: Path, base: Base, watch: Watch) -> tuple[str, str, list[str], list[str]]:
    """Give a file to the commands.

    Returns:
        Whether it is refused, broken or passes; what refuses it; the broken rules; what is wrong
        with the commands' behaviour.
    """
    wrong, verdict, line, rules = list[str](), "", "", list[str]()
    for name, *args in (("verify", path, "--json"), ("replay", path), ("explain", path),
                        ("diff", base.path, path), ("verify", path)):  # fmt: skip
        before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        began, watch.seen, watch.active = time.perf_counter(), [], True
        signal.setitimer(signal.ITIMER_REAL, 3 * PATIENCE_S)
        try:
            code, said = command(name, *args)
        except Exception as error:  # noqa: BLE001 - a crash is a finding like any other
            code, said = -1, f"{type(error).__name__}: {error}"
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0)
            watch.active = False
        took = time.perf_counter() - began
        grown = 1024 * (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)
        wrong += [f"{name} {each}" for each in watch.seen]
        if code not in (0, 1, 2):
            wrong.append(f"{name}: exit code {code}: {said[-300:]}")
        if code == 2 and said.count("\n") != 1:
            wrong.append(f"{name}: not one line: {said[-300:]}")
        if not said.replace("\n", "").isprintable() or "Traceback" in said:
            wrong.append(f"{name}: sends {said[-300:]!r}")
        if took > PATIENCE_S or grown > MEMORY or "memory" in said:
            wrong.append(f"{name}: {took:.1f} s, {grown >> 20} MB: {said[-200:]}")
        if "--json" in args:
            verdict = {0: "passes", 1: "broken"}.get(code, "refused")
            if code == 1:
                found = json.loads(said)
                rules = [each["rule"] for each in found["rules"] if each["broken"]]
            line = said.replace(str(path), "FILE").strip() if code == 2 else ""
    return verdict, line, rules, wrong


def originals(folder: Path, seed: int) -> Iterator[Base]:
    """Record the runs to forge."""
    for number, scenario in enumerate(SCENARIOS.values()):
        place = folder / str(number)
        place.mkdir()
        memory, run = Memory(), Run(replace(scenario, clock="logical"))
        path = place / "true.mcap"
        run.execute([memory, McapSink(path, run.manifest, run.problem.world)])
        rng = random.Random(f"{seed} {number}")  # noqa: S311 - no secret
        yield Base(path, run.manifest, run.problem.world, memory.events(), rng)


def row(attack: Attack, tally: Tally) -> str:
    """Return an attack's line of the table, in Markdown."""
    rules = ", ".join(f"`{name}`" for name, _ in tally.rules.most_common(3))
    why = attack.passes if tally.got["passes"] else ""
    figures = " | ".join(str(tally.got[key] or "") for key in ("refused", "broken", "passes"))
    return (
        f"| {attack.where}: {attack.name} | {figures} | {'; '.join(filter(None, (rules, why)))} |"
    )


def main() -> int:
    """Forge all files; print the table, then what is wrong."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", default="", help="attacks whose name has this text")
    parser.add_argument("--keep", type=Path, help="a folder for files that get anything unexpected")
    args = parser.parse_args()
    signal.signal(signal.SIGALRM, _stop)
    wrong, files, began = list[str](), 0, time.perf_counter()
    with tempfile.TemporaryDirectory() as name:
        bases, watch = list(originals(Path(name), args.seed)), Watch(Path(name).resolve())
        print("| attack | refused | broken | passes | rules, or why it passes |")
        print("| --- | --: | --: | --: | --- |")
        for attack in (each for each in ATTACKS if args.only in each.name):
            tally = Tally()
            for base in bases:
                data = attack.forge(base)
                if data is None:
                    continue
                files += 1
                path = base.path.with_name("forged.mcap")
                path.write_bytes(data)
                verdict, line, rules, faults = judge(path, base, watch)
                tally.got[verdict] += 1
                tally.said[line] += 1
                tally.rules.update(rules)
                if verdict == "passes" and not attack.passes:
                    faults.append("passes")
                wrong += [f"{attack.name}, {base.manifest.scenario.planner}: {f}" for f in faults]
                if faults and args.keep:
                    args.keep.mkdir(parents=True, exist_ok=True)
                    kept = f"{attack.name}-{base.path.parent.name}.mcap".replace("/", "_")
                    (args.keep / kept).write_bytes(data)
            print(row(attack, tally), flush=True)
            for line in sorted(filter(None, tally.said)):
                print(f"    {line}", file=sys.stderr)
    print(f"\n{len(ATTACKS)} attacks, {files} files in {time.perf_counter() - began:.0f} s, "
          f"{len(wrong)} findings")  # fmt: skip
    for line, count in Counter(wrong).most_common(SHOWN):
        print(f"{count} times: {line}")
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main())
