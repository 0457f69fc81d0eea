"""Starts and goals: random ones, and messages that refuse a query."""

import math
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from brrt import BrrtError, Kind, Memory, Problem, Run, Scenario, World, make_robot
from brrt.robots import ROBOTS as ROBOT_CLASSES
from brrt.scenario.query import Query
from tests.conftest import Result, findings_of

ROBOTS = {
    "point": "circles2d:n=60",
    "point in space": "boxes3d",
    "polygon:length=4,width=2": "circles2d:n=30",
    "chain": "circles2d:n=10",
    "chain:base_x=20,base_y=20,self_collision=true": "squares2d:n=30",
}


def scenario(robot: str, seed: int = 0) -> Scenario:
    """Return a scenario with a random start and goal."""
    return Scenario(
        world=ROBOTS[robot], robot=robot.partition(" in ")[0], planner="rrt-connect", seed=seed,
        start="random", goal="random", iterations=500,
    )  # fmt: skip


@pytest.mark.parametrize("robot", ROBOTS)
def test_both_are_free_and_determined_by_the_seed(robot: str) -> None:
    """The same seed gives the same query; ten seeds give ten free starts and goals."""
    drawn = []
    for seed in range(10):
        problem, again = (Problem.of(scenario(robot, seed)) for _ in range(2))
        for q, same in ((problem.start, again.start), (problem.goal, again.goal)):
            assert problem.robot.collision(problem.world, q) is None
            assert q.tolist() == same.tolist()
            drawn.append(tuple(q))
    assert len(set(drawn)) == 20


def test_they_spread_evenly() -> None:
    """In an empty world each quarter of the map gets as many draws."""
    base = Scenario(world="circles2d:n=0", start="random")
    world = Problem.of(base).world
    many = [Problem.of(replace(base, seed=seed), world).start > 50 for seed in range(400)]
    quarters = np.array(many) @ [1, 2]
    assert np.bincount(quarters, minlength=4).min() > 70


def test_each_has_its_own_generator() -> None:
    """Neither affects the other, the world, or the planner's draws."""
    both = Problem.of(scenario("point"))
    start, goal = tuple(both.start.tolist()), tuple(both.goal.tolist())
    one = replace(scenario("point"), goal=goal)
    other = replace(scenario("point"), start=start)
    logs = []
    for each in (scenario("point"), one, other, replace(one, start=start)):
        problem = Problem.of(each, both.world)
        assert (problem.start == both.start).all()
        assert (problem.goal == both.goal).all()
    plain = Scenario(world=ROBOTS["point"], planner="rrt-connect")
    assert Problem.of(plain).world.to_json() == both.world.to_json()
    for each in (scenario("point"), replace(scenario("point"), start=start, goal=goal)):
        # Obstacles close to a given query are left out, so its world may have fewer.
        memory = Memory()
        Run(each).execute([memory])
        logs.append(memory.events())
    assert logs[0].tables.keys() == logs[1].tables.keys()
    samples = [[tuple(q) for q in log[Kind.SAMPLE]["q"]][:5] for log in logs]
    assert samples[0] == samples[1]


def test_a_recording_has_the_drawn_query(brrt: Callable[..., Result]) -> None:
    """By option or by file; the manifest's scenario plans it again, and all rules hold."""
    done = brrt("plan", "--start", "random", "--goal", "random", "--seed", 5, "--out", "a.mcap",
                "--json")  # fmt: skip
    assert done.code == 0, done.err
    assert brrt("replay", "a.mcap", "--json").json == done.json
    assert brrt("verify", "a.mcap").code == 0
    Path("s.toml").write_text('start = "random"\ngoal = "random"\nseed = 5\n')
    again = brrt("plan", "s.toml", "--out", "b.mcap", "--json")
    assert again.json["path"] == done.json["path"]
    assert brrt("replay", "a.mcap", "--check", "b.mcap").code == 0


def test_rules_hold() -> None:
    """All rules hold for a run of each robot."""
    for robot in ROBOTS:
        run, memory = Run(scenario(robot)), Memory()
        run.execute([memory])
        assert findings_of(run.manifest, run.problem.world, memory.events()) == []
        assert run.manifest.start == tuple(run.problem.start.tolist())
        assert run.manifest.scenario.start == "random"


def test_no_room_is_one_line() -> None:
    """A robot that fits nowhere is refused."""
    full = Scenario(
        world="circles2d:n=0",
        robot="polygon:length=99.9,width=99.9",
        start="random",
        goal="random",
    )
    with pytest.raises(BrrtError, match="none of 10,000 random configurations for the start"):
        Problem.of(full)
    with pytest.raises(BrrtError, match="goal must be numbers like 1,2, or random, and not 'rand'"):
        Scenario(goal="rand")  # type: ignore[arg-type]


def test_a_chain_keeps_its_base_free() -> None:
    """An obstacle at the base would block every configuration."""
    robot = make_robot("chain:base_x=20,base_y=20")
    for seed in range(5):
        problem = Problem.of(
            Scenario(
                world=f"circles2d:n=150,max_radius=4,seed={seed}",
                robot="chain:base_x=20,base_y=20,length=2",
                start="random",
                goal="random",
            )
        )
        position = robot.position(problem.start)
        assert position is not None
        assert problem.world.obstacle_at(position) is None


def refused(scenario: Scenario, world: World | None = None) -> str:
    """Return the message that refuses a query."""
    with pytest.raises(BrrtError) as error:
        Problem.of(scenario, world)
    return str(error.value)


@pytest.mark.parametrize("start", [(1.5708, 0.0), (math.nextafter(math.pi / 2, 9), 0.0), (0, -2)])
def test_advised_limits_are_accepted(start: tuple[float, ...]) -> None:
    """A joint beyond its limits reads differently than these, which are accepted as written."""
    arm = Scenario(world="empty2d", robot="chain:links=2", start=start, goal=(0, 0))
    message = refused(arm)
    value, low, high = re.findall(r"at (\S+), beyond its limits (\S+) to (\S+)", message)[0]
    assert not float(low) <= float(value) <= float(high)
    for corner in re.findall(r"between (\S+) and (\S+)", message)[0]:
        assert Problem.of(replace(arm, start=corner)).start is not None


def test_far_from_the_origin() -> None:
    """Start, obstacle and bounds have the digits in which places of the world differ."""
    world = World(
        "utm", np.array([388096.25, 3948996.5]), np.array([388116.25, 3949016.5]),
        boxes=np.array([[388104.25, 3948997.0, 388106.25, 3949011.0]]),
    )  # fmt: skip
    start, goal = (388105.25, 3949000.5), (388115.0, 3949006.5)
    assert refused(Scenario(start=start, goal=goal), world) == (
        "start 388105.25,3949000.5 is in collision with box 0 (388104.25, 3948997 to 388106.25, "
        "3949011); choose a free one between 388096.25,3948996.5 and 388116.25,3949016.5"
    )
    outside = (388116.2500001, 3949000.5)
    assert refused(Scenario(start=outside, goal=goal), world).startswith(
        "start 388116.2500001,3949000.5 is outside the bounds; choose"
    )


@pytest.mark.parametrize("start", ["random", (0.0, 0.0)])
def test_a_base_in_an_obstacle(start: Any) -> None:
    """No start helps a chain whose base is not free: the message names the base."""
    world = World("w", np.zeros(2), np.full(2, 20.0), boxes=np.array([[5.0, 5.0, 15.0, 15.0]]))
    arm = Scenario(robot="chain:links=2", start=start, goal=start)
    assert refused(arm, world) == (
        "robot chain: its base (10, 10) is in collision with box 0 (5, 5 to 15, 15), so no "
        "configuration is free; move it by base_x and base_y, or base in the robot's file"
    )
    moved = replace(arm, robot="chain:links=2,base_x=2.5,base_y=2.5,length=1")
    assert Problem.of(moved, world).robot.misfit(world) is None
    outside = replace(arm, robot="chain:links=2,base_x=-1,base_y=3")
    assert "its base (-1, 3) reaches the bounds, so no" in refused(outside, world)


def test_a_joint_aside_of_its_link() -> None:
    """A base in an obstacle does not matter if no link covers it."""
    world = World("w", np.zeros(2), np.full(2, 20.0), boxes=np.array([[9.9, 9.9, 10.1, 10.1]]))
    joint = {"offset": [0, 0], "link": [[1, -0.1], [2, -0.1], [2, 0.1]], "limits": None}
    arm = ROBOT_CLASSES["chain"].from_definition({"base": [10, 10], "joints": [joint]})
    scene = Scenario(start=(0.0,), goal=(3.0,))
    assert Query.of(scene, world, arm).robot.collision(world, np.zeros(1)) is None


@pytest.mark.parametrize("robot", ["polygon:length=200", "chain:links=1,length=150"])
def test_a_body_longer_than_the_map(robot: str) -> None:
    """A body that fits nowhere is refused as that, whatever start is given."""
    for start in ("random", None, (0.0,)):
        message = refused(Scenario(world="empty2d", robot=robot, start=start, goal="random"))
        assert " long, and the diagonal of the bounds 141.421" in message
