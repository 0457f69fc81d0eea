"""Rerun recordings: exact, readable by stock tools, and refused in one line where they are cut."""

import os
import struct
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow  # noqa: ICN001 - it gets that name below
import pytest
import rerun as rr
from rerun.chunk import RrdReader

from brrt import Events, Kind, RecordingError, Run, Scenario, metrics, read
from brrt.events import FIELDS, table_dtype
from brrt.formats.rrd import reader
from brrt.formats.rrd.columns import END, Column, event_columns, time_columns, to_arrow
from brrt.formats.rrd.reader import read_rrd
from brrt.views.rerun import sink
from brrt.views.rerun.sink import RerunSink
from tests.conftest import recorded
from tests.support.files import part, same, write
from tests.support.logs import split

pa: Any = pyarrow  # mypy knows none of its names

SCENARIOS = {
    "2d": Scenario(world="circles2d:n=30", seed=7, clock="logical", params={"step": 2.0}),
    "boxes2d": Scenario(world="boxes2d:n=30", seed=2),
    "3d": Scenario(world="boxes3d:n=60", seed=1, params={"step": 1.5}),
    "unsolved": Scenario(world="spheres3d:n=9", iterations=40),
}
POINTS = r"; replay the \.mcap of the run$"


@pytest.fixture(autouse=True)
def small_batches(monkeypatch: pytest.MonkeyPatch) -> None:
    """Write each batch as it comes."""
    monkeypatch.setattr(sink, "_BATCH", 1)


def record(path: Path, name: str, size: int = 50) -> tuple[Run, Events]:
    """Record a run in batches of so many events; return it with its log."""
    run, log = recorded(SCENARIOS[name])
    write(path, run, *split(log, size))
    return run, log


@pytest.mark.parametrize("name", SCENARIOS)
def test_round_trip(name: str, tmp_path: Path) -> None:
    """What is read is what was written, to the last bit and the last nanosecond."""
    path = tmp_path / "run.rrd"
    run, log = record(path, name)
    recording = read(path)
    assert same(recording.events(), log)
    assert recording.manifest == run.manifest
    assert recording.world.to_json() == run.problem.world.to_json()
    assert recording.result == metrics(recording).as_dict()
    record(path, name, size=100_000)
    assert same(read(path).events(), log)


def test_batches_come_in_order(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each batch follows the one before, and the batches can be read again."""
    path = tmp_path / "run.rrd"
    _, log = record(path, "2d")
    monkeypatch.setattr(reader, "_MOST_EVENTS", 20)
    recording = read_rrd(path)
    for _ in range(2):
        seq = 0
        for batch in recording.batches():
            first, kinds = batch.kinds_in_order()
            assert first == seq
            assert len(kinds) <= 20
            seq += len(kinds)
        assert seq == len(log)


def test_stock_reader_finds_every_field(tmp_path: Path) -> None:
    """Rerun's own reader lists each kind with its fields under their names, on all timelines."""
    path = tmp_path / "run.rrd"
    _, log = record(path, "3d")
    stock = RrdReader(path)
    (store,) = stock.recordings()
    assert store.application_id == "brrt 3d 100 x 100 x 100"
    assert len(stock.blueprints()) == 1
    for kind, table in log.tables.items():
        chunks = [each for each in stock.stream() if each.entity_path == f"/ev/{kind.label}"]
        batches = [chunk.to_record_batch() for chunk in chunks]
        assert sum(batch.num_rows for batch in batches) == len(table)
        names = {f"brrt.{kind.label}:{field.name}" for field in FIELDS[kind]}
        assert names | {"iteration", "event", "t"} <= set(batches[0].schema.names)


@pytest.mark.parametrize("kind", Kind)
def test_columns_are_those_that_rerun_makes(kind: Kind) -> None:
    """They are only made faster."""
    table = np.zeros(3, table_dtype(kind, 2))
    table["seq"] = table["t"] = [1, 5, 7]
    for field in FIELDS[kind]:
        if field.type == "q[]":
            table[field.name] = [np.ones((n, 2)) for n in (1, 4, 2)]
    values = {field.name: to_arrow(field, table[field.name]) for field in FIELDS[kind]}
    wanted = rr.DynamicArchetype.columns(f"brrt.{kind.label}", components=values)
    for ours, its in zip(event_columns(kind, table), wanted, strict=True):
        assert ours.component_descriptor() == its.component_descriptor()
        assert ours.as_arrow_array() == its.as_arrow_array()
    times = [
        rr.TimeColumn("iteration", sequence=table["iteration"]),
        rr.TimeColumn("event", sequence=table["seq"]),
        rr.TimeColumn("t", duration=table["t"].astype("m8[ns]")),
    ]
    for mine, stock in zip(time_columns(table), times, strict=True):
        assert mine.timeline_name() == stock.timeline_name()
        assert mine.as_arrow_array() == stock.as_arrow_array()


def rerun_command(folder: Path, *args: str) -> str:
    """Run Rerun's own program; a new home each time keeps it from sending anything anywhere."""
    done = subprocess.run(
        [sys.executable, "-m", "rerun_cli", *args],
        cwd=folder,
        env={**os.environ, "HOME": str(folder), "XDG_CONFIG_HOME": str(folder)},
        capture_output=True,
        text=True,
        timeout=60,
        check=True,
    )
    return done.stdout


def test_stock_commands_read_and_rewrite_it(tmp_path: Path) -> None:
    """`rerun rrd stats` reads the file; what `optimize` makes of it has the same events."""
    _, log = record(tmp_path / "run.rrd", "2d")
    assert "/ev/edge" in rerun_command(tmp_path, "rrd", "stats", "run.rrd")
    rerun_command(tmp_path, "rrd", "optimize", "run.rrd", "-o", "other.rrd")
    recording = read(tmp_path / "other.rrd")
    assert same(recording.events(), log)
    assert recording.result == metrics(recording).as_dict()
    record(tmp_path / "3d.rrd", "3d")
    rerun_command(tmp_path, "rrd", "merge", "run.rrd", "3d.rrd", "-o", "both.rrd")
    with pytest.raises(RecordingError, match=r"both\.rrd: holds 2 recordings; brrt reads a file"):
        read(tmp_path / "both.rrd")


def test_run_that_did_not_end(tmp_path: Path) -> None:
    """Its events are all there; the result is not."""
    run, log = recorded(SCENARIOS["2d"])
    sink = RerunSink(run.manifest, run.problem.world, path=tmp_path / "run.rrd")
    sink.write(part(log, 0, 150))
    sink.close(None)
    sink.close(None)
    recording = read(tmp_path / "run.rrd")
    assert (recording.result, recording.counts) == (None, None)
    assert same(recording.events(), part(log, 0, 150))


def test_cut_anywhere(tmp_path: Path) -> None:
    """A file that was cut, at whatever byte, is refused at once, partial or not."""
    path = tmp_path / "run.rrd"
    record(path, "2d")
    data = path.read_bytes()
    for size in [4, 12, 50, *range(100, len(data), len(data) // 40), len(data) - 1]:
        path.write_bytes(data[:size])
        for partial in (False, True):
            with pytest.raises(RecordingError, match=rf"run\.rrd: is cut{POINTS}"):
                read(path, partial=partial)
    path.write_bytes(data[: len(data) // 2] + bytes(len(data)))
    with pytest.raises(RecordingError, match=f"is cut{POINTS}"):
        read(path)


def test_a_killed_run_leaves_a_cut_file(tmp_path: Path) -> None:
    """Until the sink is closed, its file is one that was cut."""
    run, log = recorded(SCENARIOS["2d"])
    sink = RerunSink(run.manifest, run.problem.world, path=tmp_path / "run.rrd")
    try:
        sink.write(log)
        with pytest.raises(RecordingError, match=f"is cut{POINTS}"):
            read(tmp_path / "run.rrd")
    finally:
        sink.close(None)
    assert len(read(tmp_path / "run.rrd").events()) == len(log)


def frames(data: bytes) -> list[tuple[int, int]]:
    """Return the place and the length of each frame."""
    found, at = [], 12
    while at < len(data) - 32:
        length = struct.unpack_from("<Q", data, at + 8)[0]
        found.append((at, length))
        at += 16 + length
    return found


def test_damaged_structure(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A wrong length, zeros in a chunk or another footer: refused in one line."""
    path = tmp_path / "run.rrd"
    record(path, "2d")
    data = path.read_bytes()
    (at, _), (big, length) = frames(data)[4], max(frames(data)[:-1], key=lambda each: each[1])
    for place, change, message in (
        (at + 15, b"\x7f", f"is damaged near byte {at:,}"),
        (big + 16, bytes(length), r"is damaged \(.+\)"),
        (len(data) - 2000, bytes(100), r"is damaged \(.+\)"),
        (len(data) - 32, bytes(8), r"is damaged \(.+\)"),
    ):
        path.write_bytes(data[:place] + change + data[place + len(change) :])
        with pytest.raises(RecordingError, match=rf"run\.rrd: {message}{POINTS}") as error:
            read(path).events()
        assert str(error.value).isprintable()
    path.write_bytes(data)
    monkeypatch.setattr(reader, "_MOST_FRAME", 5000)
    with pytest.raises(
        RecordingError, match=f"a frame of .* bytes; brrt reads up to 5,000{POINTS}"
    ):
        read(path)


def test_foreign_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Files of others, and of a newer brrt, are refused in one line that names the file."""
    path = tmp_path / "foreign.rrd"
    with rr.RecordingStream("other") as rec:
        rec.save(path)
        rec.log("text", rr.TextLog("hello"))
        rec.disconnect()
    with pytest.raises(RecordingError, match=r"foreign\.rrd: a Rerun file, but not a recording"):
        read(path)
    path.write_bytes(b"RRF1 something else")
    with pytest.raises(RecordingError, match=r"foreign\.rrd: not a Rerun recording"):
        read(path)
    with pytest.raises(RecordingError, match=r"none\.rrd: No such file"):
        read_rrd(tmp_path / "none.rrd")
    record(path, "unsolved")
    monkeypatch.setattr("brrt.scenario.manifest.Manifest.FORMAT", "0")
    with pytest.raises(RecordingError, match=r"foreign\.rrd: recording format '1' .* update brrt"):
        read(path)


@contextmanager
def forged(path: Path) -> Iterator[RerunSink]:
    """Give a sink to write what none does; nothing ends its file as the sink would."""
    run, _ = recorded(SCENARIOS["2d"])
    sink = RerunSink(run.manifest, run.problem.world, path=path)
    try:
        yield sink
        sink._rec.flush()
    finally:
        sink._disconnect()


def test_files_of_older_versions(tmp_path: Path) -> None:
    """Texts that older versions wrote, checks and a stamp, are passed over."""
    path = tmp_path / "old.rrd"
    _, log = recorded(SCENARIOS["2d"])
    with forged(path) as sink:
        sink._write_texts("/brrt/check", {"bytes": "7", "crc32": "7"})
        sink.write(log)
        sink._write_texts(END, {"events": str(len(log)), "stamp": "QjZ~!crc#QZ~"})
    assert same(read(path).events(), log)


def test_made_of_a_cut_file(tmp_path: Path) -> None:
    """A file that other tools finished, and that has no end of brrt's, is one that was cut."""
    path = tmp_path / "x.rrd"
    with forged(path) as sink:
        sink.write(recorded(SCENARIOS["2d"])[1])
    with pytest.raises(RecordingError, match=rf"is cut, or was made of a file that was .*{POINTS}"):
        read(path)


def without(log: Events, *numbers: int) -> list[Events]:
    """Return a log that lacks events."""
    tables = {kind: t[~np.isin(t["seq"], numbers)] for kind, t in log.tables.items()}
    return [Events(log.dof, tables)]


def with_nan(log: Events) -> list[Events]:
    """Return a log with a value that is not a number."""
    samples = log[Kind.SAMPLE].copy()
    samples["q"][3] = np.nan
    return [Events(log.dof, {**log.tables, Kind.SAMPLE: samples})]


BROKEN: dict[str, tuple[Callable[[Events], list[Events]], str]] = {
    "gap": (lambda log: without(log, 5), "events were written, "),
    "no end": (lambda log: [log.until(seq=99)], "events were written, 100 are there"),
    "twice": (lambda log: [log, log], "events are missing|events were written"),
    "impossible": (with_nan, r"sample has q = \[nan"),
}


@pytest.mark.parametrize("case", BROKEN)
def test_events_that_are_not_right(case: str, tmp_path: Path) -> None:
    """Events that are missing, doubled or impossible."""
    make, message = BROKEN[case]
    path, (_, log) = tmp_path / "x.rrd", recorded(SCENARIOS["2d"])
    with forged(path) as sink:
        for batch in make(log):
            sink.write(batch)
        sink._write_texts(END, {"events": str(len(log))})
    with pytest.raises(RecordingError, match=rf"x\.rrd: is damaged \(.*({message}).*\){POINTS}"):
        read(path).events()


NAME, STATUS = "brrt.phase:name", "brrt.phase:status"


def lists(values: Any, kind: Any) -> Any:
    """One value a row, as Rerun has them."""
    return pa.array([[value] for value in values], pa.list_(kind))


COLUMNS: dict[str, tuple[dict[str, Any], str]] = {
    "gone": ({NAME: None}, "name"),
    "two a row": ({NAME: pa.array([[0, 1]], pa.list_(pa.uint8()))}, "name has 2 values of uint8"),
    "floats": ({NAME: lists([0.5], pa.float64())}, "name has 1 values of double in 1 rows"),
    "texts": ({STATUS: lists(["a"], pa.string())}, "status has 1 values of string"),
    "null": ({NAME: pa.array([[None]], pa.list_(pa.uint8()))}, "name has 1 values of uint8"),
}


@pytest.mark.parametrize("case", COLUMNS)
def test_columns_of_other_types(case: str, tmp_path: Path) -> None:
    """Of another type, with more or less than a value a row."""
    change, message = COLUMNS[case]
    path = tmp_path / "x.rrd"
    phase = lists([0], pa.uint8())
    given = {NAME: phase, STATUS: phase, **change}
    with forged(path) as sink:
        columns = [
            Column(rr.ComponentDescriptor(name, archetype="brrt.phase"), values)
            for name, values in given.items()
            if values is not None
        ]
        sink._rec.send_columns(
            "/ev/phase", time_columns(np.zeros(1, table_dtype(Kind.PHASE, 2))), columns
        )
        sink._write_texts(END, {"events": "1"})
    with pytest.raises(RecordingError, match=rf"x\.rrd: is damaged \(.*{message}.*\){POINTS}"):
        read(path).events()


def test_files_that_unpack_to_much(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Events that take more memory than those of any real file of that size."""
    path = tmp_path / "run.rrd"
    record(path, "2d")
    monkeypatch.setattr(reader, "_ANY", 10_000)
    monkeypatch.setattr(reader, "_TIMES", 0)
    with pytest.raises(RecordingError, match=f"unpacks to more than any real file.*{POINTS}"):
        read(path).events()


@pytest.mark.parametrize("text", ["[1]", "[" * 100_000, ""])
def test_a_manifest_that_is_none(text: str, tmp_path: Path) -> None:
    """A manifest that is no table, nests, or is empty."""
    path = tmp_path / "x.rrd"
    with forged(path) as sink:
        sink._write_texts("/brrt/manifest", {"json": text})
        sink._write_texts(END, {"events": "0"})
    with pytest.raises(RecordingError, match=rf"x\.rrd: is damaged \(.*{POINTS}"):
        read(path)
