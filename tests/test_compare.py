"""Two runs side by side: what is told of them is true, and no more is read than needed."""

import json
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from brrt import Comparison, Events, Kind, Manifest, McapSink, Scenario, World, compare, read
from brrt.manifest import Branch

from .conftest import Result, recorded

SCENARIO = Scenario(world="circles2d:n=40,seed=3", seed=7, clock="logical")
OTHER = replace(SCENARIO, params={"step": 1.5})
Live = tuple[Manifest, World, Events]


def live(scenario: Scenario) -> Live:
    """Return a run as it is in memory."""
    run, log = recorded(scenario)
    return run.manifest, run.problem.world, log


def unplanned(scenario: Scenario) -> Live:
    """Return a run that has not begun; nothing is compiled for it."""
    problem = scenario.make_problem()
    start, goal = (tuple(q.tolist()) for q in (problem.start, problem.goal))
    manifest = Manifest(scenario, start, goal, 2, problem.dof, 0, {}, problem.robot.to_json())
    return manifest, problem.world, Events(problem.dof, {})


def filed(run: Live, path: Path, *, whole: bool = True) -> Path:
    """Write a run to a file, in small batches."""
    manifest, world, log = run
    if path.suffix == ".rrd":
        from brrt.recording.rerun import RerunSink

        sink: Any = RerunSink(manifest, world, path=path)
    else:
        sink = McapSink(path, manifest, world)
    sink.write(log)
    sink.close(whole=whole)
    return path


def altered(run: Live, kind: Kind, row: int, **fields: Any) -> Live:
    """Return a run in which one event is another one."""
    manifest, world, log = run
    table = log[kind].copy()
    for name, value in fields.items():
        table[name][row] = value
    return manifest, world, Events(log.dof, {**log.tables, kind: table})


@pytest.mark.parametrize("kinds", [(".mcap", ".mcap"), (".mcap", ".rrd"), (".rrd", ".rrd")])
def test_files_and_memory_are_equal(kinds: tuple[str, str], tmp_path: Path) -> None:
    """A run equals its own recordings, and those each other, whatever their kind."""
    run = live(SCENARIO)
    a, b = (filed(run, tmp_path / f"{i}{kind}") for i, kind in enumerate(kinds))
    for left, right in ((a, b), (read(a), run), (run, str(b))):
        found = compare(left, right)
        assert found.equal
        assert found.lines()[-1].startswith("The events are equal")
        assert found.figures[0] == found.figures[1]
        assert found.events[0] == found.events[1]


@settings(max_examples=40)
@given(data=st.data())
def test_the_parting_event_and_what_is_ahead_of_it(data: st.DataObject) -> None:
    """One event is changed: that one is told, its field is marked, with the ten ahead of it."""
    run = live(SCENARIO)
    log = run[2]
    row = data.draw(st.integers(0, len(log[Kind.EDGE]) - 1))
    event = log[Kind.EDGE][row]
    other = altered(run, Kind.EDGE, row, cost=np.nextafter(event["cost"], np.inf))
    found = compare(run, other)
    assert found.first is not None
    assert not found.equal
    seq = int(event["seq"])
    assert [ahead["seq"] for ahead in found.first.before] == list(range(max(0, seq - 10), seq))
    assert found.as_dict()["first"]["fields"] == ["cost"]
    told = found.lines()
    assert any(f"{seq:,}" in line and "*cost" in line for line in told)
    shown = next(line.split("cost: ")[1] for line in told if line.strip().startswith("cost: "))
    assert len(set(shown.split(" against "))) == 2
    assert all(len(line) <= 80 for line in told)


CHANGED = {
    "seed": replace(SCENARIO, seed=8),
    "iterations": replace(SCENARIO, iterations=50),
    "shortcuts": replace(SCENARIO, shortcuts=3),
    "smooth": replace(SCENARIO, smooth=False),
    "param step": OTHER,
    "planner": replace(SCENARIO, planner="rrt-connect"),
    "start": replace(SCENARIO, start=(6.0, 5.0)),
    "robot polygons": replace(SCENARIO, robot="polygon:length=1,width=1"),
    "world balls": replace(SCENARIO, world="circles2d:n=41,seed=3"),
    "world upper": replace(SCENARIO, world="circles2d:n=40,seed=3,size=90"),
}


@pytest.mark.parametrize("name", CHANGED)
def test_settings_that_differ_are_named(name: str) -> None:
    """Whatever decides what a run does is told where it differs."""
    sides = [unplanned(each) for each in (SCENARIO, CHANGED[name])]
    found = compare(*sides)
    assert not found.equal
    assert name in [row.name for row in found.settings]
    assert any(line.startswith(f"  {name}") for line in found.lines())
    assert not compare(sides[0], sides[0]).settings


def test_defaults_names_and_versions_are_no_difference() -> None:
    """A default that is given, another file name and another version leave runs equal."""
    manifest, world, log = live(replace(SCENARIO, params={"goal_bias": 0.05}))
    other = replace(
        manifest,
        scenario=replace(manifest.scenario, world="moved/map.json", params={}),
        made_by={**manifest.made_by, "numpy": "1.0"},
    )
    found = compare((manifest, world, log), (other, replace(world, name="moved"), log))
    assert found.equal
    assert {row.name for row in found.notes} == {"world", "numpy"}


def test_where_a_run_branched_is_a_setting() -> None:
    """A run that changed its settings on the way is another run."""
    manifest, world, log = live(SCENARIO)
    turn = Branch("", "", 100, 300, SCENARIO, seed=4)
    found = compare((manifest, world, log), (replace(manifest, branches=(turn,)), world, log))
    assert found.settings == (("branches", "none", "100 with seed 4"),)


def test_paths_differ_by_a_waypoint() -> None:
    """Of two paths the first waypoint that differs is told, and not all of them."""
    run = live(SCENARIO)
    waypoints = run[2][Kind.PATH]["waypoints"][0].copy()
    waypoints[2] += 1
    told = compare(run, altered(run, Kind.PATH, 0, waypoints=waypoints)).lines()
    assert any(line.strip().startswith("waypoint 2: (") for line in told)
    told = compare(run, altered(run, Kind.PATH, 0, waypoints=waypoints[1:])).lines()
    assert f"waypoints: {len(waypoints)} against {len(waypoints) - 1}" in "\n".join(told)


def test_a_world_of_the_same_name_with_other_content() -> None:
    """One circle has moved a little; the name says nothing of it."""
    manifest, world, log = live(SCENARIO)
    balls = world.balls.copy()
    balls[3, 0] += 1e-9
    found = compare((manifest, world, log), (manifest, replace(world, balls=balls), log))
    assert not found.equal
    assert found.first is None
    (row,) = found.settings
    assert (row.name, row.b) == ("world balls", "1 of them other ones")


def test_reads_no_further_than_needed() -> None:
    """An early difference costs the first batch, and figures come from the end of the file."""
    manifest, world, log = live(SCENARIO)
    read_so_far = []

    def batches(log: Events) -> Iterator[Events]:
        for part in (log.until(seq=20), log):
            read_so_far.append(part)
            yield part

    a, b = ((manifest, world, batches(each)) for each in (log, live(OTHER)[2]))
    assert compare(a, b).first is not None
    assert len(read_so_far) == 2


@pytest.mark.parametrize("kind", [".mcap", ".rrd"])
def test_counts_come_from_the_end_of_the_file(kind: str, tmp_path: Path) -> None:
    """Counts of all kinds are read without the events; a cut file has none."""
    run = live(SCENARIO)
    path = filed(run, tmp_path / f"run{kind}")
    counts = read(path).counts
    assert counts is not None
    assert {kind: count for kind, count in counts.items() if count} == dict(run[2].counts)
    early = compare(path, live(OTHER))
    assert early.first is not None
    assert early.events[0]["path"] == len(run[2][Kind.PATH])
    for size in (1, 9, 40, 300) if kind == ".mcap" else (10_000,):
        path.write_bytes(path.read_bytes()[:-size])
        assert read(path).counts is None
        assert read(path).result is None


def test_command(brrt: Callable[..., Result], tmp_path: Path) -> None:
    """Exit codes, text and JSON of the command."""
    a, b = (filed(live(each), tmp_path / f"{i}.mcap") for i, each in enumerate((SCENARIO, OTHER)))
    same = brrt("diff", a, a)
    assert (same.code, same.err) == (0, "")
    parted = brrt("diff", a.name, b.name)
    assert parted.code == 1
    assert "brrt view 0.mcap 1.mcap" in parted.out
    assert brrt("replay", a.name, "--at-event", "3").code == 0
    told = brrt("diff", a, b, "--json")
    assert told.code == 1
    assert told.json["first"]["seq"] == 3
    assert told.json["settings"] == [{"name": "param step", "a": "auto", "b": 1.5}]
    for kind in told.json["events"].values():
        assert kind["a"] > 0
    missing = brrt("diff", a, "none.mcap")
    assert missing.code == 2
    assert missing.err.count("\n") == 1


def test_files_that_were_cut(brrt: Callable[..., Result], tmp_path: Path) -> None:
    """Where the difference lies ahead of the cut nothing is missing but the figures."""
    whole = filed(live(SCENARIO), tmp_path / "whole.mcap")
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(whole.read_bytes()[:-100])
    refused = brrt("diff", whole, cut)
    assert refused.code == 2
    assert "--partial" in refused.err
    assert brrt("diff", whole, cut, "--partial").code == 0
    other = filed(live(OTHER), tmp_path / "other.mcap")
    early = brrt("diff", other, cut)
    assert early.code == 1
    assert "cut: no result" in early.out


def test_one_object_of_json_even_with_infinities() -> None:
    """JSON has no infinity."""
    run = live(SCENARIO)
    found: Comparison = compare(altered(run, Kind.EDGE, 5, cost=np.inf), run)
    json.dumps(found.as_dict(), allow_nan=False)
