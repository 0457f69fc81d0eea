"""`recover`: the events before a cut or damage, in a new file that is whole."""

from collections.abc import Callable
from pathlib import Path

import pytest
from mcap.reader import make_reader

from brrt import Events, RecordingError, Scenario, first_difference, read
from brrt.formats.mcap import sink
from brrt.formats.recover import NOTE, recover
from tests.conftest import Result, recorded
from tests.support.files import (
    FORMATS,
    begins,
    files_limited_to,
    flipped,
    mcap_records,
    new_sink,
    saved,
    write,
)
from tests.support.logs import split

SCENARIO = Scenario(world="circles2d:n=40", seed=7, clock="logical")
Command = Callable[..., Result]


@pytest.fixture(autouse=True)
def _at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Write a chunk for each batch."""
    monkeypatch.setattr(sink, "_CHUNK_SECONDS", 0.0)


@pytest.fixture
def log(tmp_path: Path) -> Events:
    """Record a run in run.mcap; return its log."""
    run, events = recorded(SCENARIO)
    write(tmp_path / "run.mcap", run, *split(events, 100))
    return events


@pytest.mark.parametrize("suffix", FORMATS)
def test_recover(suffix: str, log: Events, tmp_path: Path) -> None:
    """Cut in the middle, the events up to there; cut after the run, all of it and the result."""
    path, cut, whole = tmp_path / "run.mcap", tmp_path / "cut.mcap", tmp_path / f"whole{suffix}"
    data = path.read_bytes()
    for size in (len(data) * 2 // 5, len(data) - 60):
        cut.write_bytes(data[:size])
        expected, _ = saved(cut)
        found = recover(cut, whole, new_sink)
        events, error = saved(whole)
        assert error is None
        assert begins(log, events)
        assert len(events) == len(expected) == found.events
        assert found.until_s == expected.last.t / 1e9
        end = ", after the last event" if found.ended else ""
        assert found.lost == f"{cut}: the file is cut at byte {size:,}{end}"
    assert len(events) == len(log)
    assert read(whole).result == read(path).result is not None


def test_recovered_file_names_its_origin(log: Events, tmp_path: Path) -> None:
    """Stock mcap finds a whole file, with a note of what it was made of."""
    cut, whole = tmp_path / "cut.mcap", tmp_path / "whole.mcap"
    data = (tmp_path / "run.mcap").read_bytes()
    cut.write_bytes(data[: len(data) // 2])
    found = recover(cut, whole)
    with whole.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        names = {record.name: record.metadata for record in reader.iter_metadata()}
        assert sum(1 for _ in reader.iter_messages()) == found.events
    assert 0 < found.events < len(log)
    assert set(names) == {"brrt.run", NOTE}
    assert names[NOTE]["from"] == "cut.mcap"
    assert names[NOTE]["events"] == str(found.events)
    assert names[NOTE]["lost"] == f"cut.mcap: the file is cut at byte {len(data) // 2:,}"


def test_recover_damaged_files(log: Events, tmp_path: Path) -> None:
    """Of a wrong byte in a chunk, the events before; of one beside them, all and the result."""
    path, whole = tmp_path / "run.mcap", tmp_path / "whole.mcap"
    data, result = path.read_bytes(), read(path).result
    chunk, index, text = (mcap_records(data, opcode)[-1][0] for opcode in (6, 7, 12))
    for place, complete in (
        (chunk + 60, False),
        (index + 20, True),
        (text + 60, True),
        (-20, True),
    ):
        path.write_bytes(flipped(data, place % len(data)))
        found = recover(path, whole)
        assert "damaged" in (found.lost or "")
        assert (found.complete, found.ended) == (complete, complete)
        assert found.events == len(log) - (0 if complete else len(log) % 100)
        assert begins(log, read(whole).events())
        assert read(whole).result == (result if complete else None)


def test_recover_converts_a_whole_rrd(log: Events, tmp_path: Path) -> None:
    """An .rrd that is whole becomes an .mcap; one that is not is refused, with what to do."""
    path = tmp_path / "run.rrd"
    write(path, recorded(SCENARIO)[0], log)
    found = recover(path, tmp_path / "other.mcap")
    assert (found.lost, found.events) == (None, len(log))
    assert first_difference([log], read(tmp_path / "other.mcap").batches()) is None
    assert read(tmp_path / "other.mcap").result == read(path).result
    path.write_bytes(path.read_bytes()[:-1000])
    with pytest.raises(RecordingError, match=r"run\.rrd: is cut; replay the \.mcap of the run$"):
        recover(path, tmp_path / "none.mcap")
    assert not (tmp_path / "none.mcap").exists()


def test_recover_to_a_disk_that_is_full(log: Events, tmp_path: Path) -> None:
    """The message names the file that was asked for, and nothing is left of it."""
    del log
    path, whole = tmp_path / "run.mcap", tmp_path / "whole.mcap"
    with (
        files_limited_to(20_000),
        pytest.raises(
            RecordingError,
            match=r" \S+/whole\.mcap: File too large; nothing of it is left: name .* more room$",
        ),
    ):
        recover(path, whole)
    assert list(tmp_path.iterdir()) == [path]


def test_command(log: Events, brrt: Command, tmp_path: Path) -> None:
    """It says in one line what it did; nothing is written over the recording or without events."""
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
    for out, message in (
        ("bare.mcap", "is the recording itself"), ("d.mcap", "nothing can be saved")
    ):  # fmt: skip
        done = brrt("recover", "bare.mcap", "--out", out, "--force")
        assert (done.code, done.err.count("\n")) == (2, 1)
        assert message in done.err
    assert not Path("d.mcap").exists()


def test_what_a_cut_leaves_holds(log: Events, brrt: Command, tmp_path: Path) -> None:
    """Before the first event, after a batch and after the last one: recovered, it verifies."""
    data, found = (tmp_path / "run.mcap").read_bytes(), set[int]()
    first, _ = mcap_records(data, 6)[0]
    for size in (first + 30, (first + len(data)) // 2, len(data) - 9):
        Path("cut.mcap").write_bytes(data[:size])
        done = brrt("recover", "cut.mcap", "--out", "whole.mcap", "--force")
        assert (done.code, "the problem alone" in done.out) == (int(not found), not found)
        for name, options in (("whole.mcap", []), ("cut.mcap", ["--partial"])):
            done = brrt("verify", name, "--json", *options)
            assert (done.code, done.json["holds"]) == (0, True), done.out
            assert done.json["events"] == brrt("replay", name, "--json", *options).json["events"]
        found.add(done.json["events"])
    assert len(found) == 3
    assert {0, len(log)} <= found


def test_commands_name_remedies(log: Events, brrt: Command, tmp_path: Path) -> None:
    """Commands that judge a damaged .mcap name both; of a cut .rrd, all name the .mcap."""
    path = tmp_path / "run.mcap"
    data = path.read_bytes()
    chunk = mcap_records(data, 6)[-1][0] + 60
    for place, least, most in ((chunk, 1, len(log) - 1), (-40, len(log), len(log))):
        path.write_bytes(flipped(data, place % len(data)))
        for command, *other in (["verify"], ["diff", path.name]):
            done = brrt(command, path.name, *other)
            assert (done.code, done.out, done.err.count("\n")) == (2, "", 1)
            assert " with --partial, or save them with brrt recover run" in done.err
            assert ("no event is lost" in done.err) == (most == len(log))
        assert brrt("verify", path.name, "--partial").code == 0
        done = brrt("explain", path.name)
        assert (done.code, done.err.count("\n")) == (0, 1)
        done = brrt("replay", path.name, "--json")
        assert (done.code, done.err.count("\n")) == (0, 1)
        assert ("no event is lost" in done.err) == (most == len(log))
        assert least <= done.json["events"] <= most
    write(tmp_path / "run.rrd", recorded(SCENARIO)[0], log)
    rrd = (tmp_path / "run.rrd").read_bytes()
    Path("cut.rrd").write_bytes(rrd[: len(rrd) // 2])
    for command, *options in (
        ("replay",), ("verify", "--partial"), ("explain",), ("view", "--screenshot", "x.png"),
        ("plot", "--out", "x.png"), ("export", "--foxglove", "x.mcap"),
        ("recover", "--out", "x.mcap"), ("diff", "run.rrd"),
    ):  # fmt: skip
        done = brrt(command, "cut.rrd", *options)
        assert (done.code, done.out) == (2, "")
        assert done.err == "brrt: cut.rrd: is cut; replay the .mcap of the run\n"
