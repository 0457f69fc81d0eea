"""The default step of rrt-star and bi-rrt-star: part of the world's side, or from its free space.

    python benchmarks/star_step.py [--seeds 5] [--iterations 20000] [--worlds FOLDER] [--only NAME]

For each map a row of rrt-connect, and of each star planner with a step of 20 % of the world's
longest side (the default before) and with its own default: solved of how many seeds, and the
medians of the path's cost, unsmoothed, and of the time. Maps that FOLDER does not have are left
out.
"""

import argparse
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from statistics import median

import numpy as np

from brrt import Run, Scenario, World
from brrt.worlds.generators.mazes import spanning_tree
from brrt.worlds.occupancy import Grid

FORMER = 0.2
GRIDS = (
    (100, 0.1), (100, 0.2), (200, 0.1), (200, 0.15), (300, 0.1), (300, 0.15), (512, 0.05),
    (512, 0.1),
)  # fmt: skip
GENERATED = (
    "empty2d", "circles2d", "circles2d:n=200", "circles2d:n=400,size=200", "squares2d",
    "polygons2d", "forest2d", "walls2d",
    "passage2d", "bugtrap2d", "maze2d", "rooms2d", "spiral2d", "boxes3d",
    "boxes3d:n=400", "maze3d", "tower3d", "hurdles3d",
)  # fmt: skip
FILES = (
    "movingai/arena.map", "movingai/den312d.map", "movingai/maze-32-32-2.map",
    "movingai/random-32-32-20.map", "ros_maps/tb3_sandbox.yaml", "ros_maps/TenByTen.yaml",
)  # fmt: skip


def random_grid(side: int, part: float) -> Grid:
    """Cells of which a part is blocked at random."""
    cells = np.random.default_rng(0).random((side, side)) < part
    cells[:3, :3] = cells[-3:, -3:] = False
    return Grid(cells, np.zeros(2), 1.0)


def maze_grid(rooms: int, width: int) -> Grid:
    """A maze whose corridors are some cells wide and whose walls are one."""
    pairs = spanning_tree((rooms, rooms), np.random.default_rng(0))
    side = rooms * (width + 1) + 1
    cells = np.ones((side, side), bool)
    corners = 1 + (width + 1) * np.stack(np.unravel_index(np.arange(rooms**2), (rooms,) * 2), 1)
    for row, column in corners:
        cells[row : row + width, column : column + width] = False
    for one, other in pairs:
        (low, left), (high, right) = np.sort(corners[[one, other]], axis=0)
        cells[low : high + width, left : right + width] = False
    return Grid(cells, np.zeros(2), 1.0)


def worlds(folder: Path) -> Iterator[tuple[str, World | str]]:
    """Yield names and worlds."""
    for side, part in GRIDS:
        yield f"grid {side}, {part:.0%} blocked", World.of_grid("grid", random_grid(side, part))
    for rooms, width in ((6, 1), (8, 2), (8, 8)):
        yield f"maze {rooms}, {width} wide", World.of_grid("maze", maze_grid(rooms, width))
    yield from ((name, name) for name in GENERATED)
    yield from ((name, str(folder / name)) for name in FILES if (folder / name).exists())


def made(scenario: Scenario, world: World | str) -> Run:
    """Make a run in a world, or in that of the scenario."""
    return Run(scenario, world=None if isinstance(world, str) else world)


def row(scenario: Scenario, world: World | str, seeds: int) -> str:
    """Run all seeds; return solved, cost and time."""
    figures = []
    for seed in range(seeds):
        run = made(replace(scenario, seed=seed), world)
        figures.append(run.execute().as_dict())
    solved = [f for f in figures if f["solved"]]
    cost = f"{median(f['path_cost'] for f in solved):.4g}" if solved else "-"
    seconds = median(f["plan_time_s"] for f in figures)
    return f"{len(solved)}/{seeds} {cost:>6} {seconds:6.2f} s"


def main() -> None:
    """Measure every map and print a table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--iterations", type=int, default=20_000)
    parser.add_argument("--worlds", type=Path, default=Path("../shared/worlds"))
    parser.add_argument("--only", default="", help="a part of the names of the maps to measure")
    options = parser.parse_args()
    heads = ("rrt-connect", "rrt-star, 20 %", "rrt-star", "bi-rrt-star, 20 %", "bi-rrt-star")
    print(f"{'map':32}" + "".join(f"{head:>22}" for head in heads))
    for name, world in worlds(options.worlds):
        if options.only not in name:
            continue
        ends = {} if isinstance(world, str) else {"start": (1.5, 1.5), "goal": world.upper - 1.5}
        if name in FILES:
            ends = {"start": "random", "goal": "random"}
        base = {"world": world if isinstance(world, str) else world.name, "smooth": False, **ends}
        cells = []
        for planner in ("rrt-connect", "rrt-star", "bi-rrt-star"):
            given = base | {"planner": planner, "iterations": options.iterations}
            if planner != "rrt-connect":
                extent = made(Scenario.parse(given), world).problem.world.extent
                former = given | {"params": {"step": FORMER * extent}}
                cells.append(row(Scenario.parse(former), world, options.seeds))
            cells.append(row(Scenario.parse(given), world, options.seeds))
        print(f"{name:32}" + "".join(f"{cell:>22}" for cell in cells), flush=True)


if __name__ == "__main__":
    main()
