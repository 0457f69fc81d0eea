"""Indexes, statistics and repeated records that differ from the file, with right checksums."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    ChunkIndex,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
)

from brrt import McapSink, RecordingError, Scenario, read, verify
from brrt.formats import DamagedError
from brrt.formats.mcap.records import CHECKSUM, with_checksum
from brrt.formats.recover import recover
from tests.conftest import Result, recorded, result_of
from tests.support.files import part, same, saved
from tests.support.forging import Parts, changed, data_of, declared_in, file_of, summary_of

SCENARIO = Scenario(world="circles2d:n=9", seed=1, clock="logical", iterations=60)
RESULT = -1
"""The last metadata."""


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """Write a recording whose events are in two chunks."""
    run, log = recorded(SCENARIO)
    half = len(log) // 2
    sink = McapSink(tmp_path / "run.mcap", run.manifest, run.problem.world)
    sink.write(part(log, 0, half))
    sink.annotate("note", {"a": "b"})
    sink.write(part(log, half, len(log)))
    sink.close(result_of(run.manifest, log))
    return tmp_path / "run.mcap"


def rewrite(path: Path, summary: Callable[[Parts], Parts]) -> None:
    """Write a file with another summary."""
    file = path.read_bytes()
    data = data_of(file)
    path.write_bytes(file_of(data, summary(summary_of(data, declared_in(file)))))


def swapped(kind: Any, field: str) -> Callable[[Parts], Parts]:
    """Give the last two of a kind each other's value."""

    def change(parts: Parts) -> Parts:
        *_, a, b = (getattr(record, field) for record in parts if isinstance(record, kind))
        return changed(changed(parts, kind, -1, **{field: a}), kind, -2, **{field: b})

    return change


def without(kind: Any, number: int = -1) -> Callable[[Parts], Parts]:
    """Leave one of a kind out."""

    def change(parts: Parts) -> Parts:
        left = [record for record in parts if isinstance(record, kind)][number]
        return [record for record in parts if record is not left]

    return change


def set_to(kind: Any, number: int = -1, **fields: Any) -> Callable[[Parts], Parts]:
    """Give one of a kind other fields."""
    return lambda parts: changed(parts, kind, number, **fields)


BENT: dict[str, Callable[[Parts], Parts]] = {
    "result of another name": set_to(MetadataIndex, name="brrt.other"),
    "result left out": without(MetadataIndex),
    "manifest left out": without(MetadataIndex, 0),
    "result nowhere": set_to(MetadataIndex, offset=1 << 62),
    "result beyond all": set_to(MetadataIndex, offset=(1 << 64) - 1),
    "result at the manifest": swapped(MetadataIndex, "offset"),
    "result among the messages": set_to(MetadataIndex, offset=5000),
    "result too long": set_to(MetadataIndex, length=1 << 60),
    "result of no length": set_to(MetadataIndex, length=0),
    "names swapped": swapped(MetadataIndex, "name"),
    "world of another name": set_to(AttachmentIndex, name="other"),
    "world elsewhere": set_to(AttachmentIndex, offset=8),
    "world of another size": set_to(AttachmentIndex, data_size=3),
    "world of another time": set_to(AttachmentIndex, log_time=1),
    "chunk elsewhere": set_to(ChunkIndex, chunk_start_offset=8),
    "chunks swapped": swapped(ChunkIndex, "chunk_start_offset"),
    "chunk left out": without(ChunkIndex),
    "chunk twice": lambda parts: [*parts, parts[-1], *(p for p in parts if type(p) is ChunkIndex)],
    "chunk of another time": set_to(ChunkIndex, message_end_time=7),
    "chunk of another length": set_to(ChunkIndex, chunk_length=9),
    "chunk of another size": set_to(ChunkIndex, uncompressed_size=9),
    "messages elsewhere": swapped(ChunkIndex, "message_index_offsets"),
    "index of another length": set_to(ChunkIndex, message_index_length=1),
    "too many messages": set_to(Statistics, message_count=10**6),
    "too few messages": set_to(Statistics, message_count=1),
    "messages of another channel": set_to(Statistics, channel_message_counts={1: 10**6}),
    "another start": set_to(Statistics, message_start_time=5),
    "another end": set_to(Statistics, message_end_time=1),
    "no chunks": set_to(Statistics, chunk_count=0),
    "more metadata": set_to(Statistics, metadata_count=9),
    "no attachment": set_to(Statistics, attachment_count=0),
    "topics swapped": swapped(Channel, "topic"),
    "another schema": set_to(Schema, data=b"float64 x\n"),
}


def test_rewritten_summaries(path: Path) -> None:
    """The same summary, made anew, is right; so is one with neither indexes nor statistics."""
    log = recorded(SCENARIO)[1]
    for change in (list, lambda parts: [p for p in parts if isinstance(p, Schema | Channel)]):
        rewrite(path, change)
        events, error = saved(path)
        assert error is None
        assert same(events, log)
        assert verify(read(path)).findings == []


@pytest.mark.parametrize("case", BENT)
def test_bent_summaries(case: str, path: Path, brrt: Callable[..., Result]) -> None:
    """Damage, by which no event is lost, and the result is the one that is there."""
    log, result = recorded(SCENARIO)[1], read(path).result
    rewrite(path, BENT[case])
    assert read(path).result == result
    events, error = saved(path)
    assert same(events, log)
    assert isinstance(error, DamagedError)
    assert (error.complete, error.ended) == (True, True)
    done = brrt("verify", path)
    assert (done.code, done.err.count("\n")) == (2, 1)
    assert "damaged" in done.err
    assert "no event is lost" in done.err
    found = recover(path, path.with_name("whole.mcap"))
    assert (found.events, found.complete, found.ended) == (len(log), True, True)
    assert read(path.with_name("whole.mcap")).result == result


def metadata(name: str, **texts: str) -> Metadata:
    """Return metadata as brrt writes it."""
    return Metadata(name, with_checksum({k: v for k, v in texts.items() if k != CHECKSUM}))


def doubled(data: Parts, kind: Any, number: int, change: Callable[[Any], Any]) -> Parts:
    """Return a data section with a changed copy of a record at its end."""
    return [*data, change([record for record in data if isinstance(record, kind)][number])]


TWICE: dict[str, tuple[Any, int, Callable[[Any], Any], str]] = {
    "manifest": (Metadata, 0, lambda m: metadata("brrt.run", **{**m.metadata, "epoch_ns": "5"}),
                 "two metadata records brrt.run"),
    "result": (Metadata, RESULT, lambda m: metadata("brrt.result", **{**m.metadata, "nodes": "5"}),
               "two metadata records brrt.result"),
    "world": (Attachment, 0, lambda a: replace(a, data=a.data.replace(b"0.0", b"0.5", 1)),
              "two attachments world.json"),
}  # fmt: skip


@pytest.mark.parametrize("case", TWICE)
@pytest.mark.parametrize("first", [True, False])
def test_two_of_what_is_there_once(case: str, first: bool, path: Path) -> None:
    """Two manifests, worlds or results are damage if they differ, wherever they are."""
    kind, number, change, message = TWICE[case]
    file = path.read_bytes()
    data = data_of(file)
    same_twice = doubled(data, kind, number, lambda record: record)
    path.write_bytes(file_of(same_twice, summary_of(same_twice, declared_in(file))))
    assert saved(path)[1] is None
    *data, other = doubled(data, kind, number, change)
    forged = [data[0], other, *data[1:]] if first else [*data, other]
    path.write_bytes(file_of(forged, summary_of(forged, declared_in(file))))
    with pytest.raises(RecordingError, match=message):
        for _ in read(path).batches():
            pass


def test_the_result_of_another_run(path: Path) -> None:
    """It states another number of events."""
    run, log = recorded(replace(SCENARIO, iterations=30))
    file = path.read_bytes()
    assert len(log) != len(recorded(SCENARIO)[1])
    texts = {name: json.dumps(value) for name, value in result_of(run.manifest, log).items()}
    data = changed(data_of(file), Metadata, RESULT, metadata=with_checksum(texts))
    path.write_bytes(file_of(data, summary_of(data, declared_in(file))))
    events, error = saved(path)
    assert same(events, recorded(SCENARIO)[1])
    assert error is not None
    assert f"{len(log)} events were written, {len(events)} are there" in str(error)
