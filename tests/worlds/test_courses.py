"""The seven course maps, planned by LRTA* and RRT; skipped if they are missing."""

import json
from pathlib import Path

import numpy as np
import pytest

from brrt import Kind, Memory, Run, Scenario
from tests.conftest import findings_of

MAPS = Path(__file__).parents[3] / "shared" / "worlds" / "ece276b"
QUERIES = MAPS / "queries.json"
NAMES = sorted(json.loads(QUERIES.read_text())["queries"]) if QUERIES.exists() else []
CELL = 0.5

pytestmark = pytest.mark.skipif(not NAMES, reason="no course maps here")


def driven(name: str, planner: str) -> tuple[Run, Memory, dict[str, object]]:
    """Plan and execute a course map as the published run did."""
    start, goal = json.loads(QUERIES.read_text())["queries"][name]
    classic = {"cell": CELL, "diagonals": False, "lookahead": 1}
    run, memory = Run(
        Scenario(
            world=str(MAPS / f"{name}.txt"), start=tuple(start), goal=tuple(goal), planner=planner,
            params=classic if planner == "lrta-star" else {}, execute=True,
        )
    ), Memory()  # fmt: skip
    return run, memory, run.execute([memory]).as_dict()


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("planner", ["lrta-star", "rrt"])
def test_course(planner: str, name: str) -> None:
    """Solved in time, by moves of at most 1 from start to goal; verification passes."""
    run, memory, figures = driven(name, planner)
    events = memory.events()
    assert figures["solved"]
    assert figures["deadline_misses"] == 0
    assert figures["charged_moves"] == figures["moves"] == len(events[Kind.MOVE])
    moves = events[Kind.MOVE]
    way = np.array([run.manifest.start, *moves["q"]])
    assert np.linalg.norm(np.diff(way, axis=0), axis=1).max() <= 1 + 1e-12
    assert way[-1].tolist() == list(run.manifest.goal)
    assert findings_of(run.manifest, run.problem.world, events) == []


@pytest.mark.parametrize("name", NAMES)
def test_lrta_star_goes_cell_by_cell(name: str) -> None:
    """LRTA* moves 0.5 each time, then once to the goal; one path length is known exactly."""
    _, _, figures = driven(name, "lrta-star")
    path = np.array(figures["path"])
    hop = float(np.linalg.norm(path[-1] - path[-2]))
    assert hop <= 1
    moves, cost = len(path) - 1, figures["path_cost"]
    assert figures["moves"] == moves
    assert cost == pytest.approx(CELL * (moves - 1) + hop, rel=1e-12)
    if name == "single_cube":
        assert (moves, round(float(str(cost)), 3)) == (27, 13.755)
