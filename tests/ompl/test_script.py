"""`brrt record` of scripts that plan with OMPL."""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from brrt import read, verify
from tests.conftest import Result

SCRIPT = """\
from ompl import base, geometric
space = base.RealVectorStateSpace(2)
space.setBounds(0.0, 10.0)
setup = geometric.SimpleSetup(space)
setup.setStateValidityChecker(lambda q: (q[0] - 5) ** 2 + (q[1] - 5) ** 2 > 4)
start, goal = (setup.getSpaceInformation().allocState() for _ in range(2))
start[0] = start[1] = 1.0
goal[0] = goal[1] = 9.0
setup.setStartAndGoalStates(start, goal)
setup.setPlanner(geometric.RRTConnect(setup.getSpaceInformation()))
print(setup.solve(5.0))
"""


def test_each_solve_of_an_unchanged_script_is_a_recording(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, brrt: Callable[..., Result]
) -> None:
    """The nested solve of the planner is part of that of its set-up."""
    pytest.importorskip("ompl")
    monkeypatch.chdir(tmp_path)
    Path("plan.py").write_text(SCRIPT)
    plain = subprocess.run([sys.executable, "plan.py"], capture_output=True, text=True, check=True)
    done = brrt("record", "plan.py")
    # OMPL's seed and times differ.
    assert (done.code, done.out.splitlines()[-1]) == (0, plain.stdout.splitlines()[-1])
    assert done.err.splitlines()[-1].startswith("brrt: plan-1.mcap: ")
    assert [path.name for path in tmp_path.glob("*.mcap")] == ["plan-1.mcap"]
    recording = read("plan-1.mcap")
    assert recording.manifest.scenario.planner == "ompl:RRTConnect"
    assert recording.result is not None
    assert recording.result["solved"]
    assert verify(recording).holds
