"""What LRTA* and A* promise on a lattice, proven from their events alone and by slow twins."""

import hashlib
import json
import math
import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from brrt.errors import BrrtError
from brrt.events import FIELDS, Events, Kind, Reason, Stage, Status
from brrt.kernels.event_log import EventLog
from brrt.kernels.jit import config, kernel
from brrt.kernels.space import segment_free
from brrt.planners import AStar, LRTAStar, Planner
from brrt.planners.base.problem import Problem
from brrt.planners.base.stop import Stop
from brrt.robots import Point, Polygon
from brrt.runs.run import Run
from brrt.scenario.contract import Contract, Lattice
from brrt.scenario.scenario import Scenario
from brrt.worlds import Grid, World
from tests.conftest import Result
from tests.support import naive
from tests.support.naive_lattice import Emitted, Twin, costs_to_go

Floats = NDArray[np.float64]

SHARED = Path(__file__).parents[3] / "shared" / "worlds"
MAPS = SHARED / "ece276b"
SOME = settings(max_examples=60, deadline=None)
ROUNDING = 1e-12


@kernel
def is_free(space: Any, ends: Floats) -> bool:
    """Whether the motion from ends[0] to ends[1] is free."""
    return segment_free(space, ends, 0, ends, 1)


def planned(
    planner: Planner, problem: Problem, *, batch: int = 16384, stop: Stop | None = None
) -> Events:
    """Run a planner on the logical clock; return its whole log."""
    rng, log = np.random.default_rng(0), EventLog(problem.dof, batch, logical_clock=True)
    return Events.concat(problem.dof, planner.solve(problem, rng, log, stop or Stop()))


def status(events: Events) -> Status:
    """How planning ended."""
    return Status(int(events[Kind.PHASE]["status"][-1]))


def twin_of(problem: Problem, planner: AStar | LRTAStar) -> Twin:
    """The slow twin of a planner's lattice."""

    def free(a: Floats, b: Floats) -> bool:
        return bool(is_free(problem.space, np.array([a, b])))

    grid = planner.resolved(problem)
    options = {name: getattr(grid, name) for name in ("cell", "diagonals", "max_move")}
    return Twin(problem.world, problem.start, problem.goal, free, **options)


def emitted(events: Events) -> list[Emitted]:
    """The events that the twin emits too, in the order of the log."""
    rows: list[tuple[int, Emitted]] = []
    for kind in (Kind.EXPAND, Kind.REJECT, Kind.HEURISTIC, Kind.MOVE):
        names = [f.name for f in FIELDS[kind] if f.name != "q"]
        for event in events[kind]:
            fields = tuple(event[name].item() for name in names)
            row = (kind, int(event["iteration"]), fields, tuple(event["q"].tolist()))
            rows.append((int(event["seq"]), row))
    return [row for _, row in sorted(rows)]


@st.composite
def problems(draw: st.DrawFn, most: int = 7) -> Problem:
    """Small worlds of blocked unit squares or cubes, and balls; start and goal are free."""
    dim = draw(st.sampled_from([2, 3]))
    side = draw(st.integers(2, most if dim == 2 else 4))
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    blocked = np.argwhere(rng.random((side,) * dim) < draw(st.sampled_from([0.1, 0.3, 0.5])))
    margin = draw(st.sampled_from([0.0, 0.2]))
    boxes = np.hstack([blocked + margin, blocked + 1 - margin]).astype(float)
    balls = np.hstack([rng.random((2, dim)) * side, np.full((2, 1), 0.3)])
    world = World("random", np.zeros(dim), np.full(dim, float(side)), balls, boxes)
    ends = [[0.5] * dim, [side - 0.5] * dim]
    if draw(st.booleans()):
        ends = (rng.random((2, dim)) * side).tolist()
    centres = (np.argwhere(np.ones((side,) * dim)) + 0.5).tolist()
    free = [q for q in ends + centres if world.obstacle_at(q) is None]
    if not free:
        free, world = ends, World("empty", world.lower, world.upper)
    return Problem(world, Point(), np.array(free[0]), np.array(free[min(1, len(free) - 1)]))


LATTICES = st.fixed_dictionaries(
    {
        "cell": st.sampled_from([0.4, 0.5, 1.0]),
        "diagonals": st.booleans(),
        "max_move": st.sampled_from([0.0, 0.5, 1.0, 2.5]),
    }
)
AHEAD = st.one_of(st.just(1), st.integers(1, 20), st.just(500))


@SOME
@given(problems(), LATTICES, AHEAD, st.integers(1, 3))
def test_lrta_star_is_its_twin(
    problem: Problem, options: dict[str, Any], lookahead: int, trials: int
) -> None:
    """Every event is the slow twin's; the goal is reached exactly where that is possible."""
    planner = LRTAStar(**options, lookahead=lookahead, trials=trials)
    events, twin = planned(planner, problem), twin_of(problem, planner)
    lengths = []
    for number in range(trials):
        length = twin.trial(number, lookahead)
        if length is None:
            break
        lengths.append(length)
    assert emitted(events) == twin.emitted
    assert events[Kind.PATH]["cost"].tolist() == lengths
    solvable = 0 in costs_to_go(twin_of(problem, planner))
    assert status(events) is (Status.SOLVED if solvable else Status.NO_PATH)


@SOME
@given(problems(), LATTICES)
def test_a_star_is_its_twin_and_optimal(problem: Problem, options: dict[str, Any]) -> None:
    """Every event is the slow twin's, and the path as short as Dijkstra's."""
    planner = AStar(**options)
    events, twin = planned(planner, problem), twin_of(problem, planner)
    found = twin.search(0, math.inf)
    assert emitted(events) == twin.emitted
    least = costs_to_go(twin_of(problem, planner))
    if found is None:
        assert status(events) is Status.NO_PATH
        assert not least
    else:
        assert status(events) is Status.SOLVED
        assert events[Kind.PATH]["cost"].tolist() == [pytest.approx(least[0], rel=ROUNDING)]
        check_paths(problem, planner, events)


def check_paths(problem: Problem, planner: AStar | LRTAStar, events: Events) -> None:
    """Paths lead from start to goal, are free, go from cell to cell, and have the stated length."""
    for path in events[Kind.PATH]:
        q = path["waypoints"]
        assert path["stage"] == Stage.RAW
        assert (q[0] == problem.start).all()
        np.testing.assert_allclose(q[-1], problem.goal, rtol=0, atol=1e-9)
        assert path["cost"] == pytest.approx(naive.path_length(q), rel=1e-9, abs=1e-9)
        assert naive.path_is_free(problem.world, q)
        steps = np.diff(q, axis=0)
        axes = (np.abs(steps) > 1e-9).sum(axis=1)
        grid = planner.resolved(problem)
        cells = np.abs(steps) / grid.cell
        assert ((np.abs(cells - np.round(cells)) < 1e-9) & (cells < 1.5))[:-1].all()
        assert (axes[:-1] <= (problem.dof if grid.diagonals else 1)).all()
        if len(steps) and axes[-1] > 1 and not grid.diagonals:
            assert math.hypot(*steps[-1]) <= grid.max_move * (1 + ROUNDING)


@SOME
@given(problems(), LATTICES, AHEAD)
def test_lrta_star_keeps_its_promises(
    problem: Problem, options: dict[str, Any], lookahead: int
) -> None:
    """Estimates rise and stay admissible; moves follow the estimates, by at most N cells."""
    planner = LRTAStar(**options, lookahead=lookahead, trials=3)
    events = planned(planner, problem)
    check_paths(problem, planner, events)
    twin = twin_of(problem, planner)
    least = costs_to_go(twin)
    estimates: dict[tuple[float, ...], float] = {}
    for event in events[Kind.HEURISTIC]:
        q = tuple(event["q"].tolist())
        before = estimates.get(q, twin.straight(event["q"]))
        assert event["h"] > before
        estimates[q] = float(event["h"])
    if least:
        names = {tuple(twin.q(at).tolist()): cell for at, cell in twin.number.items()}
        for q, h in estimates.items():
            assert h <= least[names[q]] * (1 + 1e-9)
    expansions = events[Kind.EXPAND]
    searches = np.flatnonzero(expansions["parent"] < 0)
    assert (np.diff(np.append(searches, len(expansions))) <= lookahead).all()
    for reject in events[Kind.REJECT]:
        inside = problem.world.inside(reject["q"])
        assert reject["reason"] == (Reason.COLLISION if inside else Reason.LIMITS)
        if inside:
            (row,) = np.flatnonzero(expansions["cell"] == reject["node"])[:1]
            assert naive.nearly_hits(problem.world, expansions["q"][row], reject["q"])


@settings(max_examples=25, deadline=None)
@given(problems(most=5), LATTICES, st.sampled_from([1, 2, 7]))
def test_trials_converge_to_the_shortest_path(
    problem: Problem, options: dict[str, Any], lookahead: int
) -> None:
    """If it keeps what it learned, the robot finally moves along a path of A*.

    The number of trials is not known in advance; but once a trial teaches nothing, it and all that
    follow are shortest.
    """
    best = planned(AStar(**options), problem)[Kind.PATH]["cost"]
    for trials in (200, 2_000, 20_000):
        planner = LRTAStar(**options, lookahead=lookahead, trials=trials)
        events = planned(planner, problem, stop=Stop(iterations=10**8))
        if not len(best):
            assert status(events) is Status.NO_PATH
            return
        assert status(events) is Status.SOLVED
        costs = events[Kind.PATH]["cost"]
        assert len(costs) == trials
        assert costs.min() >= best[0] * (1 - 1e-9)
        trial = np.searchsorted(events[Kind.PATH]["seq"], events[Kind.HEURISTIC]["seq"])
        settled = int(np.setdiff1d(np.arange(trials), trial).min(initial=trials))
        np.testing.assert_allclose(costs[settled:], best[0], rtol=1e-9)
        if settled < trials:
            return
    raise AssertionError("it goes on learning")


@SOME
@given(problems(), LATTICES, AHEAD, st.integers(1, 400))
def test_batches_never_change_the_log(
    problem: Problem, options: dict[str, Any], lookahead: int, batch: int
) -> None:
    """The log is the same bit by bit however it is cut into batches."""
    for planner in (LRTAStar(**options, lookahead=lookahead, trials=2), AStar(**options)):
        naive.assert_same(planned(planner, problem), planned(planner, problem, batch=batch))


@SOME
@given(problems(), LATTICES, AHEAD, st.integers(0, 60), st.integers(40, 90))
def test_a_run_that_is_cut_is_the_beginning_of_the_whole(
    problem: Problem, options: dict[str, Any], lookahead: int, cut: int, batch: int
) -> None:
    """A budget ends the run exactly; an interrupted run equals a run with that budget."""
    for planner in (LRTAStar(**options, lookahead=lookahead, trials=2), AStar(**options)):
        whole = planned(planner, problem)
        allowed = planned(planner, problem, stop=Stop(iterations=cut))
        check_beginning(allowed, whole)
        if status(allowed) is Status.ITERATION_LIMIT:
            assert allowed.last.iteration == cut
        naive.assert_same(allowed, planned(planner, problem, stop=Stop(draws=cut)))
        stop, batches = Stop(), list[Events]()
        log = EventLog(problem.dof, batch, logical_clock=True)
        for events in planner.solve(problem, np.random.default_rng(0), log, stop):
            stop.interrupted = True
            batches.append(events)
        short = Events.concat(problem.dof, batches)
        check_beginning(short, whole)
        # An interruption may end the run within a lookahead.
        stop = Stop(events=len(short) - 1) if status(short) is Status.INTERRUPTED else Stop()
        again = planned(planner, problem, stop=stop)
        if status(short) is Status.INTERRUPTED:
            assert status(again) is Status.ITERATION_LIMIT
            short[Kind.PHASE]["status"][-1] = Status.ITERATION_LIMIT
        naive.assert_same(short, again)


def check_beginning(part: Events, whole: Events) -> None:
    """All but the last event of a part are those with which the whole begins."""
    last = len(part) - 2
    naive.assert_same(part.until(seq=last), whole.until(seq=last))


@pytest.mark.parametrize("planner", [LRTAStar(lookahead=3, trials=2), LRTAStar(), AStar()])
def test_time_ends_a_run(planner: AStar | LRTAStar) -> None:
    """A search on 10^12 cells that cannot reach the goal ends when its time is up."""
    boxes = np.array([[6.0, -1.0, 6.5, 11.0]])
    world = World("walled", np.zeros(2), np.full(2, 10.0), boxes=boxes)
    problem = Problem(world, Point(), np.array([1.0, 5.0]), np.array([9.0, 5.0]))
    events = planned(replace(planner, cell=3e-5), problem, stop=Stop(iterations=10**9, time_s=0.05))
    assert status(events) is Status.TIME_LIMIT
    assert len(events[Kind.EXPAND]) > 10


@pytest.mark.parametrize("planner", [LRTAStar(lookahead=50), LRTAStar(), AStar()])
def test_tables_grow(planner: AStar | LRTAStar, monkeypatch: pytest.MonkeyPatch) -> None:
    """Room for a few cells and moves at first changes nothing."""
    world = World("walled", np.zeros(2), np.full(2, 10.0), boxes=np.array([[5.0, 0, 6.0, 9.0]]))
    problem = Problem(world, Point(), np.array([1.0, 1.0]), np.array([9.0, 1.0]))
    fine = replace(planner, cell=0.2)
    whole = planned(fine, problem)
    assert len(whole[Kind.EXPAND]) > 300
    monkeypatch.setattr("brrt.planners.a_star._FIRST_ROOM", 1)
    monkeypatch.setattr("brrt.planners.lrta_star._FIRST_MOVES", 2)
    naive.assert_same(whole, planned(fine, problem))


@pytest.mark.parametrize("planner", [LRTAStar(lookahead=5, trials=3), LRTAStar(), AStar()])
def test_start_is_the_goal(planner: Planner) -> None:
    """A robot that is there already does not move."""
    world = World("empty", np.zeros(3), np.full(3, 10.0))
    problem = Problem(world, Point(), np.full(3, 5.0), np.full(3, 5.0))
    events = planned(planner, problem)
    assert status(events) is Status.SOLVED
    assert not len(events[Kind.MOVE])
    for path in events[Kind.PATH]:
        assert path["waypoints"].tolist() == [[5.0, 5.0, 5.0]]
        assert path["cost"] == 0


@pytest.mark.parametrize("planner", [LRTAStar(lookahead=5), LRTAStar(), AStar()])
def test_walled_in(planner: AStar | LRTAStar) -> None:
    """A start without free neighbours is hopeless at once, and so is a closed room later."""
    walls = [[3.0, 3, 7, 4], [3, 6, 7, 7], [3, 3, 4, 7], [6, 3, 7, 7]]
    world = World("room", np.zeros(2), np.full(2, 10.0), boxes=np.array(walls))
    for cell, cells in ((2.0, 1), (0.5, 9)):
        problem = Problem(world, Point(), np.array([5.0, 5.0]), np.array([1.0, 1.0]))
        events = planned(replace(planner, cell=cell), problem)
        assert status(events) is Status.NO_PATH
        assert not len(events[Kind.PATH])
        assert len(np.unique(events[Kind.EXPAND]["cell"])) == cells
        assert np.isfinite(events[Kind.HEURISTIC]["h"]).all()


@pytest.mark.parametrize("planner", [LRTAStar(), AStar()])
def test_refuses_what_it_cannot_plan_for(planner: AStar | LRTAStar) -> None:
    """Another robot, and cells that are too small, are refused in a line before any event."""
    world = World("empty", np.zeros(2), np.full(2, 10.0))
    ends = np.array([1.0, 1.0]), np.array([9.0, 9.0])
    poses = np.array([1.0, 1.0, 0.0]), np.array([9.0, 9.0, 0.0])
    with pytest.raises(BrrtError, match=r"move a point; use --robot point"):
        planned(planner, Problem(world, Polygon(length=0.5, width=0.5), *poses))
    with pytest.raises(BrrtError, match=r"cell 1e-09 is too small for this world"):
        planned(replace(planner, cell=1e-9), Problem(world, Point(), *ends))


def test_contract() -> None:
    """Their contracts."""
    world = World("empty", np.zeros(2), np.full(2, 10.0))
    problem = Problem(world, Point(), np.array([1.0, 1.0]), np.array([9.0, 9.0]))
    grid = LRTAStar(cell=0.25, lookahead=3).contract(problem).lattice
    assert grid is not None
    assert (grid.cell, grid.diagonals, grid.max_move, grid.lookahead) == (0.25, False, 0.5, 3)
    grid = AStar(diagonals=True).contract(problem).lattice
    assert grid is not None
    assert (grid.diagonals, grid.lookahead) == (True, None)


def queries() -> dict[str, Any]:
    """Start and goal on each course map, where they are at hand."""
    file = MAPS / "queries.json"
    return dict(json.loads(file.read_text())["queries"]) if file.exists() else {}


@pytest.mark.parametrize("name", sorted(queries()) or [""])
@pytest.mark.parametrize("lookahead", [1, 10])
def test_course_maps(name: str, lookahead: int) -> None:
    """All are solved; path lengths are 0.5 a move and the last hop; paths are free, exactly."""
    if not name:
        pytest.skip("no course maps here")
    start, goal = queries()[name]
    scenario = Scenario(
        world=str(MAPS / f"{name}.txt"), start=tuple(start), goal=tuple(goal), smooth=False,
        planner="lrta-star", params={"lookahead": lookahead},
    )  # fmt: skip
    run = Run(scenario)
    events = Events.concat(3, run.events())
    assert status(events) is Status.SOLVED
    moves, (path,) = events[Kind.MOVE], events[Kind.PATH]
    q = path["waypoints"]
    hop = naive.path_length(q[-2:])
    assert len(q) == len(moves) + 1
    assert moves["step"].tolist() == list(range(1, len(moves) + 1))
    assert moves["cell"][-1] == -1
    assert path["cost"] == pytest.approx(0.5 * (len(moves) - 1) + hop, rel=ROUNDING)
    assert path["cost"] == moves["cost"][-1]
    assert hop <= 1
    for i in np.random.default_rng(0).integers(0, len(q) - 1, 200):
        assert not naive.hits(run.problem.world, q[i], q[i + 1])
    if name == "single_cube":
        assert len(moves) == 27
        assert path["cost"] == pytest.approx(13.755, abs=5e-4)


def test_course_maps_on_the_command_line(brrt: Callable[..., Result]) -> None:
    """As a user types it."""
    if not queries():
        pytest.skip("no course maps here")
    for name, (start, goal) in queries().items():
        ends = [",".join(map(str, q)) for q in (start, goal)]
        args = ["--world", MAPS / f"{name}.txt", "--start", ends[0], "--goal", ends[1]]
        done = brrt("plan", *args, "--planner", "lrta-star", "--json", "--force")
        assert done.code == 0, done.err
        assert done.json["solved"]


PLAIN = """
from tests.planners.test_lattice import digest
print(digest())
"""


def digest() -> str:
    """Digest of every event of some runs."""
    world = World("walled", np.zeros(3), np.full(3, 5.0), boxes=np.array([[2.0, 0, 0, 3, 4, 5]]))
    problem = Problem(world, Point(), np.array([1.0, 1, 1]), np.array([4.0, 1, 1]))
    total = hashlib.sha256()
    for planner in (
        LRTAStar(trials=2), LRTAStar(lookahead=7, diagonals=True, cell=1.0), AStar(),
    ):  # fmt: skip
        total.update(repr(emitted(planned(planner, problem))).encode())
    return total.hexdigest()


@pytest.mark.skipif(bool(config.DISABLE_JIT), reason="this is the other side")
def test_kernels_run_as_plain_python_bit_for_bit() -> None:
    """Without the compiler the same events come out."""
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", PLAIN],
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
        cwd=Path(__file__).parents[2],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.stdout.strip() == digest(), done.stderr


@pytest.mark.parametrize("planner", ["a-star", "lrta-star"])
def test_a_goal_that_no_cell_is_near(planner: str) -> None:
    """The least longest move is named before the search, and it is accepted."""
    cases: list[tuple[str, float, tuple[float, ...], tuple[float, ...], str]] = [
        ("empty3d", 2.0, (5, 5, 5), (10, 10, 10), "1.73206"),
        ("empty2d", 2.0, (5, 5), (10, 10), "1.41422"),
        ("empty2d", 60.0, (5, 5), (95, 95), "42.4265"),
    ]
    for world, cell, start, goal, least in cases:
        params = {"cell": cell, "diagonals": True, "max_move": 1.0}
        scenario = Scenario(world=world, planner=planner, params=params, start=start, goal=goal)
        with pytest.raises(BrrtError, match=f"max_move 1 is too small: .* at least {least}, or"):
            Run(scenario)
        run = Run(replace(scenario, params=params | {"max_move": float(least)}, iterations=1000))
        assert run.execute().solved


def test_default_cells() -> None:
    """Half a unit where that suits the map; a part of its side otherwise; cells of a grid map."""
    for size, edge in ((0.01, 5e-4), (1.0, 0.05), (10.0, 0.5), (100.0, 0.5), (1e5, 500.0)):
        ends: dict[str, Any] = {"start": (0.1 * size,) * 2, "goal": (0.93 * size, 0.88 * size)}
        for planner in ("a-star", "lrta-star"):
            run = Run(Scenario(world=f"empty2d:size={size:g}", planner=planner, **ends))
            lattice = (run.manifest.contract or Contract()).lattice
            assert lattice is not None
            assert (lattice.cell, lattice.max_move) == pytest.approx((edge, 2 * edge))
            assert not lattice.diagonals
            assert run.execute().solved
            chosen = (run.manifest.contract or Contract()).planner.chosen
            assert chosen == {"cell": lattice.cell, "diagonals": False,
                              "max_move": lattice.max_move}  # fmt: skip
    cells = np.zeros((6, 300), bool)
    cells[:5, 100] = True
    world = World.of_grid("grid", Grid(cells, np.zeros(2), 1.0))
    run = Run(
        Scenario(planner="a-star", start=(0.5, 0.5), goal=(299.5, 0.5), smooth=False), world=world
    )
    assert AStar().resolved(run.problem) == Lattice(1.0, True, 2.0, None)
    # Diagonals on both sides of the wall, whose corners are not cut.
    assert run.execute().as_dict()["path_cost"] == pytest.approx(299 + 10 * (2**0.5 - 1))
