"""When a planner's loop returns and its run stops, by time and by signal, in any iteration."""

import threading
import time
from dataclasses import replace
from itertools import count
from typing import Any

import numpy as np
import pytest

from brrt import Events, Memory, Recording, Run, Scenario, reproduce, verify
from brrt.events import Kind, Status
from brrt.kernels import event_log
from brrt.planners.base.stop import Stop
from brrt.replay.metrics import metrics
from brrt.runs.branch import BranchedRun
from tests.conftest import recorded
from tests.support import naive
from tests.support.files import begins

ENDLESS: dict[str, dict[str, Any]] = {
    "rrt": {"step": 1e-5},
    "rrt-connect": {"step": 1e-5},
    "bi-rrt": {"step": 1e-5, "grow": "connect", "link": "connect"},
    "rrt-star": {"step": 150.0, "gamma": 1e9},
    "bi-rrt-star": {"step": 150.0, "gamma": 1e9},
    "lrta-star": {"cell": 1e-3, "lookahead": 10_000},
    "a-star": {"cell": 1e-3},
}
"""Settings with which a single iteration, or the whole search, takes seconds or hours."""

CUT: dict[str, tuple[str, dict[str, Any]]] = {
    "rrt-connect": ("empty2d", {"step": 0.02}),
    "bi-rrt": ("circles2d:n=20,seed=3", {"step": 0.05, "grow": "connect", "link": "connect"}),
    "rrt-star": ("circles2d:n=20,seed=3", {"gamma": 300.0, "step": 20.0}),
    "bi-rrt-star": ("circles2d:n=60,seed=2", {"gamma": 300.0, "step": 60.0}),
    "lrta-star": ("circles2d:n=20,seed=3", {"lookahead": 300}),
}
"""Worlds and settings with iterations of many events."""


def status(log: Events) -> Status:
    """How planning ended."""
    return Status(int(log[Kind.PHASE]["status"][1]))


@pytest.mark.slow
@pytest.mark.parametrize("planner", ["rrt", "rrt-star", "lrta-star", "a-star"])
def test_slow_planners_hand_over_what_they_have(
    planner: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where each iteration takes long, each is a batch; the log stays the same."""
    scenario = Scenario(
        world="circles2d:n=9", seed=1, planner=planner, iterations=60, clock="logical"
    )
    _, log = recorded(scenario)
    monkeypatch.setattr(event_log, "_MAX_DELAY_S", -1.0)
    monkeypatch.setattr(event_log, "_EVENTS_PER_CALL", 1)
    run, memory = Run(scenario), Memory()
    run.execute([memory])
    assert len(memory.batches) > 20
    assert begins(log, memory.events())
    assert len(memory.events()) == len(log)
    naive.assert_same(memory.events(), log)


@pytest.mark.parametrize("planner", ENDLESS)
def test_the_time_is_kept(planner: str) -> None:
    """A time limit ends planning although an iteration is not over; no promise is broken."""
    run = Run(Scenario(world="empty2d", planner=planner, params=ENDLESS[planner], time=0.05))
    recording = run.record()
    assert recording.result is not None
    assert recording.result["status"] == "time limit"
    assert recording.result["nodes"] + recording.result["expanded"] > 10
    assert recording.result["plan_time_s"] < 3


@pytest.mark.parametrize("planner", ENDLESS)
def test_an_interruption_is_obeyed(planner: str) -> None:
    """A flag that another thread sets ends planning although an iteration is not over."""
    run = Run(Scenario(world="empty2d", planner=planner, params=ENDLESS[planner]))
    threading.Timer(0.1, lambda: setattr(run.stop, "interrupted", True)).start()
    begun = time.perf_counter()
    found = run.execute()
    assert found.as_dict()["status"] == "interrupted"
    assert time.perf_counter() - begun < 5


def test_smoothing_and_execution_are_interrupted() -> None:
    """The smoother and the robot stop where a flag is set while they work."""
    for phase, kind in ((2, Kind.SHORTCUT), (3, Kind.MOVE)):
        shortcuts = 10**9 if phase == 2 else 0
        run = Run(
            Scenario(
                world="circles2d:n=20,seed=1", shortcuts=shortcuts, execute=True, max_move=1e-5
            )
        )
        memory = Memory()
        for batch in run.events():
            memory.write(batch)
            run.stop.interrupted |= kind in batch.counts
        log = memory.events()
        assert log[Kind.PHASE]["status"][-1] == Status.INTERRUPTED
        assert 0 < log.counts[kind] < 10**5


def cut_at(scenario: Scenario, events: int) -> Recording:
    """Record a run that an interruption ends once the log has so many events."""
    run, memory = Run(scenario), Memory()
    run.stop.events = events
    run.execute([memory])
    recording = memory.recording(run.manifest, run.problem.world)
    log = memory.events()
    tables = {kind: table.copy() for kind, table in log.tables.items()}
    planned = tables[Kind.PHASE]["status"][1:2]
    if planned[0] == Status.ITERATION_LIMIT:
        planned[:] = Status.INTERRUPTED
    recording = replace(recording, batches=lambda: iter([Events(log.dof, tables)]))
    return replace(recording, result=metrics(recording).as_dict())


@pytest.mark.parametrize("planner", CUT)
def test_runs_that_end_within_an_iteration(planner: str) -> None:
    """They begin as the whole run does, keep all promises, are reproduced, and continue."""
    world, params = CUT[planner]
    scenario = Scenario(
        world=world, planner=planner, params=params, iterations=90, clock="logical", smooth=False
    )
    _, whole = recorded(scenario)
    within = 0
    last = len(whole) - 3
    for events in {*np.linspace(4, last, 15).astype(int).tolist(), *range(last - 9, last)}:
        recording = cut_at(scenario, events)
        log = Events.concat(whole.dof, recording.batches())
        assert status(log) is Status.INTERRUPTED
        assert events <= len(log) - 1 <= events + 320
        naive.assert_same(log.until(seq=len(log) - 2), whole.until(seq=len(log) - 2))
        assert verify(recording).findings == []
        again = reproduce(recording)
        assert again.equal, list(again.lines())
        if whole.until(seq=len(log) - 2).last.iteration == 0:
            continue
        child = BranchedRun(recording, settings={"iterations": 90})
        within += child.manifest.branches[-1].events < len(log) - 1
        naive.assert_same(child.record().events(), whole)
    assert within


def test_a_branch_at_an_iteration_that_was_not_finished() -> None:
    """It is refused where that iteration is asked for, and where it is the first one."""
    scenario = Scenario(world="empty2d", planner="rrt-connect", params={"step": 0.02})
    recording = cut_at(scenario, 500)
    with pytest.raises(Exception, match=r"ended within iteration 1; branch after iteration 0"):
        BranchedRun(recording, iteration=1)
    search = Scenario(world="empty2d", planner="lrta-star", params={"lookahead": 300})
    with pytest.raises(Exception, match=r"within iteration 0; .* plan from the start"):
        BranchedRun(cut_at(search, 50), settings={"iterations": 9})


def test_a_stop_by_time() -> None:
    """The budget is asked before and after each call of a loop."""
    stop, passed = Stop(iterations=9, time_s=2.0), count()
    reasons: list[Any] = [stop.reached(0, float(next(passed))) for _ in range(3)]
    assert reasons == [None, None, Status.TIME_LIMIT]
    assert stop.reached(9, 0.0) is Status.ITERATION_LIMIT
    stop.interrupted = True
    assert stop.reached(0, 0.0) is Status.INTERRUPTED
