"""Runs as tables: columns, files, and data frames."""

import csv
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pyarrow import parquet

from brrt import BrrtError, Events, Kind, Memory, Recording, Scenario, read, snapshot
from brrt.events import FIELDS, table_dtype
from brrt.exports import files
from brrt.exports.files import write_csv, write_parquet
from brrt.exports.tables import table_names, tables
from tests.conftest import recorded
from tests.support.recordings import GOLDEN, RECORDINGS

AWKWARD = [0.1, 1e-310, -0.0, 1e300, 1 / 3, float("inf"), float("-inf"), 5e-324]


def invented(rng: np.random.Generator) -> Recording:
    """A recording with some events of every kind, whose fields have any values."""
    found: dict[Kind, Any] = {}
    for kind in Kind:
        table = np.zeros(int(rng.integers(1, 5)), table_dtype(kind, 2))
        for name in ("seq", "t", "iteration"):
            table[name] = np.arange(len(table)) + 10 * kind
        for field in FIELDS[kind]:
            if field.type == "q[]":
                for row in range(len(table)):
                    table[field.name][row] = rng.normal(size=(int(rng.integers(0, 4)), 2))
            elif field.type in ("q", "float64", "float32"):
                table[field.name] = rng.choice(
                    [*AWKWARD, *rng.normal(size=8)], table[field.name].shape
                )
            else:
                table[field.name] = rng.integers(0, 2, len(table))
        found[kind] = table
    base, memory = read(GOLDEN), Memory()
    memory.write(Events(2, found))
    return memory.recording(base.manifest, base.world)


@settings(max_examples=10)
@given(st.integers(0, 2**32))
def test_every_kind_and_field_is_a_column(seed: int) -> None:
    """By its declaration, so that a new kind needs no change here."""
    recording = invented(np.random.default_rng(seed))
    events, found = recording.events(), tables(snapshot(recording))
    assert found.keys() <= table_names()
    for kind in Kind:
        table, columns = events[kind], found[kind.key]
        assert list(columns)[:3] == ["seq", "t", "iteration"]
        for field in FIELDS[kind]:
            if field.type == "q":
                for k, name in enumerate("xy"):
                    column = columns[f"{field.name}_{name}"]
                    np.testing.assert_array_equal(column, table[field.name][:, k])
            elif field.type == "q[]":
                rows = found[f"{kind.key}_{field.name}"]
                assert columns[field.name].tolist() == [len(q) for q in table[field.name]]
                whole = np.concatenate(list(table[field.name]))
                np.testing.assert_array_equal(np.stack([rows["q_x"], rows["q_y"]], 1), whole)
                assert rows["seq"].tolist() == np.repeat(table["seq"], columns[field.name]).tolist()
            elif field.choices is not None:
                named = [field.choices(value).key for value in table[field.name].tolist()]
                assert columns[field.name].tolist() == named
            else:
                np.testing.assert_array_equal(columns[field.name], table[field.name])


@settings(max_examples=5)
@given(seed=st.integers(0, 2**32))
def test_files_are_read_back_bit_for_bit(
    seed: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """CSV by `float`, Parquet by pyarrow."""
    folder = tmp_path_factory.mktemp("export")
    found = tables(snapshot(invented(np.random.default_rng(seed))))
    write_csv(found, folder / "csv")
    write_parquet(found, folder / "parquet")
    for name, columns in found.items():
        with (folder / "csv" / f"{name}.csv").open(newline="") as file:
            header, *rows = csv.reader(file)
        table = parquet.read_table(folder / "parquet" / f"{name}.parquet")
        assert header == table.column_names == list(columns)
        for k, (key, column) in enumerate(columns.items()):
            texts, values = [row[k] for row in rows], column.tolist()
            assert table[key].to_pylist() == values
            if column.dtype.kind == "f":
                assert np.array(texts, np.float64).tobytes() == column.astype(np.float64).tobytes()
            elif column.dtype == bool:
                assert texts == [str(value).lower() for value in values]
            else:
                assert texts == [str(value) for value in values]


def test_an_instant() -> None:
    """The tables have the events up to there, and the trees and the best path then."""
    recording = read(RECORDINGS / "circles2d-rrt-star.mcap")
    for limits in ({"iteration": 100}, {"event": 50}, {"time": 0.0003}, {}):
        run, frames = snapshot(recording, **limits), recording.to_pandas(**limits)
        assert {
            name: len(frame) for name, frame in frames.items() if name in ("edge", "rewire")
        } == {
            kind.key: len(run.events[kind])
            for kind in (Kind.EDGE, Kind.REWIRE)
            if len(run.events[kind])
        }
        tree = run.forest[0]
        assert frames["nodes"]["parent"].tolist() == tree.parent.tolist()
        assert frames["nodes"]["cost"].tolist() == tree.cost.tolist()
        assert ("best_path" in frames) == (run.best_path is not None)
        if run.best_path is not None:
            path = frames["best_path"][["q_x", "q_y"]].to_numpy()
            assert path.tolist() == run.best_path[1].tolist()
    with pytest.raises(BrrtError, match="iteration must be a whole number"):
        recording.to_pandas(iteration=-1)


def test_frames_have_the_types_of_the_columns() -> None:
    """Numbers stay numbers; names are texts."""
    frame = read(RECORDINGS / "polygons2d-polygon.mcap").to_pandas()["sample"]
    assert list(frame.columns[-3:]) == ["q_x", "q_y", "q_theta"]
    assert str(frame["q_theta"].dtype) == "float64"
    assert set(frame["source"]) <= {"uniform", "goal", "other_tree", "informed"}


def test_a_log_that_makes_no_tree() -> None:
    """Its events are there all the same, without nodes; unknown names stay numbers."""
    run, log = recorded(Scenario(world="circles2d:n=9", seed=1, clock="logical", iterations=60))
    edges, samples = log[Kind.EDGE].copy(), log[Kind.SAMPLE].copy()
    edges["parent"][5] = 50
    edges["node"][5] = 40
    samples["source"][0] = 99
    memory = Memory()
    memory.write(Events(log.dof, {**log.tables, Kind.EDGE: edges, Kind.SAMPLE: samples}))
    frames = memory.recording(run.manifest, run.problem.world).to_pandas()
    assert len(frames["edge"]) == len(edges)
    assert "nodes" not in frames
    assert frames["sample"]["source"][0] == "99"


def test_missing_packages(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """The error names the extra."""
    recording = read(GOLDEN)
    for name in ("pandas", "pyarrow", "networkx"):
        monkeypatch.setitem(sys.modules, name, None)
    calls: dict[str, Callable[[], Any]] = {
        "pandas": recording.to_pandas,
        "networkx": recording.to_networkx,
        "pyarrow": lambda: write_parquet({}, tmp_path / "p"),
    }
    for name, call in calls.items():
        with pytest.raises(
            BrrtError, match=rf"{name} is not installed; pip install 'brrt\[data\]'"
        ):
            call()
    write_csv(tables(snapshot(recording)), tmp_path / "c")
    assert (tmp_path / "c" / "edge.csv").exists()


def test_folders_appear_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A failure leaves nothing, or the older export; files of others are never touched."""
    found, folder = tables(snapshot(read(GOLDEN))), tmp_path / "out"

    def fail(_columns: object, path: Path) -> None:
        path.write_text("half")
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patched:
        patched.setattr(files, "_write_csv", fail)
        with pytest.raises(BrrtError, match=r"cannot write .*out: No space left"):
            write_csv(found, folder)
    assert not list(tmp_path.iterdir())
    write_csv({**found, "heuristic": found["edge"]}, folder)
    with pytest.raises(BrrtError, match="exists already"):
        write_csv(found, folder)
    with monkeypatch.context() as patched:
        patched.setattr(files, "_write_csv", fail)
        with pytest.raises(BrrtError, match="No space left"):
            write_csv(found, folder, force=True)
    assert (folder / "heuristic.csv").read_text().startswith("seq,")
    write_csv(found, folder, force=True)
    assert sorted(path.stem for path in folder.iterdir()) == sorted(found)
    (folder / "mine.csv").write_text("1")
    with pytest.raises(BrrtError, match=r"holds mine\.csv, which is no \.csv file"):
        write_csv(found, folder, force=True)
    with pytest.raises(BrrtError, match="is a file; name a folder"):
        write_csv(found, folder / "mine.csv")
    with pytest.raises(BrrtError, match="there is no folder"):
        write_csv(found, tmp_path / "no" / "out")
    assert [path.name for path in tmp_path.iterdir()] == ["out"]
    assert (tmp_path / "out").stat().st_mode & 0o700 == 0o700
