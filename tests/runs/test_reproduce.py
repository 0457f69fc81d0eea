"""Reproduced runs: equal however the recorded run ended; doctored events are found."""

import os
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from brrt import (
    BrrtError,
    Events,
    Kind,
    McapSink,
    Recording,
    Reproduction,
    Run,
    Scenario,
    World,
    read,
    reproduce,
)
from brrt.events import Phase, Status
from brrt.planners import make_stop
from brrt.runs.reproduce import stopped_at
from tests.conftest import Result, recorded, result_of
from tests.support.logs import split

RECORDINGS = Path(__file__).parents[2] / "recordings"
PLAIN = Scenario(world="circles2d:n=30,seed=3", seed=7, execute=True, max_move=3.0)
PLANNERS = {
    "rrt": PLAIN,
    "rrt, failed ones not counted": replace(PLAIN, params={"count_failed": False}),
    "rrt-connect": replace(PLAIN, planner="rrt-connect", start="random", goal="random"),
    "rrt-star": replace(PLAIN, planner="rrt-star", iterations=500),
    "lrta-star": replace(PLAIN, planner="lrta-star", world="circles2d:n=5,seed=3,size=20"),
    "a-star": replace(PLAIN, planner="a-star", world="circles2d:n=5,seed=3,size=20"),
}


def again(run: Run, batches: list[Events], **options: Any) -> Reproduction:
    """Reproduce a run."""
    return reproduce(Recording(run.manifest, run.problem.world, lambda: batches), **options)


@pytest.mark.parametrize("path", sorted(RECORDINGS.glob("*.mcap")), ids=lambda p: p.stem)
def test_golden_recordings(path: Path) -> None:
    """Each golden recording is reproduced to the last bit."""
    recording = read(path)
    found = reproduce(recording)
    assert found.equal
    assert found.ended == ""
    assert recording.result is not None
    assert found.events == recording.result["events"]


@pytest.mark.parametrize("name", PLANNERS)
@settings(max_examples=12)
@given(batch=st.integers(1, 60), stop=st.integers(0, 40))
def test_an_interrupted_run(name: str, batch: int, stop: int) -> None:
    """Interrupted after any batch, in any phase, it is reproduced up to there."""
    run = Run(PLANNERS[name], batch=batch)
    run.stop.interrupted = stop == 0
    batches = []
    for number, events in enumerate(run.events(), 1):
        run.stop.interrupted |= number == stop
        batches.append(events)
    found = again(run, batches)
    assert found.equal, list(found.lines())
    ended_well = len(batches) < stop
    if ended_well:
        assert found.ended == ""


@pytest.mark.parametrize("name", PLANNERS)
def test_a_cut_log(name: str) -> None:
    """All events of a killed run are compared."""
    run, log = recorded(PLANNERS[name])
    for seq in np.linspace(0, len(log) - 2, 12).astype(int):
        found = again(run, split(log.until(seq=int(seq)), 50))
        assert found.equal
        assert found.events == seq + 1


@pytest.mark.parametrize("name", PLANNERS)
def test_a_run_that_the_clock_ended(name: str) -> None:
    """The clock ends planning; smoothing and execution follow, and all is reproduced."""
    scenario = replace(PLANNERS[name], goal=None, iterations=None, time=1e-9)
    run = Run(scenario)
    batches = list(run.events())
    phases = Events.concat(run.problem.dof, batches)[Kind.PHASE]
    assert Status.TIME_LIMIT in phases["status"]
    found = again(run, batches)
    assert found.equal
    assert found.ended.startswith("the clock ended planning in iteration")


def test_a_clock_that_lets_a_path_be_found() -> None:
    """RRT* has a path when its time is over, after more iterations than its default."""
    scenario = replace(PLANNERS["rrt-star"], iterations=None, time=0.15)
    run = Run(scenario)
    batches = list(run.events())
    phases = Events.concat(2, batches)[Kind.PHASE]
    assert (Phase.PLAN, Status.TIME_LIMIT) in phases[["name", "status"]].tolist()
    assert again(run, batches).equal


def doctored(log: Events, kind: Kind, name: str, change: Callable[[Any], Any]) -> Events:
    """Return a log in which a field of the middle event of a kind differs."""
    table = log[kind].copy()
    table[name][len(table) // 2] = change(table[name][len(table) // 2])
    return Events(log.dof, {**log.tables, kind: table})


@pytest.mark.parametrize(
    ("kind", "name"),
    [(Kind.SAMPLE, "q"), (Kind.EDGE, "cost"), (Kind.REJECT, "node"), (Kind.PATH, "cost")],
)
def test_what_was_doctored_is_found(kind: Kind, name: str) -> None:
    """The event with the changed number is the first difference."""
    run, log = recorded(PLAIN)
    other = doctored(log, kind, name, lambda value: value + 1)
    found = again(run, [other])
    assert not found.equal
    assert found.first is not None
    assert found.first.fields == [name]
    assert found.first.seq == log[kind]["seq"][len(log[kind]) // 2]
    assert any(line.startswith("recorded") for line in found.lines())


def test_rounding_passes_and_is_reported() -> None:
    """Numbers may differ by rounding; the greatest deviation is reported. Integers may not."""
    run, log = recorded(PLAIN)
    other = doctored(log, Kind.EDGE, "cost", lambda value: value * (1 + 1e-12))
    found = again(run, [other])
    assert found.equal
    assert found.deviation.worst == pytest.approx(1e-12, rel=1e-3)
    assert found.deviation.name == "cost"
    assert found.deviation.seq == log[Kind.EDGE]["seq"][len(log[Kind.EDGE]) // 2]
    assert "1e-12 apart" in list(found.lines())[-1]
    assert not again(run, [other], tolerance=0.0).equal
    assert not again(run, [other], tolerance=1e-13).equal


def test_a_missing_phase_is_an_interruption() -> None:
    """A log without its smoothing passes; one with more events than the run does not."""
    run, log = recorded(replace(PLAIN, execute=False))
    smoothing = int(log[Kind.PHASE]["seq"][2])
    found = again(run, [log.until(seq=smoothing - 1)])
    assert found.equal
    assert "interrupted before the phase smooth" in found.ended
    shorter = Run(replace(PLAIN, smooth=False, execute=False))
    assert not again(shorter, [log]).equal


def test_other_versions_are_reported() -> None:
    """They are no difference of the runs."""
    run, log = recorded(PLAIN)
    manifest = replace(run.manifest, made_by={**run.manifest.made_by, "numpy": "1.0"})
    found = reproduce(Recording(manifest, run.problem.world, lambda: [log]))
    assert found.equal
    (row,) = found.versions
    assert (row.name, row.a) == ("numpy", "1.0")


def foreign(folder: Path) -> Path:
    """Write a recording of a planner that is not registered."""
    run, log = recorded(PLAIN)
    scenario = replace(run.manifest.scenario, planner="somebodys", params={})
    sink = McapSink(folder / "foreign.mcap", replace(run.manifest, scenario=scenario),
                    run.problem.world)  # fmt: skip
    sink.write(log)
    sink.close(result_of(run.manifest, log))
    return folder / "foreign.mcap"


def test_command(brrt: Callable[..., Result], tmp_path: Path) -> None:
    """The files of world and robot are not needed; JSON and exit codes."""
    (tmp_path / "there").mkdir()
    os.chdir(tmp_path / "there")
    World("mine", np.zeros(2), np.full(2, 10.0), balls=np.array([[5, 5, 1]])).save("mine.json")
    ends = ("--start", "1,1", "--goal", "9,9", "--execute")
    assert brrt("plan", "--world", "mine.json", *ends, "--out", "run.mcap").code == 0
    Path("mine.json").unlink()
    os.chdir(tmp_path)
    done = brrt("verify", "there/run.mcap", "--rerun")
    assert done.code == 0
    assert re.search(r"planned again: \d+ events, equal to the last bit", done.out)
    told = brrt("verify", "there/run.mcap", "--rerun", "--tolerance", "0", "--json")
    assert told.json["rerun"]["equal"]
    assert told.json["rerun"]["tolerance"] == 0
    assert "rerun" not in brrt("verify", "there/run.mcap", "--json").json
    assert brrt("verify", "there/run.mcap", "--tolerance", "0").code == 2
    unknown = brrt("verify", foreign(tmp_path), "--rerun")
    assert unknown.code == 2
    assert unknown.err.strip().count("\n") == 0
    assert "somebodys is not registered" in unknown.err


def test_doctored_file_fails_the_command(brrt: Callable[..., Result], tmp_path: Path) -> None:
    """A moved sample breaks no rule, but the reproduced run differs."""
    run, log = recorded(replace(PLAIN, clock="logical"))
    other = doctored(log, Kind.SAMPLE, "q", lambda q: q * 0.999)
    sink = McapSink(tmp_path / "run.mcap", run.manifest, run.problem.world)
    sink.write(other)
    sink.close(result_of(run.manifest, other))
    done = brrt("verify", "run.mcap", "--rerun")
    assert done.code == 1
    assert "The first difference is event" in done.out


def test_a_stop_beyond_the_default() -> None:
    """A run that made more iterations in its time than its default is reproduced in full."""
    scenario = replace(PLAIN, time=5.0)
    stop = make_stop(stopped_at(scenario, 3_000_000))
    assert stop.draws == 3_000_000
    assert stop.iterations > 3_000_000
    assert stop.time_s is None


def test_planners_that_are_not_registered(tmp_path: Path) -> None:
    """Their runs cannot be reproduced."""
    recording = read(foreign(tmp_path))
    with pytest.raises(BrrtError, match="somebodys is not registered"):
        reproduce(recording)
