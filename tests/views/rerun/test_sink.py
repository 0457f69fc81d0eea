"""The sink into Rerun: what it draws as events come, full disks, closed viewers."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rerun as rr
from hypothesis import given
from hypothesis import strategies as st
from rerun.chunk import RrdReader

from brrt import Events, Kind, RecordingError, Run, Scenario, read
from brrt.events import Stage, table_dtype
from brrt.files import OutputFile
from brrt.recording import Memory
from brrt.views import colours
from brrt.views.rerun import sink
from brrt.views.rerun.draw import canvas, decimate, trees
from brrt.views.rerun.pipe import FilePipe
from brrt.views.rerun.sink import RerunSink
from brrt.views.viewer import process
from tests.conftest import recorded, result_of
from tests.support.files import files_limited_to, same
from tests.support.files import write as write_file
from tests.support.logs import split

SCENARIOS = {
    "2d": Scenario(world="circles2d:n=30", seed=7, clock="logical", params={"step": 2.0}),
    "3d": Scenario(world="boxes3d:n=60", seed=1, params={"step": 1.5}),
    "unsolved": Scenario(world="spheres3d:n=9", iterations=40),
}


@pytest.fixture(autouse=True)
def small_batches(monkeypatch: pytest.MonkeyPatch) -> None:
    """Write and draw each batch as it comes."""
    monkeypatch.setattr(sink, "_BATCH", 1)


def write(path: Path, scenario: Scenario) -> tuple[Run, Events]:
    """Record a run with small batches; return it with its log."""
    run, log = recorded(scenario)
    write_file(path, run, *split(log, 50))
    return run, log


def chunks(path: Path, entity: str) -> list[Any]:
    """Return the record batches of an entity that are not static."""
    stream = RrdReader(path).stream()
    return [
        chunk.to_record_batch()
        for chunk in stream
        if chunk.entity_path == entity and not chunk.is_static
    ]


def column(path: Path, entity: str, ending: str) -> list[Any]:
    """Return the values of a component, one list a row."""
    rows = []
    for batch in chunks(path, entity):
        (name,) = (name for name in batch.schema.names if name.endswith(ending))
        rows += batch.column(name).to_pylist()
    return rows


def log_lines(path: Path) -> list[str]:
    """Return the text log."""
    return [text for (text,) in column(path, "/log", ":text")]


def test_each_edge_is_drawn_in_its_time(tmp_path: Path) -> None:
    """Up to any moment the picture has the edges up to then, but for a last row of 2 % or so."""
    path = tmp_path / "run.rrd"
    _, log = write(path, SCENARIOS["2d"])
    edges = log[Kind.EDGE]
    drawn, when = [], []
    for batch in chunks(path, "/world/tree/start"):
        (strips,) = (name for name in batch.schema.names if name.endswith(":strips"))
        drawn += [len(row) for row in batch.column(strips).to_pylist()]
        when += batch.column("event").to_pylist()
    total = np.cumsum(drawn)
    assert total[-1] == len(edges) - 1
    for row, seq in enumerate(when):
        assert total[row] == np.searchsorted(edges["seq"], seq, "right") - 1
    assert max(drawn) <= 2 + len(edges) // 50


def test_edges_are_drawn_from_their_parents(tmp_path: Path) -> None:
    """Each line leads from the parent's place to the node's."""
    path = tmp_path / "run.rrd"
    _, log = write(path, SCENARIOS["3d"])
    edges = log[Kind.EDGE]
    strips = np.concatenate([np.array(row) for row in column(path, "/world/tree/start", ":strips")])
    wanted = np.stack([edges["q"][edges["parent"][1:]], edges["q"][1:]], axis=1)
    assert np.array_equal(strips, wanted.astype(np.float32))


def test_tree_of_many_nodes(tmp_path: Path) -> None:
    """A long chain that comes in several batches is drawn link by link."""
    run, count = Run(SCENARIOS["2d"]), 3000
    edges = np.zeros(count, table_dtype(Kind.EDGE, 2))
    edges["seq"] = edges["node"] = np.arange(count)
    edges["parent"] = edges["node"] - 1
    edges["q"] = np.random.default_rng(0).random((count, 2))
    path = tmp_path / "run.rrd"
    sink = RerunSink(run.manifest, run.problem.world, path=path)
    for part in np.array_split(edges, 7):
        sink.write(Events(2, {Kind.EDGE: part}))
    sink.close(result_of(run.manifest))
    strips = np.concatenate([np.array(row) for row in column(path, "/world/tree/start", ":strips")])
    wanted = np.stack([edges["q"][:-1], edges["q"][1:]], axis=1)
    assert np.array_equal(strips, wanted.astype(np.float32))


def test_path_shrinks_to_the_smoothed_one(tmp_path: Path) -> None:
    """The path is drawn after each accepted shortcut, and in the end as the smoother left it."""
    path = tmp_path / "run.rrd"
    _, log = write(path, SCENARIOS["2d"])
    raw, smoothed = log[Kind.PATH]
    rows = column(path, "/world/path/smoothed", ":strips")
    assert len(rows) == log[Kind.SHORTCUT]["accepted"].sum() + 1
    sizes = [len(strip) for (strip,) in rows]
    assert sizes == sorted(sizes, reverse=True)
    assert np.array_equal(rows[-1][0], smoothed["waypoints"].astype(np.float32))
    assert rows[-2] == rows[-1]
    ((drawn,),) = column(path, "/world/path/raw", ":strips")
    assert np.array_equal(drawn, raw["waypoints"].astype(np.float32))


def test_a_path_that_was_walked_is_not_drawn_over_its_trace(tmp_path: Path) -> None:
    """The raw path of LRTA* is where the robot went, which would flood the picture."""
    path = tmp_path / "run.rrd"
    _, log = write(path, Scenario(world="circles2d:n=9", planner="lrta-star", seed=1))
    assert len(log[Kind.PATH]) == 2
    assert len(log[Kind.MOVE]) > 0
    assert len(column(path, "/world/path/smoothed", ":strips")) > 1
    assert column(path, "/world/path/raw", ":strips") == []


def test_text_log(tmp_path: Path) -> None:
    """The text log has phases and paths, in order."""
    path = tmp_path / "run.rrd"
    write(path, SCENARIOS["2d"])
    begins, raw, ends, smooth, smoothed, done = log_lines(path)
    assert (begins, ends) == ("plan begins", "plan ends: solved")
    assert (smooth, done) == ("smooth begins", "smooth ends: done")
    assert raw.startswith("raw path: cost ")
    assert smoothed.startswith("smoothed path: cost ")
    assert smoothed.endswith(" % shorter")


def test_long_runs_are_thinned_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Beyond the limits less is drawn, the log says so, and the events stay exact."""
    monkeypatch.setattr(trees, "DRAWN_IN_FULL", 100)
    monkeypatch.setattr(decimate, "DRAWN_IN_FULL", 100)
    monkeypatch.setattr(decimate, "_CELLS", 64)
    monkeypatch.setattr(decimate, "_KEPT_NODES", 120)
    monkeypatch.setattr(decimate, "IN_FULL", 50)
    path = tmp_path / "run.rrd"
    _, log = write(path, SCENARIOS["2d"])
    drawn = sum(map(len, column(path, "/world/tree/start", ":strips")))
    assert 100 <= drawn <= 100 + 64 < len(log[Kind.EDGE])
    points = sum(map(len, column(path, "/world/samples/uniform", ":positions")))
    assert 50 <= points < len(log[Kind.SAMPLE]) / 2
    lines = log_lines(path)
    for text in ("start tree: beyond 100 nodes", "uniform samples: beyond 50", "collision rej"):
        assert sum(line.startswith(text) for line in lines) == 1
    assert same(read(path).events(), log)


def test_trees_have_names_and_colours(tmp_path: Path) -> None:
    """The start's tree is blue, the goal's red, a further one has a colour too."""
    run = Run(SCENARIOS["2d"])
    edges = np.zeros(6, table_dtype(Kind.EDGE, 2))
    edges["seq"] = np.arange(6)
    edges["tree"] = [0, 1, 2, 0, 1, 2]
    edges["node"] = [0, 0, 0, 1, 1, 1]
    edges["parent"] = [-1, -1, -1, 0, 0, 0]
    path = tmp_path / "run.rrd"
    sink = RerunSink(run.manifest, run.problem.world, path=path)
    sink.write(Events(2, {Kind.EDGE: edges}))
    sink.close(result_of(run.manifest))
    assert [
        len(column(path, f"/world/tree/{name}", ":strips")) for name in ("start", "goal", "2")
    ] == [
        1,
        1,
        1,
    ]
    (_, blue), (_, red) = colours.tree_style(0), colours.tree_style(1)
    assert blue[2] == max(blue)
    assert red[0] == max(red)
    assert colours.path_style(Stage.RAW) != colours.path_style(Stage.SMOOTHED)


@given(first=st.integers(0, 200_000), counts=st.lists(st.integers(1, 5000), min_size=1))
def test_rows_grow_with_what_there_is(first: int, counts: list[int]) -> None:
    """Rows cover everything once, and are no longer than about 1 % of it."""
    for count in counts:
        ends = canvas.growing_rows(first, count)
        sizes = np.diff(ends, prepend=0)
        assert ends[-1] == count
        assert sizes.min() >= 1
        assert sizes.max() <= min(1024, 2 + (first + count) / 50)
        first += count


def test_unwritable_path(tmp_path: Path) -> None:
    """A file that cannot be made is an error before the run."""
    run = Run(SCENARIOS["unsolved"])
    with pytest.raises(RecordingError, match=r"cannot write .*none/run\.rrd: No such file"):
        RerunSink(run.manifest, run.problem.world, path=tmp_path / "none" / "run.rrd")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_full_disk() -> None:
    """A disk that is full from the start is one clear line, and nothing hangs."""
    with pytest.raises(RecordingError, match="cannot write /dev/full: No space left on device"):
        write(Path("/dev/full"), SCENARIOS["2d"])


def test_disk_that_fills_up(tmp_path: Path) -> None:
    """A disk that fills up in the middle of a run is one clear line, and nothing hangs."""
    run, path = Run(SCENARIOS["2d"], batch=50), tmp_path / "run.rrd"
    batches = list(run.events())
    sink = RerunSink(run.manifest, run.problem.world, path=path)
    message = r"cannot write .*run\.rrd: File too large"
    with files_limited_to(200_000):
        with pytest.raises(RecordingError, match=message):
            for batch in batches * 3:
                sink.write(batch)
        with pytest.raises(RecordingError, match=message):
            sink.close(None)
    assert path.stat().st_size == 200_000


def test_whatever_fails_in_a_pipe_is_raised(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An error of any kind on its thread ends in one line; its pipe is emptied all the same."""

    def fail(self: OutputFile, data: bytes) -> None:
        raise MemoryError("too much")

    monkeypatch.setattr(OutputFile, "write", fail)
    pipe = FilePipe(tmp_path / "x.rrd")
    with open(pipe.inlet, "wb") as inlet:  # noqa: PTH123 - no path
        inlet.write(bytes(3_000_000))
    with pytest.raises(RecordingError, match=r"cannot write .*x\.rrd: too much"):
        pipe.wait()
    with pytest.raises(RecordingError, match="too much"):
        pipe.close()
    assert list(tmp_path.iterdir()) == []


def test_viewer_that_is_closed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A viewer that is closed disturbs neither the run nor its file."""
    port = process.free_port()
    monkeypatch.setattr(process, "PORT", port)
    other = rr.RecordingStream("viewer", send_properties=False)
    other.serve_grpc(grpc_port=port)
    run, memory = Run(SCENARIOS["2d"], batch=50), Memory()
    sink = RerunSink(run.manifest, run.problem.world, path=tmp_path / "run.rrd", view=True)
    for number, batch in enumerate(run.events()):
        sink.write(batch)
        memory.write(batch)
        if number == 3:
            other.disconnect()
    sink.close(result_of(run.manifest, memory.events()))
    assert same(read(tmp_path / "run.rrd").events(), memory.events())
