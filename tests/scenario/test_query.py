"""Random starts and goals."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from brrt import BrrtError, Kind, Memory, Problem, Run, Scenario, make_robot
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
        # A given query has its places kept free, so it may not meet the same world.
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
