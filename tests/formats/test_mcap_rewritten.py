"""MCAP files that other tools wrote anew, in every form that MCAP allows: all events are read."""

import itertools
import struct
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import lz4.frame
import pytest
import zstandard
from mcap import records
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.records import (
    Attachment,
    Channel,
    Chunk,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Message,
    MessageIndex,
    Metadata,
    Schema,
    Statistics,
)
from mcap.writer import CompressionType, IndexType, Writer

from brrt import Events, RecordingError, Scenario, first_difference, read
from brrt.formats import CutError, DamagedError
from brrt.formats.mcap.records import MAGIC
from brrt.formats.recover import recover
from tests.conftest import Result, recorded
from tests.support.files import begins, mcap_records, same, saved, write

SCENARIO = Scenario(world="circles2d:n=9", seed=1, clock="logical", iterations=60)


@dataclass(frozen=True)
class Parts:
    """The records of a recording.

    Attributes:
        head: Metadata and attachment that come before the events.
        schemas: By number.
        channels: By number.
        messages: In order.
        tail: The result.
    """

    head: tuple[McapRecord, ...]
    schemas: dict[int, Schema]
    channels: dict[int, Channel]
    messages: tuple[Message, ...]
    tail: tuple[McapRecord, ...]

    @property
    def declared(self) -> list[McapRecord]:
        """All schemas and channels."""
        return [*self.schemas.values(), *self.channels.values()]


def taken_apart(path: Path) -> Parts:
    """Read the records of a recording with stock mcap."""
    with path.open("rb") as file:
        reader = make_reader(file)
        (run, result), (world,) = reader.iter_metadata(), reader.iter_attachments()
        found = list(reader.iter_messages())
        summary = reader.get_summary()
    assert summary is not None
    messages = tuple(message for _, _, message in found)
    return Parts((run, world), summary.schemas, summary.channels, messages, (result,))


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """A recording."""
    run, log = recorded(SCENARIO)
    write(tmp_path / "true.mcap", run, log)
    return tmp_path / "true.mcap"


@pytest.fixture
def parts(path: Path) -> Parts:
    """Its records."""
    return taken_apart(path)


LOG: Callable[[], Events] = lambda: recorded(SCENARIO)[1]  # noqa: E731


def record_bytes(*written: McapRecord) -> bytes:
    """Return records as they are in a file."""
    builder = RecordBuilder()
    for record in written:
        record.write(builder)
    return bytes(builder.end())


def chunk(
    *written: McapRecord | bytes,
    compression: str = "",
    pack: Callable[[bytes], bytes] = bytes,
    crc: bool = True,
) -> bytes:
    """Return a chunk of records."""
    raw = b"".join(w if isinstance(w, bytes) else record_bytes(w) for w in written)
    stated = zlib.crc32(raw) if crc else 0
    return record_bytes(Chunk(compression, pack(raw), 0, 0, stated, len(raw)))


def file_of(parts: Parts, *data: bytes, summary: bytes = b"", tail: bool = True) -> bytes:
    """Return a file with some data section, without an index and without checksums."""
    before = [MAGIC, record_bytes(Header("ros2", "other"), *parts.head), *data]
    before += [record_bytes(*parts.tail) if tail else b"", record_bytes(DataEnd(0))]
    start = len(b"".join(before)) if summary else 0
    return b"".join([*before, summary, record_bytes(Footer(start, 0, 0)), MAGIC])


def halves(parts: Parts) -> tuple[list[Message], list[Message]]:
    """Divide the messages."""
    middle = len(parts.messages) // 2
    return list(parts.messages[:middle]), list(parts.messages[middle:])


def split_frames(pack: Callable[[bytes], bytes]) -> Callable[[bytes], bytes]:
    """Return a compression that makes a frame of each 1,000 bytes."""
    return lambda raw: b"".join(pack(raw[i : i + 1000]) for i in range(0, len(raw), 1000))


def streamed(raw: bytes) -> bytes:
    """Compress as streaming compressors do, which do not know the size."""
    packer = zstandard.ZstdCompressor().compressobj()
    return packer.compress(raw) + packer.flush()


def foreign(parts: Parts) -> Iterator[McapRecord]:
    """Yield the messages, with those of another tool's topic between them."""
    yield Schema(900, b"string frame", "ros2msg", "tf2_msgs/msg/TFMessage")
    yield Channel(901, "/tf", "cdr", {"a": "b"}, 900)
    yield Channel(902, "/raw", "json", {}, 0)
    for message in parts.messages:
        yield message
        yield replace(message, channel_id=901 + message.sequence % 2, data=b"x" * 7, sequence=0)


def twins(parts: Parts) -> Iterator[McapRecord]:
    """Yield the messages in two channels for each topic."""
    for channel in parts.channels.values():
        yield replace(channel, id=channel.id + 500)
    for message in parts.messages:
        yield replace(message, channel_id=message.channel_id + message.sequence % 2 * 500)


def with_private(*written: McapRecord) -> bytes:
    """Return records with ones of unknown kinds before each."""
    unknown = b"".join(struct.pack("<BQ", code, 3) + b"abc" for code in (0x10, 0x7F, 0x80, 0xFF))
    return b"".join(unknown + record_bytes(record) for record in written)


def indexes(parts: Parts) -> list[MessageIndex]:
    """Return where the messages of each channel are in a chunk of nothing else."""
    found: dict[int, MessageIndex] = {}
    at = 0
    for message in parts.messages:
        index = found.setdefault(message.channel_id, MessageIndex(message.channel_id, []))
        index.records.append((message.log_time, at))
        at += len(record_bytes(message))
    return list(found.values())


def by_channel(parts: Parts) -> list[Message]:
    """Return the messages ordered by channel."""
    return sorted(parts.messages, key=lambda m: (m.channel_id, m.sequence))


FORMS: dict[str, Callable[[Parts], bytes]] = {
    "unchunked": lambda p: file_of(p, record_bytes(*p.declared, *p.messages)),
    "declarations before the chunk": lambda p: file_of(
        p, record_bytes(*p.declared), chunk(*p.messages)
    ),
    "declarations before the chunk, and an index": lambda p: file_of(
        p, record_bytes(*p.declared), chunk(*p.messages), record_bytes(*indexes(p))
    ),
    "schemas before, channels in the chunk": lambda p: file_of(
        p, record_bytes(*p.schemas.values()), chunk(*p.channels.values(), *p.messages)
    ),
    "declarations in a chunk of their own": lambda p: file_of(
        p, chunk(*p.declared), chunk(*p.messages)
    ),
    "declarations in each chunk and between": lambda p: file_of(
        p,
        *(chunk(*p.declared, *half) + record_bytes(*p.declared) for half in halves(p)),
    ),
    "declarations before the head": lambda p: (
        MAGIC
        + record_bytes(Header("", ""), *p.declared, *p.head)
        + chunk(*p.messages)
        + record_bytes(*p.tail, DataEnd(0), Footer(0, 0, 0))
        + MAGIC
    ),
    "attachment before the metadata": lambda p: file_of(
        replace(p, head=p.head[::-1]), chunk(*p.declared, *p.messages)
    ),
    "mixed": lambda p: file_of(
        p,
        record_bytes(*p.declared, *p.messages[:40]),
        chunk(*p.messages[40:80], compression="lz4", pack=lz4.frame.compress),
        record_bytes(*p.messages[80:81]),
        chunk(*p.messages[81:120], compression="zstd", pack=zstandard.compress),
        chunk(*p.messages[120:], crc=False),
    ),
    "no checksums": lambda p: file_of(p, chunk(*p.declared, *p.messages, crc=False)),
    "zstd without size": lambda p: file_of(
        p, chunk(*p.declared, *p.messages, compression="zstd", pack=streamed)
    ),
    "zstd in frames": lambda p: file_of(
        p, chunk(*p.declared, *p.messages, compression="zstd", pack=split_frames(streamed))
    ),
    "zstd in frames with sizes": lambda p: file_of(
        p,
        chunk(*p.declared, *p.messages, compression="zstd", pack=split_frames(zstandard.compress)),
    ),
    "lz4 in frames": lambda p: file_of(
        p, chunk(*p.declared, *p.messages, compression="lz4", pack=split_frames(lz4.frame.compress))
    ),
    "empty chunks": lambda p: file_of(
        p,
        chunk(),
        chunk(compression="zstd"),
        chunk(compression="zstd", pack=zstandard.compress),
        chunk(compression="lz4", pack=lz4.frame.compress),
        chunk(*p.declared, *p.messages),
    ),
    "foreign topics": lambda p: file_of(p, chunk(*p.declared, *foreign(p))),
    "foreign topics, unchunked": lambda p: file_of(p, record_bytes(*p.declared, *foreign(p))),
    "two channels of each topic": lambda p: file_of(p, chunk(*p.declared, *twins(p))),
    "unknown records": lambda p: file_of(
        p,
        with_private(*p.declared, *p.messages[:30]),
        chunk(with_private(*p.messages[30:])),
        with_private(),
    ),
    "ordered by channel": lambda p: file_of(p, chunk(*p.declared, *by_channel(p))),
    "ordered by channel, unchunked": lambda p: file_of(
        p, record_bytes(*p.declared, *by_channel(p))
    ),
    "a chunk for each channel": lambda p: file_of(
        p,
        chunk(*p.declared),
        *(chunk(*group) for _, group in itertools.groupby(by_channel(p), lambda m: m.channel_id)),
    ),
    "last first": lambda p: file_of(p, chunk(*p.declared), *(chunk(m) for m in p.messages[::-1])),
    "no sequence numbers": lambda p: file_of(
        p, chunk(*p.declared, *(replace(m, sequence=0) for m in by_channel(p)))
    ),
    "no sequence numbers, chunks of one": lambda p: file_of(
        p, chunk(*p.declared), *(chunk(replace(m, sequence=0)) for m in p.messages)
    ),
    "no sequence numbers, unchunked": lambda p: file_of(
        p, record_bytes(*p.declared, *(replace(m, sequence=0) for m in p.messages))
    ),
    "no result": lambda p: file_of(p, chunk(*p.declared, *p.messages), tail=False),
    "index of nothing": lambda p: file_of(
        p, chunk(*p.declared, *p.messages), record_bytes(MessageIndex(1, []), MessageIndex(77, []))
    ),
    "longer records": lambda p: file_of(p, chunk(*map(extended, p.declared), *p.messages)),
}


def extended(record: McapRecord) -> bytes:
    """Return a record with a field that a later version of MCAP may add."""
    data = record_bytes(record)
    return data[:1] + struct.pack("<Q", len(data) - 9 + 4) + data[9:] + b"more"


@pytest.mark.parametrize("form", FORMS)
def test_forms(form: str, parts: Parts, tmp_path: Path) -> None:
    """All events and the result come back, and `recover` writes them as brrt does."""
    path, whole = tmp_path / "x.mcap", tmp_path / "whole.mcap"
    path.write_bytes(FORMS[form](parts))
    recording, log = read(path), LOG()
    assert same(recording.events(), log)
    assert (recording.result is None) == (form == "no result")
    assert same(read(path, partial=True).events(), log)
    done = recover(path, whole)
    assert (done.events, done.lost) == (len(log), None)
    assert same(read(whole).events(), log)
    assert mcap_records(whole.read_bytes(), Opcode.CHUNK)


@pytest.mark.parametrize(
    "form", ["unchunked", "mixed", "foreign topics", "a chunk for each channel"]
)
def test_forms_that_are_cut(form: str, parts: Parts, tmp_path: Path) -> None:
    """The first events come back, then `CutError`."""
    path, log = tmp_path / "x.mcap", LOG()
    data = FORMS[form](parts)
    for size in range(len(data) - 1, len(data) // 2, -len(data) // 9):
        path.write_bytes(data[:size])
        events, error = saved(path)
        assert isinstance(error, CutError)
        assert begins(log, events)
        assert read(path).result is None


OPTIONS: list[dict[str, Any]] = [
    {"compression": compression, "index_types": index}
    for compression in CompressionType
    for index in (IndexType.ALL, IndexType.NONE, IndexType.CHUNK, IndexType.METADATA)
]
OPTIONS += [
    {"use_chunking": chunking, option: value}
    for chunking in (True, False)
    for option, value in (
        ("enable_crcs", False), ("enable_data_crcs", True), ("repeat_channels", False),
        ("repeat_schemas", False), ("use_statistics", False), ("use_summary_offsets", False),
        ("chunk_size", 1), ("chunk_size", 3000),
    )
]  # fmt: skip
BARE = dict.fromkeys(
    ("enable_crcs", "repeat_channels", "repeat_schemas", "use_statistics", "use_summary_offsets"),
    False,
)
OPTIONS += [{**BARE, "index_types": IndexType.NONE, "use_chunking": c} for c in (True, False)]


@pytest.mark.parametrize("options", OPTIONS, ids=str)
def test_options_of_the_stock_writer(options: dict[str, Any], parts: Parts, tmp_path: Path) -> None:
    """Whatever options a file is written anew with, events and result are the same."""
    path = tmp_path / "x.mcap"
    with path.open("wb") as file:
        out = Writer(file, **options)
        out.start("ros2", "other")
        run, world = parts.head
        assert isinstance(run, Metadata)
        assert isinstance(world, Attachment)
        out.add_metadata(run.name, run.metadata)
        out.add_attachment(0, 0, world.name, world.media_type, world.data)
        schemas = {
            number: out.register_schema(s.name, s.encoding, s.data)
            for number, s in parts.schemas.items()
        }
        channels = {
            number: out.register_channel(c.topic, c.message_encoding, schemas[c.schema_id])
            for number, c in parts.channels.items()
        }
        for m in parts.messages:
            number = channels[m.channel_id]
            out.add_message(number, m.log_time, m.data, m.publish_time, m.sequence)
        (result,) = parts.tail
        assert isinstance(result, Metadata)
        out.add_metadata(result.name, result.metadata)
        out.finish()
    recording = read(path)
    assert same(recording.events(), LOG())
    assert recording.result == read(tmp_path / "true.mcap").result


def test_commands(parts: Parts, brrt: Callable[..., Result], tmp_path: Path) -> None:
    """Every command takes such a file as it takes the original."""
    Path("x.mcap").write_bytes(FORMS["unchunked"](parts))
    assert brrt("replay", "x.mcap", "--json").json == brrt("replay", "true.mcap", "--json").json
    assert brrt("verify", "x.mcap").code == 0
    assert brrt("diff", "x.mcap", "true.mcap").code == 0
    assert brrt("explain", "x.mcap").code == 0
    assert brrt("export", "x.mcap", "--foxglove", "viz.mcap").code == 0
    done = brrt("recover", "x.mcap", "--out", "whole.mcap")
    assert done.out.startswith(f"x.mcap is whole: whole.mcap holds its {len(parts.messages):,} ev")


ERRORS: dict[str, tuple[Callable[[Parts], bytes], str]] = {
    "unknown channel": (
        lambda p: file_of(p, chunk(*p.messages)),
        "a message of channel 1, which is not declared before it",
    ),
    "unknown channel, unchunked": (
        lambda p: file_of(p, record_bytes(*p.messages)),
        "a message of channel 1, which is not declared before it",
    ),
    "unknown channel beside known ones": (
        lambda p: file_of(p, chunk(*p.declared, replace(p.messages[0], channel_id=99))),
        "a message of channel 99, which is not declared before it",
    ),
    "unknown schema": (
        lambda p: file_of(p, chunk(*p.channels.values(), *p.messages)),
        "has schema 1, which is not declared before it",
    ),
    "no schema": (
        lambda p: file_of(
            p, chunk(*(replace(c, schema_id=0) for c in p.channels.values()), *p.messages)
        ),
        "has schema 0, which is not declared before it",
    ),
    "two channels with a number": (
        lambda p: file_of(p, chunk(*p.declared, replace(p.channels[1], topic="/tf"), *p.messages)),
        "two channels have the number 1",
    ),
    "other encoding": (
        lambda p: file_of(
            p,
            chunk(
                *p.schemas.values(),
                *(replace(c, message_encoding="json") for c in p.channels.values()),
                *p.messages,
            ),
        ),
        "is encoded as ('ros2msg', 'json'), brrt reads ('ros2msg', 'cdr')",
    ),
    "big endian": (
        lambda p: file_of(
            p, chunk(*p.declared, *(replace(m, data=b"\0\0" + m.data[2:]) for m in p.messages))
        ),
        "a message does not have the layout of its schema",
    ),
    "other compression": (
        lambda p: file_of(p, chunk(*p.declared, *p.messages, compression="bz2")),
        "a chunk has the compression 'bz2', brrt reads zstd and lz4",
    ),
    "damaged lz4": (
        lambda p: file_of(p, chunk(*p.declared, *p.messages, compression="lz4")),
        "a chunk cannot be unpacked",
    ),
    "no sequence numbers and out of order": (
        lambda p: file_of(
            p, *(chunk(*p.declared, replace(m, sequence=0)) for m in p.messages[:2] + p.messages)
        ),
        "messages without sequence numbers are not in the order of their times",
    ),
    "fewer than the result says": (
        lambda p: file_of(p, chunk(*p.declared, *p.messages[:-3])),
        "events were written,",
    ),
    "fewer than the statistics say": (
        lambda p: file_of(
            p, chunk(*p.declared, *p.messages[:-3]), summary=statistics(p, {}), tail=False
        ),
        "by its statistics, ",
    ),
    "others than the statistics say": (
        lambda p: file_of(p, chunk(*p.declared, *p.messages), summary=statistics(p, {1: 1, 2: 0})),
        "by its statistics, 1 events of kind phase were written, ",
    ),
}


def statistics(parts: Parts, counts: dict[int, int]) -> bytes:
    """Return statistics of all messages."""
    return record_bytes(Statistics(1, 12, counts, 1, len(parts.messages), 0, 0, 2, 12))


@pytest.mark.parametrize("case", ERRORS)
def test_errors(case: str, parts: Parts, tmp_path: Path) -> None:
    """What MCAP does not allow, or brrt does not read, is said in one line, never skipped."""
    path = tmp_path / "x.mcap"
    make, message = ERRORS[case]
    path.write_bytes(make(parts))
    events, error = saved(path)
    assert isinstance(error, DamagedError)
    assert message in str(error)
    assert begins(LOG(), events)


def test_bombs(parts: Parts, tmp_path: Path) -> None:
    """Frames without a size, and lz4, unpack to no more than the chunk states."""
    path = tmp_path / "x.mcap"
    raw = bytes(100_000_000)
    for compression, pack in (("zstd", streamed), ("lz4", lz4.frame.compress)):
        bomb = record_bytes(records.Chunk(compression, pack(raw), 0, 0, 0, 1000))
        path.write_bytes(file_of(parts, bomb))
        with pytest.raises(RecordingError, match="a chunk has a wrong size"):
            list(read(path).batches())


def test_many_messages_of_others(parts: Parts, tmp_path: Path) -> None:
    """More messages of other topics than there are records between chunks of any real file."""
    path = tmp_path / "x.mcap"
    other = record_bytes(*list(foreign(parts))[:3], Message(901, 0, b"", 0, 0))
    many = other[-31:] * 200_000
    path.write_bytes(file_of(parts, other, many, record_bytes(*parts.declared, *parts.messages)))
    assert first_difference([LOG()], read(path).batches()) is None
