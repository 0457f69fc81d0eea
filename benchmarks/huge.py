"""Replay and compare very long recordings: events a second, and the most memory that it takes.

    python benchmarks/huge.py [--events 10000000] [--folder huge] [--rerun]

Two runs are recorded first, unless they are in the folder: rrt in a closed room, with seeds 1 and
2, so that they part at the first sample; a copy of the first is what it is equal to. Each command
runs as a process of its own. The exit code is 1 where one takes more than 1 GB, or where its own
code is not the expected one. Speed is by the time of the processor, starting up included, and by
the clock.
"""

import argparse
import os
import subprocess
import sys
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from brrt import World

MOST_MB = 1000
LINE = "{:36} {:>9} {:>9} {:>16} {:>9}"


class Cost(NamedTuple):
    """What a command took: its exit code, seconds by the clock and of the processor, and MB."""

    code: int
    clock_s: float
    processor_s: float
    peak_mb: float


def closed_room(path: Path) -> None:
    """Write a world whose goal cannot be reached."""
    boxes = [[90, 90, 91, 99], [90, 90, 99, 91], [98, 90, 99, 99], [90, 98, 99, 99],
             [30, 0, 32, 70], [60, 30, 62, 100]]  # fmt: skip
    bounds, ends = (np.zeros(2), np.full(2, 100.0)), (np.full(2, 5.0), np.full(2, 95.0))
    World("closed", *bounds, boxes=np.array(boxes, float), start=ends[0], goal=ends[1]).save(path)


def run(*words: object) -> Cost:
    """Run a command to its end."""
    began = time.perf_counter()
    command = [sys.executable, "-m", "brrt_cli", *map(str, words)]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    took = usage.ru_utime + usage.ru_stime
    # Linux counts in KiB, macOS in bytes.
    unit = 1 if sys.platform == "darwin" else 1024
    peak = usage.ru_maxrss * unit / 1e6
    return Cost(process.returncode, time.perf_counter() - began, took, peak)


def recordings(folder: Path, events: int) -> tuple[Path, Path, Path]:
    """Make the recordings; two events come of each iteration."""
    folder.mkdir(parents=True, exist_ok=True)
    world = folder / "closed.json"
    closed_room(world)
    names = [folder / f"{events}-{name}.mcap" for name in ("one", "two", "same")]
    for seed, path in enumerate(names[:2], 1):
        if not path.exists():
            took = run(
                "plan", "--world", world, "--iterations", events // 2, "--param", "step=0.5",
                "--seed", seed, "--out", path,
            )  # fmt: skip
            print(LINE.format(f"(plan, seed {seed})", *_figures(took, events)))
    if not names[2].exists():
        os.link(names[0], names[2])
    return names[0], names[1], names[2]


def _figures(cost: Cost, events: int) -> tuple[str, str, str, str]:
    return (
        f"{cost.clock_s:.1f} s", f"{cost.processor_s:.1f} s",
        f"{events / cost.processor_s:,.0f}", f"{cost.peak_mb:,.0f} MB",
    )  # fmt: skip


def main() -> int:
    """Measure all; return 1 where a bound is broken."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--events", type=int, default=10_000_000)
    parser.add_argument("--folder", type=Path, default=Path("huge"))
    parser.add_argument("--rerun", action="store_true", help="verify --rerun as well")
    options = parser.parse_args()
    print(LINE.format("", "clock", "processor", "events a second", "memory"))
    one, two, same = recordings(options.folder, options.events)
    commands: dict[str, tuple[int, tuple[object, ...]]] = {
        "replay, not solved": (0, ("replay", one)),
        "replay --json": (0, ("replay", one, "--json")),
        "diff, equal": (0, ("diff", one, same)),
        "diff, parted early": (1, ("diff", one, two)),
    }
    if options.rerun:
        commands["verify --rerun"] = (0, ("verify", one, "--rerun"))
    broken = False
    for name, (code, words) in commands.items():
        cost = run(*words)
        print(LINE.format(name, *_figures(cost, options.events)))
        broken |= cost.code != code or cost.peak_mb > MOST_MB
    return int(broken)


if __name__ == "__main__":
    sys.exit(main())
