"""What RRT promises, proven from its events alone."""

import json
import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from brrt.events import Events, Kind, Phase, Reason, Source, Stage, Status
from brrt.planners import make_planner
from brrt.runs.reproduce import stopped_at
from brrt.runs.run import Run
from brrt.scenario.scenario import Scenario
from brrt.worlds import World
from tests.support import naive

Floats = NDArray[np.float64]

MAPS = Path(__file__).parents[3] / "shared" / "worlds" / "ece276b"
FEW = settings(max_examples=25, deadline=None)
ROUNDING = 1e-12
"""Part of the lengths at hand by which sums may differ."""


@pytest.fixture(scope="module")
def walled(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A world file whose start and goal are kept apart by a wall."""
    path = tmp_path_factory.mktemp("worlds") / "walled.json"
    boxes = np.array([[4.0, -1.0, 6.0, 11.0], [1.0, 4.0, 2.0, 5.0]])
    ends = np.array([1.0, 1.0]), np.array([9.0, 9.0])
    World("walled", np.zeros(2), np.full(2, 10.0), np.empty((0, 3)), boxes, *ends).save(path)
    return str(path)


def planned(scenario: Scenario, batch: int = 16384) -> tuple[Run, Events]:
    """Run a scenario; return the run and its whole log."""
    run = Run(scenario, batch=batch)
    return run, Events.concat(run.problem.dof, run.events())


def plain(world: str, **settings: Any) -> Scenario:
    """A scenario without smoothing, on the logical clock."""
    return Scenario(**{"world": world, "smooth": False, "clock": "logical", **settings})


def column(events: Events, name: str) -> NDArray[np.int64]:
    """A column that every kind has, in the order of `seq`."""
    tables = list(events.tables.values())
    order = np.argsort(np.concatenate([table["seq"] for table in tables]))
    return np.concatenate([table[name] for table in tables])[order]


def status(events: Events) -> Status:
    """How planning ended."""
    return Status(int(events[Kind.PHASE]["status"][-1]))


def check_log(events: Events) -> None:
    """Events are numbered 0, 1, 2 ..., time rises, iterations never fall."""
    assert (column(events, "seq") == np.arange(len(events))).all()
    assert (np.diff(column(events, "t")) > 0).all()
    assert column(events, "t")[0] >= 0
    assert (np.diff(column(events, "iteration")) >= 0).all()


def check_tree(run: Run, events: Events) -> None:
    """One tree from the start: numbered, in bounds, free, costs right, edges short."""
    world, edges, options = (
        run.problem.world,
        events[Kind.EDGE],
        make_planner(run.manifest.scenario),
    )
    settings = options.as_dict()
    step = settings["step"] or 0.05 * world.extent
    q, parent, cost = edges["q"], edges["parent"], edges["cost"]
    assert (edges["tree"] == 0).all()
    assert (edges["node"] == np.arange(len(edges))).all()
    assert parent[0] == -1
    assert cost[0] == 0
    assert (q[0] == run.problem.start).all()
    assert (parent[1:] >= 0).all()
    assert (parent[1:] < edges["node"][1:]).all()
    assert ((world.lower <= q) & (q <= world.upper)).all()

    lengths = np.array(
        [naive.path_length(q[[i, j]]) for i, j in edges[["parent", "node"]][1:].tolist()]
    )
    np.testing.assert_allclose(cost[1:], cost[parent[1:]] + lengths, rtol=ROUNDING, atol=0)
    longest = np.full(len(lengths), step)
    joins_goal = (q[1:] == run.problem.goal).all(axis=1)
    if settings["goal_test"] == "line-of-sight":
        longest[joins_goal] = np.inf
    if settings["keep_intermediate"]:
        longest[~joins_goal] /= settings["slices"]
    assert (lengths <= longest + ROUNDING * np.abs(q).max()).all()
    for i, j in edges[["parent", "node"]][1:].tolist():
        assert not naive.hits(world, q[i], q[j]), (q[i].tolist(), q[j].tolist())


def check_samples(run: Run, events: Events) -> None:
    """One sample an iteration, in bounds; goal samples are the goal."""
    world, samples = run.problem.world, events[Kind.SAMPLE]
    q, goal = samples["q"], samples["source"] == Source.GOAL
    assert (samples["iteration"] == 1 + np.arange(len(samples))).all()
    assert (samples["tree"] == 0).all()
    assert ((world.lower <= q) & (q <= world.upper)).all()
    assert (q[goal] == run.problem.goal).all()
    assert np.isin(samples["source"], [Source.UNIFORM, Source.GOAL]).all()


def check_extensions(run: Run, events: Events) -> None:
    """Each sample steers from a nearest node by at most a step: to a node, or to a rejection."""
    world, options = run.problem.world, make_planner(run.manifest.scenario).as_dict()
    step, edges = options["step"] or 0.05 * world.extent, events[Kind.EDGE]
    slices = options["slices"] if options["keep_intermediate"] else 1
    rejects = events[Kind.REJECT]
    assert (rejects["tree"] == 0).all()
    samples = events[Kind.SAMPLE]
    for sample in samples[:: 1 + len(samples) // 400]:
        grown = edges[edges["iteration"] == sample["iteration"]]
        refused = rejects[rejects["iteration"] == sample["iteration"]]
        blocked = refused["reason"] == Reason.GOAL_BLOCKED
        born = edges["seq"] < sample["seq"]
        distances = np.sqrt(naive.squared_distances(edges["q"][born], sample["q"]))
        if len(grown):
            assert len(grown) in (slices, slices + 1)
            near, reached = int(grown["parent"][0]), grown["q"][slices - 1]
            assert (grown["parent"][1:slices] == grown["node"][: slices - 1]).all()
            if len(grown) > slices:
                assert (grown["q"][slices] == run.problem.goal).all()
                assert grown["parent"][slices] == grown["node"][slices - 1]
        else:
            (refusal,) = refused[~blocked]
            near, reached = int(refusal["node"]), refusal["q"]
            if refusal["reason"] == Reason.COLLISION:
                assert naive.nearly_hits(world, edges["q"][near], reached)
            else:
                assert refusal["reason"] == Reason.NO_PROGRESS
                assert distances[near] == 0
        assert distances[near] == distances.min()
        part = min(1.0, step / distances[near]) if distances[near] else 0.0
        wanted = edges["q"][near] + part * (sample["q"] - edges["q"][near])
        np.testing.assert_allclose(reached, wanted, rtol=0, atol=ROUNDING * np.abs(wanted).max())
    for refusal in rejects[rejects["reason"] == Reason.GOAL_BLOCKED]:
        assert (refusal["q"] == run.problem.goal).all()
        assert naive.nearly_hits(world, edges["q"][refusal["node"]], refusal["q"])


def check_goal_tests(run: Run, events: Events) -> None:
    """The goal test is made for each vector's end that it applies to: a join, or a refusal."""
    options = make_planner(run.manifest.scenario).as_dict()
    edges, rejects = events[Kind.EDGE], events[Kind.REJECT]
    refused = rejects["node"][rejects["reason"] == Reason.GOAL_BLOCKED]
    step = options["step"] or 0.05 * run.problem.world.extent
    distances = np.sqrt(naive.squared_distances(edges["q"], run.problem.goal))
    last = np.append(edges["iteration"][1:] != edges["iteration"][:-1], True)
    within = distances <= (step if options["goal_test"] == "step" else np.inf)
    tested = edges["node"][last & within & (distances > 0)]
    assert (np.sort(refused) == tested).all()
    assert (distances == 0).any() == (len(events[Kind.PATH]) == 1)


def check_path(run: Run, events: Events) -> None:
    """At most one raw path: from start to goal along the tree, its cost its length, and free."""
    paths, edges = events[Kind.PATH], events[Kind.EDGE]
    raw = paths[paths["stage"] == Stage.RAW]
    solved = status(events) is Status.SOLVED
    assert len(raw) == int(solved)
    for event in raw:
        waypoints = event["waypoints"]
        assert (waypoints[0] == run.problem.start).all()
        assert (waypoints[-1] == run.problem.goal).all()
        node = len(edges) - 1
        for waypoint in waypoints[::-1]:
            assert (edges["q"][node] == waypoint).all()
            node = int(edges["parent"][node])
        assert node == -1
        assert event["cost"] == pytest.approx(naive.path_length(waypoints), rel=ROUNDING, abs=0)
        assert naive.path_is_free(run.problem.world, waypoints)


def check_phases(run: Run, events: Events) -> None:
    """The plan begins first and ends last; the iteration limit is exact."""
    phases = events[Kind.PHASE]
    assert (phases["name"] == Phase.PLAN).all()
    assert phases["status"][0] == Status.BEGIN
    assert phases["seq"].tolist() == [0, len(events) - 1]
    scenario = run.manifest.scenario
    counted = len(events[Kind.SAMPLE])
    if not make_planner(scenario).as_dict()["count_failed"]:
        counted = len(np.setdiff1d(events[Kind.EDGE]["iteration"], [0]))
    assert counted <= run.stop.iterations
    if status(events) is Status.ITERATION_LIMIT:
        assert counted == run.stop.iterations
    else:
        assert status(events) is Status.SOLVED


def check_all(run: Run, events: Events) -> None:
    """Properties of every run without smoothing and without a time limit."""
    check_log(events)
    check_phases(run, events)
    check_samples(run, events)
    check_tree(run, events)
    check_extensions(run, events)
    check_goal_tests(run, events)
    check_path(run, events)


@st.composite
def scenarios(draw: st.DrawFn) -> Scenario:
    """Small runs with any options in random worlds."""
    worlds = st.sampled_from(["circles2d", "squares2d", "boxes2d", "boxes3d", "spheres3d"])
    params: dict[str, Any] = {"goal_bias": draw(st.sampled_from([0.0, 0.05, 0.3, 1.0]))}
    params["goal_test"] = draw(st.sampled_from(["step", "line-of-sight"]))
    params["count_failed"] = draw(st.booleans())
    if draw(st.booleans()):
        params |= {"keep_intermediate": True, "slices": draw(st.sampled_from([1, 2, 3, 10]))}
    if draw(st.booleans()):
        params["step"] = draw(st.sampled_from([0.5, 3.0, 20.0, 1000.0]))
    if not params["count_failed"]:
        params["goal_bias"] = min(params["goal_bias"], 0.3)
    n, seed = draw(st.sampled_from([0, 5, 40, 100])), draw(st.integers(0, 999))
    return plain(
        f"{draw(worlds)}:n={n},seed={seed}",
        params=params,
        seed=draw(st.integers(0, 2**64)),
        iterations=draw(st.integers(1, 150)),
    )


@FEW
@given(scenarios())
def test_contract(scenario: Scenario) -> None:
    """Everything that RRT promises, on random worlds with random options."""
    check_all(*planned(scenario))


@FEW
@given(scenarios(), st.lists(st.integers(20, 300), min_size=1, max_size=3))
def test_batches_never_change_the_log(scenario: Scenario, batches: list[int]) -> None:
    """The log is the same bit by bit however it is cut into batches."""
    smoothed = replace(scenario, smooth=True)
    _, whole = planned(smoothed)
    for batch in batches:
        naive.assert_same(whole, planned(smoothed, batch)[1])


@pytest.mark.parametrize(
    "params", [{}, {"keep_intermediate": True, "slices": 4}, {"count_failed": False}]
)
def test_the_last_iteration_may_solve(params: dict[str, Any]) -> None:
    """A run allowed just the iterations that it needs is solved, in batches of any size."""
    ample = plain("circles2d:n=20,seed=3", seed=5, params={"step": 8.0, **params})
    run, whole = planned(ample)
    check_all(run, whole)
    needed = len(whole[Kind.SAMPLE])
    if not make_planner(ample).as_dict()["count_failed"]:
        needed = len(np.setdiff1d(whole[Kind.EDGE]["iteration"], [0]))
    exact = replace(ample, iterations=needed)
    naive.assert_same(whole, planned(exact)[1])
    for batch in range(20, 60):
        naive.assert_same(whole, planned(exact, batch)[1])
    assert status(planned(replace(ample, iterations=needed - 1))[1]) is Status.ITERATION_LIMIT


def test_the_last_iteration_may_solve_where_every_draw_adds_a_node() -> None:
    """The same where the tree fills the room that the iterations allow to the last node."""
    ample = plain("circles2d:n=0", params={"goal_bias": 1.0, "step": 1.0})
    _, whole = planned(ample)
    needed = len(whole[Kind.SAMPLE])
    assert len(whole[Kind.EDGE]) == needed + 2
    naive.assert_same(whole, planned(replace(ample, iterations=needed))[1])


@FEW
@given(scenarios())
def test_a_seed_decides_everything(scenario: Scenario) -> None:
    """The same seed gives the same events; another seed other samples."""
    _, events = planned(scenario)
    naive.assert_same(events, planned(scenario)[1])
    samples = events[Kind.SAMPLE]
    if (samples["source"] == Source.UNIFORM).any():
        _, others = planned(replace(scenario, seed=scenario.seed + 1))
        assert samples["q"].tobytes() != others[Kind.SAMPLE]["q"].tobytes()


@pytest.mark.parametrize("world", ["walled", "circles2d:n=30", "spheres3d:n=30"])
def test_real_time_rises_and_changes_nothing_else(world: str, walled: str) -> None:
    """The real clock changes the times alone; they rise from event to event."""
    spec = walled if world == "walled" else world
    logical = planned(plain(spec, iterations=3000))[1]
    real = planned(plain(spec, iterations=3000, clock="real"))[1]
    check_log(real)
    assert (column(logical, "t") == 1000 * np.arange(len(logical))).all()
    for kind, table in real.tables.items():
        table["t"] = logical.tables[kind]["t"]
    naive.assert_same(logical, real)


def bounds_of_binomial(n: int, p: float, alarm: float = 1e-9) -> tuple[int, int]:
    """Numbers of successes in n trials outside of which the probability is `alarm`."""
    chance = np.array(
        [
            math.exp(
                math.lgamma(n + 1) - math.lgamma(k + 1) - math.lgamma(n - k + 1)
                + k * math.log(p) + (n - k) * math.log1p(-p)
            )
            for k in range(n + 1)
        ]
    )  # fmt: skip
    below, above = np.cumsum(chance), np.cumsum(chance[::-1])[::-1]
    return int((below < alarm).sum()), int(n - (above < alarm).sum())


@pytest.mark.parametrize("bias", [0.01, 0.05, 0.5])
@pytest.mark.parametrize("seed", [0, 1])
def test_goal_bias(walled: str, bias: float, seed: int) -> None:
    """The goal is drawn with the requested probability (false alarm 1e-9)."""
    n = 4000
    _, events = planned(plain(walled, params={"goal_bias": bias}, iterations=n, seed=seed))
    low, high = bounds_of_binomial(n, bias)
    assert low <= (events[Kind.SAMPLE]["source"] == Source.GOAL).sum() <= high


@pytest.mark.parametrize(("bias", "share"), [(0.0, 0.0), (1.0, 1.0)])
def test_goal_bias_of_none_and_all(walled: str, bias: float, share: float) -> None:
    """Bias 0 never draws the goal, bias 1 nothing else."""
    _, events = planned(plain(walled, params={"goal_bias": bias}, iterations=500))
    assert (events[Kind.SAMPLE]["source"] == Source.GOAL).mean() == share


def test_samples_are_spread_evenly(walled: str) -> None:
    """Each tenth of each axis gets its share of the samples (false alarm 1e-9)."""
    n = 4000
    _, events = planned(plain(walled, params={"goal_bias": 0.0}, iterations=n))
    low, high = bounds_of_binomial(n, 0.1)
    for axis in range(2):
        shares = np.bincount(events[Kind.SAMPLE]["q"][:, axis].astype(int), minlength=10)
        assert len(shares) == 10
        assert low <= shares.min() <= shares.max() <= high


@pytest.mark.parametrize("iterations", [1, 2, 1000, 20_000])
def test_unsolvable_world_ends_at_the_limit(walled: str, iterations: int) -> None:
    """No path through a wall: the run ends after exactly the iterations allowed."""
    run, events = planned(plain(walled, iterations=iterations))
    metrics = Run(run.manifest.scenario).execute()
    assert status(events) is Status.ITERATION_LIMIT
    assert metrics.status == "iteration limit"
    assert len(events[Kind.SAMPLE]) == iterations
    assert not len(events[Kind.PATH])
    assert not metrics.solved
    check_log(events)
    if iterations <= 1000:
        check_all(run, events)


def test_failed_draws_need_not_count(walled: str) -> None:
    """With count_failed off, the limit counts the draws that added a node."""
    run, events = planned(plain(walled, iterations=300, params={"count_failed": False}))
    assert status(events) is Status.ITERATION_LIMIT
    assert len(events[Kind.EDGE]) == 301
    assert len(events[Kind.SAMPLE]) > 300
    check_all(run, events)


def test_draws_that_all_fail_end_all_the_same(tmp_path: Path) -> None:
    """A start that is walled in on all sides ends the run even where failures do not count."""
    boxes = [[1, 1, 9, 2], [1, 8, 9, 9], [1, 1, 2, 9], [8, 1, 9, 9]]
    path = tmp_path / "cell.json"
    World("cell", np.zeros(2), np.full(2, 10.0), np.empty((0, 3)), np.array(boxes, float)).save(
        path
    )
    scenario = plain(
        str(path), start=(5.0, 5.0), goal=(0.5, 0.5), iterations=3,
        params={"count_failed": False, "goal_bias": 1.0, "step": 100.0},
    )  # fmt: skip
    _, events = planned(scenario)
    assert status(events) is Status.ITERATION_LIMIT
    assert len(events[Kind.EDGE]) == 1
    check_log(events)


@pytest.mark.parametrize("keep", [False, True])
def test_start_next_to_the_goal(keep: bool) -> None:
    """A goal within a step is joined at once, without a draw."""
    scenario = plain(
        "circles2d:n=0", start=(1.0, 1.0), goal=(1.0, 4.0), params={"keep_intermediate": keep}
    )
    run, events = planned(scenario)
    check_all(run, events)
    assert not len(events[Kind.SAMPLE])
    assert events[Kind.PATH]["cost"].tolist() == [3.0]
    assert len(events[Kind.PATH]["waypoints"][0]) == 2


@pytest.mark.parametrize("goal_test", ["step", "line-of-sight"])
def test_start_is_the_goal(goal_test: str) -> None:
    """A run that is there already has a path of one waypoint and no cost."""
    scenario = plain("circles2d:n=0", start=(1.0, 1.0), goal=(1.0, 1.0), smooth=True)
    run, events = planned(replace(scenario, params={"goal_test": goal_test}))
    raw, smoothed = events[Kind.PATH]
    for path in (raw, smoothed):
        assert path["waypoints"].tolist() == [[1.0, 1.0]]
        assert path["cost"] == 0
    assert not len(events[Kind.SAMPLE])
    check_log(events)
    check_tree(run, events)


def test_line_of_sight_reaches_far() -> None:
    """With a line of sight, an empty world needs no draw at all; within a step it does."""
    far = plain("boxes3d:n=0", params={"goal_test": "line-of-sight"})
    run, events = planned(far)
    check_all(run, events)
    assert len(events[Kind.PATH]["waypoints"][0]) == 2
    run, events = planned(replace(far, params={"goal_test": "step"}))
    check_all(run, events)
    assert len(events[Kind.PATH]["waypoints"][0]) > 2


def test_a_vector_keeps_its_points(walled: str) -> None:
    """keep_intermediate adds evenly spaced points of each vector as nodes, one below the other."""
    params = {"keep_intermediate": True, "slices": 5, "step": 2.0, "goal_bias": 0.0}
    run, events = planned(plain(walled, params=params, iterations=200))
    check_all(run, events)
    edges = events[Kind.EDGE][1:]
    assert len(edges) % 5 == 0
    q = events[Kind.EDGE]["q"]
    for vector in edges.reshape(-1, 5):
        points = q[[int(vector["parent"][0]), *vector["node"].tolist()]]
        gaps = np.diff(points, axis=0)
        np.testing.assert_allclose(gaps, np.broadcast_to(gaps.mean(axis=0), gaps.shape), atol=1e-12)


@pytest.mark.parametrize("count_failed", [True, False])
def test_a_time_budget_ends_the_run(walled: str, count_failed: bool) -> None:
    """A run ends when its time is up, with all that it did up to then in the log."""
    params = {"count_failed": count_failed}
    scenario = plain(walled, params=params, time=0.03, clock="real", iterations=10**9)
    run, events = planned(scenario)
    assert status(events) is Status.TIME_LIMIT
    assert not len(events[Kind.PATH])
    check_log(events)
    check_samples(run, events)
    took = np.diff(events[Kind.PHASE]["t"])[0]
    assert 0.03e9 <= took < 10e9


@settings(max_examples=10, deadline=None)
@given(st.integers(20, 200), st.integers(0, 99), st.integers(0, 3))
def test_an_interrupted_run_is_the_beginning_of_the_whole(batch: int, seed: int, cut: int) -> None:
    """Interrupted after a batch, the run ends properly; the same run ended there is the same."""
    scenario = plain(f"circles2d:n=60,seed={seed}", seed=seed, iterations=500, params={"step": 3.0})
    run = Run(scenario, batch=batch)
    run.stop.interrupted = cut == 0
    batches: list[Events] = []
    for number, events in enumerate(run.events(), 1):
        run.stop.interrupted |= number == cut
        batches.append(events)
    log = Events.concat(2, batches)
    check_log(log)
    if status(log) is Status.INTERRUPTED:
        if len(log[Kind.SAMPLE]):
            again = planned(stopped_at(scenario, len(log[Kind.SAMPLE])))[1]
            for events in (log, again):
                events[Kind.PHASE]["status"][-1] = Status.INTERRUPTED
            naive.assert_same(log, again)
        else:
            assert [len(log[kind]) for kind in (Kind.PHASE, Kind.EDGE)] == [2, 1]


def real_queries() -> Iterator[Any]:
    """Map, start and goal of each course map, or one that is skipped."""
    try:
        queries = json.loads((MAPS / "queries.json").read_text())["queries"]
    except OSError:
        yield pytest.param(
            "", (), (), marks=pytest.mark.skip(reason="no course maps here"), id="none"
        )
        return
    for name, (start, goal) in queries.items():
        yield pytest.param(name, tuple(start), tuple(goal), id=name)


@pytest.mark.parametrize(("name", "start", "goal"), list(real_queries()))
def test_real_maps(name: str, start: tuple[float, ...], goal: tuple[float, ...]) -> None:
    """The course maps are solved; raw and smoothed path are free by exact arithmetic."""
    scenario = Scenario(world=str(MAPS / f"{name}.txt"), start=start, goal=goal, seed=1)
    run, events = planned(scenario)
    check_log(events)
    check_samples(run, events)
    raw, smoothed = events[Kind.PATH]
    for path in (raw, smoothed):
        waypoints = path["waypoints"]
        assert waypoints[[0, -1]].tolist() == [list(start), list(goal)]
        assert naive.path_is_free(run.problem.world, waypoints)
        assert path["cost"] == pytest.approx(naive.path_length(waypoints), rel=ROUNDING)
    assert smoothed["cost"] <= raw["cost"]
    edges = events[Kind.EDGE]
    for node in np.random.default_rng(0).integers(1, len(edges), 200):
        assert not naive.hits(
            run.problem.world, edges["q"][edges["parent"][node]], edges["q"][node]
        )
