"""What is left of a recording when something goes wrong while it is written."""

import errno
import resource
import struct
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rerun as rr
from hypothesis import given
from hypothesis import strategies as st
from mcap.reader import make_reader

from brrt import Events, Kind, McapSink, RecordingError, Run, Scenario, first_difference, read
from brrt.events import table_dtype
from brrt.files import OutputFile
from brrt.formats import CutError, DamagedError
from brrt.formats.background import Background
from brrt.formats.integrity import Numbering
from brrt.formats.mcap import writer
from brrt.formats.recover import NOTE, recover
from brrt.formats.rrd.checksum import BLANK, WRITTEN
from brrt.formats.rrd.frames import BATCH, FRAME, HEAD, unpacked
from brrt.formats.rrd.outline import Outline
from brrt.planners.base.stop import Stop
from brrt.recording import Memory
from brrt.views.rerun import sink
from brrt.views.rerun.pipe import Drain
from brrt.views.rerun.sink import RerunSink
from tests.conftest import Result, recorded, result_of

SCENARIO = Scenario(world="circles2d:n=40", seed=7, clock="logical")
ENDINGS = (".mcap", ".rrd")
Command = Callable[..., Result]


def new_sink(path: Path, run: Run) -> Any:
    """Open a sink by the ending of the name."""
    if path.suffix == ".rrd":
        return RerunSink(run.manifest, run.problem.world, path=path)
    return McapSink(path, run.manifest, run.problem.world)


def write(path: Path, batch: int = 100) -> Events:
    """Record a run without gathering its batches; return its log."""
    run, log = recorded(SCENARIO, batch=batch)
    sink = new_sink(path, run)
    for first in range(0, len(log), batch):
        sink.write(part(log, first, first + batch))
    sink.close(result_of(run.manifest, log))
    return log


def part(log: Events, first: int, end: int) -> Events:
    """Events from a number on, up to another."""
    tables = {k: t[(t["seq"] >= first) & (t["seq"] < end)] for k, t in log.tables.items()}
    return Events(log.dof, {k: t for k, t in tables.items() if len(t)})


@pytest.fixture(autouse=True)
def _at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Write each batch as it comes, as if each had waited long enough."""
    monkeypatch.setattr(writer, "_CHUNK_SECONDS", 0.0)
    monkeypatch.setattr(sink, "_FILE_S", 0.0)


def saved(path: Path) -> tuple[Events, RecordingError | None]:
    """Return what a file gives, and the error behind it."""
    recording, batches = read(path), list[Events]()
    try:
        batches.extend(recording.batches())
    except RecordingError as error:
        return Events.concat(recording.manifest.dof, batches), error
    return Events.concat(recording.manifest.dof, batches), None


def begins(log: Events, events: Events) -> bool:
    """Whether events are how a log begins, times and all."""
    beginning = log.until(seq=len(events) - 1)
    return first_difference([beginning], [events]) is None and all(
        (table["t"] == events[kind]["t"]).all() for kind, table in beginning.tables.items()
    )


@pytest.mark.parametrize("ending", ENDINGS)
def test_killed_at_any_batch(ending: str, tmp_path: Path) -> None:
    """What the file holds once a batch was taken is that batch and all before; a name says that."""
    run, log = recorded(SCENARIO, batch=100)
    path, left = tmp_path / f"run{ending}", tmp_path / f"left{ending}"
    sink = new_sink(path, run)
    for first in range(0, len(log), 100):
        sink.write(part(log, first, first + 100))
        left.write_bytes(path.read_bytes())
        events, error = saved(left)
        assert isinstance(error, CutError)
        assert len(events) == min(first + 100, len(log))
        assert begins(log, events)
    sink.close(result_of(run.manifest, log))
    assert [p.name for p in tmp_path.iterdir() if p != left] == [path.name]


@pytest.mark.parametrize("ending", ENDINGS)
def test_older_file_stays_until_there_is_another(ending: str, tmp_path: Path) -> None:
    """A sink that cannot begin leaves what was there, and nothing else."""
    path = tmp_path / f"run{ending}"
    path.write_text("precious")
    run, _ = recorded(SCENARIO, batch=100)
    with files_limited_to(100), pytest.raises(RecordingError, match=r"cannot write .*too large"):
        new_sink(path, run)
    assert path.read_text() == "precious"
    assert list(tmp_path.iterdir()) == [path]


@contextmanager
def files_limited_to(size: int) -> Iterator[None]:
    """Let writing fail beyond a size, as a disk does that fills up."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


@pytest.mark.parametrize("threaded", [False, True])
def test_disk_that_fills_up(threaded: bool, tmp_path: Path) -> None:
    """The file is cut back to its last whole chunk, and nothing comes behind that."""
    path = tmp_path / "run.mcap"
    run, log = recorded(SCENARIO, batch=100)
    sink = new_sink(path, run)
    with files_limited_to(20_000), pytest.raises(RecordingError, match="File too large"):
        run_all(Background(sink) if threaded else sink, log)
    events, error = saved(path)
    assert isinstance(error, CutError)
    assert path.stat().st_size < 20_000
    assert error.fault == f"{path}: the file is cut at byte {path.stat().st_size:,}"
    assert 0 < len(events) < len(log)
    assert begins(log, events)


def run_all(sink: Any, log: Events) -> None:
    """Feed a sink and close it, as a run does."""
    try:
        for first in range(0, len(log), 100):
            sink.write(part(log, first, first + 100))
    except BaseException:
        sink.close(None)
        raise
    sink.close(result_of(recorded(SCENARIO)[0].manifest, log))


def test_nothing_is_written_behind_a_batch_that_failed() -> None:
    """Where a thread's sink fails once, the batches behind that one are left out."""
    _, log = recorded(SCENARIO, batch=100)
    got = list[int]()

    class Shaky:
        def write(self, events: Events) -> None:
            got.append(len(events))
            if len(got) == 2:
                raise MemoryError("too much")

        def close(self, result: Any) -> None:
            assert result is None

    with pytest.raises(MemoryError, match="too much"):
        run_all(Background(Shaky()), log)
    assert got == [100, 100]


def test_whatever_happens_to_a_drain_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An error of any kind on its thread ends in one line; its pipe is emptied all the same."""

    def fail(self: OutputFile, data: bytes) -> None:
        raise MemoryError("too much")

    monkeypatch.setattr(OutputFile, "write", fail)
    drain = Drain(tmp_path / "x.rrd")
    with open(drain.inlet, "wb") as inlet:  # noqa: PTH123 - no path
        inlet.write(bytes(3_000_000))
    with pytest.raises(RecordingError, match=r"cannot write .*x\.rrd: too much"):
        drain.settle()
    with pytest.raises(RecordingError, match="too much"):
        drain.close()
    assert list(tmp_path.iterdir()) == []


def test_disk_that_fails_later(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What the disk does not keep, though the system took it, is an error at the end."""

    def fail(number: int) -> None:
        raise OSError(errno.EIO, "Input/output error")

    path = tmp_path / "run.mcap"
    run, log = recorded(SCENARIO, batch=100)
    sink = new_sink(path, run)
    monkeypatch.setattr("brrt.files.os.fsync", fail)
    with pytest.raises(RecordingError, match="Input/output error"):
        run_all(sink, log)


@pytest.mark.parametrize("planner", ["rrt", "rrt-star", "lrta-star", "a-star"])
def test_slow_planners_hand_over_what_they_have(
    planner: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where each iteration takes long, each is a batch; the log is the same all the same."""
    scenario = Scenario(
        world="circles2d:n=9", seed=1, planner=planner, iterations=60, clock="logical"
    )
    _, log = recorded(scenario)
    clock = iter(range(10**9))
    monkeypatch.setattr("brrt.kernels.event_log._MAX_DELAY_S", -1.0)
    monkeypatch.setattr("brrt.planners.base.stop.time.monotonic", lambda: float(next(clock)))
    run, memory = Run(scenario), Memory()
    run.stop._share = 1
    run.execute([memory])
    assert len(memory.batches) > 20
    assert begins(log, memory.events())
    assert len(memory.events()) == len(log)


def test_share_of_a_slow_planner_and_of_a_fast_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """A loop is given so much that it comes back about each tenth of a second."""
    now = [0.0]
    monkeypatch.setattr("brrt.planners.base.stop.time.monotonic", lambda: now[0])
    for iteration_s in (1e-6, 1e-3, 1.0):
        stop, share = Stop(iterations=10**9), 0
        for _ in range(60):
            share = stop.share(0)
            now[0] += share * iteration_s
        assert share == 1 or 0.05 <= share * iteration_s <= 0.4


@pytest.mark.parametrize("ending", ENDINGS)
@pytest.mark.parametrize("out", ENDINGS)
def test_recover(ending: str, out: str, tmp_path: Path) -> None:
    """What is whole of a cut file, in a file that lacks nothing; cut behind the run, all of it."""
    path, whole = tmp_path / f"run{ending}", tmp_path / f"whole{out}"
    log = write(path)
    data = path.read_bytes()
    cut = tmp_path / f"cut{ending}"
    for size in (len(data) * 2 // 5, len(data) - 60):
        cut.write_bytes(data[:size])
        expected, _ = saved(cut)
        found = recover(cut, whole)
        events, error = saved(whole)
        assert error is None or (out == ".rrd" and isinstance(error, CutError))
        assert begins(log, events)
        assert len(events) == len(expected) == found.events
        assert found.until_s == expected.last.t / 1e9
        assert found.lost == f"{cut}: the file is cut at byte {size:,}" + (
            ", behind the last event" if found.ended and ending == ".mcap" else ""
        )
    assert len(events) == len(log)
    assert read(whole).result == read(path).result is not None


def test_recovered_file_says_so(tmp_path: Path) -> None:
    """Stock mcap finds a whole file, with a note of what it was made of."""
    path, cut, whole = (tmp_path / f"{name}.mcap" for name in ("run", "cut", "whole"))
    write(path)
    data = path.read_bytes()
    cut.write_bytes(data[: len(data) // 2])
    found = recover(cut, whole)
    with whole.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        names = {record.name: record.metadata for record in reader.iter_metadata()}
        assert sum(1 for _ in reader.iter_messages()) == found.events > 0
    assert set(names) == {"brrt.run", NOTE}
    assert names[NOTE]["from"] == "cut.mcap"
    assert names[NOTE]["events"] == str(found.events)
    assert names[NOTE]["lost"] == f"cut.mcap: the file is cut at byte {len(data) // 2:,}"


@pytest.mark.parametrize("ending", ENDINGS)
def test_recover_what_stands_ahead_of_damage(ending: str, tmp_path: Path) -> None:
    """Of a file with a wrong byte, the events ahead of it are saved."""
    path, whole = tmp_path / f"run{ending}", tmp_path / "whole.mcap"
    log = write(path)
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 8
    path.write_bytes(data)
    found = recover(path, whole)
    assert found.lost is not None
    assert "damaged" in found.lost
    events, _ = saved(whole)
    assert 0 < len(events) == found.events < len(log)
    assert begins(log, events)


def records(data: bytes, opcode: int) -> list[tuple[int, int]]:
    """Place and length, head included, of an MCAP file's records of a kind."""
    found, at = [], 8
    while at + 9 <= len(data) - 8:
        op, length = struct.unpack_from("<BQ", data, at)
        found += [(at, length + 9)] if op == opcode else []
        at += length + 9
    return found


def test_damage_beside_the_events_takes_none(tmp_path: Path) -> None:
    """In an index, the figures, the summary or their heads: all events are saved, and figures."""
    path, whole = tmp_path / "run.mcap", tmp_path / "whole.mcap"
    log = write(path)
    data, figures = path.read_bytes(), read(path).result
    (index, size), (result, _) = records(data, 7)[5], records(data, 12)[-1]
    end = records(data, 15)[0][0]
    places = [*range(index, index + min(size, 31), 2), *range(result, result + 9, 2), result + 60]
    for place in [*places, *range(end, end + 13, 2), *range(end + 13, len(data) - 8, 997)]:
        damaged = bytearray(data)
        damaged[place] ^= 1 << place % 8
        path.write_bytes(damaged)
        events, error = saved(path)
        assert isinstance(error, DamagedError), place
        assert len(events) == len(log), (place, error)
        found = recover(path, whole)
        assert (found.events, found.complete, found.ended) == (len(log), True, True), (place, error)
        assert begins(log, events)
        assert first_difference([events], read(whole).batches()) is None
        assert read(whole).result == figures


@pytest.mark.parametrize("ending", ENDINGS)
def test_recover_up_to_a_gap_or_an_impossible_value(ending: str, tmp_path: Path) -> None:
    """Of a batch that lacks an event, or has one that none can be, the events ahead are saved."""
    run, log = recorded(SCENARIO, batch=100)
    path, whole = tmp_path / f"run{ending}", tmp_path / f"whole{ending}"
    samples = log[Kind.SAMPLE].copy()
    at = len(samples) // 2
    samples["q"][at] = np.nan
    odd = Events(log.dof, {**log.tables, Kind.SAMPLE: samples})
    for k, events in [
        *((k, log) for k in (0, 1, 57, len(log) - 2)),
        (int(samples["seq"][at]), odd),
    ]:
        sink = new_sink(path, run)
        whole_log = events is log
        written = [part(log, 0, k), part(log, k + 1, len(log))] if whole_log else [odd]
        for each in written:
            sink.write(each)
        sink.close(result_of(run.manifest, *written))
        found = recover(path, whole)
        assert (found.events, found.complete) == (k, False)
        assert "damaged" in (found.lost or "")
        kept, _ = saved(whole)
        assert len(kept) == k
        assert begins(log, kept)


@given(st.lists(st.integers(0, 11), max_size=12), st.lists(st.integers(0, 11), max_size=12))
def test_beginning_of_a_batch(a: list[int], b: list[int]) -> None:
    """`Numbering.beginning` gives the longest row of numbers in which each is there once."""
    tables = {}
    for kind, seqs in ((Kind.SAMPLE, a), (Kind.REJECT, b)):
        tables[kind] = np.zeros(len(seqs), table_dtype(kind, 2))
        tables[kind]["seq"] = seqs
    first, count = 3, 0
    rising = [naive_rising(seqs) for seqs in (a, b)]
    while sum(first + count in seqs for seqs in rising) == 1:
        count += 1
    numbering = Numbering(first)
    events, wrong = numbering.beginning(Events(2, tables))
    found = sorted(int(seq) for table in events.tables.values() for seq in table["seq"])
    assert found == list(range(first, first + count))
    assert numbering.next == first + count
    assert (wrong is None) == (count == len(a) + len(b))


def naive_rising(seqs: list[int]) -> list[int]:
    """The numbers up to the first that is not above the one ahead of it."""
    kept = list[int]()
    for seq in seqs:
        if kept and seq <= kept[-1]:
            break
        kept.append(seq)
    return kept


@pytest.mark.parametrize("ending", ENDINGS)
def test_damaged_file_names_remedies(ending: str, brrt: Command, tmp_path: Path) -> None:
    """Each command names both; with --partial it takes what is ahead of the damage."""
    path = tmp_path / f"run{ending}"
    log = write(path)
    data = path.read_bytes()
    assert read(path, partial=True).result == read(path).result
    for place, least, most in ((len(data) // 2, 1, len(log) - 1), (-40, len(log), len(log))):
        damaged = bytearray(data)
        damaged[place] ^= 8
        path.write_bytes(damaged)
        for command in ("replay", "verify", "explain"):
            done = brrt(command, path.name)
            assert (done.code, done.out, done.err.count("\n")) == (2, "", 1)
            assert " with --partial, or save them with brrt recover run" in done.err
            assert ("no event is lost" in done.err) == (most == len(log))
        taken = read(path, partial=True)
        assert taken.result is None
        assert least <= len(taken.events()) <= most
        assert brrt("verify", path.name, "--partial").code == 0
        done = brrt("replay", path.name, "--partial", "--json")
        assert (done.code, done.err.count("\n")) == (0, 1)
        assert least <= done.json["events"] <= most
        done = brrt("recover", path.name, "--out", "whole.mcap", "--force")
        assert done.code == 0
        assert ("no event is lost" in done.out) != ("anything later is lost" in done.out)


def test_nothing_is_given_under_a_head_that_is_not_proved(tmp_path: Path) -> None:
    """Of an .rrd that was killed, no event comes with a manifest whose checksum is wrong."""
    path = tmp_path / "run.rrd"
    write(path)
    data = path.read_bytes()[: path.stat().st_size // 2]
    first = first_event(path)
    refused = 0
    for place in range(20, first, first // 40):
        damaged = bytearray(data)
        damaged[place] ^= 2
        path.write_bytes(damaged)
        try:
            assert len(read(path, partial=True).events()) == 0  # it is what follows the head
        except RecordingError as error:
            refused += "run.rrd: " in str(error)
    assert refused >= 39


@pytest.mark.parametrize("ending", ENDINGS)
def test_replaced_while_it_is_read(ending: str, tmp_path: Path) -> None:
    """The manifest of one run and the events of another never come together."""
    path = tmp_path / f"run{ending}"
    write(path)
    run, log = recorded(replace(SCENARIO, seed=8), batch=100)
    opened = read(path)
    sink = new_sink(path, run)
    run_all(sink, log)
    with pytest.raises(RecordingError, match="was replaced while it was being read"):
        list(opened.batches())
    path.unlink()
    with pytest.raises(RecordingError, match=r"No such file"):
        list(opened.batches())


def test_recover_says_what_it_did(brrt: Command, tmp_path: Path) -> None:
    """In one line; nothing is written over the recording, nor where there is nothing to save."""
    log = write(tmp_path / "run.mcap")
    data = (tmp_path / "run.mcap").read_bytes()
    for name, size in (("cut", len(data) // 2), ("bare", 1000), ("nearly", len(data) - 9)):
        (tmp_path / f"{name}.mcap").write_bytes(data[:size])
    done = brrt("recover", "run.mcap", "--out", "a.mcap")
    assert done.out.startswith(f"run.mcap is whole: a.mcap holds its {len(log):,} events up to 0.")
    done = brrt("recover", "nearly.mcap", "--out", "b.mcap")
    assert f"; no event is lost: b.mcap holds all {len(log):,} events up to" in done.out
    done = brrt("recover", "cut.mcap", "--out", "c.mcap")
    assert "; c.mcap holds what is whole: " in done.out
    assert done.out.count("\n") == 1
    assert brrt("verify", "c.mcap").code == 0
    assert brrt("recover", "cut.mcap", "--out", "c.mcap").code == 2
    for out, message in (("bare.mcap", "is the recording itself"), ("d.mcap", "nothing to save")):
        done = brrt("recover", "bare.mcap", "--out", out, "--force")
        assert (done.code, done.err.count("\n")) == (2, 1)
        assert message in done.err
    assert not Path("d.mcap").exists()
    assert "save them with brrt recover" in brrt("replay", "cut.mcap").err


@pytest.mark.parametrize("ending", ENDINGS)
def test_what_a_cut_leaves_is_never_called_broken(
    ending: str, brrt: Command, tmp_path: Path
) -> None:
    """Ahead of the first event, behind a batch and behind the last one: recovered, it verifies."""
    path = tmp_path / f"run{ending}"
    log, found = write(path), set[int]()
    data, first = path.read_bytes(), first_event(path)
    cut, whole = tmp_path / f"cut{ending}", tmp_path / f"whole{ending}"
    for size in (first + 30, (first + len(data)) // 2, len(data) - 9):
        cut.write_bytes(data[:size])
        done = brrt("recover", cut.name, "--out", whole.name, "--force")
        assert (done.code, "the problem alone" in done.out) == (int(not found), not found)
        for name, options in ((whole.name, []), (cut.name, ["--partial"])):
            done = brrt("verify", name, "--json", *options)
            assert (done.code, done.json["holds"]) == (0, True), done.out
            assert done.json["events"] == brrt("replay", name, "--json", *options).json["events"]
        found.add(done.json["events"])
    assert len(found) == 3
    assert {0, len(log)} <= found


@pytest.mark.parametrize("ending", ENDINGS)
def test_power_cut_that_leaves_zeros(ending: str, brrt: Command, tmp_path: Path) -> None:
    """A file may have its length and not its content: what follows the last batch is a cut."""
    path = tmp_path / f"run{ending}"
    run, log = recorded(SCENARIO, batch=100)
    sink = new_sink(path, run)
    sink.write(part(log, 0, 300))
    data = path.read_bytes()
    sink.close(None)
    for size in (1 << 12, 1 << 24):
        for keep in (len(data), len(data) - 20):
            path.write_bytes(data[:keep] + bytes(size))
            found = recover(path, tmp_path / "whole.mcap")
            assert found.lost is not None
            assert begins(log, read(tmp_path / "whole.mcap").events())
            if keep == len(data):
                assert found.events == 300
                done = brrt("replay", path.name, "--partial", "--json")
                assert (done.code, done.json["events"]) == (0, 300)


def first_event(path: Path) -> int:
    """Return the byte near which a file's events begin."""
    if path.suffix == ".rrd":
        return Outline.of(path).places[0][1]
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    return summary.chunk_indexes[0].chunk_start_offset


def test_events_of_an_rrd_are_sound_ahead_of_their_picture(tmp_path: Path) -> None:
    """A checksum stands right behind a batch's events: what is drawn of them may be cut off."""
    path = tmp_path / "run.rrd"
    log = write(path, batch=10**6)
    data, (_, at, length, _) = path.read_bytes(), Outline.of(path).places[-1]
    check = at + length
    path.write_bytes(data[: check + FRAME.size + FRAME.unpack_from(data, check)[1]])
    assert len(saved(path)[0]) == len(log)


def test_recover_to_a_disk_that_is_full(tmp_path: Path) -> None:
    """The message names the file that was asked for, and nothing is left of it."""
    path, whole = tmp_path / "run.mcap", tmp_path / "whole.mcap"
    write(path)
    with (
        files_limited_to(20_000),
        pytest.raises(
            RecordingError,
            match=r" \S+/whole\.mcap: File too large; nothing of it is left: name .* more room$",
        ),
    ):
        recover(path, whole)
    assert list(tmp_path.iterdir()) == [path]


def test_killed_rrd_is_replayed_in_part(brrt: Command, tmp_path: Path) -> None:
    """As an .mcap is: refused with what can be saved, taken with --partial."""
    log = write(tmp_path / "run.rrd")
    data = (tmp_path / "run.rrd").read_bytes()
    (tmp_path / "cut.rrd").write_bytes(data[: len(data) // 2])
    refused = brrt("replay", "cut.rrd")
    assert refused.code == 2
    assert "replay them with --partial" in refused.err
    done = brrt("replay", "cut.rrd", "--partial", "--json")
    assert done.code == 0
    assert 0 < done.json["events"] < len(log)
    assert brrt("verify", "cut.rrd", "--partial").code == 0


def test_compression_leaves_the_stamp_alone(tmp_path: Path) -> None:
    """Also beside the texts and lengths with which it took the last letter of the bare blank."""
    path, taken = tmp_path / "x.rrd", (30, 55, 125, 222, 311, 318, 415, 512)
    with rr.RecordingStream("x", send_properties=False) as rec:
        rec.save(path)
        for text in (BLANK, WRITTEN):
            for i in taken:
                result = "a" * (i % 97) + str(i * i)
                texts = {"events": str(i), "result": result, "stamp": text}
                value = rr.DynamicArchetype("brrt.end", components=texts)
                rec.log("/brrt/end", value, static=True)
                rec.flush()
        rec.disconnect()
    data, at, kept = path.read_bytes(), HEAD, list[bool]()
    while at + FRAME.size <= len(data):
        kind, length = FRAME.unpack_from(data, at)
        message = data[at + FRAME.size :][:length]
        if kind == BATCH and b"/brrt/end" in bytes(unpacked(message)[:2000]):
            kept.append(BLANK.encode() in message)
        at += FRAME.size + length
    assert kept[-len(taken) :] == [True] * len(taken)


def test_faults() -> None:
    """A few kills at full speed and a few spoiled copies; benchmarks/faults.py has thousands."""
    script = Path(__file__).parents[2] / "benchmarks" / "faults.py"
    done = subprocess.run(
        [sys.executable, script, "--kills", "1", "--copies", "36"],
        capture_output=True, text=True, check=False, timeout=300,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.count("findings: 0") == 2
