"""Runs: their settings are numbers of any library, and threads get their interval back."""

import sys
import threading
from typing import Any

import numpy as np
import pytest

from brrt import BrrtError, Events, Run, Scenario
from brrt.runs.branch import BranchedRun


class Held:
    """A sink that lets a run go on only when it is told."""

    def __init__(self) -> None:
        self.entered, self.released = threading.Event(), threading.Event()

    def write(self, events: Events) -> None:
        """Wait at the first batch."""
        self.entered.set()
        assert self.released.wait(20)

    def close(self, result: Any) -> None:
        """Keep nothing."""


def test_overlapping_runs_restore_the_switch_interval() -> None:
    """The first of two runs ends first; once both have ended, threads switch as before."""
    usual = sys.getswitchinterval()
    sinks = [Held(), Held()]
    threads = []
    for seed, sink in enumerate(sinks):
        run = Run(Scenario(seed=seed))
        threads.append(threading.Thread(target=run.execute, args=([sink],)))
        threads[-1].start()
        assert sink.entered.wait(20)
    during = sys.getswitchinterval()
    for sink, thread in zip(sinks, threads, strict=True):
        sink.released.set()
        thread.join()
    assert during < usual
    assert sys.getswitchinterval() == usual


def test_the_switch_interval_after_an_error() -> None:
    """A sink that fails ends the run, and threads switch as before."""

    class Failing(Held):
        def write(self, events: Events) -> None:
            raise OSError("disk")

    usual = sys.getswitchinterval()
    with pytest.raises(OSError, match="disk"):
        Run(Scenario()).execute([Failing()])
    assert sys.getswitchinterval() == usual


def test_moves_that_cannot_be_counted() -> None:
    """A move limit is refused if the moves would not fit into 32 bits."""
    for limit in (1e-17, 1e-150, 3e-8):
        with pytest.raises(BrrtError, match=r"too small for this world; .* at least 5e-"):
            Run(Scenario(world="empty2d", execute=True, max_move=limit))
    Run(Scenario(world="empty2d", execute=True, max_move=5e-7))
    run = Run(Scenario(world="empty2d", execute=True, max_move=5e-7, params={"step": 1.0}))
    object.__setattr__(run._execute, "max_move", 1e-9)
    with pytest.raises(BrrtError, match=r"too small for this path; it must be at least 6\.4e-08"):
        run.record()


def test_numpy_numbers_in_branches() -> None:
    """Seeds, instants and settings of a branch may be numpy's."""
    numbers: Any = np.array([1, 30])
    scenario = Scenario(world="empty2d", seed=numbers[0], iterations=numbers[1])
    recording = Run(scenario).record()
    plain = BranchedRun(recording, iteration=5, seed=7, settings={"iterations": 40})
    given: dict[str, Any] = {"iteration": np.int64(5), "seed": np.int64(7)}
    numpy = BranchedRun(recording, **given, settings={"iterations": np.int16(40)})
    assert plain.manifest.to_strings().keys() == numpy.manifest.to_strings().keys()
    assert plain.manifest.scenario == numpy.manifest.scenario


def test_failed_draws_do_not_count() -> None:
    """With count_failed off a run makes as many iterations as allowed, in more draws."""
    scenario = Scenario(iterations=100, params={"count_failed": False})
    recording = Run(scenario).record()
    assert recording.result is not None
    found = recording.result
    assert found["counted_iterations"] == 100
    assert found["iterations"] == found["samples"] > 100
    child = BranchedRun(recording, params={"count_failed": True}, settings={"iterations": 150})
    result = child.record().result
    assert result is not None
    assert result["counted_iterations"] == 150
    assert result["iterations"] == found["iterations"] + 50
