"""Paths on real grid maps, compared with their authors' lengths and with lower bounds."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from numpy.typing import NDArray

from brrt import Memory, Run, Scenario
from brrt.worlds import Grid, World, make_world

GRIDS = Path(__file__).parents[3] / "shared" / "worlds" / "movingai"
Floats = NDArray[np.float64]

EVERY = pytest.mark.parametrize(
    "path", sorted(GRIDS.glob("*.scen")) or [Path()], ids=lambda p: p.stem
)


def lengths(path: Path) -> list[float]:
    """The stated lengths of a file of scenarios: 8 directions, corners not cut."""
    if not path.name:
        pytest.skip("no grid maps here")
    return [float(line.split()[-1]) for line in path.read_text().splitlines()[1:] if line.strip()]


def planned(world: str, planner: str, **settings: Any) -> dict[str, Any]:
    """The figures of a run."""
    scenario = Scenario(world=world, planner=planner, **settings)
    return Run(scenario).execute([Memory()]).as_dict()


@EVERY
def test_a_star_finds_the_stated_optima(path: Path) -> None:
    """By default, on every scenario that there is, to 1e-3."""
    for number, length in enumerate(lengths(path)):
        figures = planned(f"{path}#{number}", "a-star", smooth=False)
        assert figures["path_cost"] == pytest.approx(length, abs=1e-3)


def taut(world: World) -> float:
    """The infimum of the lengths of all paths from start to goal, over corners of cells.

    A path off the lattice passes right by a corner from which a path of cell centres keeps half a
    cell, so it may be much shorter than the stated length: a single blocked cell between start
    and goal makes 2 of sqrt(2). The factor of 1.0824 between paths on a lattice and straight ones
    is for lattices whose points lie on the corners (Nash 2012).
    """
    assert world.grid is not None
    assert world.start is not None
    assert world.goal is not None
    edged = np.pad(world.grid.cells, 1, constant_values=True)
    solid, corners = _solid(edged)
    points = np.concatenate([[world.start, world.goal], corners])
    distance = np.where(np.arange(len(points)) == 0, 0.0, np.inf)
    waiting = np.ones(len(points), bool)
    while waiting[1] and (distance[waiting] < np.inf).any():
        i = int(np.where(waiting, distance, np.inf).argmin())
        waiting[i] = False
        rest = np.flatnonzero(waiting)
        ways = np.stack([np.broadcast_to(points[i], (len(rest), 2)), points[rest]], axis=1)
        seen = rest[~shapely.intersects(solid, shapely.linestrings(ways))]
        reach = distance[i] + np.hypot(*(points[seen] - points[i]).T)
        distance[seen] = np.minimum(distance[seen], reach)
    return float(distance[1])


def _solid(edged: NDArray[np.bool_]) -> tuple[Any, Floats]:
    """The blocked cells of an edged map, a hair smaller, and the corners where paths turn."""
    around = np.sum(
        [
            edged[a : len(edged) - 1 + a, b:][:, : edged.shape[1] - 1]
            for a in (0, 1)
            for b in (0, 1)
        ],
        axis=0,
    )
    knots = (around == 2) & (edged[:-1, :-1] == edged[1:, 1:])
    y, x = np.nonzero(edged)
    cells = shapely.union_all(shapely.box(x - 1, y - 1, x, y))
    # Where two cells meet at a corner alone, nothing slips through.
    y, x = np.nonzero(knots)
    bolts = shapely.union_all(shapely.box(x - 1e-5, y - 1e-5, x + 1e-5, y + 1e-5))
    solid = shapely.union(cells.buffer(-1e-6, join_style="mitre"), bolts)
    shapely.prepare(solid)
    return solid, np.argwhere(around == 1)[:, ::-1].astype(np.float64)


def test_the_shortest_path_of_all() -> None:
    """Right by a corner; around two cells that meet at one; straight where nothing is between."""
    for rows, start, goal, length in (
        (".@|..", (0, 0), (1, 1), 2**0.5), ("..|..", (0, 0), (1, 0), 1.0),
        (".@.|...", (0, 0), (2, 0), 1 + 2 * 0.5**0.5), (".@.|@..|...", (0, 0), (2, 0), np.inf),
        ("..@.|.@..|....", (0, 0), (3, 0), 2.5**0.5 + 1 + 4.5**0.5),
    ):  # fmt: skip
        cells = np.array([[c == "@" for c in row] for row in rows.split("|")])
        ends = np.array([start, goal]) + 0.5
        assert taut(World.of_grid("", Grid(cells, np.zeros(2), 1.0), *ends)) == pytest.approx(
            length
        )


@EVERY
@pytest.mark.parametrize("planner", ["rrt-star", "rrt-connect"])
def test_no_path_is_shorter_than_there_can_be(path: Path, planner: str) -> None:
    """However long it is improved and smoothed; and the stated length is not shorter either."""
    params = {"informed": True} if planner == "rrt-star" else {}
    solved = 0
    for number in np.linspace(0, len(lengths(path)) - 1, 4).astype(int):
        spec = f"{path}#{number}"
        figures = planned(spec, planner, params=params, iterations=4000, shortcuts=300)
        shortest = taut(make_world(spec))
        assert lengths(path)[number] >= shortest - 1e-3
        for cost in (figures["path_cost"], figures["smoothed_cost"]):
            if cost is not None:
                assert cost >= shortest * (1 - 1e-12)
                solved += 1
    assert solved
