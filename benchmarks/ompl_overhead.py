"""What recording costs planners of OMPL in C++, in processor time with it over that without.

    python benchmarks/ompl_overhead.py

Needs g++ and libompl-dev: it compiles tests/cpp/ompl.cpp. Each planner runs five times with and
five times without, one after the other and each in a process of its own, with the same seed, so
that both do the same; the least times count. The motion check is exact, among 120 circles; behind a
wall the goal cannot be reached, so that RRT and RRT-Connect use up their iterations.
"""

import json
import os
import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import Any

ROUNDS = 5
COMPILER = shutil.which("g++") or "g++"
ROOT = Path(__file__).parents[1]
CASES = (
    ("RRT", "closed", 20_000, 2.0),
    ("RRTConnect", "closed", 20_000, 2.0),
    ("RRTstar", "many", 4000, 1.3),
    ("RRTstar", "many", 12_000, 1.3),
    ("InformedRRTstar", "many", 4000, 1.3),
    ("BITstar", "many", 4000, 1.3),
    ("FMT", "many", 4000, 1.5),
    ("PRMstar", "many", 500, None),
    ("KPIECE1", "closed", 5000, None),
)
"""Planner, world, iterations, and the ratio that is promised."""


def build(folder: Path) -> Path:
    """Compile the program."""
    program = folder / "ompl"
    folders = (ROOT / "brrt" / "include", "/usr/include/ompl-1.5", "/usr/include/eigen3")
    subprocess.run(
        [COMPILER, "-O2", "-std=c++17", "-pthread", *(f"-I{path}" for path in folders),
         ROOT / "tests" / "cpp" / "ompl.cpp", "-o", program, "-lompl"],
        check=True,
    )  # fmt: skip
    return program


def plan(program: Path, planner: str, world: str, iterations: int, *file: Path) -> dict[str, Any]:
    """Plan in a process of its own; return what it prints. Symbols are found before it begins."""
    for path in file:
        path.unlink(missing_ok=True)
    done = subprocess.run(
        [program, planner, world, str(iterations), "3", *file], capture_output=True, text=True,
        check=True, env={**os.environ, "LD_BIND_NOW": "1"},
    )  # fmt: skip
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def main() -> None:
    """Print a row for each planner."""
    print(f"{'planner':16}{'nodes':>8}{'without':>11}{'with':>11}{'ratio':>8}{'at most':>9}")
    with tempfile.TemporaryDirectory() as name:
        program = build(Path(name))
        for planner, world, iterations, most in CASES:
            without, recorded = [], []
            for _ in range(ROUNDS):
                found = plan(program, planner, world, iterations)
                without.append(found["seconds"])
                found = plan(program, planner, world, iterations, Path(name) / "run.mcap")
                recorded.append(found["seconds"])
            ratio = min(recorded) / min(without)
            print(
                f"{planner:16}{len(found['nodes']):8,}{1e3 * min(without):8.1f} ms"
                f"{1e3 * min(recorded):8.1f} ms{ratio:8.2f}{most or '-':>9}"
            )


if __name__ == "__main__":
    main()
