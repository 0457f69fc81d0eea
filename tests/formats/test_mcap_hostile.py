"""MCAP files that were made to do harm: refused in one line, soon, and with little memory."""

import tracemalloc
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import zstandard
from mcap import records
from mcap.data_stream import RecordBuilder
from mcap.reader import make_reader
from mcap.writer import CompressionType, IndexType, Writer

from brrt import RecordingError, Scenario, compare, first_difference, read
from brrt.formats.mcap.records import CHECKSUM
from brrt.formats.recover import recover
from tests.conftest import recorded
from tests.support.files import mcap_records, write

SCENARIO = Scenario(world="circles2d:n=9", seed=1, clock="logical", iterations=60)
LITTLE = 64 << 20


def refusal(path: Path) -> str:
    """Read a file that is refused; return its one line, and check that it took little memory."""
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
        run, self.log = recorded(SCENARIO)
        self.path, self.original = path, path.with_name("true.mcap")
        write(self.original, run, self.log)
        self.index, self.compression = index, CompressionType.ZSTD
        with self.original.open("rb") as file:
            reader = make_reader(file)
            (self.run,) = [m.metadata for m in reader.iter_metadata() if m.name == "brrt.run"]
            del self.run[CHECKSUM]  # who forges a manifest can forge that, too
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
            events: How many events the result states, if there is to be a result.
            late: Write the manifest after the messages.
        """
        with self.path.open("wb") as file:
            size = 1000 if late else 1 << 20
            out = Writer(file, size, self.compression, self.index)
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
        assert first_difference([forger.log], read(forger.forge()).batches()) is None
    # It has no result, but its run has come to its end: it is not a cut file.
    forger = Forger(tmp_path / "x.mcap")
    found = compare(forger.forge(), forger.original)
    assert found.equal
    assert found.cuts == (None, None)


def test_a_manifest_that_comes_late(forger: Forger) -> None:
    """The error says what must be where, and what to do."""
    said = refusal(forger.forge(late=True))
    assert "metadata brrt.run and attachment world.json must precede the first message" in said
    assert "read the file that it was made of" in said


SCHEMAS: dict[str, tuple[Callable[[str], str], str]] = {
    "more numbers": (lambda t: t.replace("float64[2]", "float64[3]"), "the layout of its schema"),
    "one number": (lambda t: t.replace("float64[2]", "float64[1]"), "the layout of its schema"),
    "other type": (lambda t: t.replace("uint8 tree", "float32 tree"), "no such field 'tree'"),
    "field twice": (lambda t: t + "uint8 iteration\n", "the schema of"),
    "iteration gone": (lambda t: t.replace("iteration", "iterations"), "no such field 'iteration'"),
    "sequence": (
        lambda t: t.replace("64 cost ", "64 x ") + "float64[] cost\n" if " parent" in t else t,
        "no such field 'cost'",
    ),
    "field gone": (lambda t: t.replace("tree", "bush"), "no such field 'tree'"),
    "text": (lambda _: "string name\n", "unsupported message field"),
    "itself": (lambda t: t + "brrt_msgs/Phase phase\n", "unsupported message field"),
    "endless": (lambda t: t + "#" * (1 << 21), "a chunk says that it unpacks to"),
}


@pytest.mark.parametrize("case", SCHEMAS)
def test_schemas_that_are_not_ours(case: str, forger: Forger) -> None:
    """A schema decides what is read, and never what is not there."""
    change, message = SCHEMAS[case]
    assert message in refusal(forger.forge(schema=change))


def test_two_channels_of_a_topic(forger: Forger) -> None:
    """Events of a kind in two channels, as tools merge files: all are read."""
    assert first_difference([forger.log], read(forger.forge(twice=True)).batches()) is None


def test_events_missing_and_twice(forger: Forger) -> None:
    """Every number is there once; the events before the first for which that is not so are read."""
    log = forger.messages
    for messages, count, message in (
        (log[:7] + log[8:], 7, "events are missing"),
        (log[1:], 0, "events are missing"),
        ([*log[:7], log[6], *log[8:]], 7, "events are out of order"),
        (log[:-1] + [log[-1]] * 2, len(log), "events are there twice"),
    ):
        forger.messages = messages
        assert message in refusal(forger.forge())
        found = recover(forger.path, forger.path.with_name("whole.mcap"))
        assert (found.events, found.complete) == (count, False)


def test_last_events_missing(forger: Forger) -> None:
    """As many events must be there as the result states."""
    n = len(forger.messages)
    forger.forge(events=n)
    assert len(read(forger.path).events()) == n
    forger.messages = forger.messages[:-3]
    assert f"damaged: {n} events were written, {n - 3} are there" in refusal(forger.forge(events=n))


MANIFESTS: dict[str, tuple[dict[str, str], str]] = {
    "huge": ({"dof": "1000000000"}, "a configuration of 1000000000 numbers"),
    "negative": ({"dof": "-2"}, "a configuration of -2 numbers"),
    "other dof": ({"dof": "3"}, "start has 2 numbers instead of 3"),
    "other dim": ({"dim": "3"}, "its world is 2D instead of 3D"),
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
    """Numbers that are impossible, and texts that nest."""
    change, message = MANIFESTS[case]
    forger.run = {**forger.run, **change}
    assert message in refusal(forger.forge())


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
    """No file is written to the name of an attachment."""
    before = set(tmp_path.parent.rglob("*"))
    path = forger.forge(attach="../../escaped.json")
    assert len(read(path).events()) == len(forger.messages)
    assert set(tmp_path.parent.rglob("*")) == before | {path}


def test_zstd_bomb(tmp_path: Path) -> None:
    """A chunk that unpacks to a thousand times its size is not unpacked."""
    path = tmp_path / "x.mcap"
    run, log = recorded(SCENARIO)
    write(path, run, log)
    data = path.read_bytes()
    at, size = mcap_records(data, 6)[0]
    raw = bytes(200_000_000)
    packed = zstandard.ZstdCompressor().compress(raw)
    for stated, message in (
        (len(raw), "unpacks to 200,000,000 bytes"), (1000, "a chunk has a wrong size")
    ):  # fmt: skip
        new = RecordBuilder()
        records.Chunk("zstd", packed, 1, 0, 0, stated).write(new)
        path.write_bytes(data[:at] + new.end() + data[at + size :])
        assert message in refusal(path)


def test_records_without_events(tmp_path: Path) -> None:
    """A file of nothing but empty records, or of schemas, ends soon."""
    path = tmp_path / "x.mcap"
    run, log = recorded(SCENARIO)
    write(path, run, log)
    data = path.read_bytes()
    at, _ = mcap_records(data, 6)[0]
    path.write_bytes(data[:at] + (b"\x90" + bytes(8)) * 200_000)
    assert "131,073 records without an event" in refusal(path)
    schema = RecordBuilder()
    for number in range(1, 20_000):
        records.Schema(number, b"uint8 x # " + b"x" * 1000, "ros2msg", "x").write(schema)
    raw = schema.end()
    chunk = RecordBuilder()
    records.Chunk("", raw, 1, 0, 1, len(raw)).write(chunk)
    path.write_bytes(data[:at] + chunk.end())
    assert "the checksum of a chunk does not match" in refusal(path)
    chunk = RecordBuilder()
    records.Chunk("", raw, 1, 0, zlib.crc32(raw), len(raw)).write(chunk)
    path.write_bytes(data[:at] + chunk.end())
    assert "it declares more than any real file" in refusal(path)
