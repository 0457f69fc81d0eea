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

from brrt import (
    BrrtError,
    Comparison,
    Events,
    Kind,
    Manifest,
    McapSink,
    Memory,
    Metrics,
    Recording,
    Run,
    Scenario,
    World,
    compare,
    read,
    snapshot,
)
from brrt.formats import CutError
from brrt.scenario.manifest import Branch
from tests.cli.test_replay import cut
from tests.conftest import Result, recorded, result_of

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
        from brrt.views.rerun.sink import RerunSink

        sink: Any = RerunSink(manifest, world, path=path)
    else:
        sink = McapSink(path, manifest, world)
    sink.write(log)
    sink.close(result_of(manifest, log) if whole else None)
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
    turn = Branch("", "p.mcap", 100, 300, SCENARIO, seed=4)
    turned = replace(manifest, branches=(turn,))
    found = compare((manifest, world, log), (turned, world, log))
    assert found.settings == (("branched from", "none", "p.mcap at iteration 100"),)
    moved = replace(manifest, branches=(replace(turn, file="elsewhere.mcap"),))
    assert compare((turned, world, log), (moved, world, log)).equal
    other = replace(manifest, branches=(replace(turn, seed=5),))
    found = compare((turned, world, log), (other, world, log))
    (row,) = found.settings
    assert (row.a, row.b) == (
        "p.mcap at iteration 100: draws from seed 4", "p.mcap at iteration 100: draws from seed 5"
    )  # fmt: skip


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


def figures(run: Live, until: int | None = None) -> dict[str, Any]:
    """Fold a run's events, or those up to a number."""
    metrics = Metrics(run[0])
    metrics.write(run[2].until(seq=until))
    return metrics.as_dict()


@pytest.mark.parametrize("known", [True, False])
def test_reads_no_further_than_needed(*, known: bool) -> None:
    """An early difference costs the first batch, if the figures stand at the end of the file."""
    runs, read_so_far = (live(SCENARIO), live(OTHER)), []

    def batches(log: Events) -> Iterator[Events]:
        for part in cut(log, 20):
            read_so_far.append(part)
            yield part

    def opened(run: Live) -> Recording:
        manifest, world, log = run
        return Recording(manifest, world, lambda: batches(log), figures(run) if known else None)

    found = compare(*map(opened, runs))
    assert found.first is not None
    assert found.figures == tuple(map(figures, runs))
    assert len(read_so_far) == (2 if known else sum(len(cut(log, 20)) for _, _, log in runs))


@settings(max_examples=60)
@given(data=st.data())
def test_figures_go_as_far_as_the_recording(data: st.DataObject) -> None:
    """Wherever files are cut, and whatever they are compared with: the figures are never mixed."""
    runs = [live(data.draw(st.sampled_from([SCENARIO, OTHER]))) for _ in range(2)]
    ends = [data.draw(st.none() | st.integers(0, len(log) - 1)) for _, _, log in runs]

    def opened(run: Live, end: int | None) -> Recording:
        manifest, world, log = run
        size = data.draw(st.integers(5, 200))
        whole = None if end is not None else figures(run)
        parts = cut(log.until(seq=end), size)
        return Recording(manifest, world, lambda: iter(parts), whole, log.counts if whole else None)

    found = compare(*map(opened, runs, ends))
    for run, end, told, kinds, until in zip(
        runs, ends, found.figures, found.events, found.cuts, strict=True
    ):
        part = run[2].until(seq=end)
        assert told == figures(run, end)
        assert {name: n for name, n in kinds.items() if n} == {
            kind.label: n for kind, n in part.counts.items()
        }
        assert until == (None if end is None else (end + 1, part.last.t / 1e9))
    text = str(found)
    assert text.count("   cut behind event") == sum(end is not None for end in ends)
    assert all(len(line) <= 80 for line in found.lines())
    assert ("the run has ended" in text) is (
        found.first is not None
        and None in (found.first.left, found.first.right)
        and ends[found.first.left is not None] is None
    )


def test_a_run_that_begins_like_another() -> None:
    """A log that is the beginning of another is called so; a file that was cut, cut."""
    manifest, world, log = live(SCENARIO)
    n, short = len(log) // 2, log.until(seq=len(log) // 2)
    told = compare((manifest, world, short), (manifest, world, log)).lines()
    assert f"A is the beginning of B: B goes on after event {n:,}:" in told
    assert f"A {n + 1:,}  the run has ended" in told
    short_file = Recording(manifest, world, lambda: iter([short]), None)
    told = compare((manifest, world, log), short_file).lines()
    assert f"B is cut, and up to there equal to A: A goes on after event {n:,}:" in told
    assert f"B {n + 1:,}  the recording is cut here" in told


def test_what_a_planner_decides_is_told() -> None:
    """Two defaults that come out as different steps are a difference; one that is given is none."""
    star = replace(SCENARIO, planner="rrt-star")
    rows = {row.name: row for row in compare(unplanned(SCENARIO), unplanned(star)).settings}
    assert rows["param step"][1:] == ("auto: 5", "auto: 20")
    assert rows["param gamma"].a is None
    given_step = replace(SCENARIO, params={"step": 5.0})
    assert not compare(unplanned(SCENARIO), unplanned(given_step)).settings
    smaller = replace(SCENARIO, world="circles2d:n=40,seed=3,size=90")
    rows = {row.name: row for row in compare(unplanned(SCENARIO), unplanned(smaller)).settings}
    assert rows["param step"][1:] == ("auto: 5", "auto: 4.5")


def test_values_that_are_long_stand_below_each_other() -> None:
    """Each beside the letter of its run."""
    manifest, world, log = live(SCENARIO)
    name = "maps/" + "x" * 40
    other = replace(manifest, scenario=replace(manifest.scenario, world=name))
    told = [
        " ".join(line.split())
        for line in compare((manifest, world, log), (other, world, log)).lines()
    ]
    at = told.index(f"world A {manifest.scenario.world}")
    assert told[at + 1] == f"B {name}"


def test_moves_are_those_of_a_robot_that_moved() -> None:
    """A path that nobody drove has motions."""
    told = compare(live(SCENARIO), live(OTHER)).lines()
    (motions,) = (line.split() for line in told if line.startswith("  motions"))
    paths = [run[2][Kind.PATH]["waypoints"][-1] for run in (live(SCENARIO), live(OTHER))]
    assert motions[1:3] == [str(len(path) - 1) for path in paths]
    assert not any(line.startswith("  moves") for line in told)
    driven = compare(live(replace(SCENARIO, execute=True)), live(SCENARIO)).lines()
    assert any(line.startswith("  moves") for line in driven)


def test_runs_in_memory_and_what_is_none() -> None:
    """A run goes with its log; one without the other is refused in one line that says so."""
    run, log = Run(replace(SCENARIO, iterations=50)), Memory()
    run.execute([log])
    own = (run.manifest, run.problem.world, log.events())
    for other in ((run, log), (run, log.events()), (run, log.batches), own):
        assert compare((run, log), other).equal
    wrong: Any
    for wrong in (run, log, log.events(), (run,), (run, run), (log, run), (run, "log"), 5, None):
        with pytest.raises(BrrtError, match=r"\(run, log\)") as error:
            compare(own, wrong)
        assert "\n" not in str(error.value)


def test_short_words_for_long_things(tmp_path: Path) -> None:
    """What Python prints of a recording, an instant or a comparison fits a line or a screen."""
    recording = read(filed(live(SCENARIO), tmp_path / "run.mcap"))
    moment, found = snapshot(recording, iteration=20), compare(recording, live(OTHER))
    assert str(found).splitlines() == found.lines()
    for each in (recording, moment, found):
        assert len(repr(each)) < 120
    assert "run.mcap" in repr(recording)
    assert "iteration 20" in repr(moment)


@pytest.mark.parametrize("kind", [".mcap", ".rrd"])
def test_reading_a_cut_file_in_part(kind: str, tmp_path: Path) -> None:
    """The error names the remedy, and that gives what is whole."""
    path = filed(live(SCENARIO), tmp_path / f"run{kind}")
    path.write_bytes(path.read_bytes()[:-300])
    with pytest.raises(CutError, match=r"partial=True\) takes what is whole$"):
        _ = snapshot(read(path)).events
    part = read(path, partial=True)
    assert part.result is None
    assert compare(part, live(SCENARIO)).cuts[0] == (len(part.events()), part.events().last.t / 1e9)


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
    assert told.json["settings"] == [{"name": "param step", "a": "auto: 5", "b": 1.5}]
    for kind in told.json["events"].values():
        assert kind["a"] > 0
    missing = brrt("diff", a, "none.mcap")
    assert missing.code == 2
    assert missing.err.count("\n") == 1


def test_files_that_were_cut(brrt: Callable[..., Result], tmp_path: Path) -> None:
    """Where the difference lies ahead of the cut nothing is missing but the figures."""
    whole = filed(live(SCENARIO), tmp_path / "whole.mcap")
    broken = tmp_path / "cut.mcap"
    broken.write_bytes(whole.read_bytes()[:-100])
    refused = brrt("diff", whole, broken)
    assert refused.code == 2
    assert "--partial" in refused.err
    assert brrt("diff", whole, broken, "--partial").code == 0
    # What is told of a file does not depend on what it is compared with, nor on how it was saved.
    short = filed(
        (*live(SCENARIO)[:2], live(SCENARIO)[2].until(seq=150)), tmp_path / "short.rrd", whole=False
    )
    assert brrt("recover", short, "--out", "saved.mcap").code == 0
    other = filed(live(OTHER), tmp_path / "other.mcap")
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
        assert (
            done.json["metrics"]["iterations"][side] == figures(live(SCENARIO), 150)["iterations"]
        )
        assert brrt("diff", a, b, "--partial").out.count("   cut behind event 150 (") == 1 + (
            b == short
        )
    early = brrt("diff", other, broken)
    assert early.code == 1
    assert f"cut behind event {len(live(SCENARIO)[2]) - 1:,} (" in early.out


def test_one_object_of_json_even_with_infinities() -> None:
    """JSON has no infinity."""
    run = live(SCENARIO)
    found: Comparison = compare(altered(run, Kind.EDGE, 5, cost=np.inf), run)
    json.dumps(found.as_dict(), allow_nan=False)
