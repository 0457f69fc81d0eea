"""Two runs compared: what is printed is true, and no more is read than needed."""

import json
from collections.abc import Callable, Iterator
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
    Manifest,
    McapSink,
    Memory,
    Problem,
    Recording,
    Run,
    Scenario,
    compare,
    read,
    snapshot,
)
from brrt.formats import CutError
from brrt.scenario.manifest import Branch
from tests.conftest import Result, result_of
from tests.support.logs import recording, split

SCENARIO = Scenario(world="circles2d:n=40,seed=3", seed=7, clock="logical")
OTHER = replace(SCENARIO, params={"step": 1.5})


def unplanned(scenario: Scenario) -> Recording:
    """Return a run without events; nothing is compiled for it."""
    problem = Problem.of(scenario)
    start, goal = (tuple(q.tolist()) for q in (problem.start, problem.goal))
    manifest = Manifest(scenario, start, goal, 2, problem.dof, 0, {}, problem.robot.to_json())
    return Recording(manifest, problem.world, list)


def write(run: Recording, path: Path) -> Path:
    """Write a recording to a file."""
    if path.suffix == ".rrd":
        from brrt.views.rerun.sink import RerunSink

        sink: Any = RerunSink(run.manifest, run.world, path=path)
    else:
        sink = McapSink(path, run.manifest, run.world)
    for batch in run.batches():
        sink.write(batch)
    sink.close(run.result)
    return path


def altered(run: Recording, kind: Kind, row: int, **fields: Any) -> Recording:
    """Return a run in which one event differs."""
    log = run.events()
    table = log[kind].copy()
    for name, value in fields.items():
        table[name][row] = value
    return replace(run, batches=lambda: [Events(log.dof, {**log.tables, kind: table})])


def until(run: Recording, seq: int) -> Recording:
    """Return a run that is cut after an event."""
    log = run.events().until(seq=seq)
    return replace(run, batches=lambda: [log], result=None)


@pytest.mark.parametrize("kinds", [(".mcap", ".mcap"), (".mcap", ".rrd"), (".rrd", ".rrd")])
def test_files_and_memory_are_equal(kinds: tuple[str, str], tmp_path: Path) -> None:
    """A run equals its own recordings, and those each other, whatever their format."""
    run = recording(SCENARIO)
    a, b = (write(run, tmp_path / f"{i}{kind}") for i, kind in enumerate(kinds))
    for left, right in ((a, b), (read(a), run), (run, str(b))):
        found = compare(left, right)
        assert found.equal
        assert found.lines()[-1].startswith("All events are equal")
        assert found.metrics[0] == found.metrics[1]
        assert found.counts[0] == found.counts[1]


def test_runs_in_memory() -> None:
    """What `record` and `Memory` return is compared; anything else is refused in one line."""
    run, memory = Run(replace(SCENARIO, iterations=50)), Memory()
    run.execute([memory])
    kept = memory.recording(run.manifest, run.problem.world)
    assert compare(kept, Run(run.manifest.scenario).record()).equal
    wrong: Any
    for wrong in (run, memory, (run, memory), 5, None):
        with pytest.raises(BrrtError, match=r"compare takes recordings or names of files") as error:
            compare(kept, wrong)
        assert "\n" not in str(error.value)


@settings(max_examples=40)
@given(data=st.data())
def test_the_first_difference_is_marked(data: st.DataObject) -> None:
    """One event is changed: that one is shown, its field is marked, with the ten before it."""
    run = recording(SCENARIO)
    edges = run.events()[Kind.EDGE]
    row = data.draw(st.integers(0, len(edges) - 1))
    other = altered(run, Kind.EDGE, row, cost=np.nextafter(edges["cost"][row], np.inf))
    found = compare(run, other)
    assert found.first is not None
    assert not found.equal
    seq = int(edges["seq"][row])
    assert [event["seq"] for event in found.first.before] == list(range(max(0, seq - 10), seq))
    assert found.as_dict()["first"]["fields"] == ["cost"]
    lines = found.lines()
    assert any(f"{seq:,}" in line and "*cost" in line for line in lines)
    shown = next(line.split("cost: ")[1] for line in lines if line.strip().startswith("cost: "))
    assert len(set(shown.split(" against "))) == 2
    assert all(len(line) <= 80 for line in lines)


def test_paths_differ_by_a_waypoint() -> None:
    """Of two paths the first waypoint that differs is shown, and not all of them."""
    run = recording(SCENARIO)
    waypoints = run.events()[Kind.PATH]["waypoints"][0].copy()
    waypoints[2] += 1
    lines = compare(run, altered(run, Kind.PATH, 0, waypoints=waypoints)).lines()
    assert any(line.strip().startswith("waypoint 2: (") for line in lines)
    text = str(compare(run, altered(run, Kind.PATH, 0, waypoints=waypoints[1:])))
    assert f"waypoints: {len(waypoints)} against {len(waypoints) - 1}" in text


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
    """Whatever decides what a run does is named if it differs."""
    runs = [unplanned(each) for each in (SCENARIO, CHANGED[name])]
    found = compare(*runs)
    assert not found.equal
    assert name in [row.name for row in found.settings]
    assert any(line.startswith(f"  {name}") for line in found.lines())
    assert not compare(runs[0], runs[0]).settings


def test_defaults_names_and_versions_are_not_settings() -> None:
    """A default that is given, another file name and another version leave runs equal."""
    run = recording(replace(SCENARIO, params={"goal_bias": 0.05}))
    manifest = run.manifest
    other = replace(
        manifest,
        scenario=replace(manifest.scenario, world="moved/map.json", params={}),
        made_by={**manifest.made_by, "numpy": "1.0"},
    )
    found = compare(run, replace(run, manifest=other, world=replace(run.world, name="moved")))
    assert found.equal
    assert {row.name for row in found.metadata} == {"world", "numpy"}


def test_where_a_run_branched_is_a_setting() -> None:
    """A run that changed its settings on the way is another run."""
    run = recording(SCENARIO)
    branch = Branch("", "p.mcap", 100, 300, SCENARIO, seed=4)

    def branched(**changes: Any) -> Recording:
        branches = (replace(branch, **changes),)
        return replace(run, manifest=replace(run.manifest, branches=branches))

    found = compare(run, branched())
    assert found.settings == (("branched from", "none", "p.mcap at iteration 100"),)
    assert compare(branched(), branched(file="elsewhere.mcap")).equal
    (row,) = compare(branched(), branched(seed=5)).settings
    assert (row.a, row.b) == (
        "p.mcap at iteration 100: draws from seed 4", "p.mcap at iteration 100: draws from seed 5"
    )  # fmt: skip


def test_a_world_of_the_same_name_with_other_content() -> None:
    """One circle has moved a little, which the name does not show."""
    run = recording(SCENARIO)
    balls = run.world.balls.copy()
    balls[3, 0] += 1e-9
    found = compare(run, replace(run, world=replace(run.world, balls=balls)))
    assert not found.equal
    assert found.first is None
    (row,) = found.settings
    assert (row.name, row.b) == ("world balls", "1 of them differ")


def test_automatic_settings_are_resolved() -> None:
    """Automatic steps with different values differ; a given step of the same value is equal."""
    star = replace(SCENARIO, planner="rrt-star")
    rows = {row.name: row for row in compare(unplanned(SCENARIO), unplanned(star)).settings}
    assert rows["param step"][1:] == ("auto: 5", "auto: 20")
    assert rows["param gamma"].a is None
    given_step = replace(SCENARIO, params={"step": 5.0})
    assert not compare(unplanned(SCENARIO), unplanned(given_step)).settings
    smaller = replace(SCENARIO, world="circles2d:n=40,seed=3,size=90")
    rows = {row.name: row for row in compare(unplanned(SCENARIO), unplanned(smaller)).settings}
    assert rows["param step"][1:] == ("auto: 5", "auto: 4.5")


def test_long_values_take_a_line_each() -> None:
    """Each beside the letter of its run."""
    run = recording(SCENARIO)
    name = "maps/" + "x" * 40
    scenario = replace(run.manifest.scenario, world=name)
    other = replace(run, manifest=replace(run.manifest, scenario=scenario))
    lines = [" ".join(line.split()) for line in compare(run, other).lines()]
    at = lines.index(f"world A {run.manifest.scenario.world}")
    assert lines[at + 1] == f"B {name}"


def test_moves_are_those_of_a_robot_that_moved() -> None:
    """A path that was not executed has motions."""
    runs = recording(SCENARIO), recording(OTHER)
    lines = compare(*runs).lines()
    (motions,) = (line.split() for line in lines if line.startswith("  motions"))
    paths = [run.events()[Kind.PATH]["waypoints"][-1] for run in runs]
    assert motions[1:3] == [str(len(path) - 1) for path in paths]
    assert not any(line.startswith("  moves") for line in lines)
    executed = compare(recording(replace(SCENARIO, execute=True)), runs[0]).lines()
    assert any(line.startswith("  moves") for line in executed)


@pytest.mark.parametrize("known", [True, False])
def test_reads_no_further_than_needed(*, known: bool) -> None:
    """If the result is stored, an early difference is found in the first batch."""
    read_so_far = []

    def opened(run: Recording) -> Recording:
        def batches() -> Iterator[Events]:
            for part in run.batches():
                read_so_far.append(part)
                yield part

        return replace(run, batches=batches, result=run.result if known else None)

    runs = [recording(each, 20) for each in (SCENARIO, OTHER)]
    found = compare(*map(opened, runs))
    assert found.first is not None
    assert list(found.metrics) == [run.result for run in runs]
    assert len(read_so_far) == (2 if known else sum(len(list(run.batches())) for run in runs))


@settings(max_examples=60)
@given(data=st.data())
def test_metrics_cover_the_recording(data: st.DataObject) -> None:
    """Wherever files are cut, and whatever they are compared with: the metrics are never mixed."""
    runs = [recording(data.draw(st.sampled_from([SCENARIO, OTHER]))) for _ in range(2)]
    ends = [data.draw(st.none() | st.integers(0, len(run.events()) - 2)) for run in runs]

    def opened(run: Recording, end: int | None) -> Recording:
        log = run.events()
        parts = split(log.until(seq=end), data.draw(st.integers(5, 200)))
        whole = end is None
        return replace(
            run,
            batches=lambda: parts,
            result=run.result if whole else None,
            counts=log.counts if whole else None,
        )

    found = compare(*map(opened, runs, ends))
    for run, end, metrics, counts, cut in zip(
        runs, ends, found.metrics, found.counts, found.cuts, strict=True
    ):
        part = run.events().until(seq=end)
        assert metrics == result_of(run.manifest, part)
        assert {name: n for name, n in counts.items() if n} == {
            kind.label: n for kind, n in part.counts.items()
        }
        assert cut == (None if end is None else (end + 1, part.last.t / 1e9))
    text = str(found)
    assert text.count("   cut after event") == sum(end is not None for end in ends)
    assert all(len(line) <= 80 for line in found.lines())
    assert ("the run has ended" in text) is (
        found.first is not None
        and None in (found.first.left, found.first.right)
        and ends[found.first.left is not None] is None
    )


def test_a_run_that_begins_like_another() -> None:
    """A log may be the beginning of another, whether its run ended there or it is cut."""
    run = recording(SCENARIO)
    n = len(run.events()) // 2
    short = until(run, n)
    lines = compare(replace(short, result=result_of(run.manifest, short.events())), run).lines()
    assert f"A ends after event {n:,}; B equals it up to there and continues:" in lines
    assert f"A {n + 1:,}  the run has ended" in lines
    lines = compare(run, short).lines()
    assert f"B is cut after event {n:,} and equals A up to there:" in lines
    assert f"B {n + 1:,}  the recording is cut here" in lines


def test_a_recording_without_a_result_may_be_complete() -> None:
    """If its last phase has ended, it is not cut."""
    run = recording(SCENARIO)
    assert compare(replace(run, result=None), run).cuts == (None, None)


def test_texts_are_short(tmp_path: Path) -> None:
    """What Python prints of a recording, a snapshot or a comparison fits a line or a screen."""
    run = read(write(recording(SCENARIO), tmp_path / "run.mcap"))
    early, found = snapshot(run, iteration=20), compare(run, recording(OTHER))
    assert str(found).splitlines() == found.lines()
    for each in (run, early, found):
        assert len(repr(each)) < 120
    assert "run.mcap" in repr(run)
    assert "iteration 20" in repr(early)


def test_reading_a_cut_file_in_part(tmp_path: Path) -> None:
    """The error names the remedy, which gives what can be read."""
    path = write(recording(SCENARIO), tmp_path / "run.mcap")
    path.write_bytes(path.read_bytes()[:-300])
    with pytest.raises(CutError, match=r"partial=True\) reads up to there$"):
        _ = snapshot(read(path)).events
    part = read(path, partial=True)
    assert part.result is None
    assert compare(part, recording(SCENARIO)).equal


@pytest.mark.parametrize("kind", [".mcap", ".rrd"])
def test_counts_come_from_the_end_of_the_file(kind: str, tmp_path: Path) -> None:
    """Counts of all kinds are read without the events; a cut file has none."""
    run = recording(SCENARIO)
    path = write(run, tmp_path / f"run{kind}")
    counts = read(path).counts
    assert counts is not None
    assert {kind: count for kind, count in counts.items() if count} == dict(run.events().counts)
    early = compare(path, recording(OTHER))
    assert early.first is not None
    assert early.counts[0]["path"] == len(run.events()[Kind.PATH])
    for size in (1, 9, 40, 300) if kind == ".mcap" else ():
        path.write_bytes(path.read_bytes()[:-size])
        assert read(path).counts is None
        assert read(path).result is None


def test_command(brrt: Callable[..., Result], tmp_path: Path) -> None:
    """Exit codes, text and JSON of the command."""
    a, b = (
        write(recording(each), tmp_path / f"{i}.mcap") for i, each in enumerate((SCENARIO, OTHER))
    )
    same = brrt("diff", a, a)
    assert (same.code, same.err) == (0, "")
    differs = brrt("diff", a.name, b.name)
    assert differs.code == 1
    assert "brrt view 0.mcap 1.mcap" in differs.out
    assert brrt("replay", a.name, "--at-event", "3").code == 0
    found = brrt("diff", a, b, "--json")
    assert found.code == 1
    assert found.json["first"]["seq"] == 3
    assert found.json["settings"] == [{"name": "param step", "a": "auto: 5", "b": 1.5}]
    for kind in found.json["events"].values():
        assert kind["a"] > 0
    missing = brrt("diff", a, "none.mcap")
    assert missing.code == 2
    assert missing.err.count("\n") == 1


def test_files_that_were_cut(brrt: Callable[..., Result], tmp_path: Path) -> None:
    """If the difference lies before the cut, nothing is missing but the metrics."""
    run = recording(SCENARIO)
    whole = write(run, tmp_path / "whole.mcap")
    broken = tmp_path / "cut.mcap"
    broken.write_bytes(whole.read_bytes()[:-100])
    refused = brrt("diff", whole, broken)
    assert refused.code == 2
    assert "--partial" in refused.err
    assert brrt("diff", whole, broken, "--partial").code == 0
    # The result does not depend on what a file is compared with, nor on its format.
    short = write(until(run, 150), tmp_path / "short.rrd")
    assert brrt("recover", short, "--out", "saved.mcap").code == 0
    other = write(recording(OTHER), tmp_path / "other.mcap")
    metrics = result_of(run.manifest, run.events().until(seq=150))
    for a, b in (
        ("saved.mcap", other),
        (other, "saved.mcap"),
        ("saved.mcap", short),
        (short, whole),
    ):
        done = brrt("diff", a, b, "--partial", "--json")
        assert done.code == (b != short)
        side = "b" if a == other else "a"
        assert done.json["cut"][side]["events"] == 151
        assert done.json["metrics"]["events"][side] == 151
        assert sum(kind[side] for kind in done.json["events"].values()) == 151
        assert done.json["metrics"]["iterations"][side] == metrics["iterations"]
        text = brrt("diff", a, b, "--partial").out
        assert text.count("   cut after event 150 (") == 1 + (b == short)
    early = brrt("diff", other, broken)
    assert early.code == 1
    assert f"cut after event {len(run.events()) - 1:,} (" in early.out


def test_json_has_no_infinity() -> None:
    """An infinite cost becomes null."""
    run = recording(SCENARIO)
    found = compare(altered(run, Kind.EDGE, 5, cost=np.inf), run)
    json.dumps(found.as_dict(), allow_nan=False)
