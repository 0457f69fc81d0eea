"""What recording OMPL's planners in Python costs, in processor time.

    python benchmarks/ompl_overhead_python.py [--iterations 20000]

Runs each planner without and with recording in turn, with the same seed, and prints the least of
five each, and their ratio. Three checkers in Python: a motion validator and a validity checker that
are compiled by numba, the fastest that there can be, and a validity checker of plain Python. All
threads count, also the one that writes the file.
"""

import argparse
import os
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray
from ompl import base

sys.path.insert(0, str(Path(__file__).parents[1]))

import brrt
from tests.support.ompl_problems import free_in, iterations, point_setup

WORLD = brrt.make_world("circles2d:n=30,seed=4")
ROUNDS = 5
PLANNERS = ("RRTstar", "InformedRRTstar", "BITstar")


@numba.njit(cache=True)  # type: ignore[misc, unused-ignore]
def free(ax: float, ay: float, bx: float, by: float, balls: NDArray[np.float64]) -> bool:
    """Return whether a segment is clear of circles."""
    dx, dy = bx - ax, by - ay
    square = dx * dx + dy * dy
    for x, y, r in balls:
        part = 0.0
        if square > 0:
            part = min(1.0, max(0.0, ((x - ax) * dx + (y - ay) * dy) / square))
        if (ax + part * dx - x) ** 2 + (ay + part * dy - y) ** 2 <= r * r:
            return False
    return True


class Motions(base.MotionValidator):  # type: ignore[misc]
    """Checks whole motions."""

    def checkMotion(self, a: Any, b: Any) -> bool:  # noqa: N802
        """Return whether a motion is free."""
        return bool(free(a[0], a[1], b[0], b[1], WORLD.balls))


def compiled_motions(setup: Any) -> None:
    """Check motions by a validator."""
    compiled_states(setup)
    information = setup.getSpaceInformation()
    information.setMotionValidator(Motions(information))


def compiled_states(setup: Any) -> None:
    """Check states, OMPL's motion validator steps along motions."""
    setup.setStateValidityChecker(lambda q: free(q[0], q[1], q[0], q[1], WORLD.balls))


def plain_states(setup: Any) -> None:
    """Check states without numba."""
    setup.setStateValidityChecker(free_in(WORLD))


CHECKERS: dict[str, Callable[[Any], None]] = {
    "motions, numba": compiled_motions,
    "states, numba": compiled_states,
    "states, Python": plain_states,
}


def seconds(planner: str, checker: Callable[[Any], None], count: int, path: Path | None) -> float:
    """Return the processor time of a run."""
    setup = point_setup(planner, WORLD, seed=3, resolution=0.01)
    checker(setup)
    setup.setup()
    begin = time.process_time()
    if path is None:
        setup.solve(iterations(count))
    else:
        with brrt.ompl.record(setup, path, world=WORLD):
            setup.solve(iterations(count))
    return time.process_time() - begin


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--iterations", type=int, default=20_000)
    count = parser.parse_args().iterations
    print(f"{'':16} {'checker':15}   off s    on s  ratio")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run.mcap"
        for planner in PLANNERS:
            for name, checker in CHECKERS.items():
                seconds(planner, checker, 100, path)
                off, on = [], []
                for _ in range(ROUNDS):
                    off.append(seconds(planner, checker, count, None))
                    on.append(seconds(planner, checker, count, path))
                ratio = min(on) / min(off)
                print(f"{planner:16} {name:15} {min(off):7.3f} {min(on):7.3f} {ratio:6.2f}")
    sys.stdout.flush()
    os._exit(0)  # OMPL's Python module else prints what it takes for leaks


if __name__ == "__main__":
    main()
