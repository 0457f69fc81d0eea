"""A specification is one world: a query leaves obstacles out, and moves none."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from brrt import Problem, Scenario
from brrt.worlds import GENERATORS, World, make_world
from brrt.worlds.convex import gap
from tests.worlds.test_worlds import refused

CLEARING = ("circles2d", "squares2d", "boxes2d", "polygons2d", "boxes3d", "spheres3d", "forest2d",
            "forest3d")  # fmt: skip


def obstacles(world: World) -> list[Any]:
    """Return all obstacles, each as plain numbers, in order."""
    polygons = [polygon.tolist() for polygon in world.polygons]
    return [*world.balls.tolist(), *world.boxes.tolist(), *polygons]


def distance(obstacle: Any, point: np.ndarray[Any, Any]) -> float:
    """Return the distance of an obstacle from a point."""
    shape, d = np.array(obstacle), len(point)
    if shape.ndim == 2:
        return gap(point[None], shape)
    if len(shape) == d + 1:
        return float(np.linalg.norm(shape[:d] - point) - shape[d])
    return float(np.linalg.norm(point - np.clip(point, shape[:d], shape[d:])))


@pytest.mark.parametrize("name", list(GENERATORS))
@settings(max_examples=15, deadline=None)
@given(st.data())
def test_a_query_moves_no_obstacle(name: str, data: st.DataObject) -> None:
    """Whatever the query, the obstacles are those of the world but for close ones, in order."""
    made = make_world(name)
    d = made.dim
    ends = st.none() | st.lists(st.floats(0, 100), min_size=d, max_size=d).map(np.array)
    start, goal = data.draw(ends), data.draw(ends)
    room = data.draw(st.sampled_from([0.0, 1.5, 12.0]))
    world = make_world(name, start, goal, room)
    assert world.start is not None
    assert world.goal is not None
    kept = iter(obstacles(world))
    rest, out = next(kept, None), []
    for obstacle in obstacles(made):
        if obstacle == rest:
            rest = next(kept, None)
        else:
            out.append(obstacle)
    assert rest is None
    near = [min(distance(o, world.start), distance(o, world.goal)) for o in out]
    assert all(far <= (room + 1) * (1 + 1e-12) for far in near)
    if name in CLEARING:
        far = [distance(o, end) for o in obstacles(world) for end in (world.start, world.goal)]
        assert min(far, default=np.inf) > room + 1 - 1e-9
        assert bool(out) == any("or goal are left out: " in note for note in world.notes)
    else:
        assert not out


@pytest.mark.parametrize(
    ("robot", "start", "goal"),
    [
        ("point", None, None), ("point", (20, 20), (50, 90)), ("point", (20, 20), None),
        ("point", "random", "random"), ("polygon:length=3,width=1", None, None),
        ("polygon:length=3,width=1", (20, 20, 1), (50, 90, 2)),
        ("chain:base_x=30,base_y=40,length=2", "random", "random"),
    ],
)  # fmt: skip
@pytest.mark.parametrize("world", ["squares2d", "circles2d:density=0.3", "polygons2d:n=80"])
def test_a_specification_is_one_world(world: str, robot: str, start: Any, goal: Any) -> None:
    """Another robot, start or goal meets the same obstacles, and its query is free."""
    made = obstacles(make_world(world))
    problem = Problem.of(Scenario(world=world, robot=robot, start=start, goal=goal))
    found = obstacles(problem.world)
    assert [o for o in made if o in found] == found
    assert len(made) - len(found) <= 6
    if robot == "point" and start is goal is None:
        assert made == found


def test_what_is_left_out_is_noted() -> None:
    """The note names the obstacles by their numbers in the whole world."""
    made = make_world("squares2d")
    low, high = np.split(made.boxes[7], 2)
    world = make_world("squares2d", (low + high) / 2)
    (note,) = world.notes
    assert note.startswith("obstacles closer than 1 to start or goal are left out: ")
    for name in note.partition("out: ")[2].split(", "):
        assert made.boxes[int(name.removeprefix("box "))].tolist() not in world.boxes.tolist()


def test_connected_is_of_the_specification() -> None:
    """A query does not choose the draw; one that the draw does not connect is refused."""
    spec = "squares2d:n=800,connected=true,seed=1"
    made, aside = obstacles(make_world(spec)), np.array([50.0, 50.0])
    try:
        found = obstacles(make_world(spec, aside))
    except Exception:  # noqa: BLE001 - which of both depends on the world
        assert "no path from start to goal was found" in refused(lambda: make_world(spec, aside))
    else:
        assert [o for o in made if o in found] == found
    wall = "walls2d:connected=true"
    assert obstacles(make_world(wall, np.array([5.0, 50.0]))) == obstacles(make_world(wall))
    assert "the start touches box 1" in refused(lambda: make_world(wall, aside))
