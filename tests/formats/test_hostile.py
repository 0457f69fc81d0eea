"""Recordings that were made to do harm: refused in one line, soon, and with little memory."""

import os
import struct
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pyarrow  # noqa: ICN001 - it gets that name below
import pytest
import zstandard
from mcap import records
from mcap.data_stream import RecordBuilder
from mcap.reader import make_reader
from mcap.writer import CompressionType, IndexType, Writer

from brrt import Events, Kind, McapSink, RecordingError, Scenario, compare, first_difference, read
from brrt.formats.mcap.container import MAGIC
from brrt.formats.mcap.records import SEAL
from brrt.formats.recover import recover
from brrt.formats.rrd.frames import FRAME
from brrt.formats.rrd.outline import Outline
from brrt.views.rerun.sink import RerunSink
from tests.conftest import Result, recorded, result_of

SCENARIO = Scenario(world="circles2d:n=9", seed=1, clock="logical", iterations=60)
pa: Any = pyarrow  # mypy knows none of its names
NAME = "brrt.phase:name"
LITTLE = 64 << 20


def write(path: Path, events: Events | None = None) -> Events:
    """Record a run, or other events in its name; return its log."""
    run, log = recorded(SCENARIO)
    sink: Any
    if path.suffix == ".rrd":
        sink = RerunSink(run.manifest, run.problem.world, path=path)
    else:
        sink = McapSink(path, run.manifest, run.problem.world)
    sink.write(log if events is None else events)
    sink.close(result_of(run.manifest, log if events is None else events))
    return log


def told(path: Path) -> str:
    """Read a file that is of no use; return its one line, and see that it took little memory."""
    tracemalloc.start()
    try:
        with pytest.raises(RecordingError) as error:
            for _ in read(path).batches():
                pass
        assert tracemalloc.get_traced_memory()[1] < LITTLE
    finally:
        tracemalloc.stop()
    said = str(error.value)
    assert said.startswith(f"{path}: ")
    assert said.isprintable()
    assert len(said) < len(str(path)) + 300
    return said


class Forger:
    """Writes a recording anew with stock mcap, with one thing or another changed.

    Args:
        path: The new file.
        index: Which indexes it gets.
    """

    def __init__(self, path: Path, index: IndexType = IndexType.ALL) -> None:
        write(path.with_name("true.mcap"))
        self.path = path
        self.index, self.compression = index, CompressionType.ZSTD
        with path.with_name("true.mcap").open("rb") as file:
            reader = make_reader(file)
            (self.run,) = [m.metadata for m in reader.iter_metadata() if m.name == "brrt.run"]
            del self.run[SEAL]  # who forges a manifest can forge that, too
            (world,) = reader.iter_attachments()
            self.world = world.data
            found: list[tuple[Any, Any, Any]] = list(reader.iter_messages())
            self.messages = found

    def forge(
        self,
        schema: Callable[[str], str] = str,
        attach: str = "world.json",
        twice: bool = False,
        events: int | None = None,
        late: bool = False,
    ) -> Path:
        """Write it.

        Args:
            schema: Changes the text of a schema.
            attach: Name of the world's attachment.
            twice: Divide the messages of each topic between two channels.
            events: So many the figures speak of, if there are to be figures.
            late: Write the manifest behind the messages.
        """
        with self.path.open("wb") as file:
            out = Writer(file, index_types=self.index, compression=self.compression)
            out.start("ros2", "forger")
            if not late:
                out.add_metadata("brrt.run", self.run)
            out.add_attachment(0, 0, attach, "application/json", self.world)
            if attach != "world.json":
                out.add_attachment(0, 0, "world.json", "application/json", self.world)
            ids: dict[tuple[int, int], int] = {}
            for kind, channel, message in self.messages:
                half = message.sequence % 3 // 2 if twice else 0
                if (channel.id, half) not in ids:
                    text = schema(kind.data.decode()).encode()
                    number = out.register_schema(kind.name, kind.encoding, text)
                    ids[channel.id, half] = out.register_channel(channel.topic, "cdr", number)
                out.add_message(
                    ids[channel.id, half], message.log_time, message.data,
                    message.publish_time, message.sequence,
                )  # fmt: skip
            if events is not None:
                out.add_metadata("brrt.result", {"events": str(events)})
            if late:
                out.add_metadata("brrt.run", self.run)
            out.finish()
        return self.path


@pytest.fixture
def forger(tmp_path: Path) -> Forger:
    """A forger of x.mcap."""
    return Forger(tmp_path / "x.mcap")


def test_written_anew_by_stock_mcap(tmp_path: Path) -> None:
    """What other tools write is read, with and without indexes."""
    for index in (IndexType.ALL, IndexType.NONE):
        forger = Forger(tmp_path / "x.mcap", index)
        log = write(tmp_path / "true.mcap")
        assert first_difference([log], read(forger.forge()).batches()) is None
    # It has no figures, but its run has come to its end: nobody cut it.
    found = compare(Forger(tmp_path / "x.mcap").forge(), tmp_path / "true.mcap")
    assert found.equal
    assert found.cuts == (None, None)


def test_a_manifest_that_stands_behind(forger: Forger) -> None:
    """The error says what is to stand where, and what to do."""
    said = told(forger.forge(late=True))
    assert "metadata brrt.run and behind it attachment world.json must stand ahead" in said
    assert "read the file that it was made of" in said


SCHEMAS: dict[str, tuple[Callable[[str], str], str]] = {
    "more numbers": (
        lambda t: t.replace("float64[2]", "float64[3]"),
        "does not point at a message",
    ),
    "one number": (lambda t: t.replace("float64[2]", "float64[1]"), "not point at a message"),
    "other type": (lambda t: t.replace("uint8 tree", "float32 tree"), "no such field 'tree'"),
    "field twice": (lambda t: t + "uint8 iteration\n", "the schema of"),
    "field gone": (lambda t: t.replace("tree", "bush"), "no such field 'tree'"),
    "text": (lambda _: "string name\n", "unsupported message field"),
    "itself": (lambda t: t + "brrt_msgs/Phase phase\n", "unsupported message field"),
    "endless": (lambda t: t + "#" * (1 << 21), "a chunk says that it unpacks to"),
}


@pytest.mark.parametrize("case", SCHEMAS)
def test_schemas_that_are_not_ours(case: str, forger: Forger) -> None:
    """A schema decides what is read, and never what is not there."""
    change, message = SCHEMAS[case]
    assert message in told(forger.forge(schema=change))


def test_two_channels_of_a_topic(forger: Forger) -> None:
    """Events of a kind in two channels: one of them would be lost."""
    assert "two channels hold events of kind" in told(forger.forge(twice=True))


def test_events_missing_and_twice(forger: Forger) -> None:
    """Every number is there once; what is ahead of the first of which that is not so is saved."""
    log = forger.messages
    for messages, message, count in (
        (log[:7] + log[8:], "events are missing", 7),
        (log[1:], "events are missing", 0),
        ([*log[:7], log[6], *log[8:]], "out of order", 7),
        (log[:-1] + [log[-1]] * 2, "out of order", len(log)),
    ):
        forger.messages = messages
        assert message in told(forger.forge())
        found = recover(forger.path, forger.path.with_name("whole.mcap"))
        assert (found.events, found.complete) == (count, False)


def test_last_events_missing(forger: Forger) -> None:
    """What the figures speak of must be there."""
    n = len(forger.messages)
    forger.forge(events=n)
    assert len(read(forger.path).events()) == n
    forger.messages = forger.messages[:-3]
    assert f"damaged: {n} events were written, {n - 3} are there" in told(forger.forge(events=n))


MANIFESTS: dict[str, tuple[dict[str, str], str]] = {
    "huge": ({"dof": "1000000000"}, "a configuration of 1000000000 numbers"),
    "negative": ({"dof": "-2"}, "a configuration of -2 numbers"),
    "other dof": ({"dof": "3"}, "start has 2 numbers, and not 3"),
    "other dim": ({"dim": "3"}, "its world is 2D, and not 3D"),
    "epoch": ({"epoch_ns": "9" * 40}, "ns after 1970"),
    "no planner": ({"scenario": '{"world": "w"}'}, "its scenario has no planner"),
    "no epoch": ({"epoch_ns": "1e9"}, "the manifest is damaged"),
    "long number": ({"dof": "9" * 5000}, "the manifest is damaged"),
    "recursion": ({"scenario": "[" * 200_000}, "the manifest is damaged"),
    "foreign": ({"scenario": "[]"}, "a scenario must be a table"),
    "not a number": ({"start": "[NaN, 1]"}, "NaN is no number"),
    "infinite": ({"goal": "[1e999, 1]"}, "damaged: goal is (inf, 1.0)"),
    "parameter": (
        {"scenario": '{"world": "w", "planner": "mine", "params": {"a": Infinity}}'},
        "Infinity is no number",
    ),
}


@pytest.mark.parametrize("case", MANIFESTS)
def test_manifests(case: str, forger: Forger) -> None:
    """Numbers that are out of the question, and texts that nest."""
    change, message = MANIFESTS[case]
    forger.run = {**forger.run, **change}
    assert message in told(forger.forge())


def test_worlds(forger: Forger) -> None:
    """A world that nests, is of millions of lists, or is none."""
    for world, message in (
        (b"[" * 200_000, "not a JSON world"),
        (b'{"schema": "brrt.world", "boxes": [' + b"[]," * 5_100_000, "lists"),
        (b"\xff\xfe\x00", "world"),
    ):
        forger.world = world
        path = forger.forge()
        with pytest.raises(RecordingError, match=message):
            read(path)


def test_names_of_attachments_are_no_paths(forger: Forger, tmp_path: Path) -> None:
    """An attachment's name goes nowhere."""
    before = set(tmp_path.parent.rglob("*"))
    path = forger.forge(attach="../../escaped.json")
    assert len(read(path).events()) == len(forger.messages)
    assert set(tmp_path.parent.rglob("*")) == before | {path}


def test_zstd_bomb(tmp_path: Path) -> None:
    """A chunk that unpacks to a thousand times its size is not unpacked."""
    path = tmp_path / "x.mcap"
    write(path)
    data = path.read_bytes()
    at, size = next((at, size) for opcode, at, size in frames_of(data) if opcode == 6)
    raw = bytes(200_000_000)
    packed = zstandard.ZstdCompressor().compress(raw)
    for stated, message in (
        (len(raw), "unpacks to 200,000,000 bytes"), (1000, "lies about its size")
    ):  # fmt: skip
        new = RecordBuilder()
        records.Chunk("zstd", packed, 1, 0, 0, stated).write(new)
        path.write_bytes(data[:at] + new.end() + data[at + size :])
        assert message in told(path)


def frames_of(data: bytes) -> list[tuple[int, int, int]]:
    """Opcode, place and length, head included, of the records of an MCAP file."""
    found, at = [], 8
    while at + 9 <= len(data) - 8:
        opcode, length = struct.unpack_from("<BQ", data, at)
        found.append((opcode, at, length + 9))
        at += length + 9
    return found


@pytest.mark.parametrize("what", ["brrt.run", "world.json", "brrt.result"])
def test_head_and_figures_have_checksums_of_their_own(what: str, tmp_path: Path) -> None:
    """A letter of the manifest, the world or the figures is another: seen before any event is."""
    path = tmp_path / "x.mcap"
    write(path)
    data, texts = bytearray(path.read_bytes()), {"brrt.run": b'"seed": 1', "world.json": b"circ"}
    text = texts.get(what, b'"iteration limit"')
    at = data.index(text, data.index(what.encode()))
    data[at + len(text) - 2] ^= 1
    path.write_bytes(data)
    if what == "brrt.result":
        assert read(path).result is None
        assert "checksum of brrt.result does not match" in told(path)
    else:
        with pytest.raises(RecordingError, match=f"the checksum of {what} does not match"):
            read(path)


@pytest.mark.parametrize("ending", [".mcap", ".rrd"])
def test_events_that_contradict_each_other(
    ending: str, brrt: Callable[..., Result], tmp_path: Path
) -> None:
    """Of a log that makes no tree nothing is told but that, with the name of its file."""
    log, path = write(tmp_path / f"bad{ending}"), f"bad{ending}"
    for name, value in (("parent", 50), ("parent", 5), ("node", 7), ("iteration", 1 << 59)):
        edges = log[Kind.EDGE].copy()
        edges[name][5] = value
        write(tmp_path / path, Events(log.dof, {**log.tables, Kind.EDGE: edges}))
        for command in (
            ("replay", path), ("replay", path, "--node", "5"), ("explain", path),
            ("plot", path, "--out", "x.png", "--dpi", "40"),
            ("export", path, "--foxglove", "x.mcap", "--force"),
        ):  # fmt: skip
            done = brrt(*command)
            if done.code == 0:
                assert done.out
                assert name == "iteration" or command[0] in ("explain", "export"), command
                continue
            assert (done.code, done.out, done.err.count("\n")) == (2, "", 1), (command, done.err)
            assert done.err.startswith(f"brrt: {path}: ")
            assert done.err.endswith("; see brrt verify\n")
        assert brrt("verify", path).code == 1
        Path("x.png").unlink(missing_ok=True)


def test_what_is_no_file(brrt: Callable[..., Result], tmp_path: Path) -> None:
    """Folders, pipes, devices, loops of links, and nothing at all: one line, at once."""
    Path("folder").mkdir()
    os.mkfifo("pipe")
    Path("loop").symlink_to("loop")
    Path("zeros").symlink_to("/dev/zero")
    Path("empty").touch()
    Path("latin").write_bytes(b"\xff\xfe\x00")
    Path("short").write_bytes(MAGIC)
    Path("blank").write_bytes(MAGIC + bytes(10_000_000))
    Path("barren").write_bytes(MAGIC + (b"\x90" + bytes(8)) * 200_000)
    for name in "folder pipe loop zeros empty latin short blank barren missing".split():
        for command in (
            ("replay", name),
            ("recover", name, "--out", "x.mcap"),
            ("diff", name, "x"),
        ):
            done = brrt(*command)
            assert (done.code, done.out, done.err.count("\n")) == (2, "", 1), command
            assert done.err.startswith(f"brrt: {name}: ")


def varint(value: int) -> bytes:
    """As Protocol Buffers write a number."""
    out = b""
    while value > 127:
        out, value = out + bytes([value & 127 | 128]), value >> 7
    return out + bytes([value])


def message(payload: bytes, size: int, compression: int = 2) -> bytes:
    """A frame of an .rrd with an Arrow stream."""
    body = b"\x10" + varint(compression) + b"\x18" + varint(size)
    body += b"\x2a" + varint(len(payload)) + payload
    return FRAME.pack(2, len(body)) + body


def behind_head(path: Path, frame: bytes) -> None:
    """Put a frame behind the manifest and the world of an .rrd, and end it there."""
    write(path)
    data = path.read_bytes()
    first = Outline.of(path).places[0][1] - FRAME.size
    path.write_bytes(data[:first] + frame + FRAME.pack(0, 0))


def arrow(table: dict[str, Any], entity: str = "/ev/phase", **options: Any) -> bytes:
    """An Arrow stream of one record batch for an entity."""
    batch = pa.record_batch(table).replace_schema_metadata({"rerun:entity_path": entity})
    sink = pa.BufferOutputStream()
    with pa.ipc.new_stream(sink, batch.schema, options=pa.ipc.IpcWriteOptions(**options)) as stream:
        stream.write_batch(batch)
    return bytes(sink.getvalue().to_pybytes())


def lists(values: Any, kind: Any) -> Any:
    """One value a row, as Rerun has them."""
    return pa.array([[value] for value in values], pa.list_(kind))


def phases(n: int = 1, **change: Any) -> dict[str, Any]:
    """Columns of events."""
    return {
        "event": pa.array(range(n), pa.int64()),
        "iteration": pa.array([0] * n, pa.int64()),
        "t": pa.array(range(n), pa.duration("ns")),
        NAME: lists([0] * n, pa.uint8()),
        "brrt.phase:status": lists([0] * n, pa.uint8()),
    } | change


FRAMES: dict[str, tuple[bytes, str]] = {
    "kind": (FRAME.pack(9, 4) + bytes(4), "there is no frame of kind 9"),
    "length": (FRAME.pack(2, 1 << 62), "cut at byte"),
    "protobuf": (FRAME.pack(2, 12) + b"\xff" * 12, "a number without an end"),
    "fields": (FRAME.pack(2, 8) + b"\x10\x00" * 4, "too many fields"),
    "size": (message(bytes(100), 1 << 40), "100 bytes cannot hold"),
    "lz4": (message(b"\xf0" * 100, 9000), "damaged near byte"),
    "no arrow": (message(b"/ev/" + b"x" * 5000, 0, 0), "damaged near byte"),
    "type": (message(arrow(phases(t=pa.array(["a"]))), 0, 0), "damaged near byte"),
    "nulls": (message(arrow(phases(event=pa.array([None], pa.int64()))), 0, 0), "without a time"),
    "gone": (message(arrow({"event": pa.array([0])}), 0, 0), "damaged near byte"),
    "two a row": (
        message(arrow(phases(**{NAME: pa.array([[0, 1]], pa.list_(pa.uint8()))})), 0, 0),
        "name: 2 values of uint8 in 1 rows",
    ),
    "floats": (
        message(arrow(phases(**{NAME: lists([0.5], pa.float64())})), 0, 0),
        "name: 1 values of double",
    ),
    "twice": (message(arrow(phases(2, event=pa.array([0, 0]))), 0, 0), "damaged"),
    "bomb": (
        message(arrow(phases(1000), compression="zstd"), 0, 0), "a form that Rerun does not write"
    ),
    "two runs": (
        message(arrow({"brrt.world:json": lists(["{}"], pa.string())}, "/brrt/world"), 0, 0),
        "more than one recording",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", FRAMES)
def test_frames_that_lie(case: str, tmp_path: Path) -> None:
    """In an .rrd: lengths, sizes, types and numbers that are not so."""
    frame, said = FRAMES[case]
    path = tmp_path / "x.rrd"
    behind_head(path, frame)
    assert said in told(path)


def test_lz4_bomb(tmp_path: Path) -> None:
    """Messages that unpack to more than any real file, in all."""
    path = tmp_path / "x.rrd"
    raw = bytes(40_000_000)
    packed = pa.Codec("lz4_raw").compress(raw).to_pybytes()
    behind_head(path, message(packed, len(raw)) * 4)
    with pytest.raises(RecordingError, match="unpacks to more than any real file"):
        for _ in read(path).batches():
            pass
