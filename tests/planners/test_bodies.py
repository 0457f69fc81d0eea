"""Runs of robots with bodies, from planning to smoothing; real robots and published experiments."""

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from brrt import Run, Scenario, World
from brrt.robots import Chain, Polygon
from brrt.robots.chain import Joint
from tests.conftest import Result
from tests.support import naive
from tests.support.bodies import BODIES

Floats = NDArray[np.float64]

REAL = Path(__file__).parents[3] / "shared" / "worlds" / "robots"
SLICES = 100
HEAD = {"schema": "brrt.robot", "version": 1}

ROOM = "circles2d:n=6,size=20,max_radius=1.5,seed=1"


def check_path(run: Run, path: Floats) -> None:
    """A path leads from start to goal, and at each hundredth of its motions the twin is free."""
    problem = run.problem
    np.testing.assert_array_equal(path[0], problem.start)
    np.testing.assert_array_equal(path[-1], problem.goal)
    for a, b in naive.motions(path):
        Q = naive.densified(problem.robot, np.asarray(a), np.asarray(b), SLICES)
        assert naive.clearance(problem.world, problem.robot, Q).min() > 0


RUNS = {
    "polygon": Scenario(world=ROOM, robot="polygon:length=2,width=1"),
    "chain": Scenario(
        world="circles2d:n=3,size=20,max_radius=1,seed=2", robot="chain:links=3,width=0.3",
        start=(0.0, 0.5, 0.5), goal=(-1.0, -1.0, 1.0),
    ),
}  # fmt: skip


@BODIES
def test_a_run_from_end_to_end(kind: str) -> None:
    """Raw and smoothed paths are free; the cost is the length in the robot's metric."""
    run = Run(RUNS[kind])
    figures = run.execute().as_dict()
    assert figures["solved"]
    for name in ("path", "smoothed"):
        path = np.array(figures["path" if name == "path" else "smoothed_path"])
        check_path(run, path)
        cost = run.problem.robot.distance(path[:-1], path[1:]).sum()
        assert figures[f"{name}_cost"] == pytest.approx(cost)


@BODIES
def test_uncompiled_kernels(kind: str) -> None:
    """Without the compiler, the events are the same, bit for bit."""
    scenario = json.dumps(RUNS[kind].as_dict() | {"iterations": 40})
    program = (
        "import sys, json; from brrt import Memory, Run, Scenario;"
        "run, log = Run(Scenario.parse(json.loads(sys.argv[1]))), Memory();"
        "run.execute([log]);"
        "print([event['q'].tobytes().hex() for kind in ('EDGE', 'REJECT')"
        " for event in log.events()[__import__('brrt').Kind[kind]]])"
    )
    printed = [
        subprocess.run(
            [sys.executable, "-c", program, scenario],
            env={**os.environ, "NUMBA_DISABLE_JIT": word},
            capture_output=True, text=True, check=True,
        ).stdout
        for word in ("0", "1")
    ]  # fmt: skip
    assert printed[0] == printed[1]
    assert len(printed[0]) > 100


def test_a_recording_needs_no_robot_file(brrt: Callable[..., Result]) -> None:
    """The manifest has the robot's definition; a scenario finds the file in its own folder."""
    Path("robot.json").write_text(Polygon(2.0, 1.0).to_json())
    Path("run.toml").write_text(f'world = "{ROOM}"\nrobot = "robot.json"\n')
    Path("elsewhere").mkdir()
    planned = brrt("plan", "run.toml", "--json", "--out", "elsewhere/run.mcap")
    assert planned.code == 0
    Path("robot.json").unlink()
    replayed = brrt("replay", "elsewhere/run.mcap", "--json")
    assert replayed.json == planned.json
    assert brrt("replay", "elsewhere/run.mcap", "--rrd", "run.rrd").code == 0


needs_real = pytest.mark.skipif(not REAL.is_dir(), reason="no real robots here")
EXAMPLES = [
    path
    for path in sorted((Path(__file__).parents[2] / "examples").glob("*.toml"))
    if Scenario.load(path).robot != "point"
]


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_examples(path: Path) -> None:
    """Each is solved, except the unreachable one."""
    run = Run(Scenario.load(path))
    figures = run.execute().as_dict()
    assert figures["solved"] == ("unreachable" not in path.stem)
    if figures["solved"]:
        check_path(run, np.array(figures["path"]))
        check_path(run, np.array(figures["smoothed_path"]))


def real_scenario(folder: Path, name: str) -> Scenario:
    """Convert one of the real experiments to brrt's files."""
    data = json.loads((REAL / "polygon_and_chain.json").read_text())
    given, (x0, y0, x1, y1) = data["worlds"][name], data["region"]
    polygons = [
        (np.array(obstacle["polygon"], float) + obstacle["at"]).tolist()
        for obstacle in given["obstacles"]
    ]
    world = World("real", np.array([x0, y0]), np.array([x1, y1]), polygons=tuple(polygons))
    robot = {key: value for key, value in given["robot"].items() if key != "kind"}
    (folder / "robot.json").write_text(
        json.dumps({**HEAD, "kind": given["robot"]["kind"], **robot})
    )
    world.save(folder / "world.json")
    return Scenario(
        world=str(folder / "world.json"), robot=str(folder / "robot.json"),
        start=tuple(given["start"]), goal=tuple(given["goal"]),
    )  # fmt: skip


@needs_real
@pytest.mark.parametrize("name", ["robot_world", "robot_arm_world"])
def test_real_experiments(name: str, tmp_path: Path) -> None:
    """They are solved, and the paths are free by the twin."""
    run = Run(real_scenario(tmp_path, name))
    figures = run.execute().as_dict()
    assert figures["solved"]
    check_path(run, np.array(figures["path"]))
    check_path(run, np.array(figures["smoothed_path"]))


@needs_real
@pytest.mark.parametrize("links", [3])
def test_horn(links: int, tmp_path: Path) -> None:
    """A chain of line segments without joint limits among line segments, with self-collision."""
    data = json.loads((REAL / f"horn_{links:02}.json").read_text())
    length = data["link_length"]
    joints = tuple(
        Joint((length if i else 0.0, 0.0), np.array([[0.0, 0.0], [length, 0.0]]), None)
        for i in range(links)
    )
    x, y = data["base"]
    robot = Chain(links, self_collision=True, base_x=x, base_y=y, joints=joints)
    walls = tuple(np.array(segment).reshape(2, 2) for segment in data["segments"])
    World("horn", np.full(2, -1.2), np.full(2, 1.2), polygons=walls).save(tmp_path / "world.json")
    (tmp_path / "robot.json").write_text(robot.to_json())
    run = Run(
        Scenario(
            world=str(tmp_path / "world.json"), robot=str(tmp_path / "robot.json"),
            start=tuple(data["start"]), goal=tuple(data["goal"]),
            params={"step": 0.3}, iterations=2_000_000,
        )
    )  # fmt: skip
    figures = run.execute().as_dict()
    assert figures["solved"]
    check_path(run, np.array(figures["path"]))
