"""`brrt.record` and `brrt.log`: events one by one, in arrays, as whole trees, from threads."""

import os
import signal
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import brrt
from brrt import (
    BrrtError,
    Kind,
    Memory,
    Recorder,
    Scenario,
    World,
    forest,
    read,
    record,
    verify,
)
from brrt.events import Events, Status
from brrt.recorder.rows import row_dtype, row_struct
from brrt.scenario.query import Query

WORLD = World(
    "open",
    lower=np.zeros(2),
    upper=np.full(2, 10.0),
    start=np.ones(2),
    goal=np.full(2, 9.0),
)


def ended(path: Path, *broken: str) -> tuple[brrt.Recording, Events]:
    """Read a recording; no other rules may be broken."""
    recording = read(path)
    assert {finding.rule for finding in verify(recording).findings} <= set(broken)
    return recording, recording.events()


def test_every_event(tmp_path: Path) -> None:
    """With numbers, costs and iterations that the recorder adds."""
    path = tmp_path / "mine.mcap"
    far = np.hypot(5, 4)
    with record(path, world=WORLD, planner="mine", params={"step": 2}, seed=4) as rec:
        assert rec.edge((1, 1)) == 0
        rec.sample([1.0, 9.0])
        assert rec.edge(np.array([1.0, 9.0]), 0) == 1
        rec.sample([9, 9], "goal")
        rec.reject([9, 9], 1, "collision")
        assert rec.edge([4, 5], 1, node=2) == 2
        assert rec.edge([9, 9], 2) == 3
        rec.path([[1, 1], [1, 9], [4, 5], [9, 9]])
        rec.rewire(2, 0)
        assert rec.edge([9, 8], 3) == 4
        rec.path([[1, 1], [4, 5], [9, 9]])
    recording, log = ended(path)
    assert recording.manifest.scenario.planner == "mine"
    assert dict(recording.manifest.scenario.params) == {"step": 2}
    assert recording.result is not None
    assert recording.result["status"] == "solved"
    assert recording.result["path_cost"] == pytest.approx(5 + far)
    assert log[Kind.EDGE]["cost"].tolist() == pytest.approx([0, 8, 13, 13 + far, 6 + far])
    assert log[Kind.REWIRE]["cost"].tolist() == [5]
    assert log[Kind.SAMPLE]["source"].tolist() == [0, 1]
    assert log[Kind.REJECT]["iteration"].tolist() == [2]
    tree = forest(log)[0]
    assert tree.parent.tolist() == [-1, 0, 0, 2, 3]
    assert tree.cost.tolist() == pytest.approx([0, 8, 5, 5 + far, 6 + far])


def test_two_trees(tmp_path: Path) -> None:
    """And a link between them."""
    with record(tmp_path / "two.mcap", world=WORLD) as rec:
        rec.edge([1, 1])
        rec.edge([9, 9], tree=1)
        rec.edge([4, 5], 0)
        rec.connect(1, 0)
        rec.path([[1, 1], [4, 5], [9, 9]])
    _, log = ended(tmp_path / "two.mcap")
    assert log[Kind.CONNECT]["cost"].tolist() == pytest.approx([5 + np.hypot(5, 4)])


def scalar(rec: Recorder, q: np.ndarray, parent: np.ndarray) -> None:
    """Record nodes one by one."""
    for row, up in zip(q, parent.tolist(), strict=True):
        rec.edge(row, None if up < 0 else up)


@settings(max_examples=6)
@given(seed=st.integers(0, 1000), n=st.integers(1, 40), more=st.integers(0, 40))
def test_arrays_and_trees_are_events(
    seed: int, n: int, more: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """In arrays, and as whole trees whose parents change, the forest is the same."""
    rng = np.random.default_rng(seed)
    folder = tmp_path_factory.mktemp("arrays")
    q = rng.uniform(0, 10, (n + more, 2))
    q[0] = WORLD.start
    parent = np.array([-1, *(int(rng.integers(0, i)) for i in range(1, n + more))])
    later = parent.copy()
    for row in range(2, n):
        if rng.random() < 0.3:
            later[row] = rng.integers(0, row)
    with record(folder / "one.mcap", world=WORLD) as rec:
        scalar(rec, q, parent)
    with record(folder / "many.mcap", world=WORLD) as rec:
        rec.edges(q[:n], parent[:n])
        assert rec.edges(q[n:], parent[n:]).tolist() == list(range(n, n + more))
    with record(folder / "tree.mcap", world=WORLD) as rec:
        rec.tree(q[:n], parent[:n])
        rec.tree(q, later)
    one, many = (ended(folder / f"{name}.mcap")[1] for name in ("one", "many"))
    names = ["node", "parent", "cost", "q"]
    for name in names:
        np.testing.assert_allclose(one[Kind.EDGE][name], many[Kind.EDGE][name], rtol=1e-12)
    tree = forest(ended(folder / "tree.mcap", "rewires gain")[1])[0]
    places = {tuple(place): node for node, place in enumerate(tree.q.tolist())}
    for row, up in enumerate(later.tolist()):
        node = places[tuple(q[row].tolist())]
        assert tree.parent[node] == (-1 if up < 0 else places[tuple(q[up].tolist())])


def test_samples_and_rejections_in_arrays(tmp_path: Path) -> None:
    """Their times rise, and each sample is an iteration."""
    q = np.random.default_rng(0).uniform(0, 10, (20_000, 2))
    with record(tmp_path / "x.mcap", world=WORLD) as rec:
        rec.edge([1, 1])
        rec.samples(q)
        rec.rejects(q[:5], 0, np.array([0, 1, 0, 1, 0]))
    _, log = ended(tmp_path / "x.mcap")
    assert log[Kind.SAMPLE]["iteration"].tolist() == list(range(1, 20_001))
    assert log[Kind.REJECT]["reason"].tolist() == [0, 1, 0, 1, 0]
    assert (np.diff(log[Kind.SAMPLE]["t"]) > 0).all()


def test_a_clock_of_the_caller(tmp_path: Path) -> None:
    """And iterations that it counts."""
    ticks = iter(range(1000, 10**6, 1000))
    with record(tmp_path / "x.mcap", world=WORLD, clock=lambda: next(ticks)) as rec:
        rec.edge([1, 1])
        rec.iteration = 7
        rec.sample([2, 2])
    _, log = ended(tmp_path / "x.mcap")
    assert log[Kind.EDGE]["t"].tolist() == [2000]
    assert log[Kind.SAMPLE]["iteration"].tolist() == [7]


WRONG: list[tuple[str, tuple[Any, ...], dict[str, Any], str]] = [
    ("edge", ([1.0, 2.0, 3.0],), {}, "q must be 2 finite numbers, not .1.0, 2.0, 3.0"),
    ("edge", ([1.0, float("nan")],), {}, "q must be 2 finite numbers"),
    ("edge", ([1e200, -1e200],), {}, "q must be 2 finite numbers"),
    ("edge", ("ab",), {}, "q must be 2 finite numbers, not 'ab'"),
    ("edge", (7,), {}, "q must be 2 finite numbers, not 7"),
    ("edge", ([1.0, None],), {}, "q must be 2 finite numbers"),
    ("edge", ([2.0, 2.0], 5), {}, "parent must be a node of tree 0, not 5"),
    ("edge", ([2.0, 2.0], 0.0), {}, "parent must be a node of tree 0, not 0.0"),
    ("edge", ([2.0, 2.0], 0), {"node": 7}, "node of tree 0 must be 1, its next, not 7"),
    ("edge", ([2.0, 2.0], 0), {"cost": "1"}, "cost must be a finite number, not '1'"),
    ("edge", ([2.0, 2.0], 0), {"cost": float("inf")}, "cost must be a finite number"),
    ("edge", ([2.0, 2.0],), {"tree": 2}, "tree must be 0 or 1, not 2"),
    ("sample", ([2.0, 2.0], "nowhere"), {}, "unknown source 'nowhere'"),
    ("sample", ([2.0, 2.0], 99), {}, "unknown source '99'"),
    ("sample", ([2.0, 2.0],), {"tree": -1}, "tree must be 0 or 1"),
    ("reject", ([2.0, 2.0], 0.5), {}, "node must be a node of tree 0 or an expanded cell, not 0.5"),
    ("reject", ([2.0, 2.0], 1), {}, "node must be a node of tree 0"),
    ("reject", ([2.0, 2.0], 0, 77), {}, "unknown reason '77'"),
    ("rewire", (0, 9), {}, "parent must be a node of tree 0, not 9"),
    ("rewire", (0, 0), {}, "parent of node 0 must not descend from it"),
    ("connect", (0, 0), {}, "other must be a node of tree 1, not 0"),
    ("path", ([[1.0, 1.0, 1.0]],), {}, r"waypoints must have the shape \(n, 2\), not \(1, 3\)"),
    ("path", ([[1.0, float("nan")]],), {}, "waypoints must be finite"),
    ("path", (np.empty((0, 2)),), {}, "waypoints must be one configuration at least"),
    ("path", ([[1.0], [1.0, 2.0]],), {}, "waypoints must be rows of 2 numbers"),
    ("expand", (-1, 0, [1.0, 1.0], 0.0), {}, "cell must be the number of a cell, not -1"),
    ("samples", (np.zeros(3),), {}, r"q must have the shape \(n, 2\)"),
    ("samples", (np.full((3, 2), np.inf),), {}, "q must be finite"),
    ("samples", (np.ones((2, 2)), [0, 99]), {}, r"source must be numbers of 0 \(uniform\)"),
    ("edges", (np.ones((2, 2)), [0, 5]), {}, "parent must be for each row a node of tree 0 before"),
    ("edges", (np.ones((2, 2)), [0.5, 0.5]), {}, "parent must be for each row a node"),
    ("edges", (np.ones((2, 2)), [0, 0]), {"cost": [1.0, np.nan]}, "cost must be finite"),
    ("edges", (np.ones((2, 2)), [0, 0]), {"cost": [1.0] * 3}, "cost must be 2 numbers"),
    ("rejects", (np.ones((2, 2)), 0, [0, 77]), {}, r"reason must be numbers of 0 \(collision\)"),
    ("rejects", (np.ones((2, 2)), [0, 9]), {}, "node must be nodes of tree 0"),
    ("tree", (np.ones((2, 2)), [1, 0]), {}, "lead to no root"),
    ("close", ("perhaps",), {}, "unknown status 'perhaps'"),
]


@pytest.mark.parametrize(("method", "given", "named", "message"), WRONG)
def test_wrong_values_are_errors_at_the_call(
    method: str, given: tuple[Any, ...], named: dict[str, Any], message: str, tmp_path: Path
) -> None:
    """The rest of the recording is kept."""
    with record(tmp_path / "x.mcap", world=WORLD) as rec:
        rec.edge([1, 1])
        with pytest.raises(BrrtError, match=message):
            getattr(rec, method)(*given, **named)
    _, log = ended(tmp_path / "x.mcap")
    assert log.counts == {Kind.PHASE: 2, Kind.EDGE: 1}
    assert log.last.iteration == 0


def test_an_exception_ends_the_run(tmp_path: Path) -> None:
    """As interrupted, and is passed on; nothing is recorded afterwards."""
    with pytest.raises(ZeroDivisionError), record(tmp_path / "x.mcap", world=WORLD) as rec:
        rec.edge([1, 1])
        1 / 0  # noqa: B018
    recording, log = ended(tmp_path / "x.mcap")
    assert recording.result is not None
    assert recording.result["status"] == "interrupted"
    assert log[Kind.PHASE]["status"].tolist() == [Status.BEGIN, Status.INTERRUPTED]
    with pytest.raises(BrrtError, match="is closed"):
        rec.sample([1, 1])
    rec.close()


def test_a_sink_that_fails() -> None:
    """The error is raised at the next call, also where only the flush in the background met it."""

    class Full(Memory):
        def write(self, events: Events) -> None:
            raise BrrtError("no space left")

    for wait in (0.6, 0.0):
        sink = Full()
        rec = Recorder(sink, Query.of(Scenario(), WORLD))
        threading.Event().wait(wait)
        with pytest.raises(BrrtError, match="no space left"):
            rec.close()
        rec.close()
        assert sink.result is None
        with pytest.raises(BrrtError, match="is closed"):
            rec.sample([2, 2])
    rec = Recorder(Full(), Query.of(Scenario(), WORLD))
    threading.Event().wait(0.6)
    with pytest.raises(BrrtError, match="no space left"):
        rec.sample([2, 2])
    with pytest.raises(BrrtError, match="no space left"), rec:
        rec.edge([1, 1])


def test_searches(tmp_path: Path) -> None:
    """Cells that are expanded, and what was rejected from them."""
    with record(tmp_path / "x.mcap", world=WORLD) as rec:
        rec.expand(0, -1, [1, 1], 0.0)
        rec.reject([1, 2], 0)
        rec.expand(5, 0, [2, 1], 1.0)
        rec.reject([2, 2], 5, "collision")
    log = read(tmp_path / "x.mcap").events()
    assert log[Kind.EXPAND]["cell"].tolist() == [0, 5]
    assert log[Kind.REJECT]["node"].tolist() == [0, 5]


def test_a_tree_that_turns_around(tmp_path: Path) -> None:
    """A child becomes the parent of its parent; what closes a circle is refused."""
    q = [[1.0, 1.0], [2.0, 1.0], [3.0, 1.0]]
    with record(tmp_path / "x.mcap", world=WORLD) as rec:
        rec.tree(q, [-1, 0, 1])
        rec.tree(q, [-1, 2, 0])
        with pytest.raises(BrrtError, match="a circle, or a root"):
            rec.tree(q, [-1, 2, 1])
    tree = forest(read(tmp_path / "x.mcap").events())[0]
    assert tree.parent.tolist() == [-1, 2, 0]


def test_threads(tmp_path: Path) -> None:
    """Nothing is lost."""
    with record(tmp_path / "x.mcap", world=WORLD) as rec:
        rec.edge([1, 1])

        def work() -> None:
            for _ in range(3000):
                rec.sample([2.0, 3.0])

        threads = [threading.Thread(target=work) for _ in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    _, log = ended(tmp_path / "x.mcap")
    assert len(log[Kind.SAMPLE]) == 12_000


def test_log_of_a_library(tmp_path: Path) -> None:
    """It writes to the recording that was opened last, and to none if none is open."""
    assert brrt.log.edge([1, 1]) is None
    assert brrt.log.recorder is None
    with record(tmp_path / "a.mcap", world=WORLD):
        brrt.log.edge([1, 1])
        with record(tmp_path / "b.mcap", world=WORLD):
            assert brrt.log.edge([1, 1]) == 0
            brrt.log.sample([2, 2])
            brrt.log.reject([2, 2])
            assert brrt.log.edge([2, 2], 0) == 1
        assert brrt.log.edge([3, 3], 0) == 1
    brrt.log.sample([4, 4])
    brrt.log.rewire(0, 1)
    brrt.log.path([[1, 1]])
    brrt.log.connect(0, 0)
    assert len(ended(tmp_path / "a.mcap")[1][Kind.EDGE]) == 2
    assert len(ended(tmp_path / "b.mcap")[1][Kind.SAMPLE]) == 1


def test_the_log_imports_nothing() -> None:
    """A library that is instrumented for good starts as fast as before."""
    code = "import sys, brrt; brrt.log.edge([1, 2]); print(*sys.modules)"
    names = subprocess.run(
        [sys.executable, "-c", code], check=True, capture_output=True, text=True
    ).stdout.split()
    assert not {"numba", "rerun", "mcap", "numpy"} & set(names)


def test_recording_needs_no_numba(tmp_path: Path) -> None:
    """Nor planners, kernels or runs."""
    code = f"""
import sys
sys.modules["numba"] = None
import brrt
with brrt.record({str(tmp_path / "x.mcap")!r}, world="circles2d:n=3", planner="mine") as rec:
    rec.edge([5, 5])
assert not any(name.startswith("brrt.planners") for name in sys.modules)
"""
    subprocess.run([sys.executable, "-c", code], check=True)
    assert len(ended(tmp_path / "x.mcap")[1][Kind.EDGE]) == 1


KILLED = """
import sys, time, brrt
world = brrt.World("open", lower=[0, 0], upper=[10, 10], start=[1, 1], goal=[9, 9])
rec = brrt.record(sys.argv[1], world=world)
rec.edge([1, 1])
for _ in range(500):
    rec.sample([2, 3])
print("recorded", flush=True)
time.sleep(60)
"""


def test_a_killed_process_keeps_what_it_recorded(tmp_path: Path) -> None:
    """Up to half a second before, also while it records nothing."""
    path = tmp_path / "x.mcap"
    with subprocess.Popen(
        [sys.executable, "-c", KILLED, path], stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "recorded\n"
        threading.Event().wait(1.5)  # a busy machine is slower than half a second
        os.kill(process.pid, signal.SIGKILL)
    recording = read(path, partial=True)
    assert recording.result is None
    assert len(recording.events()[Kind.SAMPLE]) == 500
    assert verify(recording).findings == []


def test_rows_are_packed_as_they_are_laid_out() -> None:
    """For any number of coordinates."""
    for dof in (1, 2, 7):
        assert row_struct(dof).size == row_dtype(dof).itemsize


def test_files_that_cannot_be_written(tmp_path: Path) -> None:
    """One line each."""
    with pytest.raises(BrrtError, match=r"ends in \.mcap"):
        record(tmp_path / "x.rrd", world=WORLD)
    with pytest.raises(BrrtError, match=r"nowhere/x\.mcap"):
        record(tmp_path / "nowhere" / "x.mcap", world=WORLD)


@pytest.mark.parametrize("seed", range(5))
def test_default_costs_in_arrays_are_those_one_by_one(seed: int, tmp_path: Path) -> None:
    """For parents before the array and within it, and for roots; one by one but for rounding."""
    rng = np.random.default_rng(seed)
    q = rng.uniform(0, 10, (300, 2))
    parent = np.array([-1, *(rng.integers(-1 if n % 50 == 0 else 0, n) for n in range(1, 300))])
    ends, logs = {"start": q[0], "goal": (9.0, 9.0)}, []
    for name, size in (("one", 1), ("few", 7), ("all", 300)):
        with brrt.record(tmp_path / f"{name}.mcap", world="empty2d:size=10", **ends) as rec:
            for first in range(0, 300, size):
                part = slice(first, first + size)
                if size == 1:
                    rec.edge(q[first], int(parent[first]))
                else:
                    rec.edges(q[part], parent[part])
        logs.append(brrt.read(tmp_path / f"{name}.mcap").events()[brrt.Kind.EDGE])
    one, few, every = logs
    for field in ("node", "parent", "cost", "q"):
        assert np.array_equal(few[field], every[field])
        assert np.allclose(one[field], every[field], rtol=1e-14, atol=0)
