"""The real-time mode: a path is driven in moves of bounded length."""

import math
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from brrt.events import Events, Kind, Phase, Stage, Status
from brrt.kernels.event_log import EventLog
from brrt.kernels.spaces import make_space
from brrt.planners.base.stop import Stop
from brrt.planners.postprocessing.execute import Execute
from brrt.robots import Point
from brrt.runs.run import Run
from brrt.scenario.scenario import Scenario
from brrt.worlds import World
from tests.planners.test_rrt import ROUNDING, check_log, column, plain, planned
from tests.support import naive

Floats = NDArray[np.float64]

PLANNERS = ["rrt", "rrt-connect", "bi-rrt", "rrt-star", "bi-rrt-star"]


def driven(
    path: Floats, max_move: float, *, capacity: int = 1000, stop: Stop | None = None
) -> Events:
    """The log of driving a path in an empty world of side 100."""
    dim = path.shape[1]
    space = make_space(Point(), World("empty", np.zeros(dim), np.full(dim, 100.0)))
    log = EventLog(dim, capacity, logical_clock=True)
    batches = Execute(max_move=max_move).follow(path, space, log, stop or Stop(), 7)
    return Events.concat(dim, batches)


def wanted_moves(path: Floats, max_move: float) -> list[Floats]:
    """Where each move leads: each motion in the fewest equal parts that are short enough."""
    moves = []
    for a, b in pairwise(path):
        parts = max(1, math.ceil(naive.path_length(np.array([a, b])) / max_move * (1 - 1e-12)))
        moves += [a + (b - a) * (k / parts) for k in range(1, parts)] + [b]
    return moves


def check_moves(events: Events, path: Floats, max_move: float) -> None:
    """The moves lead along the path, to its end, and none is too long."""
    moves = events[Kind.MOVE]
    stops = np.concatenate([path[:1], moves["q"]])
    wanted = np.array([path[0], *wanted_moves(path, max_move)])
    np.testing.assert_allclose(stops, wanted, rtol=0, atol=1e-12 * max(1.0, np.abs(path).max()))
    assert (stops[-1] == path[-1]).all()
    corners = iter(stops.tolist())
    assert all(waypoint in corners for waypoint in path.tolist())
    lengths = [naive.path_length(np.array(pair)) for pair in pairwise(stops)]
    longest = max_move + 1e-12 * np.abs(path).max()
    assert all(length <= longest for length in lengths)
    np.testing.assert_allclose(moves["cost"], np.cumsum(lengths), rtol=1e-9, atol=1e-300)
    assert moves["step"].tolist() == list(range(1, len(moves) + 1))
    assert (moves["trial"] == 0).all()
    assert (moves["cell"] == -1).all()


@st.composite
def paths(draw: st.DrawFn) -> Floats:
    """Paths of any length, down to a single waypoint."""
    dim = draw(st.sampled_from([2, 3]))
    coordinates = st.floats(0, 100, allow_nan=False, allow_subnormal=False)
    waypoints = st.tuples(*[coordinates | st.integers(0, 9).map(float)] * dim)
    return np.array(draw(st.lists(waypoints, min_size=1, max_size=8)), np.float64)


@settings(max_examples=60, deadline=None)
@given(paths(), st.sampled_from([0.3, 1.0, 1.7, 12.0, 1e9]), st.integers(2, 40))
def test_any_path(path: Floats, max_move: float, capacity: int) -> None:
    """Whatever the path, and in batches of any size."""
    events = driven(path, max_move)
    check_log(events)
    check_moves(events, path, max_move)
    phases = events[Kind.PHASE]
    assert (phases["name"] == Phase.EXECUTE).all()
    assert phases["status"].tolist() == [Status.BEGIN, Status.DONE]
    assert phases["seq"].tolist() == [0, len(events) - 1]
    assert (column(events, "iteration") == 7).all()
    naive.assert_same(events, driven(path, max_move, capacity=capacity))


@pytest.mark.parametrize(
    ("length", "max_move", "moves"),
    [
        (3.0, 1.0, 3),
        (3.000001, 1.0, 4),
        (2.999999, 1.0, 3),
        (0.5, 1.0, 1),
        (0.7, 0.1, 7),  # 0.7 / 0.1 is 6.999999999999999 in floats, and 3 * 0.1 above 0.3
        (0.3, 0.1, 3),
        (0.1 + 0.2, 0.1, 3),
        (10.0, 1e9, 1),
    ],
)
def test_the_fewest_moves(length: float, max_move: float, moves: int) -> None:
    """A motion of a whole number of moves takes just these, rounding or not."""
    path = np.array([[50.0, 50.0], [50.0 + length, 50.0]])
    assert len(driven(path, max_move)[Kind.MOVE]) == moves


def test_a_path_of_one_waypoint_needs_no_move() -> None:
    """Who is there already stays."""
    events = driven(np.array([[1.0, 2.0]]), 1.0)
    assert events[Kind.PHASE]["status"].tolist() == [Status.BEGIN, Status.DONE]
    assert len(events) == 2


@pytest.mark.parametrize("cut", [0, 1, 3])
def test_an_interrupted_robot_stops(cut: int) -> None:
    """If interrupted after a batch, the run keeps the moves so far, and the phase ends."""
    path = np.array([[0.0, 0.0], [90.0, 0.0]])
    space = make_space(Point(), World("empty", np.zeros(2), np.full(2, 100.0)))
    log, stop = EventLog(2, 10, logical_clock=True), Stop(interrupted=cut == 0)
    batches = []
    for number, batch in enumerate(Execute(max_move=1.0).follow(path, space, log, stop, 7), 1):
        stop.interrupted |= number == cut
        batches.append(batch)
    events = Events.concat(2, batches)
    assert events[Kind.PHASE]["status"].tolist() == [Status.BEGIN, Status.INTERRUPTED]
    assert len(events[Kind.MOVE]) == max(0, 10 * cut - 1)
    naive.assert_same(
        events.until(seq=len(events) - 2), driven(path, 1.0).until(seq=len(events) - 2)
    )


def scenario_of(planner: str, **changes: Any) -> Scenario:
    """A scenario in which the robot drives."""
    few = {"iterations": 800} if "star" in planner else {}
    base = plain("circles2d:n=20,seed=2", planner=planner, seed=1, execute=True, **few)
    return replace(base, **changes)


@pytest.mark.parametrize("planner", PLANNERS)
@pytest.mark.parametrize("smooth", [False, True])
@pytest.mark.parametrize("max_move", [1.0, 30.0])
def test_the_final_path_is_driven(planner: str, smooth: bool, max_move: float) -> None:
    """What is driven is the last path of the run, after all planning, and free."""
    run, events = planned(scenario_of(planner, smooth=smooth, max_move=max_move))
    check_log(events)
    path = events[Kind.PATH][-1]
    assert (path["stage"] == Stage.SMOOTHED) == smooth
    check_moves(events, path["waypoints"], max_move)
    phases = [(int(e["name"]), int(e["status"])) for e in events[Kind.PHASE]]
    parts = [Phase.PLAN, Phase.SMOOTH, Phase.EXECUTE] if smooth else [Phase.PLAN, Phase.EXECUTE]
    assert [name for name, status in phases if status == Status.BEGIN] == parts
    assert phases[-1] == (Phase.EXECUTE, Status.DONE)
    begins = events[Kind.PHASE]["seq"][-2]
    assert (events[Kind.MOVE]["seq"] > begins).all()
    stops = np.concatenate([[run.problem.start], events[Kind.MOVE]["q"]])
    assert naive.path_is_free(run.problem.world, stops)
    assert (stops[-1] == run.problem.goal).all()
    last = events[Kind.MOVE]["cost"][-1]
    assert last == pytest.approx(float(path["cost"]), rel=100 * ROUNDING)


@pytest.mark.parametrize("planner", PLANNERS)
def test_driving_does_not_touch_the_plan(planner: str) -> None:
    """All events before the robot moves are those of a run in which it does not."""
    still = planned(scenario_of(planner, smooth=True, execute=False))[1]
    moving = planned(scenario_of(planner, smooth=True))[1]
    naive.assert_same(still, moving.until(seq=len(still) - 1))
    assert len(moving) > len(still)


@pytest.mark.parametrize("planner", PLANNERS)
def test_no_moves_without_a_path(planner: str) -> None:
    """A run without a path has no events of the execution."""
    scenario = scenario_of(planner, iterations=1, world="circles2d:n=20,seed=2", smooth=True)
    _, events = planned(scenario)
    assert not len(events[Kind.PATH])
    assert not len(events[Kind.MOVE])
    assert (events[Kind.PHASE]["name"] == Phase.PLAN).all()


def test_no_moves_once_interrupted() -> None:
    """Interrupted while smoothing, the run does not begin to execute."""
    run = Run(scenario_of("rrt", smooth=True))
    batches = []
    for batch in run.events():
        run.stop.interrupted |= Kind.SHORTCUT in batch.counts
        batches.append(batch)
    events = Events.concat(2, batches)
    assert not len(events[Kind.MOVE])
    assert Phase.EXECUTE not in events[Kind.PHASE]["name"]


def test_planning_comes_before_the_first_move() -> None:
    """On the real clock the first move carries the planning, and times rise from move to move."""
    _, events = planned(scenario_of("rrt-star", clock="real", iterations=3000))
    moves, phases = events[Kind.MOVE]["t"], events[Kind.PHASE]
    ended = phases["t"][(phases["name"] == Phase.PLAN) & (phases["status"] != Status.BEGIN)][0]
    assert ended < moves[0]
    assert moves[0] > moves[-1] - moves[0]
    assert (np.diff(moves) > 0).all()
