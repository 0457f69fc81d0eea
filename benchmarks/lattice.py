"""Moves a second of LRTA*, and the time of A* on a large grid map, recording on.

    python benchmarks/lattice.py [--maps FOLDER] [--runs 5]

FOLDER holds course maps in the boundary/block format and their queries.json; without it LRTA*
walks 200 times through a generated 3D world. Each run writes an MCAP file in a temporary folder.
The first time is that in kernels, by the events' own stamps, from the first to the last of each
batch; the second is that of planning as a user sees it, waits for the recorder included, which
needs a core of its own. Both are the best of the runs, on loaded kernels.
"""

import argparse
import json
import tempfile
from pathlib import Path

import numpy as np

from brrt import Events, McapSink, Memory, Run, Scenario
from brrt.events import Kind
from brrt.formats.background import BackgroundSink

SIDE = 512
ENDS = (Kind.PHASE, Kind.PATH)


def courses(folder: Path | None) -> dict[str, Scenario]:
    """Queries for LRTA*, by name."""
    if folder is None:
        world = "boxes3d:n=400,size=40,min_side=2,max_side=6,seed=1"
        scenario = Scenario(world=world, planner="lrta-star", smooth=False, params={"trials": 200})
        return {"400 boxes": scenario}
    queries = json.loads((folder / "queries.json").read_text())["queries"]
    return {
        name: Scenario(
            world=str(folder / f"{name}.txt"), start=tuple(start), goal=tuple(goal),
            planner="lrta-star", smooth=False,
        )
        for name, (start, goal) in queries.items()
    }  # fmt: skip


def random_cells(part: float) -> np.ndarray:
    """Cells of which a part is blocked at random."""
    return np.random.default_rng(0).random((SIDE, SIDE)) < part


def room_cells() -> np.ndarray:
    """Rooms of 32 x 32 cells with a door of two cells in each wall."""
    rng, size = np.random.default_rng(0), 32
    cells = np.zeros((SIDE, SIDE), bool)
    for wall in range(size, SIDE, size):
        cells[wall] = cells[:, wall] = True
    for wall in range(size, SIDE, size):
        for room in range(0, SIDE, size):
            door, other = rng.integers(2, size - 2, 2) + room
            cells[wall, door : door + 2] = cells[other : other + 2, wall] = False
    return cells


def grids(folder: Path) -> dict[str, Scenario]:
    """Grid maps of 512 x 512 for A*, from corner to corner, by name."""
    kinds = {
        "10 % blocked": random_cells(0.1), "20 % blocked": random_cells(0.2), "rooms": room_cells()
    }  # fmt: skip
    found = {}
    for name, cells in kinds.items():
        cells[:2, :2] = cells[-2:, -2:] = False
        rows = ["".join(".@"[int(cell)] for cell in row) for row in cells]
        path = folder / f"{name.split()[0]}.map"
        path.write_text("\n".join(["type octile", f"height {SIDE}", f"width {SIDE}", "map", *rows]))
        found[name] = Scenario(
            world=str(path), start=(0.5, 0.5), goal=(SIDE - 0.5, SIDE - 0.5), planner="a-star",
            params={"cell": 1.0, "diagonals": True}, smooth=False,
        )  # fmt: skip
    return found


def recorded(scenario: Scenario, folder: Path) -> tuple[Events, float, float]:
    """Run once with everything recorded; return the log, and seconds in kernels and of planning."""
    run, memory = Run(scenario), Memory()
    path = folder / "run.mcap"
    path.unlink(missing_ok=True)
    metrics = run.execute([BackgroundSink(McapSink(path, run.manifest, run.problem.world)), memory])
    inside = 0
    for batch in memory.batches:
        # Those of the two ends are written by Python.
        tables = [table for kind, table in batch.tables.items() if kind not in ENDS]
        inside += max(int(t["t"][-1]) for t in tables) - min(int(t["t"][0]) for t in tables)
    return memory.events(), inside / 1e9, float(metrics.as_dict()["plan_time_s"])


def measure(name: str, scenario: Scenario, counted: Kind, folder: Path, runs: int) -> None:
    """Run a few times and print a line."""
    found = [recorded(scenario, folder) for _ in range(runs)]
    log, inside, whole = found[0][0], min(f[1] for f in found), min(f[2] for f in found)
    n, length = len(log[counted]), float(log[Kind.PATH]["cost"][0])
    print(
        f"{name:14}{n:8}{len(log):9}{length:10.2f}{inside * 1e3:10.3f}{n / inside:13,.0f}"
        f"{whole * 1e3:10.3f}",
        flush=True,
    )


def main() -> None:
    """Measure and print two tables."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--maps", type=Path)
    parser.add_argument("--runs", type=int, default=5)
    options = parser.parse_args()
    head = f"{'events':>9}{'length':>10}{'kernel ms':>10}{'a second':>13}{'whole ms':>10}"
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        print(f"{'LRTA*':14}{'moves':>8}{head}")
        for course, scenario in courses(options.maps).items():
            measure(course, scenario, Kind.MOVE, folder, options.runs)
        print(f"{'A*':14}{'cells':>8}{head}")
        for grid, scenario in grids(folder).items():
            measure(grid, scenario, Kind.EXPAND, folder, options.runs)


if __name__ == "__main__":
    main()
