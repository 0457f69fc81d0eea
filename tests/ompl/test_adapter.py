"""`brrt record script.py` with scripts that plan by OMPL."""

from collections.abc import Callable
from pathlib import Path

import pytest

import brrt as library
from tests.conftest import Result

pytest.importorskip("ompl")

SCRIPT = """
import sys
from ompl import base as ob, geometric as og, util as ou
ou.setLogLevel(ou.LOG_NONE)

space = ob.RealVectorStateSpace(2)
space.setBounds(0.0, 10.0)
information = ob.SpaceInformation(space)
information.setStateValidityChecker(lambda s: (s[0] - 5) ** 2 + (s[1] - 5) ** 2 > 4)
start, goal = information.allocState(), information.allocState()
start[0] = start[1] = 1.0
goal[0] = goal[1] = 9.0
setup = og.SimpleSetup(information)
setup.setStartAndGoalStates(start, goal, 0.1)
setup.setPlanner(og.RRTConnect(information))
print(setup.solve(time=2.0).asString())

definition = ob.ProblemDefinition(information)
definition.setStartAndGoalStates(start, goal, 0.1)
planner = og.RRT(information)
planner.setProblemDefinition(definition)
planner.setup()
print(planner.solve(2.0).asString())


class Region(ob.GoalRegion):
    def distanceGoal(self, state):
        return max(0.0, 9 - state[0])


definition = ob.ProblemDefinition(information)
definition.addStartState(start)
region = Region(information)
region.setThreshold(0.5)
definition.setGoal(region)
planner = og.RRT(information)
planner.setProblemDefinition(definition)
planner.setup()
print(planner.solve(2.0).asString())
"""


def test_each_solve_of_a_script(brrt: Callable[..., Result], tmp_path: Path) -> None:
    """Two are recorded; of the third one there is a line, and the script does not notice."""
    from ompl import geometric

    before = geometric.SimpleSetup.solve, geometric.RRT.solve
    (tmp_path / "plan.py").write_text(SCRIPT)
    done = brrt("record", "--out", tmp_path, tmp_path / "plan.py")
    assert done.code == 0, done.err
    assert done.out.count("Exact solution") == 3
    assert "RRT.solve is not recorded: goal must be given" in done.err
    planners = []
    for number in (1, 2):
        recording = library.read(tmp_path / f"plan-{number}.mcap")
        planners.append(recording.manifest.scenario.planner)
        assert (recording.result or {})["status"] == "solved"
        assert not library.verify(recording).findings
    assert planners == ["ompl:RRTConnect", "ompl:RRT"]
    assert (geometric.SimpleSetup.solve, geometric.RRT.solve) == before
