"""MCAP recordings: exact, readable by stock tools, and honest about damage."""

import json
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.stream_reader import StreamReader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader

from brrt import BrrtError, Events, Kind, McapSink, RecordingError, Run, Scenario, metrics, read
from brrt.events import FIELDS
from brrt.formats import CutError
from brrt.formats.background import Background
from brrt.formats.mcap.cdr import Layout, definition
from brrt.recording import Memory, Result

SCENARIOS = {
    "2d": Scenario(world="circles2d:n=40,seed=3", seed=7, clock="logical"),
    "3d": Scenario(world="boxes3d:n=60", seed=1),
    "unsolved": Scenario(world="circles2d", iterations=40),
}


def write(path: Path, scenario: Scenario, *, batch: int = 50) -> tuple[Run, Events]:
    """Record a run with small batches; return it with its log."""
    run, memory = Run(scenario, batch=batch), Memory()
    run.execute([McapSink(path, run.manifest, run.problem.world), memory])
    return run, memory.events()


def same(a: Events, b: Events) -> bool:
    """Whether two logs are equal, times and all."""
    if a.tables.keys() != b.tables.keys():
        return False
    for kind, table in a.tables.items():
        for name in table.dtype.names or ():
            x, y = table[name], b[kind][name]
            if len(x) != len(y) or not all(map(np.array_equal, x, y)):
                return False
    return True


@pytest.mark.parametrize("name", SCENARIOS)
def test_round_trip(name: str, tmp_path: Path) -> None:
    """What is read is what was written, to the last bit and the last nanosecond."""
    run, log = write(tmp_path / "run.mcap", SCENARIOS[name])
    recording = read(tmp_path / "run.mcap")
    assert same(recording.events(), log)
    assert recording.manifest == run.manifest
    assert recording.world.to_json() == run.problem.world.to_json()
    assert recording.result == metrics(recording).as_dict()


def test_stock_mcap_decodes_every_message(tmp_path: Path) -> None:
    """The mcap reader and its ROS 2 decoder read all fields of all messages, in order."""
    _, log = write(tmp_path / "run.mcap", SCENARIOS["3d"])
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
        figures = metrics(read(tmp_path / "run.mcap")).as_dict()
        statistics = reader.get_summary()
    assert statistics is not None
    assert statistics.statistics is not None
    assert statistics.statistics.message_count == figures["events"] == len(log)
    for label, figure in (("sample", "samples"), ("reject", "rejects"), ("edge", "edges")):
        assert counts[label] == figures[figure]


@pytest.mark.parametrize("diagonals", [False, True])
def test_a_lattice_has_more_cells_than_the_log_has_events(diagonals: bool, tmp_path: Path) -> None:
    """Where nothing is in the way an event shows many cells at once, and all are numbered."""
    scenario = Scenario(
        world="boxes3d:n=0", planner="a-star", start=(50, 50, 50), goal=(90, 89, 88),
        params={"epsilon": 2.0, "diagonals": diagonals}, smooth=False,
    )  # fmt: skip
    run, memory = Run(scenario), Memory()
    sink = McapSink(tmp_path / "run.mcap", run.manifest, run.problem.world)
    run.execute([sink, memory])
    events = read(tmp_path / "run.mcap").events()
    assert len(events) == len(memory.events())
    assert events[Kind.EXPAND]["cell"].max() > len(events)


def test_rosbags_decodes_every_message(tmp_path: Path) -> None:
    """Rosbags opens the bare file and reads every message."""
    _, log = write(tmp_path / "run.mcap", SCENARIOS["2d"])
    with AnyReader([tmp_path / "run.mcap"]) as reader:
        decoded: list[Any] = [reader.deserialize(raw, c.msgtype) for c, _, raw in reader.messages()]
    assert len(decoded) == len(log)
    costs = [m.cost for m in decoded if type(m).__name__.endswith("Edge")]
    assert np.array_equal(costs, log[Kind.EDGE]["cost"])


def test_every_crc_holds(tmp_path: Path) -> None:
    """The stream reader finds the checksums of chunks and of the data section right."""
    write(tmp_path / "run.mcap", SCENARIOS["2d"])
    with (tmp_path / "run.mcap").open("rb") as file:
        assert len(list(StreamReader(file, validate_crcs=True).records)) > 3


def test_manifest_and_world_come_first(tmp_path: Path) -> None:
    """A cut file keeps them, and stock tools find them."""
    write(tmp_path / "run.mcap", SCENARIOS["2d"])
    with (tmp_path / "run.mcap").open("rb") as file:
        names = [type(r).__name__ for r in StreamReader(file, emit_chunks=True).records]
    assert names[:4] == ["Header", "Metadata", "Attachment", "Chunk"]
    with (tmp_path / "run.mcap").open("rb") as file:
        (world,) = list(make_reader(file).iter_attachments())
    assert json.loads(world.data)["schema"] == "brrt.world"


def test_logical_clock_gives_the_same_bytes(tmp_path: Path) -> None:
    """With a logical clock two runs write one and the same file."""
    for name in ("a", "b"):
        write(tmp_path / f"{name}.mcap", SCENARIOS["2d"])
    assert (tmp_path / "a.mcap").read_bytes() == (tmp_path / "b.mcap").read_bytes()


def test_layout_derives_from_the_text() -> None:
    """Numpy's layout has every field where CDR puts it."""
    layout = Layout.parse(definition(Kind.EDGE, 3))
    body = layout.record.itemsize - 31 - 4
    assert body == 8 + 1 + 3 + 4 + 4 + 4 + 8 + 24
    assert Layout.parse(definition(Kind.PATH, 3)).ragged == "waypoints"


@pytest.mark.parametrize(
    "text", ["string name", "float64[0] q", "uint8[] x", "float64[x] q", "uint8"]
)
def test_layout_refuses_what_it_cannot_lay_out(text: str) -> None:
    """A schema that is not flat is an error, not a guess."""
    with pytest.raises(RecordingError, match="unsupported message field"):
        Layout.parse(text)


def test_cut_file_gives_its_whole_chunks(tmp_path: Path) -> None:
    """At whatever byte a file is cut, what was whole comes back, then `CutError`."""
    path = tmp_path / "run.mcap"
    scenario = Scenario(world="circles2d:n=40,seed=3", seed=7, iterations=20_000,
                        params={"goal_bias": 0.0, "step": 0.1}, clock="logical")  # fmt: skip
    _, log = write(path, scenario, batch=10_000)
    whole, saved = path.read_bytes(), []
    for cut in range(len(whole) - 1, 3000, -len(whole) // 11):
        path.write_bytes(whole[:cut])
        recording, batches = read(path), list[Events]()
        with pytest.raises(CutError, match="cut at byte"):
            for batch in recording.batches():
                batches.append(batch)
        got = Events.concat(2, batches)
        assert same(got, log.until(seq=len(got) - 1))
        assert recording.result is None
        saved.append(len(got))
    assert saved == sorted(saved, reverse=True)
    assert 0 < saved[len(saved) // 2] < len(log)


@settings(
    max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(where=st.floats(0, 1, exclude_max=True), flip=st.integers(1, 255))
def test_flipped_byte_is_harmless_or_reported(
    where: float, flip: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """One changed byte anywhere: either the events are the same, or one clear error."""
    folder = tmp_path_factory.getbasetemp()
    source, path = folder / "flip-source.mcap", folder / "flipped.mcap"
    if not source.exists():
        write(source, SCENARIOS["2d"])
    data = bytearray(source.read_bytes())
    data[int(where * len(data))] ^= flip
    path.write_bytes(data)
    try:
        events = read(path).events()
    except BrrtError as error:
        assert "\n" not in str(error)
        assert str(path) in str(error)
        return
    assert same(events, read(source).events())


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "not a recording"),
        (b"hello", "not a recording"),
        (b"\x89MCAP0\r\n", "cut"),
        (b"\x89MCAP0\r\n" + b"\x01\xff\xff\xff\xff\xff\xff\xff\x7f", "a record of"),
    ],
)
def test_foreign_files(data: bytes, message: str, tmp_path: Path) -> None:
    """Other files are told apart in one line that names the file."""
    path = tmp_path / "x.mcap"
    path.write_bytes(data)
    with pytest.raises(RecordingError, match=message) as error:
        read(path)
    assert str(path) in str(error.value)


def test_unwritable_place(tmp_path: Path) -> None:
    """A file that cannot be opened is one clear error."""
    run = Run(SCENARIOS["2d"])
    with pytest.raises(RecordingError, match="No such file"):
        McapSink(tmp_path / "no" / "run.mcap", run.manifest, run.problem.world)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
@pytest.mark.parametrize("threaded", [False, True])
def test_full_disk(threaded: bool) -> None:
    """A full disk ends the run with one clear error, also from the writer's thread."""
    run = Run(SCENARIOS["2d"])
    with pytest.raises(RecordingError, match="No space left on device"):
        sink = McapSink(Path("/dev/full"), run.manifest, run.problem.world)
        run.execute([Background(sink) if threaded else sink])


def test_background_raises_what_its_sink_raises() -> None:
    """An error on the thread reaches the planner's side, and the sink is closed."""

    class Broken:
        closed = False

        def write(self, events: Events) -> None:
            raise RecordingError("broken")

        def close(self, result: Result | None) -> None:
            self.closed = True
            assert result is None

    sink, run = Broken(), Run(SCENARIOS["2d"], batch=20)
    with pytest.raises(RecordingError, match="broken"):
        run.execute([Background(sink)])
    assert sink.closed


def test_paths_may_be_texts(tmp_path: Path) -> None:
    """As a user types them in a notebook."""
    run, kept = Run(Scenario(world="circles2d", iterations=40)), Memory()
    name = str(tmp_path / "a.mcap")
    run.execute([McapSink(name, run.manifest, run.problem.world), kept])
    assert len(read(name).events()) == len(kept.events())
