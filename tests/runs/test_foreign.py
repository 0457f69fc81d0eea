"""Planners that are not registered: their runs are recorded, read, drawn and verified."""

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from brrt import (
    RRT,
    BrrtError,
    Kind,
    McapSink,
    Memory,
    Metrics,
    Run,
    Scenario,
    forest,
    read,
    verify,
)
from brrt.events import Events, Phase, Stage, Status, table_dtype
from brrt.kernels.event_log import EventLog
from brrt.views.rerun.sink import RerunSink
from tests.conftest import Result, recorded, result_of
from tests.support.toys import TOYS, Silent

FOREIGN = Scenario(
    world="circles2d:n=12,seed=3", planner="their-own", params={"zeal": 7}, seed=3, iterations=60
)


@pytest.fixture
def files(tmp_path: Path) -> list[Path]:
    """Record a planner that states no contract, in both formats."""
    run = Run(FOREIGN, planner=Silent())
    paths, world = [tmp_path / "their.mcap", tmp_path / "their.rrd"], run.problem.world
    run.execute(
        [McapSink(paths[0], run.manifest, world), RerunSink(run.manifest, world, path=paths[1])]
    )
    return paths


def test_recordings_need_no_class(brrt: Callable[..., Result], files: list[Path]) -> None:
    """They replay, verify and draw without the class; verify says what it did not check."""
    for path in files:
        recording = read(path)
        assert recording.manifest.scenario == FOREIGN
        assert verify(recording).holds
        figures = brrt("replay", path, "--json").json
        assert figures["planner"] == "their-own"
        assert figures["links"] == 1
        assert brrt("replay", path, "--rrd", "again.rrd", "--force").code == 0
        done = brrt("verify", path)
        assert done.code == 0
        assert "no contract and planner their-own is not" in done.out
        assert brrt("verify", path, "--json").json["planner_known"] is False


@pytest.mark.parametrize("solve", [None, lambda *_: None])
def test_a_planner_without_batches(solve: Any) -> None:
    """One line says what is missing."""
    planner: Any = SimpleNamespace() if solve is None else SimpleNamespace(solve=solve)
    with pytest.raises(BrrtError, match="needs a method solve that yields batches of events"):
        Run(Scenario(planner="mine"), planner=planner)


def test_verify(brrt: Callable[..., Result], tmp_path: Path) -> None:
    """Exit code 0 if all rules hold, 1 with the event if one is broken, 2 for no recording."""
    run, log = recorded(Scenario(world="circles2d:n=40,seed=3", seed=7, clock="logical"))
    edges = log[Kind.EDGE].copy()
    edges["cost"][-1] += 1
    doctored = Events(log.dof, {**log.tables, Kind.EDGE: edges})
    for name, events in (("good", log), ("bad", doctored)):
        sink = McapSink(tmp_path / f"{name}.mcap", run.manifest, run.problem.world)
        sink.write(events)
        sink.close(result_of(run.manifest, events))
    good, bad = brrt("verify", "good.mcap"), brrt("verify", "bad.mcap")
    assert (good.code, bad.code) == (0, 1)
    assert "edges free" in good.out
    assert "BROKEN" not in good.out
    assert f"event {edges['seq'][-1]:,} at " in bad.out
    assert bad.out.startswith("edge costs ")
    data = brrt("verify", "bad.mcap", "--json").json
    assert data["holds"] is False
    assert [rule["rule"] for rule in data["rules"] if rule["broken"]] == ["edge costs"]
    assert brrt("verify", "none.mcap").code == 2


def test_a_planner_of_ones_own_is_named() -> None:
    """It cannot have the name of a registered planner; a registered one states its settings."""
    with pytest.raises(BrrtError, match="planner rrt is brrt's own; name yours"):
        Run(Scenario(), planner=TOYS["pair"])
    run = Run(Scenario(), planner=RRT(step=3.0))
    assert run.manifest.scenario.params["step"] == 3.0
    with pytest.raises(BrrtError, match="unknown planner 'their-own'"):
        Run(FOREIGN)


@pytest.mark.parametrize(
    ("kind", "fields", "message"),
    [
        (Kind.EDGE, {"tree": 0}, "edge event needs the field 'node' (int32)"),
        (Kind.SAMPLE, {"tree": 0, "source": 0, "q": [1.0]}, "q of a sample event must be 2"),
        (Kind.SAMPLE, {"tree": 0, "source": 0, "q": 3.0}, "q of a sample event must be 2 numbers"),
        (Kind.SAMPLE, {"tree": 0, "source": 0, "Q": [1.0, 2.0]}, "unknown field of a sample event"),
        (Kind.SAMPLE, {"tree": 0, "source": 0, "q": [1.0, 2.0], "x": 1}, "unknown field"),
        (Kind.PATH, {"stage": 0, "cost": "dear", "waypoints": []}, "event must be float64"),
        (Kind.PATH, {"stage": 0, "cost": 1, "waypoints": [[1.0]]}, "must be rows of 2 numbers"),
        (Kind.PHASE, {"name": 2**40, "status": 0}, "name of a phase event must be uint8"),
    ],
)  # fmt: skip
def test_wrong_fields_are_named(kind: Kind, fields: dict[str, Any], message: str) -> None:
    """The message names the kind and the field; nothing is recorded."""
    log = EventLog(2, 4)
    with pytest.raises(BrrtError) as error:
        log.emit(kind, 0, **fields)
    assert message in str(error.value)
    assert "\n" not in str(error.value)
    assert len(log) == 0


def test_a_full_batch_is_named() -> None:
    """A planner that does not drain the log gets an error."""
    log = EventLog(2, 1)
    log.emit(Kind.PHASE, 0, name=Phase.PLAN, status=Status.BEGIN)
    with pytest.raises(BrrtError, match=r"the batch is full; yield log\.drain"):
        log.emit(Kind.PHASE, 0, name=Phase.PLAN, status=Status.SOLVED)


def moved(times_s: list[float], trials: list[int]) -> Events:
    """Return a log with moves at these times; planning begins at 10 s."""
    phases = np.zeros(1, table_dtype(Kind.PHASE, 2))
    phases["t"] = 10**10
    moves = np.zeros(len(trials), table_dtype(Kind.MOVE, 2))
    moves["seq"], moves["trial"] = 1 + np.arange(len(trials)), trials
    moves["t"] = np.round(1e9 * np.array(times_s)).astype(np.int64)
    return Events(2, {Kind.PHASE: phases, Kind.MOVE: moves})


@pytest.mark.parametrize("size", [1, 2, 3, 10])
def test_figures_of_moves(size: int) -> None:
    """The time of a move counts from the move before, across batches; deadlines are 2 s."""
    log = moved([11, 15.5, 16, 18, 18.1], [0, 0, 0, 1, 1])
    run, _ = recorded(Scenario(world="circles2d:n=40,seed=3", seed=7, clock="logical"))
    metrics = Metrics(run.manifest)
    for first in range(0, 6, size):
        tables = {
            kind: table[(table["seq"] >= first) & (table["seq"] < first + size)]
            for kind, table in log.tables.items()
        }
        metrics.write(Events(2, {kind: table for kind, table in tables.items() if len(table)}))
    figures = metrics.as_dict()
    assert figures["moves"] == 2
    assert figures["max_move_time_s"] == 4.5
    assert figures["deadline_misses"] == 1
    assert figures["charged_moves"] == 1 + 3 + 1 + 1 + 1
    assert figures["stays"] == 2


def test_first_and_best_path() -> None:
    """The metrics of the first path stay; the path is the best one."""
    memory, toy = Memory(), TOYS["star"]
    scenario = replace(FOREIGN, iterations=150, smooth=False, world="circles2d:n=6,seed=5", seed=5)
    figures = Run(scenario, planner=toy).execute([memory]).as_dict()
    paths = memory.events()[Kind.PATH]
    assert len(paths) > 1
    assert paths["stage"].tolist() == [Stage.RAW] + [Stage.IMPROVED] * (len(paths) - 1)
    assert (
        figures["first_path_cost"] == paths["cost"][0] > figures["path_cost"] == paths["cost"][-1]
    )
    assert figures["first_path_iteration"] == paths["iteration"][0]
    began = memory.events()[Kind.PHASE]["t"][0]
    assert figures["first_path_s"] == (paths["t"][0] - began) / 1e9
    assert figures["rewires"] == len(memory.events()[Kind.REWIRE]) > 0


def test_replay_prints_the_trees_as_rewired(brrt: Callable[..., Result], tmp_path: Path) -> None:
    """The printed depth is that of the tree after its rewires."""
    run, memory = Run(replace(FOREIGN, smooth=False), planner=TOYS["star"]), Memory()
    run.execute([memory, McapSink(tmp_path / "star.mcap", run.manifest, run.problem.world)])
    log = memory.events()
    tree = forest(log)[0]
    assert tree.leaves != forest(Events(2, {Kind.EDGE: log[Kind.EDGE]}))[0].leaves
    done = brrt("replay", "star.mcap")
    assert done.out.split()[-1] == f"{tree.cost.max():.6g}"
    assert done.out.split()[-3:-1] == [f"{tree.leaves:,}", f"{tree.depth:,}"]


class Babble:
    """Emit an impossible event in the second batch.

    Args:
        kind: Kind of the impossible event.
        fields: Its fields.
    """

    def __init__(self, kind: Kind, **fields: Any) -> None:
        self._kind, self._fields = kind, fields

    def solve(self, problem: Any, rng: Any, log: EventLog, stop: Any) -> Any:
        """Emit two batches."""
        log.emit(Kind.PHASE, 0, name=Phase.PLAN, status=Status.BEGIN)
        log.emit(Kind.EDGE, 0, tree=0, node=0, parent=-1, cost=0.0, q=problem.start)
        yield log.drain()
        log.emit(self._kind, 1, **self._fields)
        yield log.drain()


@pytest.mark.parametrize(
    ("planner", "message"),
    [
        (Babble(Kind.PHASE, name=7, status=0), "phase has name = 7; possible are 0 (plan), 1 (s"),
        (Babble(Kind.PHASE, name=0, status=99), "phase has status = 99; possible are 0 (begin)"),
        (Babble(Kind.SAMPLE, tree=0, source=9, q=[1, 1]), "sample has source = 9; possible are"),
        (Babble(Kind.SAMPLE, tree=0, source=0, q=[1, np.nan]), "sample has q = [ 1. nan]"),
        (Babble(Kind.PATH, stage=5, cost=1.0, waypoints=[[1, 1]]), "path has stage = 5; possi"),
    ],
    ids=["phase", "status", "source", "not a number", "stage"],
)
def test_what_no_event_can_say(planner: Babble, message: str, tmp_path: Path) -> None:
    """It is an error at once with any sink; the events before it can be read."""
    run = Run(replace(FOREIGN, smooth=False), planner=Babble(Kind.PHASE, name=0, status=5))
    run._planner = planner  # a run compiles by trying the planner
    paths, world = [tmp_path / "x.mcap", tmp_path / "x.rrd"], run.problem.world
    memory = Memory()
    sinks: list[Any] = [
        memory, McapSink(paths[0], run.manifest, world),
        RerunSink(run.manifest, world, path=paths[1]),
    ]  # fmt: skip
    with pytest.raises(BrrtError, match=re.escape(f"event 2: {message}")):
        run.execute(sinks)
    assert len(memory.events()) == 2
    for path in paths:
        assert len(read(path).events()) == 2
