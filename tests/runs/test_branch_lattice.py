"""Searches on a lattice that branch off a recorded one with other settings."""

from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from brrt import BranchedRun, BrrtError, Kind, Recording, ReproducedRun, Scenario
from brrt import first_difference as parting
from brrt.events import Phase, Status
from tests.conftest import findings_of
from tests.planners.test_rrt import status
from tests.runs.test_branch import FEW, child, last_open, parent
from tests.support import naive

CAVE = Scenario(
    world="circles2d:n=40,seed=2", planner="lrta-star", params={"cell": 2.0}, smooth=False,
    clock="logical",
)  # fmt: skip


@st.composite
def scenarios(draw: st.DrawFn) -> Scenario:
    """Draw a search on a coarse lattice, so that it ends soon."""
    planner = draw(st.sampled_from(["a-star", "lrta-star"]))
    params: dict[str, Any] = {
        "cell": draw(st.sampled_from([2.0, 3.6])),
        "diagonals": draw(st.booleans()),
        "max_move": draw(st.sampled_from([0.0, 5.0])),
    }
    if planner == "lrta-star":
        params |= {"lookahead": draw(st.sampled_from([1, 2, 7])), "trials": draw(st.integers(1, 3))}
    seed = draw(st.integers(0, 9))
    world = draw(st.sampled_from(["circles2d:n=40", "squares2d:n=30"]))
    return Scenario(
        world=f"{world},seed={seed}", seed=seed, planner=planner, params=params, iterations=600
    )


@FEW
@given(scenarios(), st.data(), st.sampled_from([1, 40, 8192]))
def test_without_a_change_it_is_the_parent(
    scenario: Scenario, data: st.DataObject, batch: int
) -> None:
    """All events are the same, smoothing included."""
    recording, log = parent(scenario)
    iteration = data.draw(st.integers(0, last_open(log) - 1))
    _, again = child(recording, iteration=iteration, batch=batch)
    assert parting([log], [again]) is None


@FEW
@given(scenarios(), st.data(), st.sampled_from([1, 3, 12]), st.integers(1, 4))
def test_a_change_rules_from_the_branch_on(
    scenario: Scenario, data: st.DataObject, lookahead: int, trials: int
) -> None:
    """Each stretch keeps its contract, and the run is reproducible; so is a branch of a branch."""
    recording, log = parent(scenario)
    params = {"lookahead": lookahead, "trials": trials} if scenario.planner == "lrta-star" else {}
    how: dict[str, Any] = {"params": params, "settings": {"iterations": 900}}
    last = last_open(log) - 1
    for _ in range(2):
        iteration = data.draw(st.integers(0, last))
        run, events = child(recording, iteration=iteration, **how)
        shared = run.manifest.branches[-1].events
        naive.assert_same(recording.events().until(seq=shared - 1), events.until(seq=shared - 1))
        assert findings_of(run.manifest, recording.world, events) == []
        assert (
            parting([events], ReproducedRun(replace(recording, manifest=run.manifest)).events())
            is None
        )
        recording = Recording(run.manifest, recording.world, lambda e=events: iter([e]), None)  # type: ignore[misc]
        last = last_open(events) - 1
        how = {"params": {"lookahead": 2} if params else {}}


@pytest.mark.parametrize("planner", ["a-star", "lrta-star"])
def test_a_failed_run_gets_more_iterations(planner: str) -> None:
    """It equals the run that had them from the start."""
    scenario = replace(CAVE, planner=planner, iterations=30)
    recording, log = parent(scenario)
    assert status(log) is Status.ITERATION_LIMIT
    _, whole = parent(replace(scenario, iterations=20_000))
    assert status(whole) is Status.SOLVED
    naive.assert_same(whole, child(recording, settings={"iterations": 20_000})[1])


@pytest.mark.parametrize("lookahead", [1, 5])
def test_more_trials(lookahead: int) -> None:
    """A robot that arrived starts over with what it learned, as with more trials from the start."""
    scenario = replace(CAVE, params={**CAVE.params, "lookahead": lookahead})
    recording, _ = parent(scenario)
    with pytest.raises(BrrtError, match=r"ended with its path at .*, or let it start over"):
        BranchedRun(recording)
    run, more = child(recording, params={"trials": 3})
    assert len(more[Kind.PATH]) == 3
    _, whole = parent(replace(scenario, params={**scenario.params, "trials": 3}))
    assert parting([whole], [more]) is None
    assert findings_of(run.manifest, recording.world, more) == []


def test_another_lookahead_plans_anew() -> None:
    """The moves that were planned with the old lookahead are not made."""
    scenario = replace(CAVE, params={**CAVE.params, "lookahead": 40})
    recording, log = parent(scenario)
    run, events = child(recording, iteration=2, params={"lookahead": 1})
    first = run.manifest.branches[0].events
    assert int(events[Kind.EXPAND]["seq"][events[Kind.EXPAND]["iteration"] == 2][-1]) >= first
    assert parting([log], [events]) is not None
    assert findings_of(run.manifest, recording.world, events) == []
    short = replace(run.manifest, branches=())
    assert findings_of(short, recording.world, events) != []


def test_refusals() -> None:
    """The lattice cannot change; nothing follows an optimal path or a proof."""
    recording, _ = parent(CAVE)
    for name, value in {"cell": 1.0, "diagonals": True, "max_move": 9.0}.items():
        with pytest.raises(
            BrrtError, match=f"{name} cannot change to {value} at a branch: the lattice"
        ):
            BranchedRun(recording, iteration=3, params={name: value})
    shortest, _ = parent(replace(CAVE, planner="a-star"))
    with pytest.raises(BrrtError, match=r"ended with its path at .* \(--at-iteration\)$"):
        BranchedRun(shortest)
    coarse = {"cell": 7.5}
    hopeless = replace(CAVE, world="passage2d:gap=3", params=coarse)
    recording, log = parent(hopeless)
    assert status(log) is Status.NO_PATH
    with pytest.raises(BrrtError, match="ended with the proof that there is no path at iteration"):
        BranchedRun(recording)
    ends = log[Kind.PHASE]
    end = int(ends["iteration"][ends["name"] == Phase.PLAN][-1])
    assert parting([log], [child(recording, iteration=end - 1)[1]]) is None
