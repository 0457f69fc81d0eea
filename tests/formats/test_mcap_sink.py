"""MCAP files as written: exact, readable by stock tools, and whole up to the last batch."""

import errno
import json
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.stream_reader import StreamReader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader

from brrt import Events, Kind, McapSink, Memory, RecordingError, Run, Scenario, metrics, read
from brrt.events import FIELDS
from brrt.formats import CutError
from brrt.formats.background import BackgroundSink
from brrt.formats.mcap import sink
from tests.conftest import recorded
from tests.support.files import begins, files_limited_to, part, same, saved, write
from tests.support.logs import split

SCENARIOS = {
    "2d": Scenario(world="circles2d:n=40,seed=3", seed=7, clock="logical"),
    "3d": Scenario(world="boxes3d:n=60", seed=1),
    "unsolved": Scenario(world="circles2d", iterations=40),
}


@pytest.fixture(autouse=True)
def _at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Write each batch as it comes, as if each had waited long enough."""
    monkeypatch.setattr(sink, "_CHUNK_SECONDS", 0.0)


def record(path: Path, name: str) -> tuple[Run, Events]:
    """Record a run with small batches; return it with its log."""
    run, log = recorded(SCENARIOS[name])
    write(path, run, *split(log, 50))
    return run, log


@pytest.mark.parametrize("name", SCENARIOS)
def test_round_trip(name: str, tmp_path: Path) -> None:
    """What is read is what was written, to the last bit and the last nanosecond."""
    run, log = record(tmp_path / "run.mcap", name)
    recording = read(str(tmp_path / "run.mcap"))
    assert same(recording.events(), log)
    assert recording.manifest == run.manifest
    assert recording.world.to_json() == run.problem.world.to_json()
    assert recording.result == metrics(recording).as_dict()


def test_stock_mcap_decodes_every_message(tmp_path: Path) -> None:
    """The mcap reader and its ROS 2 decoder read all fields of all messages, in order."""
    _, log = record(tmp_path / "run.mcap", "3d")
    rows = {kind.label: iter(log[kind]) for kind in Kind}
    counts: Counter[str] = Counter()
    with (tmp_path / "run.mcap").open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        last = -1
        for _, channel, message, decoded in reader.iter_decoded_messages():
            label = channel.topic.removeprefix("/brrt/")
            row = next(rows[label])
            counts[label] += 1
            assert message.sequence == row["seq"] == sum(counts.values()) - 1
            assert message.log_time > last
            last = message.log_time
            for field in FIELDS[Kind[label.upper()]]:
                assert np.array_equal(
                    np.ravel(row[field.name]), np.ravel(getattr(decoded, field.name))
                )
        summary = reader.get_summary()
    assert summary is not None
    assert summary.statistics is not None
    found = metrics(read(tmp_path / "run.mcap")).as_dict()
    assert summary.statistics.message_count == found["events"] == len(log)
    for label, name in (("sample", "samples"), ("reject", "rejects"), ("edge", "edges")):
        assert counts[label] == found[name]


def test_rosbags_decodes_every_message(tmp_path: Path) -> None:
    """Rosbags opens the bare file and reads every message."""
    _, log = record(tmp_path / "run.mcap", "2d")
    with AnyReader([tmp_path / "run.mcap"]) as reader:
        decoded: list[Any] = [reader.deserialize(raw, c.msgtype) for c, _, raw in reader.messages()]
    assert len(decoded) == len(log)
    costs = [m.cost for m in decoded if type(m).__name__.endswith("Edge")]
    assert np.array_equal(costs, log[Kind.EDGE]["cost"])


def test_manifest_and_world_come_first(tmp_path: Path) -> None:
    """A cut file keeps them, and stock tools find them; all checksums are right."""
    record(tmp_path / "run.mcap", "2d")
    with (tmp_path / "run.mcap").open("rb") as file:
        names = [type(r).__name__ for r in StreamReader(file, emit_chunks=True).records]
    assert names[:4] == ["Header", "Metadata", "Attachment", "Chunk"]
    with (tmp_path / "run.mcap").open("rb") as file:
        assert len(list(StreamReader(file, validate_crcs=True).records)) > 3
        file.seek(0)
        (world,) = list(make_reader(file).iter_attachments())
    assert json.loads(world.data)["schema"] == "brrt.world"


def test_logical_clock_gives_the_same_bytes(tmp_path: Path) -> None:
    """With a logical clock two runs write the same file."""
    for name in ("a", "b"):
        run = Run(SCENARIOS["2d"], batch=50)
        run.execute([McapSink(tmp_path / f"{name}.mcap", run.manifest, run.problem.world)])
    assert (tmp_path / "a.mcap").read_bytes() == (tmp_path / "b.mcap").read_bytes()


def test_killed_at_any_batch(tmp_path: Path) -> None:
    """Once a batch was taken, the file has that batch and all before, under its final name."""
    run, log = recorded(SCENARIOS["2d"])
    path, left = tmp_path / "run.mcap", tmp_path / "left.mcap"
    sink = McapSink(path, run.manifest, run.problem.world)
    for first in range(0, len(log), 100):
        sink.write(part(log, first, first + 100))
        left.write_bytes(path.read_bytes())
        events, error = saved(left)
        assert isinstance(error, CutError)
        assert len(events) == min(first + 100, len(log))
        assert begins(log, events)
    sink.close({})
    assert {p.name for p in tmp_path.iterdir()} == {path.name, left.name}


@pytest.mark.parametrize("threaded", [False, True])
def test_disk_that_fills_up(threaded: bool, tmp_path: Path) -> None:
    """The file is truncated to its last whole chunk, and nothing comes after that."""
    path = tmp_path / "run.mcap"
    run, log = recorded(SCENARIOS["2d"])
    sink = McapSink(path, run.manifest, run.problem.world)
    target = BackgroundSink(sink) if threaded else sink
    with files_limited_to(14_000), pytest.raises(RecordingError, match="File too large"):
        try:
            for batch in split(log, 50):
                target.write(batch)
        finally:
            target.close(None)
    events, error = saved(path)
    assert isinstance(error, CutError)
    assert path.stat().st_size < 14_000
    assert error.fault == f"{path}: the file is cut at byte {path.stat().st_size:,}"
    assert 0 < len(events) < len(log)
    assert begins(log, events)


def test_disk_that_fails_later(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An error of the disk after the system took the data is raised at the end."""

    def fail(_number: int) -> None:
        raise OSError(errno.EIO, "Input/output error")

    run, log = recorded(SCENARIOS["2d"])
    sink = McapSink(tmp_path / "run.mcap", run.manifest, run.problem.world)
    sink.write(log)
    monkeypatch.setattr("os.fsync", fail)
    with pytest.raises(RecordingError, match="Input/output error"):
        sink.close(None)


def test_unwritable_place(tmp_path: Path) -> None:
    """A file that cannot be made is one clear error; an older file stays."""
    run = Run(SCENARIOS["2d"])
    with pytest.raises(RecordingError, match="No such file"):
        McapSink(tmp_path / "no" / "run.mcap", run.manifest, run.problem.world)
    path = tmp_path / "run.mcap"
    path.write_text("precious")
    with files_limited_to(100), pytest.raises(RecordingError, match=r"cannot write .*too large"):
        McapSink(path, run.manifest, run.problem.world)
    assert path.read_text() == "precious"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
@pytest.mark.parametrize("threaded", [False, True])
def test_full_disk(threaded: bool) -> None:
    """A full disk ends the run with one clear error, also from the writer's thread."""
    run = Run(SCENARIOS["2d"])
    with pytest.raises(RecordingError, match="No space left on device"):
        sink = McapSink(Path("/dev/full"), run.manifest, run.problem.world)
        run.execute([BackgroundSink(sink) if threaded else sink])


@pytest.mark.parametrize("diagonals", [False, True])
def test_a_lattice_has_more_cells_than_the_log_has_events(diagonals: bool, tmp_path: Path) -> None:
    """Without obstacles an event shows many cells at once, and all are numbered."""
    scenario = Scenario(
        world="boxes3d:n=0", planner="a-star", start=(50, 50, 50), goal=(90, 89, 88),
        params={"cell": 2.0, "diagonals": diagonals}, smooth=False,
    )  # fmt: skip
    run, memory = Run(scenario), Memory()
    run.execute([McapSink(tmp_path / "run.mcap", run.manifest, run.problem.world), memory])
    events = read(tmp_path / "run.mcap").events()
    assert len(events) == len(memory.events())
    assert events[Kind.EXPAND]["cell"].max() > len(events)
