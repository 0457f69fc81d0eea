"""Each planner of OMPL: what is recorded is its data, and all that reads recordings reads it."""

from pathlib import Path
from typing import Any

import pytest

import brrt

pytest.importorskip("ompl")

from tests.support.ompl_problems import (
    PLANNERS,
    iterations,
    planner_graph,
    point_setup,
    recorded_graph,
)

WORLD = brrt.make_world("circles2d:n=30,seed=4")


def _request(planner: str, count: int) -> Any:
    return 0.1 if planner in ("PRM", "PRMstar") else iterations(count)


@pytest.mark.parametrize("exact", [False, True])
@pytest.mark.parametrize("planner", PLANNERS)
def test_recording_is_planner_data(tmp_path: Path, planner: str, exact: bool) -> None:
    """The rebuilt graph equals PlannerData, and no rule falsely accuses the planner."""
    setup = point_setup(planner, WORLD)
    count = 150 if exact else 1200
    with brrt.ompl.record(setup, tmp_path / "run.mcap", world=WORLD, exact=exact):
        try:
            setup.solve(_request(planner, count))
        except brrt.BrrtError as error:
            assert planner == "AORRTC", error  # of which OMPL tells paths only
            return
    recording = brrt.read(tmp_path / "run.mcap")
    assert recorded_graph(recording) == planner_graph(setup)
    found = brrt.verify(recording)
    assert not found.findings, str(found)
    solved = setup.getProblemDefinition().hasExactSolution()
    assert (recording.result or {})["status"] == ("solved" if solved else "iteration limit")
    if solved:
        cost = (recording.result or {})["path_cost"]
        assert cost == pytest.approx(setup.getSolutionPath().length())


@pytest.mark.parametrize(
    "planner", ["RRTConnect", "RRTstar", "BITstar", "BFMT", "PRM", "LBKPIECE1"]
)
def test_recordings_are_read(tmp_path: Path, planner: str) -> None:
    """Snapshots, comparison, explanation and transcript take what OMPL did."""
    setup = point_setup(planner, WORLD)
    with brrt.ompl.record(setup, tmp_path / "run.mcap", world=WORLD):
        setup.solve(_request(planner, 600))
    recording = brrt.read(tmp_path / "run.mcap")
    assert recording.manifest.scenario.planner == f"ompl:{planner}"
    assert recording.manifest.scenario.params
    assert brrt.compare(recording, recording).equal
    assert str(brrt.explain(recording))
    assert brrt.transcript(recording)
    half = len(recording.events()) // 2
    assert len(brrt.snapshot(recording, event=half).events) <= half + 1


def test_rrt_times_are_its_own(tmp_path: Path) -> None:
    """Read at growing intervals or in each iteration: the same edges in the same iterations."""
    logs = []
    for exact in (False, True):
        setup = point_setup("RRT", WORLD, seed=5, step=2.0)
        with brrt.ompl.record(setup, tmp_path / f"{exact}.mcap", world=WORLD, exact=exact):
            setup.solve(iterations(400))
        events = brrt.read(tmp_path / f"{exact}.mcap").events()
        logs.append([(e["iteration"], e["node"], e["parent"]) for e in events[brrt.Kind.EDGE]])
    assert len(logs[0]) > 100
    assert logs[0] == logs[1]


def test_a_recorded_planner_does_the_same(tmp_path: Path) -> None:
    """Recording changes no tree, not even of planners that use motions which are partly free."""
    for planner in ("RRT", "RRTstar", "BITstar", "KPIECE1", "BKPIECE1", "LBKPIECE1"):
        graphs = []
        for records in (False, True):
            setup = point_setup(planner, WORLD, seed=9)
            if records:
                with brrt.ompl.record(setup, tmp_path / "run.mcap"):
                    setup.solve(iterations(300))
            else:
                setup.solve(iterations(300))
            graphs.append(planner_graph(setup))
        assert graphs[0] == graphs[1], planner


def test_improving_paths(tmp_path: Path) -> None:
    """Each better path is recorded while the planner goes on."""
    setup = point_setup("RRTstar", WORLD)
    with brrt.ompl.record(setup, tmp_path / "run.mcap", world=WORLD, exact=True):
        setup.solve(iterations(600))
    costs = brrt.read(tmp_path / "run.mcap").events()[brrt.Kind.PATH]["cost"]
    assert len(costs) > 1
    assert (costs[1:] < costs[:-1]).all()


def test_verify_finds_what_a_coarse_check_lets_through(tmp_path: Path) -> None:
    """Edges and path of OMPL's own, judged by other geometry."""
    world = brrt.make_world("circles2d:n=400,min_radius=0.3,max_radius=0.5,seed=2")
    setup = point_setup("RRT", world, step=20.0, margin=0.0, resolution=0.05)
    with brrt.ompl.record(setup, tmp_path / "run.mcap", world=world):
        setup.solve(iterations(300))
    broken = {
        each.rule for each in brrt.verify(brrt.read(tmp_path / "run.mcap")).results if each.broken
    }
    assert "edges free" in broken
    assert broken <= {"edges free", "paths free"}
