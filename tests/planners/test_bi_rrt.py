"""What RRT-Connect and bidirectional RRT promise, proven from their events alone."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from brrt.events import Events, Kind, Phase, Reason, Source, Stage, Status
from brrt.planners import make_planner
from brrt.planners.bi_rrt import BiRRT
from brrt.runs.run import Run
from brrt.scenario.scenario import Scenario
from brrt.worlds import World
from tests.planners.test_rrt import (
    FEW,
    ROUNDING,
    bounds_of_binomial,
    check_log,
    plain,
    planned,
    status,
)
from tests.support import naive, twins

VARIANTS: dict[str, Any] = {
    "grow": ["extend", "connect"],
    "link": ["extend", "connect"],
    "turn": ["alternate", "smaller", "coin"],
    "always_link": [False, True],
}


@pytest.fixture(scope="module")
def walled(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A world file whose start and goal are kept apart by a wall."""
    path = tmp_path_factory.mktemp("worlds") / "walled.json"
    ends: dict[str, Any] = {"start": np.array([1.0, 1.0]), "goal": np.array([9.0, 9.0])}
    wall = np.array([[4.0, -1.0, 6.0, 11.0]])
    World("walled", np.zeros(2), np.full(2, 10.0), boxes=wall, **ends).save(path)
    return str(path)


def settings_of(run: Run) -> dict[str, Any]:
    """The planner's settings, `rrt-connect` as a variant of bi-rrt."""
    planner = make_planner(run.manifest.scenario)
    given = planner.as_dict()
    usual = BiRRT(link="connect" if run.manifest.scenario.planner == "rrt-connect" else "extend")
    return {**usual.as_dict(), **given, "step": planner.contract(run.problem).step}


def trees_of(events: Events) -> list[NDArray[np.void]]:
    """The edges of each tree."""
    edges = events[Kind.EDGE]
    return [edges[edges["tree"] == tree] for tree in range(2)]


def check_trees(run: Run, events: Events) -> None:
    """Two trees from start and goal: numbered, in bounds, free, costs right, edges short."""
    problem, step = run.problem, settings_of(run)["step"]
    for edges, root in zip(trees_of(events), (problem.start, problem.goal), strict=True):
        q, parent, cost = edges["q"], edges["parent"], edges["cost"]
        assert (edges["node"] == np.arange(len(edges))).all()
        assert parent[0] == -1
        assert cost[0] == 0
        assert (q[0] == root).all()
        assert (parent[1:] >= 0).all()
        assert (parent[1:] < edges["node"][1:]).all()
        assert ((problem.world.lower <= q) & (q <= problem.world.upper)).all()
        motions = [(q[i], q[j]) for i, j in edges[["parent", "node"]][1:].tolist()]
        lengths = np.array([naive.path_length(np.array(motion)) for motion in motions])
        np.testing.assert_allclose(cost[1:], cost[parent[1:]] + lengths, rtol=ROUNDING, atol=0)
        assert (lengths <= step + ROUNDING * np.abs(q).max()).all()
        assert (lengths > 0).all()
        assert not any(naive.hits(problem.world, a, b) for a, b in motions)


def check_end(run: Run, events: Events) -> None:
    """Trees that meet are linked by a short free motion, and the path leads over it."""
    links, paths = events[Kind.CONNECT], events[Kind.PATH]
    solved = status(events) is Status.SOLVED
    assert len(links) == len(paths) == int(solved)
    assert (events[Kind.PHASE]["name"] == Phase.PLAN).all()
    assert events[Kind.PHASE]["seq"].tolist() == [0, len(events) - 1]
    for link, path in zip(links, paths, strict=True):
        ours, theirs = trees_of(events)
        a, b = ours[link["node"]], theirs[link["other"]]
        assert naive.path_length(np.array([a["q"], b["q"]])) <= settings_of(run)["step"] * (
            1 + ROUNDING
        )
        assert not naive.hits(run.problem.world, a["q"], b["q"])
        waypoints = path["waypoints"]
        length = naive.path_length(waypoints)
        assert link["cost"] == path["cost"] == pytest.approx(length, rel=ROUNDING, abs=1e-300)
        assert path["stage"] == Stage.RAW
        assert (waypoints[0] == run.problem.start).all()
        assert (waypoints[-1] == run.problem.goal).all()
        assert len(waypoints) == 1 or (np.diff(waypoints, axis=0) != 0).any(axis=1).all()
        assert naive.path_is_free(run.problem.world, waypoints)


def check_rejects(run: Run, events: Events) -> None:
    """What was given up was in the way of something, and left from a node of its tree."""
    world, trees = run.problem.world, trees_of(events)
    for refusal in events[Kind.REJECT]:
        q = trees[refusal["tree"]]["q"][refusal["node"]]
        if refusal["reason"] == Reason.NO_PROGRESS:
            assert (q == refusal["q"]).all()
        else:
            assert naive.nearly_hits(world, q, refusal["q"])
            blocked = refusal["reason"] == Reason.LINK_BLOCKED
            other = trees[1 - refusal["tree"]]["q"]
            assert blocked == (other == refusal["q"]).all(axis=1).any()


def check_turns(run: Run, events: Events) -> None:
    """Each iteration has one sample, drawn for the tree whose turn it is."""
    turn, samples = settings_of(run)["turn"], events[Kind.SAMPLE]
    assert (samples["iteration"] == 1 + np.arange(len(samples))).all()
    assert (
        (run.problem.world.lower <= samples["q"]) & (samples["q"] <= run.problem.world.upper)
    ).all()
    linking = samples["source"] == Source.OTHER_TREE
    if turn == "alternate":
        assert (samples["tree"] == np.arange(len(samples)) % 2).all()
    if turn == "coin":
        # Heading for the other tree is the same tree's turn; otherwise they swap.
        swaps = np.diff(samples["tree"].astype(int)) != 0
        assert (swaps == ~linking[1:]).all()
    else:
        assert not linking.any()
    edges = events[Kind.EDGE]
    for number, sample in enumerate(samples):
        before = edges[edges["seq"] < sample["seq"]]
        sizes = np.bincount(before["tree"], minlength=2)
        if turn == "smaller":
            mine, other = sizes[sample["tree"]], sizes[1 - sample["tree"]]
            assert mine <= other
            if mine == other and number:
                assert sample["tree"] != samples["tree"][number - 1]
        if linking[number]:
            theirs = before[before["tree"] != sample["tree"]]
            assert (sample["q"] == theirs["q"][-1]).all()


def check_all(run: Run, events: Events) -> None:
    """Properties of every run without smoothing and without a time limit."""
    check_log(events)
    check_trees(run, events)
    check_end(run, events)
    check_rejects(run, events)
    check_turns(run, events)


def twin_of(run: Run, events: Events) -> list[twins.Event]:
    """The events of the slow twin in the same run."""
    twin = twins.BiRRT(run.problem, run.manifest.scenario.seed, settings_of(run))
    return twin.run(
        len(events[Kind.SAMPLE]) if status(events) is Status.SOLVED else run.stop.iterations
    )


@st.composite
def scenarios(draw: st.DrawFn) -> Scenario:
    """Small runs of any variant in random worlds."""
    worlds = st.sampled_from(["circles2d", "squares2d", "boxes2d", "boxes3d", "spheres3d"])
    params = {name: draw(st.sampled_from(values)) for name, values in VARIANTS.items()}
    planner = draw(st.sampled_from(["rrt-connect", "bi-rrt", "bi-rrt", "bi-rrt"]))
    if planner == "rrt-connect":
        params = {}
    params["step"] = draw(st.sampled_from([None, 0.7, 3.0, 20.0, 1000.0]))
    n, seed = draw(st.sampled_from([0, 5, 40, 100])), draw(st.integers(0, 999))
    return plain(
        f"{draw(worlds)}:n={n},seed={seed}",
        planner=planner,
        params=params,
        seed=draw(st.integers(0, 2**64)),
        iterations=draw(st.integers(1, 80)),
    )


@FEW
@given(scenarios())
def test_contract_and_twin(scenario: Scenario) -> None:
    """All properties, and the events of the slow twin one by one."""
    run, events = planned(scenario)
    check_all(run, events)
    assert twins.rows_of(events) == twin_of(run, events)


@pytest.mark.parametrize("grow", VARIANTS["grow"])
@pytest.mark.parametrize("link", VARIANTS["link"])
@pytest.mark.parametrize("turn", VARIANTS["turn"])
@pytest.mark.parametrize("world", ["circles2d:n=50,seed=3", "boxes3d:n=200,seed=3"])
def test_twin_in_a_longer_run(grow: str, link: str, turn: str, world: str) -> None:
    """Hundreds of iterations in a crowded world, as the slow twin has it."""
    params = {"grow": grow, "link": link, "turn": turn, "always_link": link == "extend"}
    scenario = plain(world, planner="bi-rrt", params={"step": 2.0, **params}, iterations=200)
    run, events = planned(scenario)
    check_all(run, events)
    assert twins.rows_of(events) == twin_of(run, events)
    assert len(events[Kind.EDGE]) > 30
    assert len(events[Kind.PATH]) or len(events[Kind.SAMPLE]) == 200


def test_rrt_connect_is_a_variant() -> None:
    """The planner of that name is the greedy one of the variants."""
    scenario = plain("squares2d:n=40,seed=3", planner="rrt-connect", params={"step": 4.0}, seed=1)
    variant = {"grow": "extend", "link": "connect", "turn": "alternate", "step": 4.0}
    _, events = planned(scenario)
    assert len(events[Kind.PATH])
    naive.assert_same(events, planned(replace(scenario, planner="bi-rrt", params=variant))[1])


@pytest.mark.parametrize("link", VARIANTS["link"])
def test_a_coin_decides_who_grows(walled: str, link: str) -> None:
    """About half of the draws head for the other tree (false alarm 1e-9); the others swap roles."""
    n = 4000
    scenario = plain(walled, planner="bi-rrt", params={"turn": "coin", "link": link}, iterations=n)
    _, events = planned(scenario)
    low, high = bounds_of_binomial(n, 0.5)
    assert low <= (events[Kind.SAMPLE]["source"] == Source.OTHER_TREE).sum() <= high


def test_the_smaller_tree_grows(tmp_path: Path) -> None:
    """A tree that is stuck in a pocket is extended until it is the larger one."""
    pocket = np.array([[1, 1, 3, 1.2], [1, 2.8, 3, 3], [1, 1, 1.2, 3], [2.8, 1.9, 3, 3.0]])
    path = tmp_path / "pocket.json"
    ends: dict[str, Any] = {"start": np.array([2.0, 2.0]), "goal": np.array([8.0, 8.0])}
    World("pocket", np.zeros(2), np.full(2, 10.0), boxes=pocket, **ends).save(path)
    shares = {}
    for turn in ("alternate", "smaller"):
        scenario = plain(
            str(path), planner="bi-rrt", params={"turn": turn, "step": 0.1}, iterations=300
        )
        run, events = planned(scenario)
        check_turns(run, events)
        shares[turn] = (events[Kind.SAMPLE]["tree"] == 0).mean()
    assert shares["alternate"] == 0.5
    assert shares["smaller"] > 0.6


@pytest.mark.parametrize("always_link", [False, True])
def test_always_link(walled: str, always_link: bool) -> None:
    """Where nothing could be added, the other tree moves only if it always does."""
    params = {"always_link": always_link, "step": 3.0}
    _, events = planned(plain(walled, planner="bi-rrt", params=params, iterations=300))
    edges, rejects, idle = events[Kind.EDGE], events[Kind.REJECT], 0
    for sample in events[Kind.SAMPLE]:
        grown = edges[edges["iteration"] == sample["iteration"]]
        refused = rejects[rejects["iteration"] == sample["iteration"]]
        if sample["tree"] in grown["tree"]:
            continue
        idle += 1
        others = np.concatenate([grown["tree"], refused["tree"]]) == 1 - sample["tree"]
        assert others.any() == always_link
    assert idle > 30


@pytest.mark.parametrize("world", ["circles2d:n=50", "boxes2d:n=30", "spheres3d:n=40"])
def test_two_trees_need_far_fewer_iterations(world: str) -> None:
    """The median over seeds is less than half of what one tree needs; paths are smoothed."""
    medians = {}
    for planner in ("rrt", "bi-rrt", "rrt-connect"):
        counts = []
        for seed in range(21):
            scenario = plain(f"{world},seed={seed}", planner=planner, seed=seed, smooth=True)
            _, events = planned(replace(scenario, iterations=100_000))
            raw, smoothed = events[Kind.PATH]
            assert smoothed["cost"] <= raw["cost"]
            assert len(smoothed["waypoints"]) <= len(raw["waypoints"])
            counts.append(len(events[Kind.SAMPLE]))
        medians[planner] = np.median(counts)
    assert medians["bi-rrt"] < medians["rrt"] / 2
    assert medians["rrt-connect"] < medians["rrt"] / 2
