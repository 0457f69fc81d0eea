"""MCAP files that are cut, damaged or replaced: read up to there, then one clear error."""

from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from brrt import BrrtError, Events, RecordingError, Scenario, read
from brrt.formats import CutError, DamagedError
from brrt.formats.mcap import sink
from tests.conftest import recorded
from tests.support.files import FORMATS, begins, flipped, mcap_records, part, same, saved, write
from tests.support.logs import split

SCENARIO = Scenario(world="circles2d:n=40", seed=7, clock="logical")
CHUNK, INDEX, METADATA, DATA_END = 6, 7, 12, 15


@pytest.fixture(autouse=True)
def _at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Write a chunk for each batch."""
    monkeypatch.setattr(sink, "_CHUNK_SECONDS", 0.0)


def record(path: Path, scenario: Scenario = SCENARIO, size: int = 100) -> Events:
    """Record a run in chunks of so many events; return its log."""
    run, log = recorded(scenario)
    write(path, run, *split(log, size))
    return log


def test_cut_anywhere(tmp_path: Path) -> None:
    """At whatever byte a file is cut, its whole chunks come back, then `CutError`."""
    path = tmp_path / "run.mcap"
    log = record(path)
    whole, counts = path.read_bytes(), []
    first = mcap_records(whole, CHUNK)[0][0]
    for size in range(len(whole) - 1, first, -len(whole) // 40):
        path.write_bytes(whole[:size])
        assert read(path).result is None
        events, error = saved(path)
        assert isinstance(error, CutError)
        assert f"{path}: the file is cut at byte {size:,}" in str(error)
        assert str(error).endswith("; brrt.read(path, partial=True) reads up to there")
        assert begins(log, events)
        assert same(read(path, partial=True).events(), events)
        counts.append(len(events))
    assert counts == sorted(counts, reverse=True)
    assert 0 < counts[len(counts) // 2] < counts[0] == len(log)


def test_a_chunk_is_read_without_its_indexes(tmp_path: Path) -> None:
    """A file that ends after a chunk has its events: the records lead from one to the next."""
    path = tmp_path / "run.mcap"
    log = record(path)
    data = path.read_bytes()
    at, length = mcap_records(data, CHUNK)[2]
    path.write_bytes(data[: at + length])
    events, error = saved(path)
    assert isinstance(error, CutError)
    assert len(events) == 300
    assert begins(log, events)


def test_power_cut_that_leaves_zeros(tmp_path: Path) -> None:
    """A file may have its length and not its content: what follows the last batch is a cut."""
    path = tmp_path / "run.mcap"
    log = record(path)
    data = path.read_bytes()
    end = mcap_records(data, CHUNK)[3][0]
    for zeros in (1 << 12, 1 << 24):
        for size, count in ((end, 300), (end - 20, 300), (end + 50, 300)):
            path.write_bytes(data[:size] + bytes(zeros))
            events, error = saved(path)
            assert isinstance(error, (CutError, DamagedError))
            assert "zeros follow" in str(error) or size != end
            assert len(events) == count
            assert begins(log, events)


@settings(
    max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(where=st.floats(0, 1, exclude_max=True), flip=st.integers(1, 255))
def test_a_wrong_byte_is_found(
    where: float, flip: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """One changed byte anywhere: the events before it, then one clear error."""
    folder = tmp_path_factory.getbasetemp()
    source, path = folder / "flip-source.mcap", folder / "flipped.mcap"
    if not source.exists():
        record(source)
    data = bytearray(source.read_bytes())
    data[int(where * len(data))] ^= flip
    path.write_bytes(data)
    try:
        events, error = saved(path)
    except BrrtError as refused:
        error = RecordingError(str(refused))
    else:
        assert begins(recorded(SCENARIO)[1], events)
    assert str(error).startswith(f"{path}: ")
    assert "\n" not in str(error)


def test_damage_in_a_chunk_ends_the_events(tmp_path: Path) -> None:
    """The events up to the chunk before are given, and nothing after it."""
    path = tmp_path / "run.mcap"
    log = record(path)
    data = path.read_bytes()
    at, length = mcap_records(data, CHUNK)[3]
    for place in (at + 2, at + 60, at + length // 2):
        path.write_bytes(flipped(data, place))
        events, error = saved(path)
        assert isinstance(error, DamagedError)
        assert (len(events), error.complete, error.ended) == (300, False, False)
        assert begins(log, events)
        taken = read(path, partial=True)
        assert taken.result is None
        assert taken.counts is None
        assert same(taken.events(), events)


def test_damage_beside_the_events_takes_none(tmp_path: Path) -> None:
    """In an index, the result, the summary or their heads: all events are read."""
    path = tmp_path / "run.mcap"
    log = record(path)
    data = path.read_bytes()
    index, size = mcap_records(data, INDEX)[5]
    result, _ = mcap_records(data, METADATA)[-1]
    end, _ = mcap_records(data, DATA_END)[0]
    places = [*range(index + 9, index + size, 7), *range(result, result + 9), result + 60]
    for place in [*places, *range(end, end + 13), *range(end + 13, len(data) - 8, 997)]:
        path.write_bytes(flipped(data, place))
        events, error = saved(path)
        assert isinstance(error, DamagedError), place
        assert same(events, log), (place, error)
        assert (error.complete, error.ended) == (True, True), (place, error)


def test_result_is_left_out_where_it_is_damaged(tmp_path: Path) -> None:
    """A letter of the result is another: there is none, and reading to the end says why."""
    path = tmp_path / "run.mcap"
    record(path)
    data = bytearray(path.read_bytes())
    data[data.index(b'"solved"', data.index(b"brrt.result")) + 2] ^= 1
    path.write_bytes(data)
    assert read(path).result is None
    assert "the checksum of brrt.result does not match" in str(saved(path)[1])


@pytest.mark.parametrize(("what", "text"), [("brrt.run", b'"seed": 7'), ("world.json", b"circ")])
def test_head_has_checksums_of_its_own(what: str, text: bytes, tmp_path: Path) -> None:
    """A letter of the manifest or the world is another: found before any event is read."""
    path = tmp_path / "run.mcap"
    record(path)
    data = bytearray(path.read_bytes())
    data[data.index(text, data.index(what.encode())) + len(text) - 2] ^= 1
    path.write_bytes(data)
    with pytest.raises(DamagedError, match=f"damaged: the checksum of {what} does not match"):
        read(path)


@pytest.mark.parametrize("suffix", FORMATS)
def test_replaced_while_it_is_read(suffix: str, tmp_path: Path) -> None:
    """The manifest of one run and the events of another never come together."""
    path = tmp_path / f"run{suffix}"
    record(path)
    opened = read(path)
    record(path, replace(SCENARIO, seed=8))
    with pytest.raises(RecordingError, match="was replaced while it was being read"):
        list(opened.batches())
    path.unlink()
    with pytest.raises(RecordingError, match=r"No such file"):
        list(opened.batches())


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "not a recording"),
        (b"hello", "not a recording"),
        (b"\x89MCAP0\r\n", "cut at byte 8, before the first event: nothing can be saved"),
        (b"\x89MCAP0\r\n" + b"\x01\xff\xff\xff\xff\xff\xff\xff\x7f", "a record of 9,22"),
    ],
)
def test_other_files(data: bytes, message: str, tmp_path: Path) -> None:
    """Other files are refused in one line that names the file."""
    path = tmp_path / "x.mcap"
    path.write_bytes(data)
    with pytest.raises(RecordingError, match=message) as error:
        read(path)
    assert str(path) in str(error.value)


def test_a_gap_or_an_impossible_value(tmp_path: Path) -> None:
    """A chunk that lacks an event is not read, nor one with a value that none can have."""
    path = tmp_path / "run.mcap"
    run, log = recorded(SCENARIO)
    parts = split(log, 100)
    negative = part(log, 200, 300)
    for table in negative.tables.values():
        table["iteration"][-1] = -1
    lacking = ((part(log, 200, 257), 257), (part(log, 201, 300), 200))
    for batch, count in (*lacking, (negative, 200)):
        write(path, run, *parts[:2], batch, *parts[3:])
        events, error = saved(path)
        assert isinstance(error, DamagedError)
        assert f"damaged after event {count - 1}: " in str(error)
        assert (len(events), error.complete) == (count, False)
        assert begins(log, events)
