"""What the smoother promises, proven from its events."""

from dataclasses import replace
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
from brrt.planners.postprocessing.shortcut import Shortcut
from brrt.robots import Point
from brrt.runs.run import Run
from brrt.scenario.scenario import Scenario
from brrt.worlds import World
from tests.support import naive

Floats = NDArray[np.float64]

EMPTY = World("empty", np.zeros(2), np.full(2, 10.0))
ROUNDING = 1e-12


def smoothed(
    world: World, path: Floats, *, attempts: int = 100, seed: int = 0, capacity: int = 1000,
    stop: Stop | None = None,
) -> Events:  # fmt: skip
    """Smooth a path; return the log."""
    log = EventLog(world.dim, capacity, logical_clock=True)
    rng = np.random.Generator(np.random.PCG64(seed))
    batches = Shortcut(attempts=attempts).smooth(
        path, make_space(Point(), world), rng, log, stop or Stop(), 7
    )
    return Events.concat(world.dim, batches)


def ring(radius: float = 4.0, waypoints: int = 7) -> Floats:
    """Waypoints on an eighth each of a circle around (5, 5)."""
    angles = np.arange(waypoints) * np.pi / 4
    return 5 + radius * np.stack([np.cos(angles), np.sin(angles)], axis=1)


BLOCKED = World("blocked", np.zeros(2), np.full(2, 10.0), np.array([[5.0, 5.0, 3.2]]))
"""A ball around which `ring` leads: neighbours see each other, no others do."""


def replayed(world: World, raw: Floats, attempts: NDArray[np.void]) -> Floats:
    """Apply the recorded attempts to the raw path, checking each against the exact test."""
    path = list(raw)
    cost = naive.path_length(raw)
    for attempt in attempts:
        i, j = int(attempt["i"]), int(attempt["j"])
        assert i >= 0
        assert i + 2 <= j < len(path)
        if attempt["accepted"]:
            assert not naive.hits(world, path[i], path[j])
            del path[i + 1 : j]
        else:
            assert naive.nearly_hits(world, path[i], path[j])
        assert attempt["cost"] == pytest.approx(naive.path_length(np.array(path)), rel=ROUNDING)
        assert attempt["cost"] <= cost, "the cost never rises"
        cost = float(attempt["cost"])
    return np.array(path)


def check(world: World, raw: Floats, events: Events, attempts: int) -> Floats:
    """Check the properties of every smoothing; return the smoothed path."""
    shortcuts = events[Kind.SHORTCUT]
    (path,) = (event for event in events[Kind.PATH] if event["stage"] == Stage.SMOOTHED)
    result = np.array(path["waypoints"])
    assert (result == replayed(world, raw, shortcuts)).all()
    assert (result[[0, -1]] == raw[[0, -1]]).all()
    assert path["cost"] == pytest.approx(naive.path_length(result), rel=ROUNDING, abs=0)
    assert path["cost"] <= naive.path_length(raw)
    assert naive.path_is_free(world, result)
    assert len(shortcuts) <= attempts
    assert len(shortcuts) == attempts or len(result) <= 2
    phases = events[Kind.PHASE][events[Kind.PHASE]["name"] == Phase.SMOOTH]
    assert phases["status"].tolist() == [Status.BEGIN, Status.DONE]
    assert path["seq"] == phases["seq"][1] - 1
    return result


@settings(max_examples=25, deadline=None)
@given(
    st.sampled_from(["circles2d", "squares2d", "boxes3d", "spheres3d"]),
    st.integers(0, 99),
    st.sampled_from([0, 1, 10, 100, 300]),
    st.booleans(),
)
def test_contract(world: str, seed: int, attempts: int, keep: bool) -> None:
    """Smoothing of RRT's paths in random worlds, those of collinear waypoints included."""
    scenario = Scenario(
        world=f"{world}:n=40,seed={seed}", seed=seed, iterations=4000, shortcuts=attempts,
        clock="logical", params={"keep_intermediate": keep},
    )  # fmt: skip
    run = Run(scenario)
    events = Events.concat(run.problem.dof, run.events())
    raw = events[Kind.PATH][events[Kind.PATH]["stage"] == Stage.RAW]
    if len(raw):
        check(run.problem.world, raw["waypoints"][0], events, attempts)
        assert (events[Kind.SHORTCUT]["iteration"] == raw["iteration"][0]).all()
    else:
        assert not len(events[Kind.SHORTCUT])
        assert len(events[Kind.PHASE]) == 2


@settings(max_examples=50, deadline=None)
@given(st.integers(1, 30), st.integers(0, 60), st.integers(0, 99), st.booleans())
def test_any_path(waypoints: int, attempts: int, seed: int, straight: bool) -> None:
    """Random and straight paths, of one waypoint on."""
    rng = np.random.default_rng(seed)
    path = rng.uniform(0, 10, (waypoints, 2))
    if straight:
        path = path[0] + np.sort(rng.random((waypoints, 1)), axis=0) * (path[-1] - path[0])
    check(EMPTY, path, smoothed(EMPTY, path, attempts=attempts, seed=seed), attempts)


def test_no_attempts() -> None:
    """Without an attempt the path stays as it is."""
    events = smoothed(BLOCKED, ring(), attempts=0)
    assert (check(BLOCKED, ring(), events, 0) == ring()).all()
    assert not len(events[Kind.SHORTCUT])


@pytest.mark.parametrize("waypoints", [1, 2])
def test_nothing_to_shorten(waypoints: int) -> None:
    """A path of one motion or none is smooth: nothing is tried."""
    path = ring()[:waypoints]
    events = smoothed(BLOCKED, path)
    assert (check(BLOCKED, path, events, 100) == path).all()
    assert not len(events[Kind.SHORTCUT])


def test_free_space_leaves_one_motion() -> None:
    """Where nothing is in the way, two waypoints remain in the end, and then it stops."""
    result = check(EMPTY, ring(), smoothed(EMPTY, ring(), attempts=1000), 1000)
    assert (result == ring()[[0, -1]]).all()


def test_no_way_through() -> None:
    """Where no shortcut is free, all attempts are made and the path stays."""
    events = smoothed(BLOCKED, ring(), attempts=400)
    assert (check(BLOCKED, ring(), events, 400) == ring()).all()
    assert not events[Kind.SHORTCUT]["accepted"].any()
    assert (events[Kind.SHORTCUT]["cost"] == events[Kind.PATH]["cost"][0]).all()


def test_each_pair_is_equally_likely() -> None:
    """All 15 pairs of 7 waypoints that are no neighbours get their share (6 sigma)."""
    n = 3000
    pairs = smoothed(BLOCKED, ring(), attempts=n, capacity=4000)[Kind.SHORTCUT][["i", "j"]]
    found, counts = np.unique(pairs, return_counts=True)
    assert len(found) == 15
    assert np.abs(counts - n / 15).max() <= 6 * np.sqrt(n * (1 / 15) * (14 / 15))


@pytest.mark.parametrize("capacity", [3, 4, 5, 6, 7, 8, 13, 50])
def test_batches_change_nothing(capacity: int) -> None:
    """The log is the same however small the batches are."""
    for world in (EMPTY, BLOCKED):
        whole = smoothed(world, ring(), attempts=40)
        parts = smoothed(world, ring(), attempts=40, capacity=capacity)
        naive.assert_same(whole, parts)


def test_an_interruption_keeps_what_is_done() -> None:
    """If interrupted, the result is the path so far, and the status is `interrupted`."""
    stop = Stop(interrupted=True)
    events = smoothed(BLOCKED, ring(), attempts=1000, capacity=20, stop=stop)
    assert events[Kind.PHASE]["status"].tolist() == [Status.BEGIN, Status.INTERRUPTED]
    assert (np.array(events[Kind.PATH]["waypoints"][0]) == ring()).all()
    assert len(events[Kind.SHORTCUT]) < 1000


def test_the_path_that_was_given_stays_as_it_was() -> None:
    """Smoothing works on a copy."""
    path = ring()
    smoothed(EMPTY, path)
    assert (path == ring()).all()


@pytest.mark.parametrize("changes", [{"smooth": False}, {"shortcuts": 0}])
def test_smoothing_does_not_touch_the_plan(changes: dict[str, Any]) -> None:
    """The planner's events are the same with any smoothing, or none."""
    scenario = Scenario(world="circles2d:n=30", clock="logical")
    plans = []
    for one in (scenario, replace(scenario, **changes)):
        run = Run(one)
        events = Events.concat(2, run.events())
        plans.append(events.until(seq=int(events[Kind.PATH]["seq"][0])))
    naive.assert_same(*plans)
