"""Properties of all planners that grow trees."""

import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from brrt.events import Events, Kind, Source, Stage, Status
from brrt.kernels import forest
from brrt.runs.reproduce import stopped_at
from brrt.runs.run import Run
from brrt.scenario.scenario import Scenario
from brrt.worlds import World
from tests.planners import test_bi_rrt, test_rrt_star
from tests.planners.test_rrt import FEW, check_log, column, plain, planned, status
from tests.support import naive, twins

ROOT = Path(__file__).parents[2]
VARIANTS: list[tuple[str, dict[str, Any]]] = [
    ("rrt-connect", {}),
    ("bi-rrt", {}),
    ("bi-rrt", {"grow": "connect", "link": "connect", "turn": "smaller"}),
    ("bi-rrt", {"link": "connect", "turn": "coin"}),
    ("bi-rrt", {"always_link": True}),
    ("rrt-star", {"goal_bias": 0.2}),
    ("rrt-star", {"informed": True}),
    ("bi-rrt-star", {}),
    ("bi-rrt-star", {"informed": True}),
]
EACH = pytest.mark.parametrize(("planner", "params"), VARIANTS)
scenarios = st.one_of(test_bi_rrt.scenarios(), test_rrt_star.scenarios())


@pytest.fixture(scope="module")
def walled(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A world file whose start and goal are kept apart by a wall."""
    path = tmp_path_factory.mktemp("worlds") / "walled.json"
    ends = np.array([1.0, 1.0]), np.array([9.0, 9.0])
    World(
        "walled", np.zeros(2), np.full(2, 10.0), boxes=np.array([[4.0, -1.0, 6.0, 11.0]]),
        start=ends[0], goal=ends[1],
    ).save(path)  # fmt: skip
    return str(path)


@pytest.fixture(scope="module")
def barred(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A world file whose start and goal are close, with a wall between that has an end."""
    path = tmp_path_factory.mktemp("worlds") / "barred.json"
    ends = np.array([3.0, 1.0]), np.array([7.0, 1.0])
    World(
        "barred", np.zeros(2), np.full(2, 10.0), boxes=np.array([[4.0, -1.0, 6.0, 6.0]]),
        start=ends[0], goal=ends[1],
    ).save(path)  # fmt: skip
    return str(path)


def check_contract(run: Run, events: Events) -> None:
    """Whatever the planner promises."""
    star = "star" in run.manifest.scenario.planner
    (test_rrt_star if star else test_bi_rrt).check_all(run, events)


def without_end(events: Events) -> Events:
    """The log without its last event, the end of planning."""
    return events.until(seq=len(events) - 2)


@FEW
@given(scenarios, st.lists(st.integers(1, 60), min_size=2, max_size=2))
def test_batches_never_change_the_log(scenario: Scenario, batches: list[int]) -> None:
    """The log is the same bit by bit however it is cut into batches."""
    smoothed = replace(scenario, smooth=True, execute=True, max_move=2.0)
    _, whole = planned(smoothed)
    check_log(whole)
    for batch in batches:
        naive.assert_same(whole, planned(smoothed, batch)[1])


@EACH
@pytest.mark.parametrize("batch", [1, 13, 50])
def test_paths_longer_than_a_batch(planner: str, params: dict[str, Any], batch: int) -> None:
    """Waypoints, rewires and links that have no room in a batch are all there in the end."""
    scenario = plain(
        "circles2d:n=5,seed=1", planner=planner, params={"step": 1.5, **params}, seed=3,
        start=(10.0, 10.0), goal=(70.0, 70.0), iterations=6000,
    )  # fmt: skip
    _, whole = planned(scenario)
    assert max(map(len, whole[Kind.PATH]["waypoints"])) > 50
    naive.assert_same(whole, planned(scenario, batch)[1])


def test_many_better_paths_in_small_batches() -> None:
    """The loop must not check a link twice if a path has to wait for room."""
    scenario = plain(
        "circles2d:n=60,seed=1", planner="bi-rrt-star", params={"step": 8.0}, iterations=4000
    )
    _, whole = planned(scenario)
    assert len(whole[Kind.PATH]) > 20
    assert len(whole[Kind.CONNECT]) > 50
    for batch in (1, 20, 50, 99):
        naive.assert_same(whole, planned(scenario, batch)[1])


@FEW
@given(scenarios, st.integers(3, 9))
def test_growth_changes_nothing(scenario: Scenario, nodes: int) -> None:
    """Trees that have to grow, often and in the midst of an iteration, are the same trees."""
    _, ample = planned(scenario)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(forest, "RESERVED_NODES", nodes)
        naive.assert_same(ample, planned(scenario)[1])


@FEW
@given(scenarios, st.data())
def test_a_shorter_run_is_the_beginning_of_a_longer_one(
    scenario: Scenario, data: st.DataObject
) -> None:
    """Where a run is cut by count it is the same up to there."""
    _, whole = planned(scenario)
    drawn = len(whole[Kind.SAMPLE])
    if drawn < 2:
        return
    cut = data.draw(st.integers(1, drawn - 1))
    for shorter in (replace(scenario, iterations=cut), stopped_at(scenario, cut)):
        _, part = planned(shorter)
        assert status(part) is Status.ITERATION_LIMIT
        assert column(part, "iteration")[-1] == cut
        naive.assert_same(without_end(part), whole.until(seq=len(part) - 2))


@FEW
@given(scenarios)
def test_a_seed_decides_everything(scenario: Scenario) -> None:
    """The same seed gives the same events; another seed other samples."""
    _, events = planned(scenario)
    naive.assert_same(events, planned(scenario)[1])
    samples = events[Kind.SAMPLE]
    if (samples["source"] == Source.UNIFORM).any():
        _, others = planned(replace(scenario, seed=scenario.seed + 1))
        assert samples["q"].tobytes() != others[Kind.SAMPLE]["q"].tobytes()


@EACH
@pytest.mark.parametrize("iterations", [1, 2, 3000])
def test_unsolvable_world_ends_at_the_limit(
    planner: str, params: dict[str, Any], iterations: int, walled: str
) -> None:
    """No path through a wall: the run ends after exactly the iterations allowed."""
    scenario = plain(walled, planner=planner, params=params, iterations=iterations)
    run, events = planned(scenario)
    assert status(events) is Status.ITERATION_LIMIT
    assert len(events[Kind.SAMPLE]) == iterations
    assert not len(events[Kind.PATH])
    assert not len(events[Kind.CONNECT])
    assert not (events[Kind.SAMPLE]["source"] == Source.INFORMED).any()
    check_log(events)
    if iterations < 100:
        check_contract(run, events)


@EACH
@pytest.mark.parametrize("stop_at_first", [False, True])
def test_start_is_the_goal(planner: str, params: dict[str, Any], stop_at_first: bool) -> None:
    """A run that is there already has a path of one waypoint and no cost, without a draw."""
    star = {"stop_at_first": stop_at_first} if "star" in planner else {}
    scenario = plain(
        "circles2d:n=0", planner=planner, params={**params, **star}, iterations=50,
        start=(1.0, 1.0), goal=(1.0, 1.0), smooth=True, execute=True,
    )  # fmt: skip
    _, events = planned(scenario)
    for path in events[Kind.PATH]:
        assert path["waypoints"].tolist() == [[1.0, 1.0]]
        assert path["cost"] == 0
        if path["stage"] == Stage.RAW:
            assert path["iteration"] == 0
    assert events[Kind.PATH]["stage"].tolist() == [Stage.RAW, Stage.SMOOTHED]
    assert not len(events[Kind.MOVE])
    assert len(events[Kind.SAMPLE]) == (0 if stop_at_first or not star else 50)
    check_log(events)
    check_contract(*planned(replace(scenario, smooth=False, execute=False)))


@EACH
@pytest.mark.parametrize("apart", [1e-9, 1.0, 5.0])
def test_start_within_a_step_of_the_goal(
    planner: str, params: dict[str, Any], apart: float
) -> None:
    """A goal within a step is joined directly; nothing is shorter than the straight line."""
    scenario = plain(
        "circles2d:n=0", planner=planner, params=params, iterations=50,
        start=(1.0, 1.0), goal=(1.0, 1.0 + apart),
    )  # fmt: skip
    run, events = planned(scenario)
    check_contract(run, events)
    (path,) = events[Kind.PATH]
    assert path["waypoints"].tolist() == [[1.0, 1.0], [1.0, 1.0 + apart]]
    assert path["iteration"] == int(planner == "rrt-star")


@EACH
def test_start_within_a_step_behind_a_wall(
    planner: str, params: dict[str, Any], barred: str
) -> None:
    """A goal that is near but out of sight is reached all the same, around the wall."""
    scenario = plain(barred, planner=planner, params={**params, "step": 6.0}, iterations=600)
    run, events = planned(scenario)
    check_contract(run, events)
    assert len(events[Kind.PATH])
    assert events[Kind.PATH]["iteration"][0] > 1


@pytest.mark.parametrize("step", [1e-20, 1e-149])
@EACH
def test_a_step_that_is_lost_in_rounding(planner: str, params: dict[str, Any], step: float) -> None:
    """No tree grows on the spot, and connecting does not go on for ever."""
    scenario = plain(
        "circles2d:n=0", planner=planner, params={**params, "step": step}, iterations=200
    )
    _, events = planned(scenario)
    assert status(events) is Status.ITERATION_LIMIT
    assert len(events[Kind.EDGE]) <= 2


@EACH
def test_a_time_budget_ends_the_run(planner: str, params: dict[str, Any], walled: str) -> None:
    """A run ends when its time is up; run again up to that draw, it begins the same."""
    scenario = plain(
        walled, planner=planner, params=params, time=0.03, clock="real", iterations=10**9
    )
    run, events = planned(scenario)
    assert status(events) is Status.TIME_LIMIT
    check_log(events)
    assert 0.03e9 <= np.diff(events[Kind.PHASE]["t"])[0] < 10e9
    again = planned(stopped_at(run.manifest.scenario, len(events[Kind.SAMPLE])))[1]
    # The time may end within an iteration, and a number of draws does not.
    before = events.until(seq=len(events) - 2)
    again = again.until(seq=len(events) - 2)
    for log in (before, again):
        for table in log.tables.values():
            table["t"] = 0
    naive.assert_same(before, again)


@settings(max_examples=15, deadline=None)
@given(scenarios, st.integers(1, 60), st.integers(0, 3))
def test_an_interrupted_run_is_the_beginning_of_the_whole(
    scenario: Scenario, batch: int, cut: int
) -> None:
    """Interrupted after a batch, the run ends properly; the same run ended there is the same."""
    run = Run(scenario, batch=batch)
    run.stop.interrupted = cut == 0
    batches: list[Events] = []
    for number, events in enumerate(run.events(), 1):
        run.stop.interrupted |= number == cut
        batches.append(events)
    log = Events.concat(run.problem.dof, batches)
    check_log(log)
    _, whole = planned(scenario)
    naive.assert_same(without_end(log), whole.until(seq=len(log) - 2))
    if status(log) is Status.INTERRUPTED and len(log[Kind.SAMPLE]):
        again = planned(stopped_at(scenario, len(log[Kind.SAMPLE])))[1]
        naive.assert_same(without_end(log), again.until(seq=len(log) - 2))
    else:
        assert status(log) in (Status.INTERRUPTED, status(whole))


PLAIN_PYTHON = """
import json, sys
from brrt import Run, Scenario
from brrt.events import Events
from tests.support.twins import rows_of
logs = []
for text in json.load(sys.stdin):
    run = Run(Scenario.parse(text))
    logs.append(rows_of(Events.concat(run.problem.dof, run.events())))
json.dump(logs, sys.stdout)
"""


def test_kernels_run_as_plain_python_bit_for_bit() -> None:
    """Without the compiler the same seed gives the same events, of every planner."""
    wanted = [
        plain(
            f"{world}:n=15,seed={number}", planner=planner, params=params, seed=number,
            iterations=200, smooth=True, execute=True, max_move=7.0,
        )
        for number, (planner, params) in enumerate(VARIANTS)
        for world in ("circles2d", "boxes3d")
    ]  # fmt: skip
    done = subprocess.run(
        [sys.executable, "-c", PLAIN_PYTHON],
        input=json.dumps([scenario.as_dict() for scenario in wanted]).encode(),
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
        cwd=ROOT,
        capture_output=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr.decode()
    logs = json.loads(done.stdout)
    kinds, sources = set[Kind](), set[int]()
    for scenario, log in zip(wanted, logs, strict=True):
        events = planned(scenario)[1]
        assert log == json.loads(json.dumps(twins.rows_of(events))), scenario
        kinds |= set(events.counts)
        sources |= set(events[Kind.SAMPLE]["source"].tolist())
    assert kinds >= {Kind.REWIRE, Kind.CONNECT, Kind.MOVE, Kind.SHORTCUT, Kind.PATH}
    assert sources >= {Source.UNIFORM, Source.OTHER_TREE, Source.INFORMED}
