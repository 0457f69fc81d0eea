"""When a planner's loop hands over its events: by time, however slow an iteration is."""

import pytest

from brrt import Run, Scenario
from brrt.planners.base.stop import Stop
from brrt.recording import Memory
from tests.conftest import recorded
from tests.support.files import begins


@pytest.mark.parametrize("planner", ["rrt", "rrt-star", "lrta-star", "a-star"])
def test_slow_planners_hand_over_what_they_have(
    planner: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where each iteration takes long, each is a batch; the log stays the same."""
    scenario = Scenario(
        world="circles2d:n=9", seed=1, planner=planner, iterations=60, clock="logical"
    )
    _, log = recorded(scenario)
    clock = iter(range(10**9))
    monkeypatch.setattr("brrt.kernels.event_log._MAX_DELAY_S", -1.0)
    monkeypatch.setattr("brrt.planners.base.stop.time.monotonic", lambda: float(next(clock)))
    run, memory = Run(scenario), Memory()
    run.stop._share = 1
    run.execute([memory])
    assert len(memory.batches) > 20
    assert begins(log, memory.events())
    assert len(memory.events()) == len(log)


def test_share_of_a_slow_planner_and_of_a_fast_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """A loop is given as many iterations as take about a tenth of a second."""
    now = [0.0]
    monkeypatch.setattr("brrt.planners.base.stop.time.monotonic", lambda: now[0])
    for iteration_s in (1e-6, 1e-3, 1.0):
        stop, share = Stop(iterations=10**9), 0
        for _ in range(60):
            share = stop.share(0)
            now[0] += share * iteration_s
        assert share == 1 or 0.05 <= share * iteration_s <= 0.4
