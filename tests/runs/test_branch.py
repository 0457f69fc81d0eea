"""Runs that branch off a recorded one with other settings."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from brrt import (
    BranchedRun,
    BrrtError,
    Kind,
    McapSink,
    Recording,
    ReproducedRun,
    Scenario,
    first_difference,
    read,
    verify,
)  # fmt: skip
from brrt.events import Events, Phase, Status
from brrt.runs.branch import last_complete_iteration
from brrt.runs.run import Run
from brrt.scenario.manifest import Manifest
from tests.conftest import Result, findings_of, recorded
from tests.planners import test_rrt
from tests.planners.test_rrt import column, plain, status
from tests.planners.test_tree_planners import scenarios as two_trees
from tests.support import naive

scenarios = st.one_of(test_rrt.scenarios(), two_trees)
RECORDINGS = Path(__file__).parents[2] / "recordings"
FEW = settings(max_examples=12)
SETTINGS: dict[str, dict[str, Any]] = {
    "rrt": {"step": 2.0, "goal_bias": 0.5, "goal_test": "line-of-sight", "count_failed": False},
    "rrt-connect": {"step": 2.0},
    "bi-rrt": {"step": 2.0, "link": "connect", "turn": "smaller"},
    "rrt-star": {"step": 9.0, "gamma": 60.0, "informed": True},
    "bi-rrt-star": {"step": 9.0, "connect_distance": 3.0, "informed": True},
}


def parent(scenario: Scenario) -> tuple[Recording, Events]:
    """Return a run's recording and log."""
    run, log = recorded(scenario)
    return Recording(run.manifest, run.problem.world, lambda: iter([log]), None, name="parent"), log


def child(recording: Recording, **how: Any) -> tuple[BranchedRun, Events]:
    """Return a branch and its log."""
    run = BranchedRun(recording, **how)
    return run, Events.concat(run.problem.dof, run.events())


def last_open(log: Events) -> int:
    """Return the last iteration of planning, or the one before if that found a path."""
    ends = log[Kind.PHASE]
    end = ends[(ends["name"] == Phase.PLAN) & (ends["status"] != Status.BEGIN)][0]
    return int(end["iteration"]) - int(end["status"] == Status.SOLVED)


@FEW
@given(scenarios, st.data(), st.sampled_from([1, 40, 8192]))
def test_without_a_change_it_is_the_parent(
    scenario: Scenario, data: st.DataObject, batch: int
) -> None:
    """The generator continues, so all events are the same, smoothing and moves included."""
    recording, log = parent(replace(scenario, smooth=True, execute=True, iterations=400))
    last = last_open(log)
    if last < 1:
        return
    iteration = data.draw(st.integers(0, last - 1))
    run, again = child(recording, iteration=iteration, batch=batch)
    assert first_difference([log], [again]) is None
    assert run.manifest.branches[0].parent == recording.manifest.digest()
    shared = run.manifest.branches[0].events
    naive.assert_same(log.until(seq=shared - 1), again.until(seq=shared - 1))
    assert log.until(iteration=iteration)[Kind.EDGE]["seq"].tolist() == [
        seq for seq in log[Kind.EDGE]["seq"].tolist() if seq < shared
    ]


@FEW
@given(scenarios, st.data(), st.none() | st.integers(0, 9))
def test_a_change_rules_from_the_branch_on(
    scenario: Scenario, data: st.DataObject, seed: int | None
) -> None:
    """The log begins as the parent's, keeps the contract of each stretch, and is reproducible."""
    recording, log = parent(replace(scenario, iterations=300))
    last = last_open(log)
    if last < 1:
        return
    iteration = data.draw(st.integers(0, last - 1))
    params = SETTINGS[scenario.planner]
    run, events = child(recording, iteration=iteration, params=params, seed=seed)
    shared = run.manifest.branches[0].events
    naive.assert_same(log.until(seq=shared - 1), events.until(seq=shared - 1))
    assert column(events, "seq").tolist() == list(range(len(events)))
    assert (np.diff(column(events, "t")) > 0).all()
    assert (column(events, "iteration")[shared:] >= iteration).all()
    assert (
        events[Kind.SAMPLE]["iteration"][events[Kind.SAMPLE]["seq"] >= shared] > iteration
    ).all()
    manifest = Manifest.from_strings(run.manifest.to_strings())
    assert manifest == run.manifest
    assert findings_of(manifest, recording.world, events) == []
    again = ReproducedRun(replace(recording, manifest=manifest))
    assert first_difference([events], again.events()) is None


@pytest.mark.parametrize("planner", sorted(SETTINGS))
def test_a_failed_run_gets_more_iterations(planner: str) -> None:
    """It equals the run that had them from the start; so does an interrupted run."""
    scenario = plain("circles2d:n=60,seed=1", planner=planner, iterations=60, seed=5)
    scenario = replace(scenario, params={"step": 1.0})
    recording, _ = parent(scenario)
    _, whole = parent(replace(scenario, iterations=200))
    assert status(whole) is Status.ITERATION_LIMIT
    _, more = child(recording, settings={"iterations": 200})
    naive.assert_same(whole, more)

    run = Run(replace(scenario, iterations=200), batch=20)
    batches: list[Events] = []
    for number, events in enumerate(run.events()):
        run.stop.interrupted = number == 2
        batches.append(events)
    assert batches[-1][Kind.PHASE]["status"][-1] == Status.INTERRUPTED
    cut = Recording(run.manifest, run.problem.world, lambda: iter(batches), None)
    naive.assert_same(whole, child(cut)[1])


def test_a_branch_of_a_branch() -> None:
    """Each stretch has its own settings; a branch before another one replaces it."""
    recording, _ = parent(plain("circles2d:n=60,seed=2", iterations=300, params={"step": 5.0}))
    world = recording.world
    for n, (iteration, step) in enumerate([(40, 3.0), (80, 2.0), (80, 1.0)], 1):
        run, events = child(recording, iteration=iteration, params={"step": step}, seed=n)
        assert findings_of(run.manifest, world, events) == []
        one_step = replace(run.manifest, branches=())
        assert findings_of(one_step, world, events)
        assert (
            first_difference(
                [events], ReproducedRun(replace(recording, manifest=run.manifest)).events()
            )
            is None
        )
        recording = Recording(run.manifest, world, lambda e=events: iter([e]), None)  # type: ignore[misc]
    steps = [scenario.params["step"] for _, scenario in recording.manifest.stretches]
    assert steps == [5.0, 3.0, 2.0, 1.0]
    early, events = child(recording, iteration=50)
    assert [b.iteration for b in early.manifest.branches] == [40, 50]
    assert early.manifest.scenario.params["step"] == 3.0
    assert findings_of(early.manifest, world, events) == []


def test_a_first_path_can_be_improved() -> None:
    """RRT* that stopped at its first path continues with `stop_at_first=false`."""
    scenario = plain(
        "circles2d:n=20,seed=3", planner="rrt-star", iterations=600, params={"stop_at_first": True}
    )
    recording, log = parent(scenario)
    assert status(log) is Status.SOLVED
    with pytest.raises(BrrtError, match="stop_at_first=false"):
        BranchedRun(recording)
    run, more = child(recording, params={"stop_at_first": False})
    assert len(more[Kind.PATH]) > 1
    never = replace(scenario, params={"stop_at_first": False})
    assert first_difference(parent(never)[0].batches(), [more]) is None
    assert findings_of(run.manifest, recording.world, more) == []


@FEW
@given(scenarios, st.data())
def test_the_last_complete_iteration(scenario: Scenario, data: st.DataObject) -> None:
    """At an event that is not the last of its iteration, the iteration before is complete."""
    _, log = parent(replace(scenario, iterations=100))
    iterations = column(log, "iteration").tolist()
    seq = data.draw(st.integers(0, len(log) - 1))
    cut = data.draw(st.integers(0, len(log) - 1))
    batches = [log.until(seq=cut), naive_rest(log, cut)]
    found, ended = last_complete_iteration(batches, {"seq": seq})
    over = iterations[seq] if iterations[seq + 1 : seq + 2] != [iterations[seq]] else None
    phases = log[Kind.PHASE]
    end = int(phases["seq"][phases["status"] != Status.BEGIN][0])
    if seq >= end - 1:
        assert (found, ended is not None) == (iterations[end - 1], True)
    else:
        assert (found, ended) == (iterations[seq] - 1 if over is None else over, None)


def naive_rest(log: Events, cut: int) -> Events:
    """Return the events after an event."""
    return Events(log.dof, {k: t[t["seq"] > cut] for k, t in log.tables.items()})


def test_a_doctored_recording_is_refused() -> None:
    """The message names the event at which planning again differs, and the versions."""
    recording, log = parent(plain("circles2d:n=20,seed=3", iterations=200, params={"step": 1.0}))
    tables = {kind: table.copy() for kind, table in log.tables.items()}
    tables[Kind.SAMPLE]["q"][7, 1] += 1e-9
    doctored = replace(recording, batches=lambda: iter([Events(2, tables)]))
    seq = tables[Kind.SAMPLE]["seq"][7]
    BranchedRun(doctored, iteration=7)
    with pytest.raises(BrrtError, match=rf"event {seq} \(sample\): q .* both by brrt"):
        BranchedRun(doctored, iteration=8)
    other = replace(recording.manifest, made_by={**recording.manifest.made_by, "numba": "0.1"})
    with pytest.raises(BrrtError, match=r"numba 0\.1 then, .* now$"):
        BranchedRun(replace(doctored, manifest=other))


def test_refusals() -> None:
    """Each message is one line and says what to do."""
    recording, log = parent(plain("circles2d:n=20,seed=3", iterations=5000))
    assert status(log) is Status.SOLVED
    last = last_open(log) + 1
    cases: dict[str, dict[str, Any]] = {
        f"ended with its path at iteration {last}; branch before": {},
        f"planning ended with iteration {last}; branch there at the latest": {"iteration": 9999},
        "a branch keeps the world of its recording": {"settings": {"world": "maze2d"}},
        "unknown setting of a branch 'itrations'": {"settings": {"itrations": 3}},
        "unknown parameter of planner rrt 'stp'": {"iteration": 3, "params": {"stp": 3}},
        "3 of 2 iterations are made; give more": {"iteration": 3, "settings": {"iterations": 2}},
        "s have passed of 1e-09; give more": {"iteration": 3, "settings": {"time": 1e-9}},
        "unknown argument 'foo'": {"foo": 2},
        "iteration must be a whole number from 0 on, not '7'": {"iteration": "7"},
    }
    for message, how in cases.items():
        with pytest.raises(BrrtError, match=message):
            BranchedRun(recording, **how)
    wrong: Any
    for wrong, message in (
        ("run.mcap", r"give brrt\.read\('run\.mcap'\)"),
        (log, "returns, not Events"),
    ):
        with pytest.raises(BrrtError, match=message):
            BranchedRun(wrong)
    foreign = replace(recording.manifest, scenario=Scenario(planner="dogleg"))
    with pytest.raises(BrrtError, match="dogleg is not registered"):
        BranchedRun(replace(recording, manifest=foreign), iteration=3)


@pytest.mark.parametrize("name", ["circles2d-rrt", "circles2d-chain", "circles2d-rrt-star"])
def test_golden_recordings(name: str, tmp_path: Path) -> None:
    """Old recordings of any robot can be branched off; the file holds the whole branch."""
    recording = read(RECORDINGS / f"{name}.mcap")
    log = recording.events()
    iteration = last_open(log) // 2
    run = BranchedRun(recording, iteration=iteration, seed=8)
    run.execute([McapSink(tmp_path / "child.mcap", run.manifest, recording.world)])
    written = read(tmp_path / "child.mcap")
    assert written.manifest == run.manifest
    assert written.manifest.to_strings()["format"] == "2"
    assert written.manifest.branches[0].file == f"{name}.mcap"
    found = first_difference([log], written.batches())
    assert found is not None
    assert found.seq >= written.manifest.branches[0].events
    assert verify(written).holds


def test_damaged_manifests() -> None:
    """Damaged branches and later formats are refused in one line."""
    recording, _ = parent(plain("circles2d:n=20,seed=3", iterations=200, params={"step": 1.0}))
    texts = BranchedRun(recording, iteration=9).manifest.to_strings()
    lies = texts["branches"].replace('"events": ', '"events": -')
    for wrong in ("{", "[3]", "[{}]", '"x"', "7", lies):
        with pytest.raises(BrrtError, match="the manifest is damaged"):
            Manifest.from_strings({**texts, "branches": wrong})
    with pytest.raises(BrrtError, match="update brrt"):
        Manifest.from_strings({**texts, "format": "4"})


def test_on_the_command_line(brrt: Callable[..., Result]) -> None:
    """`brrt plan --from` writes the parent's events up to the branch, then its own."""
    where = ("--world", "circles2d:n=20,seed=3", "--no-smooth")
    assert brrt("plan", *where, "--iterations", 40, "--out", "run.mcap").code == 1
    done = brrt("plan", "--from", "run.mcap", "--iterations", 5000, "--out", "more.mcap")
    assert done.code == 0
    assert "after iteration 40; the" in done.err
    brrt("plan", *where, "--iterations", 5000, "--out", "whole.mcap")
    assert brrt("replay", "more.mcap", "--check", "whole.mcap").code == 0
    at = ("--from", "run.mcap", "--at-iteration", 20, "--param", "step=1")
    assert brrt("plan", *at, "--out", "small.mcap").code in {0, 1}
    assert "first difference is event" in brrt("replay", "small.mcap", "--check", "run.mcap").out
    assert "from run.mcap at iteration 20: step 1, was auto" in brrt("replay", "small.mcap").out
    assert "run.mcap at iteration 20" in brrt("diff", "small.mcap", "run.mcap").out
    assert brrt("verify", "small.mcap").code == 0
    assert "at iteration 20 of run.mcap: step" in brrt("replay", "small.mcap", "--text").out
    for message, options in {
        "is the recording that --from continues": ("--from", "run.mcap", "--out", "run.mcap"),
        "say where to branch": ("--at-event", 3),
        "leave out x.toml": ("x.toml", "--from", "run.mcap"),
        "keeps the planner of its recording": ("--from", "run.mcap", "--planner", "rrt"),
    }.items():
        refused = brrt("plan", *options, "--force")
        assert refused.code == 2
        assert message in refused.err
        assert refused.err.count("\n") == 1


@pytest.mark.parametrize(
    ("planner", "iterations", "params"),
    [
        ("rrt", 5000, {}),
        ("rrt-star", 300, {}),
        ("bi-rrt-star", 300, {"stop_at_first": True}),
        ("a-star", 9000, {"cell": 2.0}),
        ("lrta-star", 9000, {"cell": 2.0, "trials": 2}),
    ],
)
def test_what_follows_planning_can_change(
    planner: str, iterations: int, params: dict[str, Any]
) -> None:
    """Planning ends as it did; then the smoother has another number of attempts."""
    scenario = Scenario(
        world="circles2d:n=20,seed=3", planner=planner, params=params, iterations=iterations
    )
    recording, _ = parent(scenario)
    run, events = child(recording, settings={"shortcuts": 7})
    assert first_difference([parent(replace(scenario, shortcuts=7))[1]], [events]) is None
    assert len(events[Kind.SHORTCUT]) == 7
    assert findings_of(run.manifest, recording.world, events) == []
    with pytest.raises(BrrtError, match=r"ended with its path|give more by --iterations"):
        BranchedRun(recording)


def test_a_run_is_made_once() -> None:
    """Its generator and its log have advanced, so a second run would differ."""
    run = Run(plain("circles2d:n=20,seed=3", iterations=50))
    run.execute([])
    with pytest.raises(BrrtError, match=r"made once; make another brrt\.Run\(scenario\)"):
        run.execute([])


def test_too_many_branches() -> None:
    """A run may have a thousand; more are refused, in a file before they are read."""
    recording, _ = parent(Scenario(world="empty2d", iterations=20, smooth=False))
    manifest = BranchedRun(recording, iteration=3).manifest
    many = replace(manifest, branches=manifest.branches * 1000)
    message = "the run has 1,001 branches, and may have at most 1,000; plan one run with"
    with pytest.raises(BrrtError, match=message):
        replace(many, branches=manifest.branches * 1001)
    texts = many.to_strings()
    texts["branches"] = f"[{'1, ' * 1000}1]"
    with pytest.raises(BrrtError, match=message):
        Manifest.from_strings(texts)
