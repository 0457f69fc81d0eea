"""The widest path from start to goal, and bodies that do not fit."""

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from brrt import (
    Polygon,
    Scenario,
    World,
    make_world,
)
from brrt.explanation.clearance import ClearanceSearch
from brrt.explanation.summary import RunSummary
from brrt.scenario.manifest import Manifest
from tests.conftest import Result
from tests.support.explanations import explained

Command = Callable[..., Result]


BODY = "polygon:length=8,width=7"


@pytest.mark.parametrize(
    "world", [["--world", "passage2d:gap=6"], ["--world", "polygons2d:n=25"]], ids=["gap", "room"]
)
def test_a_body_that_is_too_wide(world: list[str], brrt: Command) -> None:
    """The only advice is to plot the world."""
    brrt("plan", *world, "--robot", BODY, "--iterations", 1500, "--out", "run.mcap")
    found = brrt("explain", "run.mcap", "--json").json
    assert found["body"] == pytest.approx(7)
    assert found["widest"] < 7
    (advice,) = found["advice"]
    assert "fits through: it is at least 7 wide, and the widest path" in advice["why"]
    assert advice["command"] == "brrt plot run.mcap --out run-1.png"


@settings(max_examples=6)
@given(st.sampled_from([7.1, 7.6, 9]), st.floats(-3, 3), st.floats(-3, 3))
def test_a_body_that_fits_is_not_too_wide(gap: float, dx: float, dy: float) -> None:
    """Wherever its reference point lies, a passage that it fits is not too narrow."""
    body = np.add([[-4, -3.5], [4, -3.5], [4, 3.5], [-4, 3.5]], [dx, dy])
    robot = Polygon(parts=(body, body[:3] / 2))
    world = make_world(f"passage2d:gap={gap}")
    start, goal = np.array([12.0, 50.0, 0]), np.array([88.0, 50.0, 0])
    middle = float(world.boxes[:, 1].max() - gap / 2)
    way = np.array([start, [12, middle - dy, 0], [88, middle - dy, 0], goal])
    free = all(
        robot.collision(world, q) is None
        for a, b in pairwise(way)
        for q in robot.interpolate(a, b, np.linspace(0, 1, 40))
    )
    ends = tuple(start.tolist()), tuple(goal.tolist())
    summary = RunSummary(Manifest(Scenario(), *ends, dim=2, dof=3, epoch_ns=0, made_by={}), robot)
    found = ClearanceSearch(world, robot, summary).find(start, goal, 5.0)
    assert found.body == pytest.approx(7)
    assert free
    assert not found.too_narrow
    assert found.connected


def test_a_walled_off_goal(brrt: Command) -> None:
    """No longer search is advised, only a plot."""
    boxes = np.array([[60, 60, 95, 62], [60, 93, 95, 95], [60, 60, 62, 95], [93, 60, 95, 95]])
    ends = {"start": np.array([5.0, 5.0]), "goal": np.array([80.0, 80.0])}
    World("walled", np.zeros(2), np.full(2, 100.0), boxes=boxes, **ends).save("walled.json")  # type: ignore[arg-type]
    brrt("plan", "--world", "walled.json", "--iterations", 500, "--out", "run.mcap")
    found = brrt("explain", "run.mcap", "--json").json
    assert [each["command"] for each in found["advice"]] == ["brrt plot run.mcap --out run-1.png"]
    assert "no path exists from start to goal: obstacles" in found["advice"][0]["why"]


def test_a_corner_next_to_the_start_is_no_passage() -> None:
    """A narrowest place next to the start is named as such; in open space it is not."""
    for world, near in (("maze2d", True), ("empty2d", False), ("passage2d:gap=1", False)):
        way = dict(explained(Scenario(world=world, iterations=50, seed=1)).rows())["clearance"]
        assert ("close to the start" in way) == near


def test_cells_too_coarse_to_find_a_path(brrt: Command) -> None:
    """A hole in a wall is smaller than a cell: a longer search may find it."""
    brrt("plan", "--world", "gap3d:gap=1", "--iterations", 3000, "--out", "run.mcap")
    found = brrt("explain", "run.mcap", "--json").json
    assert found["connected"] is None
    assert 1 <= found["widest"] < 7
    assert found["advice"][0]["command"].startswith("brrt plan --from run.mcap --iterations ")
    assert "too coarse to find a path" in found["advice"][0]["why"]
