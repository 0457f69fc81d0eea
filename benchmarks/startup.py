"""Processor time of short commands, start-up included, as multiples of importing four packages.

    python benchmarks/startup.py
    python benchmarks/startup.py --runs 50 replay

Each command runs as a process of its own, in turn with the yardstick
`python -c "import numpy, typer, rich, mcap"`, so that a busy machine slows all alike; figures are
medians of user plus system time. One run of each comes first, which leaves bytecode and compiled
kernels in their caches. `brrt replay run.mcap --json` must stay below 2.0.
"""

import argparse
import os
import resource
import shlex
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

YARDSTICK = "import numpy, typer, rich, mcap"
BRRT = Path(sys.executable).with_name("brrt")
COMMANDS = {
    "help": "--help",
    "replay": "replay run.mcap --json",
    "summary": "replay run.mcap",
    "diff": "diff run.mcap run.mcap",
    "verify": "verify run.mcap --json",
    "explain": "explain run.mcap --json",
    "plan": "plan --no-record --json",
}


def processor_time(command: list[str], folder: Path) -> float:
    """Return the seconds of processor time, user plus system, that a command takes."""
    env = {name: text for name, text in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(command, cwd=folder, env=env, stdout=subprocess.DEVNULL, check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main() -> None:
    """Measure the commands that are named, or all."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(COMMANDS))
    parser.add_argument("--runs", type=int, default=20, help="runs of each command (20)")
    given = parser.parse_args()
    unknown = set(given.names) - set(COMMANDS)
    if unknown:
        parser.error(f"unknown command {min(unknown)}; choose from {', '.join(COMMANDS)}")
    chosen = given.names or list(COMMANDS)
    commands = {"yardstick": [sys.executable, "-c", YARDSTICK]}
    commands |= {name: [str(BRRT), *shlex.split(COMMANDS[name])] for name in chosen}
    times: dict[str, list[float]] = {name: [] for name in commands}
    with tempfile.TemporaryDirectory() as folder:
        processor_time([str(BRRT), *shlex.split("plan --out run.mcap --json")], Path(folder))
        for run in range(given.runs + 1):
            for name, command in commands.items():
                seconds = processor_time(command, Path(folder))
                if run:
                    times[name].append(seconds)
    medians = {name: statistics.median(each) for name, each in times.items()}
    print(f"{'command':<36} {'ms':>7} {'ratio':>6}   median of {given.runs} runs")
    for name, seconds in medians.items():
        text = "yardstick" if name == "yardstick" else f"brrt {COMMANDS[name]}"
        print(f"{text:<36} {1e3 * seconds:>7.0f} {seconds / medians['yardstick']:>6.2f}")


if __name__ == "__main__":
    main()
