"""Kill runs while they record, and damage recordings: what is left, and what a reader says of it.

    python benchmarks/faults.py [--kills 200] [--foreign 50] [--copies 2000] [--seed 0] [--first 0]

Kills: a run that records at full speed into both files is killed (SIGKILL) at a random moment. It
notes how many events it has handed over, and the time of the last. The .mcap must have them but
for at most a second or a chunk, and `brrt recover` must make a file of them that `brrt verify` and
stock mcap take. The .rrd must be refused with a line that names the .mcap.

Foreign: the same of a program that records an RRT of its own by `brrt.record`, one event at a time.
Its .mcap must have all but the last half second.

Copies: bytes are flipped, blocks swapped, doubled, blanked or cut off, in .mcap files of runs that
ended and of runs that were killed. Each copy must read as the original does, or as the beginning
of it and an error of one line, within 5 seconds. Copies of .rrd files are cut alone: other damage
may end the process (see docs), and they have no checksums.

The exit code is 1 if anything else happens. Each kill and each copy is drawn by its own number, so
that `--first 120` goes on where a run of this script was stopped. Findings are printed at once,
progress on stderr.
"""

import argparse
import contextlib
import io
import itertools
import os
import random
import resource
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from importlib.metadata import entry_points
from pathlib import Path
from subprocess import PIPE, Popen
from typing import IO, Any, cast

import numpy as np
from mcap.reader import make_reader
from numpy.typing import NDArray

import brrt
from brrt import (
    BrrtError,
    Events,
    McapSink,
    Run,
    Scenario,
    World,
    first_difference,
    make_world,
    read,
)
from brrt.formats.background import BackgroundSink
from brrt.formats.recover import recover
from brrt.replay.metrics import Metrics
from brrt.views.rerun.sink import RerunSink

NAMES = ("run.mcap", "run.rrd")
ENDLESS = Scenario(world="circles2d", seed=1, smooth=False, iterations=10**9,
                   params={"goal_bias": 0.0, "step": 0.05})  # fmt: skip
SMALL = (
    Scenario(world="circles2d:n=40", seed=7),
    Scenario(world="boxes3d:n=30", seed=1, planner="bi-rrt"),
    Scenario(world="circles2d", seed=2, planner="rrt-star", iterations=400),
)
PATIENCE_S = 5.0
LOSS_S, HALF_S, CHUNK = 1.0, 0.5, 1 << 16
WAYS = ("flip", "flip", "flip", "cut", "swap", "blank", "double")
REPORTS, INTERRUPTED = 20, 130
MEMORY = 6 << 30


def record(scenario: Scenario, folder: Path, batch: int = 8192) -> None:
    """Record a run in both files as `brrt plan` does; note what was handed over, and when."""
    run = Run(scenario, batch=batch)
    world = run.problem.world
    sinks = [
        BackgroundSink(McapSink(folder / NAMES[0], run.manifest, world)),
        BackgroundSink(RerunSink(run.manifest, world, path=folder / NAMES[1])),
    ]
    handed = os.open(folder / "handed", os.O_WRONLY | os.O_CREAT)
    count = 0
    metrics = Metrics(run.manifest)
    for events in run.events():
        metrics.write(events)
        for sink in sinks:
            sink.write(events)
        count += len(events)
        os.pwrite(handed, f"{count} {events.last.t}\n".encode(), 0)
    for sink in sinks:
        sink.close(metrics.as_dict())
    os.close(handed)


def record_foreign(folder: Path) -> None:
    """Record an RRT in plain Python, without end, one event at a time; note what was recorded."""
    world = make_world(ENDLESS.world)
    rng = np.random.default_rng(int.from_bytes(os.urandom(4)))
    handed = os.open(folder / "handed", os.O_WRONLY | os.O_CREAT)
    began = time.perf_counter_ns()
    with brrt.record(folder / NAMES[0], world=world, planner="foreign") as rec:
        nodes = [np.array(world.start)]
        rec.edge(nodes[0])
        for number in itertools.count(1):
            q = rng.uniform(world.lower, world.upper)
            rec.sample(q)
            near = int(np.linalg.norm(np.array(nodes[-200:]) - q, axis=1).argmin())
            near += max(0, len(nodes) - 200)
            way = q - nodes[near]
            new = nodes[near] + way * min(1.0, 0.05 / float(np.linalg.norm(way)))
            if motion_free(world, nodes[near], new):
                rec.edge(new, near)
                nodes.append(new)
            else:
                rec.reject(new, near)
            os.pwrite(handed, f"{2 * number} {time.perf_counter_ns() - began}\n".encode(), 0)


def motion_free(world: World, a: NDArray[np.float64], b: NDArray[np.float64]) -> bool:
    """Whether a motion touches no ball and stays inside the world."""
    middle, reach = (a + b) / 2, float(np.linalg.norm(b - a)) / 2
    balls = np.asarray(world.balls)
    away = np.linalg.norm(balls[:, :2] - middle, axis=1) > balls[:, 2] + reach
    return bool(away.all() and world.inside(b))


def fork_runs(work: Callable[[Path], None]) -> None:
    """Fork a run for each folder on stdin: importing and compiling takes long."""
    Run(ENDLESS)
    for line in sys.stdin:
        child = os.fork()
        if not child:
            try:
                work(Path(line.strip()))
            finally:
                os._exit(1)  # it is to be killed; it must not answer in our name
        print(child, flush=True)
        os.waitpid(child, 0)
        print("gone", flush=True)


def saved(path: Path) -> tuple[Events | None, str | None]:
    """Return the events that a file gives, and the error that ends them."""
    batches, dof = [], 0
    try:
        recording = read(path)
        dof = recording.manifest.dof
        for batch in recording.batches():
            batches.append(batch)  # noqa: PERF402 - what came before an error counts
    except BrrtError as error:
        said = str(error)
        if not (said.startswith(str(path)) and said.isprintable()):
            raise AssertionError(f"not one line that names the file: {said!r}") from None
        return (Events.concat(dof, batches) if dof else None), said
    return Events.concat(dof, batches), None


def command(*args: object) -> tuple[int, str]:
    """Run `brrt` in this process; return its exit code and its output."""
    (script,) = entry_points(group="console_scripts", name="brrt")
    said = io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
        try:
            script.load()([str(arg) for arg in args])
        except SystemExit as ended:
            if ended.code == INTERRUPTED:
                raise KeyboardInterrupt from None
            return int(ended.code or 0), said.getvalue()
    return 0, said.getvalue()


def judge_kill(folder: Path, figures: Counter[str], loss_s: float) -> list[str]:
    """Return what is wrong with the files that a killed run left."""
    note = folder / "handed"
    words = note.read_text().split() if note.exists() else []
    handed, t = (int(words[0]), int(words[1])) if words else (0, 0)
    figures["events handed over"] += handed
    mcap, rrd = (folder / name for name in NAMES)
    wrong = []
    if rrd.exists():
        events, said = saved(rrd)
        if events is not None or not str(said).endswith("is cut; replay the .mcap of the run"):
            wrong.append(f"{rrd.name} is not refused as cut: {said}")
    if not mcap.exists():
        return [*wrong, f"no {mcap.name} after {handed:,} events"] if handed else wrong
    events, said = saved(mcap)
    if events is None:
        return [*wrong, f"{mcap.name} cannot be read: {said}"]
    lost, lost_s = max(0, handed - len(events)), max(0.0, (t - events.last.t) / 1e9)
    figures["events lost"] += lost
    figures["most time lost, ms"] = max(figures["most time lost, ms"], round(1e3 * lost_s))
    if lost_s > loss_s and (lost > CHUNK or loss_s < LOSS_S):
        wrong.append(f"{mcap.name} lacks the last {lost_s:.2f} s, {lost:,} events")
    return wrong + judge_recovery(mcap, events)


def judge_recovery(path: Path, events: Events) -> list[str]:
    """Recover a file; return what is wrong with the new one."""
    whole = path.with_name("whole.mcap")
    found = recover(path, whole)
    back, error = saved(whole)
    wrong = [] if found.events == len(events) else [f"{found.events} of {len(events)} recovered"]
    if error or back is None or first_difference([events], [back]):
        wrong.append(f"{whole.name} differs: {error}")
    if len(events):
        for args in (("replay", whole), ("verify", whole), ("replay", path, "--partial")):
            code, said = command(*args)
            if code:
                wrong.append(f"brrt {args[0]} {args[1].name}: exit code {code}: {said[-200:]}")
    with whole.open("rb") as file:
        summary = make_reader(file, validate_crcs=True).get_summary()
    if summary is None or summary.statistics is None:
        return [*wrong, "stock mcap finds no summary"]
    if summary.statistics.message_count != len(events):
        wrong.append("stock mcap counts otherwise")
    return wrong


def draws(seed: int, what: str, number: int) -> random.Random:
    """The draws of one kill or copy, which do not depend on those before it."""
    return random.Random(f"{seed} {what} {number}")  # noqa: S311 - no secret


def foreign(numbers: range, seed: int, figures: Counter[str]) -> Iterator[str]:
    """Kill a program that uses `brrt.record` for each number."""
    return kills(numbers, seed, figures, "--fork-foreign", HALF_S)


def kills(
    numbers: range,
    seed: int,
    figures: Counter[str],
    option: str = "--fork-runs",
    loss_s: float = LOSS_S,
) -> Iterator[str]:
    """Kill a run for each number; yield what is wrong with what they left."""
    with Popen([sys.executable, __file__, option], stdin=PIPE, stdout=PIPE, text=True) as process:
        orders, answers = cast("IO[str]", process.stdin), cast("IO[str]", process.stdout)
        for number in counted(numbers, "kills"):
            with tempfile.TemporaryDirectory() as name:
                orders.write(f"{name}\n")
                orders.flush()
                child = int(answers.readline())
                time.sleep(draws(seed, "kill", number).uniform(0, 2.0))
                os.kill(child, signal.SIGKILL)
                answers.readline()
                wrong = judge_kill(Path(name), figures, loss_s)
            figures["killed"] += 1
            yield from (f"kill {number}: {line}" for line in wrong)
        orders.close()


def damaged(data: bytes, rng: random.Random, ways: Sequence[str]) -> tuple[str, bytes]:
    """Damage a file in one of some ways; return in which."""
    way = rng.choice(ways)
    at, size = rng.randrange(len(data)), rng.choice([1, 8, 100, 5000])
    if way == "flip":
        changed = bytearray(data)
        for _ in range(rng.choice([1, 1, 1, 20])):
            changed[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
        return way, bytes(changed)
    if way == "cut":
        return way, data[:at]
    part = data[at : at + size]
    if way == "blank":
        return way, data[:at] + bytes(len(part)) + data[at + size :]
    if way == "double":
        return way, data[: at + size] + part + data[at + size :]
    to = rng.randrange(len(data))
    first, second = sorted((at, to))
    size = min(size, second - first, len(data) - second)
    a, b = data[first : first + size], data[second : second + size]
    return way, data[:first] + b + data[first + size : second] + a + data[second + size :]


@dataclass
class Original:
    """A recording to damage: its name, its bytes, its events and all else that it says."""

    path: Path
    data: bytes
    events: Events
    head: tuple[Any, ...]

    @classmethod
    def of(cls, path: Path) -> "Original":
        """Read it."""
        events, _ = saved(path)
        if events is None:
            raise AssertionError(f"{path} gives nothing")
        return cls(path, path.read_bytes(), events, head(path))


def head(path: Path) -> tuple[Any, ...]:
    """Return what a recording says of its run but for the events."""
    recording = read(path)
    return recording.manifest, recording.world.to_json(), recording.result


def judge_copy(path: Path, original: Original) -> tuple[str, str | None]:
    """Read a damaged copy; return what became of it, and what is wrong with that."""
    whole, (events, error) = original.events, saved(path)
    if path.suffix == ".rrd":
        return ("reported", None) if events is None else ("wrong", "a cut file is not refused")
    if events is not None:
        if first_difference([whole.until(seq=len(events) - 1)], [events]):
            return "wrong", "other events, and nothing said"
        if any(
            (table["t"] != whole[kind]["t"][: len(table)]).any()
            for kind, table in events.tables.items()
        ):
            return "wrong", "other times, and nothing said"
    if error is not None:
        return "reported", None
    if events is None or len(events) != len(whole) or head(path) != original.head:
        return "wrong", "less, or another problem or result, and nothing said"
    return "harmless", None


def originals(folder: Path, seed: int) -> list[Path]:
    """Record some runs, in small batches; cut the end off copies, as a kill does."""
    found = []
    for number, scenario in enumerate(SMALL):
        place = folder / str(number)
        place.mkdir()
        record(scenario, place, batch=250)
        rng = draws(seed, "original", number)
        data = (place / NAMES[0]).read_bytes()
        killed = place / f"killed-{NAMES[0]}"
        killed.write_bytes(data[: int(len(data) * rng.uniform(0.3, 0.9))])
        found += [*(place / name for name in NAMES), killed]
    return found


def copies(numbers: range, seed: int, figures: Counter[str]) -> Iterator[str]:
    """Damage a copy for each number; yield what is wrong with how they read."""
    with tempfile.TemporaryDirectory() as name:
        sources = [Original.of(path) for path in originals(Path(name), seed)]
        for number in counted(numbers, "copies"):
            source = sources[number % len(sources)]
            ways = ["cut"] if source.path.suffix == ".rrd" else WAYS
            way, data = damaged(source.data, draws(seed, "copy", number), ways)
            path = Path(name, f"copy{source.path.suffix}")
            path.write_bytes(data)
            began = time.perf_counter()
            try:
                outcome, wrong = judge_copy(path, source)
                if number % 10 == 0:
                    code, said = command("replay", path, "--json")
                    if code not in (0, 2) or (code == 2 and said.count("\n") != 1):
                        wrong = f"brrt replay: exit code {code}: {said[-200:]}"
            except Exception as error:  # noqa: BLE001 - a crash is a finding like any other
                outcome, wrong = "crash", f"{type(error).__name__}: {error}"
            took = time.perf_counter() - began
            if took > PATIENCE_S:
                wrong = f"{wrong or ''} took {took:.1f} s"
            figures[f"{path.suffix[1:]}: {outcome}"] += 1
            figures["slowest copy, ms"] = max(figures["slowest copy, ms"], round(1e3 * took))
            if wrong:
                keep = Path(tempfile.gettempdir(), f"fault-{number}{path.suffix}")
                keep.write_bytes(data)
                yield f"copy {number} ({way} of {source.path.name}): {wrong}; see {keep}"


def counted(numbers: range, what: str) -> Iterator[int]:
    """Yield the numbers; report progress on stderr, and how to go on after an interrupt."""
    began = time.perf_counter()
    for number in numbers:
        done = number - numbers.start
        last = number == numbers.stop - 1
        if sys.stderr.isatty() or done % max(1, len(numbers) // REPORTS) == 0 or last:
            passed = time.perf_counter() - began
            left = f", {passed / done * (len(numbers) - done):.0f} s left" if done else ""
            line = f"{what}: {number:,} of {numbers.stop:,} after {passed:.0f} s{left}"
            end = "\n" if last or not sys.stderr.isatty() else ""
            sys.stderr.write(f"\r{line:60}{end}" if sys.stderr.isatty() else f"{line}{end}")
            sys.stderr.flush()
        try:
            yield number
        except GeneratorExit:
            sys.stderr.write(f"\nstopped; go on with --first {number}\n")
            raise


def run_all(what: Callable[..., Iterator[str]], numbers: range, seed: int) -> int:
    """Print each finding as it comes, then the figures, even if interrupted; count them."""
    figures: Counter[str] = Counter()
    findings, began = 0, time.perf_counter()
    try:
        for finding in what(numbers, seed, figures):
            findings += 1
            print(finding, flush=True)
    finally:
        passed = time.perf_counter() - began
        print(f"{what.__name__} {numbers.start:,} to {numbers.stop:,} in {passed:.0f} s")
        for name, figure in sorted(figures.items()):
            print(f"  {name}: {figure:,}")
        print(f"  findings: {findings}", flush=True)
    return findings


def bound_memory() -> None:
    """Bound what reading a damaged file takes; Rerun keeps threads for each file it wrote."""
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    most = pages * resource.getpagesize() + MEMORY
    resource.setrlimit(resource.RLIMIT_AS, (most, most))


def main() -> int:
    """Do both; print figures and findings."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--kills", type=int, default=200)
    parser.add_argument("--foreign", type=int, default=50)
    parser.add_argument("--copies", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--first", type=int, default=0, help="number of the first kill and copy")
    parser.add_argument("--fork-runs", action="store_true", help=argparse.SUPPRESS)
    parser.add_argument("--fork-foreign", action="store_true", help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.fork_runs or args.fork_foreign:
        with contextlib.suppress(KeyboardInterrupt):
            fork_runs(partial(record, ENDLESS) if args.fork_runs else record_foreign)
        return 0
    findings = 0
    counts = (kills, args.kills), (foreign, args.foreign), (copies, args.copies)
    for what, count in counts:
        numbers = range(args.first, count)
        if not numbers:
            continue
        if what is copies:
            bound_memory()
        try:
            findings += run_all(what, numbers, args.seed)
        except KeyboardInterrupt:
            return INTERRUPTED
    return int(bool(findings))


if __name__ == "__main__":
    sys.exit(main())
