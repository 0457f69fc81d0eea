"""`brrt.ompl.record`: several solves, errors, spaces, goals, and what is left behind."""

import math
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import brrt

pytest.importorskip("ompl")

from ompl import base, geometric

from tests.support.ompl_problems import (
    iterations,
    planner_graph,
    point_setup,
    recorded_graph,
)

WORLD = brrt.make_world("circles2d:n=30,seed=4")


def test_each_solve_is_a_recording(tmp_path: Path) -> None:
    """The second one begins with the tree as it is."""
    setup = point_setup("RRTstar", WORLD)
    with brrt.ompl.record(setup, tmp_path / "run.mcap", world=WORLD) as session:
        setup.solve(iterations(200))
        first = planner_graph(setup)
        setup.solve(iterations(200))
    assert [file.name for file in session.files] == ["run.mcap", "run-2.mcap"]
    assert recorded_graph(brrt.read(session.files[0])) == first
    second = brrt.read(session.files[1])
    assert recorded_graph(second) == planner_graph(setup)
    assert not brrt.verify(second).findings
    setup.solve(iterations(10))
    assert len(session.files) == 2


def test_everything_is_put_back(tmp_path: Path) -> None:
    """After the `with` statement OMPL is as before."""
    setup = point_setup("RRT", WORLD)
    setup.setup()
    information, solve = setup.getSpaceInformation(), geometric.SimpleSetup.solve
    validator = information.getMotionValidator()
    with brrt.ompl.record(setup, tmp_path / "run.mcap"):
        setup.solve(iterations(20))
        assert geometric.SimpleSetup.solve is not solve
    assert geometric.SimpleSetup.solve is solve
    assert information.getMotionValidator() is validator
    assert information.isSetup()


def test_a_planner_with_its_problem(tmp_path: Path) -> None:
    """`Planner.solve` is recorded as `SimpleSetup.solve` is."""
    setup = point_setup("RRTConnect", WORLD)
    setup.setup()
    planner = setup.getPlanner()
    with brrt.ompl.record(planner, tmp_path / "run.mcap", world=WORLD):
        planner.solve(iterations(500))
    assert recorded_graph(brrt.read(tmp_path / "run.mcap")) == planner_graph(setup)


@pytest.mark.parametrize("planner", ["RRTstar", "PRM", "KPIECE1"])
@pytest.mark.parametrize("kind", [ValueError, KeyboardInterrupt])
def test_exceptions_interrupt(tmp_path: Path, planner: str, kind: type[BaseException]) -> None:
    """They are passed on; the recording has what was there, and says that it was interrupted."""
    setup = point_setup(planner, WORLD)
    information = setup.getSpaceInformation()
    setup.setup()
    inner, calls = information.getMotionValidator(), [0]

    class Failing(base.MotionValidator):  # type: ignore[misc]
        def checkMotion(self, a: Any, b: Any) -> bool:  # noqa: N802
            calls[0] += 1
            if calls[0] > 150:
                raise kind("mine")
            return bool(inner.checkMotion(a, b))

    information.setMotionValidator(Failing(information))
    information.setup()
    request = 5.0 if planner == "PRM" else iterations(5000)
    with (
        pytest.raises(kind, match="mine"),
        brrt.ompl.record(setup, tmp_path / "run.mcap", world=WORLD),
    ):
        setup.solve(request)
    recording = brrt.read(tmp_path / "run.mcap")
    assert (recording.result or {})["status"] == "interrupted"
    assert not brrt.verify(recording).findings


def test_time_limit_and_pauses(tmp_path: Path) -> None:
    """The recorder's own time counts neither in the events nor for the limit."""
    setup = point_setup("RRTstar", WORLD)
    with brrt.ompl.record(setup, tmp_path / "run.mcap", exact=True):
        setup.solve(0.05)
    recording = brrt.read(tmp_path / "run.mcap")
    last = max(int(table["t"].max()) for table in recording.events().tables.values())
    assert 0.04e9 < last < 0.2e9
    assert recording.manifest.scenario.time == 0.05


def test_without_a_world_nothing_is_said_of_collisions(tmp_path: Path) -> None:
    """Rules about collisions are named as not judged."""
    setup = point_setup("RRT", WORLD)
    with brrt.ompl.record(setup, tmp_path / "run.mcap"):
        setup.solve(iterations(200))
    found = brrt.verify(brrt.read(tmp_path / "run.mcap"))
    assert "edges free" in found.not_judged["the world is not known"]
    assert not found.findings


def _pose_setup(planner: str, space: Any, start: Any, goal: Any) -> Any:
    setup = geometric.SimpleSetup(space)
    setup.setStateValidityChecker(lambda state: True)
    setup.setStartAndGoalStates(start, goal, 0.3)
    setup.setPlanner(getattr(geometric, planner)(setup.getSpaceInformation()))
    return setup


def _pose(space: Any, x: float, y: float, yaw: float) -> Any:
    state = base.SpaceInformation(space).allocState()
    state.setX(x)
    state.setY(y)
    state.setYaw(yaw)
    return state


@pytest.mark.parametrize("kind", ["SE2StateSpace", "DubinsStateSpace"])
@pytest.mark.parametrize("planner", ["RRTConnect", "RRTstar"])
def test_poses(tmp_path: Path, kind: str, planner: str) -> None:
    """An angle wraps; costs are those of the space, which the recording claims."""
    space = getattr(base, kind)()
    space.setBounds(_bounds(2, 10.0))
    setup = _pose_setup(planner, space, _pose(space, 1, 1, 3.0), _pose(space, 9, 9, -3.0))
    with brrt.ompl.record(setup, tmp_path / "run.mcap"):
        setup.solve(iterations(300))
    recording = brrt.read(tmp_path / "run.mcap")
    claims = recording.manifest.claims
    assert claims.costs == "own"
    assert claims.motions == ("straight" if kind == "SE2StateSpace" else "own")
    assert recorded_graph(recording) == planner_graph(setup, 3)
    assert not brrt.verify(recording).findings
    if kind == "SE2StateSpace":
        length = setup.getSolutionPath().length()
        assert (recording.result or {})["path_cost"] == pytest.approx(length)


def test_a_body_in_a_world(tmp_path: Path) -> None:
    """Poses of SE(2) are configurations of a polygon."""
    world = brrt.make_world("rooms2d")
    space = base.SE2StateSpace()
    space.setBounds(_bounds(2, float(world.upper.max())))
    assert world.start is not None
    x, y = world.start.tolist()
    start = _pose(space, x, y, 0.0)
    setup = _pose_setup("RRTConnect", space, start, _pose(space, x + 0.5, y + 0.5, 0.0))
    robot = brrt.make_robot("polygon:length=0.2,width=0.1")
    with brrt.ompl.record(setup, tmp_path / "run.mcap", world=world, robot=robot):
        setup.solve(iterations(100))
    recording = brrt.read(tmp_path / "run.mcap")
    assert recording.robot().kind == "polygon"
    judged = {each.rule for each in brrt.verify(recording).results if each.examined}
    assert "edges free" in judged


def _bounds(dim: int, high: float) -> Any:
    bounds = base.RealVectorBounds(dim)
    bounds.setLow(0.0)
    bounds.setHigh(high)
    return bounds


@pytest.mark.parametrize("planner", ["RRT", "RRTConnect", "RRTstar", "PRM", "BFMT"])
def test_compound_and_other_spaces(tmp_path: Path, planner: str) -> None:
    """Subspaces are read one after the other."""
    space, plane = base.CompoundStateSpace(), base.RealVectorStateSpace(2)
    plane.setBounds(0.0, 1.0)
    space.addSubspace(plane, 1.0)
    space.addSubspace(base.SO2StateSpace(), 0.5)
    state = [base.SpaceInformation(space).allocState() for _ in range(2)]
    for each, at, angle in zip(state, (0.1, 0.9), (3.0, -3.0), strict=True):
        each[0][0] = each[0][1] = at
        each[1].value = angle
    setup = _pose_setup(planner, space, *state)
    with brrt.ompl.record(setup, tmp_path / "run.mcap"):
        setup.solve(0.1 if planner == "PRM" else iterations(200))
    recording = brrt.read(tmp_path / "run.mcap")
    assert recording.manifest.start == (0.1, 0.1, 3.0)
    assert recorded_graph(recording) == planner_graph(setup, 3)
    assert not brrt.verify(recording).findings
    edges = recording.events()[brrt.Kind.EDGE]
    if planner == "RRT":
        far = np.abs(np.diff(edges["q"][:, 2]))
        step = np.minimum(far, 2 * math.pi - far)
        assert len(step)


def test_seven_numbers(tmp_path: Path) -> None:
    """R^7 is a robot that is not known, with a Euclidean metric."""
    space = base.RealVectorStateSpace(7)
    space.setBounds(-1.0, 1.0)
    state = [base.SpaceInformation(space).allocState() for _ in range(2)]
    for k in range(7):
        state[0][k], state[1][k] = -0.5, 0.5
    setup = _pose_setup("RRTConnect", space, *state)
    with brrt.ompl.record(setup, tmp_path / "run.mcap", world=WORLD):
        setup.solve(iterations(200))
    recording = brrt.read(tmp_path / "run.mcap")
    assert recording.robot().kind == "opaque"
    assert recording.manifest.claims.costs == "length"
    assert not brrt.verify(recording).findings


def test_other_objectives(tmp_path: Path) -> None:
    """Costs are those of the objective, which the recording claims."""
    setup = point_setup("RRTstar", WORLD)

    class Uphill(base.OptimizationObjective):  # type: ignore[misc]
        def stateCost(self, s: Any) -> Any:  # noqa: N802
            return base.Cost(1.0)

        def motionCost(self, a: Any, b: Any) -> Any:  # noqa: N802
            return base.Cost(abs(a[0] - b[0]) + 3 * abs(a[1] - b[1]))

    objective = Uphill(setup.getSpaceInformation())
    setup.setOptimizationObjective(objective)
    with brrt.ompl.record(setup, tmp_path / "run.mcap", world=WORLD):
        setup.solve(iterations(500))
    recording = brrt.read(tmp_path / "run.mcap")
    assert recording.manifest.claims.costs == "own"
    assert not brrt.verify(recording).findings
    q = np.asarray(recording.events()[brrt.Kind.PATH]["waypoints"][-1]).reshape(-1, 2)
    steps = np.abs(np.diff(q, axis=0)) @ [1, 3]
    assert (recording.result or {})["path_cost"] == pytest.approx(steps.sum())


def test_goal_regions(tmp_path: Path) -> None:
    """A region has no configuration; somebody must name one."""

    class Right(base.GoalRegion):  # type: ignore[misc]
        def distanceGoal(self, state: Any) -> float:  # noqa: N802
            return float(max(0.0, 90 - state[0]))

    setup = point_setup("RRT", WORLD)
    region = Right(setup.getSpaceInformation())
    region.setThreshold(1.0)
    setup.setGoal(region)
    with (
        pytest.raises(brrt.BrrtError, match="goal must be given"),
        brrt.ompl.record(setup, tmp_path / "run.mcap"),
    ):
        setup.solve(iterations(10))
    with brrt.ompl.record(setup, tmp_path / "run.mcap", world=WORLD, goal=WORLD.goal):
        setup.solve(iterations(1000))
    recording = brrt.read(tmp_path / "run.mcap")
    assert recording.manifest.claims.goal_tolerance > 100
    assert not brrt.verify(recording).findings


def test_errors(tmp_path: Path) -> None:
    """One line each; planning ends at once if it cannot be recorded."""
    setup = point_setup("RRT", WORLD)
    with pytest.raises(brrt.BrrtError, match=r"ends in \.mcap"):
        brrt.ompl.record(setup, tmp_path / "run.rrd")
    with pytest.raises(brrt.BrrtError, match="SimpleSetup or a planner"):
        brrt.ompl.record("RRT", tmp_path / "run.mcap")
    with (
        pytest.raises(
            brrt.BrrtError, match=r"cannot be written|No such|not a folder|does not exist"
        ),
        brrt.ompl.record(setup, tmp_path / "none" / "run.mcap"),
    ):
        setup.solve(60.0)  # ends at once
    wall = brrt.World("wall", WORLD.lower, WORLD.upper, boxes=np.array([[0, 0, 20, 20]]))
    with (
        pytest.raises(brrt.BrrtError, match=r"start .* is in collision"),
        brrt.ompl.record(setup, tmp_path / "run.mcap", world=wall),
    ):
        setup.solve(60.0)


def test_starts_that_are_not_valid(tmp_path: Path) -> None:
    """There is no recording of a planner without a start."""
    setup = point_setup("RRT", WORLD)
    setup.setStateValidityChecker(lambda state: False)
    with (
        pytest.raises(brrt.BrrtError, match="nothing to record"),
        brrt.ompl.record(setup, tmp_path / "run.mcap"),
    ):
        setup.solve(0.1)


def test_import_is_lazy() -> None:
    """Neither ompl nor numba is imported before it is needed."""
    code = "import sys, brrt; brrt.ompl; print({'ompl', 'numba'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "set()"


def test_without_ompl() -> None:
    """The message names the remedy."""
    code = (
        "import sys; sys.modules['ompl'] = None\n"
        "import brrt\n"
        "try: brrt.ompl.record(None, 'run.mcap')\n"
        "except brrt.BrrtError as error: print(error)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "pip install 'brrt[ompl]'" in done.stdout


def test_nothing_is_leaked(tmp_path: Path) -> None:
    """A script that records prints nothing at its end that it does not print without."""
    code = (
        "import brrt\n"
        "from tests.support.ompl_problems import point_setup, iterations\n"
        "def main():\n"
        "    world = brrt.make_world('circles2d:n=30,seed=4')\n"
        "    setup = point_setup('RRTstar', world)\n"
        f"    with brrt.ompl.record(setup, {str(tmp_path / 'run.mcap')!r}, world=world):\n"
        "        setup.solve(iterations(100))\n"
        "main()"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "leaked" not in done.stderr


def test_a_recorder_that_fails_ends_planning(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As on a full disk: the error is raised by `solve`, which does not use up its time."""

    def fail(*_: Any) -> None:
        raise brrt.BrrtError("the disk is full")

    setup = point_setup("RRTstar", WORLD)
    monkeypatch.setattr(brrt.Recorder, "put", fail)
    with (
        pytest.raises(brrt.BrrtError, match="the disk is full"),
        brrt.ompl.record(setup, tmp_path / "run.mcap", world=WORLD),
    ):
        setup.solve(60.0)


@pytest.mark.parametrize("planner", ["RRT", "RRTConnect", "RRTstar", "BITstar"])
def test_several_starts_and_goals(tmp_path: Path, planner: str) -> None:
    """The first start is the root, the first goal the goal; no rule minds the others."""
    setup = point_setup(planner, WORLD)
    information = setup.getSpaceInformation()
    goals = base.GoalStates(information)
    places = [(90.0, 95.0), (95.0, 90.0), (5.0, 9.0)]
    state = [information.allocState() for _ in places]
    for each, (x, y) in zip(state, places, strict=True):
        each[0], each[1] = x, y
    goals.addState(state[0])
    goals.addState(state[1])
    setup.setGoal(goals)
    setup.addStartState(state[2])
    with brrt.ompl.record(setup, tmp_path / "run.mcap", world=WORLD):
        setup.solve(iterations(600))
    recording = brrt.read(tmp_path / "run.mcap")
    assert recorded_graph(recording) == planner_graph(setup)
    found = brrt.verify(recording)
    assert {each.rule for each in found.findings} <= {"path ends"}, str(found)
