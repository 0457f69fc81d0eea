"""Damage the cache of compiled kernels: every run must end as with a good one.

    python benchmarks/kernel_cache.py [--flips 200] [--cuts 50] [--compilers 4] [--seed 0]

A folder with all kernels of one planner is made by processes that compile at once. Then bits are
flipped and files cut, ten in each round, index and code alike, and the planner runs. It must exit
with 0 and print the result of a run without a cache. The exit code is 1 if anything else happens.
"""

import argparse
import os
import random
import sys
import tempfile
from pathlib import Path
from subprocess import PIPE, Popen

_ROUND = 10
_TIMEOUT_S = 300
_PLAN = ["plan", "--no-record", "--json", "--clock", "logical", "--seed", "3", "--planner", "rrt"]


def main() -> None:
    """Run the script."""
    parser = argparse.ArgumentParser(description=__doc__)
    for name, number in (("flips", 200), ("cuts", 50), ("compilers", 4), ("seed", 0)):
        parser.add_argument(f"--{name}", type=int, default=number)
    options = parser.parse_args()
    rng = random.Random(options.seed)  # noqa: S311 - repeatable damage
    with tempfile.TemporaryDirectory() as folder:
        bad = measure(Path(folder), rng, options.flips, options.cuts, options.compilers)
    sys.exit(int(bad > 0))


def measure(folder: Path, rng: random.Random, flips: int, cuts: int, compilers: int) -> int:
    """Print a line for each kind of damage; return how many runs went wrong."""
    expected = _outcomes([_start(Path(os.devnull))])[0]
    found = _outcomes([_start(folder) for _ in range(compilers)])
    bad = _report(f"{compilers} compilers at once", compilers, found, expected)
    for name, number, damage in (("flipped bits", flips, _flip), ("cut files", cuts, _cut)):
        found = []
        for begin in range(0, number, _ROUND):
            files = sorted(path for path in folder.rglob("*.nb?") if path.stat().st_size)
            for file in rng.choices(files, k=min(_ROUND, number - begin)):
                file.write_bytes(damage(file.read_bytes(), rng))
            found += _outcomes([_start(folder)])
        bad += _report(f"{number} {name}", len(found), found, expected)
    return bad


def _flip(data: bytes, rng: random.Random) -> bytes:
    at = rng.randrange(len(data))
    return data[:at] + bytes([data[at] ^ 1 << rng.randrange(8)]) + data[at + 1 :]


def _cut(data: bytes, rng: random.Random) -> bytes:
    return data[: rng.randrange(len(data))]


def _start(folder: Path) -> Popen[str]:
    env = {**os.environ, "BRRT_CACHE_DIR": str(folder)}
    return Popen([sys.executable, "-m", "brrt", *_PLAN], env=env, stdout=PIPE, text=True)


def _outcomes(started: list[Popen[str]]) -> list[tuple[int, str]]:
    printed = [process.communicate(timeout=_TIMEOUT_S)[0] for process in started]
    return [(each.returncode, out) for each, out in zip(started, printed, strict=True)]


def _report(what: str, runs: int, found: list[tuple[int, str]], expected: tuple[int, str]) -> int:
    wrong = [code for code, out in found if (code, out) != expected]
    print(f"{what}: {runs} runs, {len(wrong)} wrong (exit codes {wrong})", flush=True)
    return len(wrong)


if __name__ == "__main__":
    main()
