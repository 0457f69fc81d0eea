"""A run at any instant is the log up to it."""

import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from brrt import BrrtError, Events, Kind, Metrics, Recording, Scenario, forest, read, snapshot
from tests.conftest import Result, recorded
from tests.support.logs import recording, split

STAR = Scenario(
    world="circles2d:n=40,seed=3", planner="rrt-star", iterations=250, seed=7, clock="logical"
)
PAIR = Scenario(
    world="circles2d:n=40,seed=3", planner="bi-rrt-star", iterations=120, seed=2, clock="logical"
)
WALK = Scenario(
    world="circles2d:n=12,size=20,max_radius=2,seed=3", planner="lrta-star", seed=2,
    params={"lookahead": 3, "trials": 2}, clock="logical",
)  # fmt: skip


@settings(max_examples=40)
@given(data=st.data())
def test_a_snapshot_is_the_log_up_to_its_instant(data: st.DataObject) -> None:
    """However the instant is given: trees, metrics and path are those of the events up to it."""
    scenario = data.draw(st.sampled_from([STAR, PAIR, WALK]))
    run, log = recorded(scenario)
    name = data.draw(st.sampled_from(["event", "time", "iteration"]))
    last = len(log) if name != "iteration" else log.last.iteration
    at = data.draw(st.integers(0, last + 2))
    # Event n of a logical clock happens at n us.
    limits = {"event": {"seq": at}, "time": {"t": 1000 * at}, "iteration": {"iteration": at}}[name]
    given_: Any = at * 1e-6 if name == "time" else at
    found = snapshot(recording(scenario, data.draw(st.integers(5, 400))), **{name: given_})
    part = log.until(**limits)
    metrics = Metrics(run.manifest)
    metrics.write(part)
    for each in data.draw(st.permutations(["forest", "metrics", "events", "best_path"])):
        if each == "events":
            assert len(found.events) == len(part)
            assert all((found.events[kind]["seq"] == part[kind]["seq"]).all() for kind in Kind)
        elif each == "metrics":
            assert found.metrics.as_dict() == metrics.as_dict()
        elif each == "forest":
            expected = forest(part, run.problem.robot.distance)
            assert found.forest.keys() == expected.keys()
            for number, tree in expected.items():
                assert np.array_equal(found.forest[number].parent, tree.parent)
                assert np.array_equal(found.forest[number].cost, tree.cost)
        elif found.best_path is None:
            assert not len(part[Kind.PATH])
        else:
            cost, waypoints = found.best_path
            final = part[Kind.PATH][-1]
            assert cost == final["cost"]
            assert np.array_equal(waypoints, final["waypoints"])


def test_no_more_is_read_than_is_needed() -> None:
    """Nothing is read before a property is used, and then no batch after the instant."""
    run, log = recorded(STAR)
    parts, taken = split(log, 50), []

    def batches() -> Iterator[Events]:
        for i, part in enumerate(parts):
            taken.append(i)
            yield part

    whole = Recording(run.manifest, run.problem.world, batches, None)
    found = snapshot(whole, event=120)
    assert taken == []
    assert len(found.forest[0]) > 10
    assert taken == [0, 1, 2]
    taken.clear()
    assert len(found.events) == 121
    assert taken == [0, 1, 2]
    taken.clear()
    # From here on it is in memory.
    assert found.metrics.as_dict()["events"] == 121
    assert taken == []


@pytest.mark.parametrize(
    "wrong",
    [{"time": -1}, {"time": float("nan")}, {"event": 1.5}, {"iteration": -1}, {"time": 1e30},
     {"time": 1, "event": 1}, {"time": "1ms"}, {"event": True}, {"iteration": [3]}],
)  # fmt: skip
def test_invalid_instants(wrong: dict[str, Any]) -> None:
    """It is refused before anything is read."""
    with pytest.raises(BrrtError):
        snapshot(recording(STAR), **wrong)


def test_the_event_of_an_instant_is_printed(brrt: Callable[..., Result]) -> None:
    """The event itself with all digits, and up to nine before it; within 80 columns."""
    brrt("plan", "--planner", "rrt-star", "--iterations", 200, "--out", "a.mcap")
    log = read(Path("a.mcap")).events()
    chosen = [int(log[kind]["seq"][-1]) for kind in (Kind.EDGE, Kind.REWIRE, Kind.PHASE)]
    for seq in (0, 4, *chosen):
        text = brrt("replay", "a.mcap", "--at-event", seq).out.split(f"event {seq:,}")[1]
        text = text.partition(":")[2]
        numbers = [
            int(n) for n in re.findall(r"^ +(\d+)  [a-z]", text.replace(",", ""), re.MULTILINE)
        ]
        assert numbers == list(range(max(0, seq - 9), seq + 1))
        assert max(map(len, text.splitlines())) <= 80
    q = log[Kind.EDGE]["q"][-1].tolist()
    text = " ".join(brrt("replay", "a.mcap", "--at-event", chosen[0]).out.split())
    assert all(repr(x) in text for x in q)
    late = brrt("replay", "a.mcap", "--at-event", len(log) + 5)
    assert f"event {len(log) - 1:,} and the events before it" in late.out
