"""Moves a second of LRTA*, and the time of A* on a large grid map, recording on.

    python benchmarks/lattice.py [--maps FOLDER] [--runs 5]

FOLDER holds course maps in the boundary/block format and their queries.json; without it LRTA*
walks in a generated 3D world. Each run writes an MCAP file in a temporary folder. A figure of
LRTA* is its moves over the time from the first look to the last move, by the events' own stamps;
one of A* is the time of planning. Both are the best of the runs, on loaded kernels.
"""

import argparse
import json
import tempfile
from pathlib import Path

import numpy as np

from brrt import Events, McapSink, Memory, Run, Scenario
from brrt.events import Kind
from brrt.recording.background import Background

SIDE = 512
MANY = 10_000


def courses(folder: Path | None) -> dict[str, Scenario]:
    """Queries for LRTA*, by name."""
    if folder is None:
        world = "boxes3d:n=400,size=40,min_side=2,max_side=6,seed=1"
        return {"400 boxes": Scenario(world=world, planner="lrta-star", smooth=False)}
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
            params={"epsilon": 1.0, "diagonals": True}, smooth=False,
        )  # fmt: skip
    return found


def recorded(scenario: Scenario, folder: Path) -> Events:
    """Run once with everything recorded; return the log."""
    run, memory = Run(scenario), Memory()
    path = folder / "run.mcap"
    path.unlink(missing_ok=True)
    run.execute([Background(McapSink(path, run.manifest, run.problem.world)), memory])
    return memory.events()


def main() -> None:
    """Measure and print two tables."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--maps", type=Path)
    parser.add_argument("--runs", type=int, default=5)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        print(f"{'LRTA*':16}{'moves':>8}{'length':>10}{'ms':>9}{'moves/s':>12}")
        for course, scenario in courses(options.maps).items():
            best, log = np.inf, Events(0, {})
            for _ in range(options.runs):
                log = recorded(scenario, folder)
                took = log[Kind.MOVE]["t"][-1] - log[Kind.EXPAND]["t"][0]
                best = min(best, float(took) / 1e9)
            moves = len(log[Kind.MOVE])
            length = float(log[Kind.PATH]["cost"][0])
            # Fewer moves than this are over before the machine is warm.
            note = "" if moves >= MANY else "   (few moves)"
            print(f"{course:16}{moves:8}{length:10.2f}{best * 1e3:9.3f}{moves / best:12,.0f}{note}")
        print(f"\n{'A*, 512 x 512':16}{'cells':>8}{'length':>10}{'ms':>9}{'cells/s':>12}")
        for grid, scenario in grids(folder).items():
            best, log = np.inf, Events(0, {})
            for _ in range(options.runs):
                log = recorded(scenario, folder)
                took = log[Kind.PHASE]["t"][1] - log[Kind.PHASE]["t"][0]
                best = min(best, float(took) / 1e9)
            cells = len(log[Kind.EXPAND])
            length = float(log[Kind.PATH]["cost"][0])
            print(f"{grid:16}{cells:8}{length:10.2f}{best * 1e3:9.3f}{cells / best:12,.0f}")


if __name__ == "__main__":
    main()
