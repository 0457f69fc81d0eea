"""What is around a run: a wall clock that jumps, and folders that take no file."""

import os
import time
from collections.abc import Callable, Iterator
from itertools import chain, repeat
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader

from brrt import McapSink, Memory, Run, Scenario, check, first_difference, read
from brrt.formats.background import BackgroundSink
from brrt.runs.branch import BranchedRun
from brrt.views.rerun.sink import RerunSink
from tests.conftest import Result

DAY_NS = 86_400 * 10**9
TODAY_NS = 1_790_000_000 * 10**9
CLOCKS = {
    "forwards": lambda i: TODAY_NS + i * DAY_NS,
    "backwards": lambda i: TODAY_NS - i * DAY_NS,
    "to and fro": lambda i: TODAY_NS + (-1) ** i * i * DAY_NS,
    "before 1970": lambda i: -DAY_NS,
    "far future": lambda i: 10**19,
}


@pytest.mark.parametrize("name", CLOCKS)
def test_wall_clock_that_jumps(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Only when a run began is asked of it, once: events, waiting and syncing go by another."""
    ticks = map(CLOCKS[name], chain(range(1, 1000), repeat(7)))
    monkeypatch.setattr(time, "time_ns", lambda: next(ticks))
    monkeypatch.setattr(time, "time", lambda: next(ticks) / 1e9)
    monkeypatch.setattr("brrt.files._SYNC_S", 0.001)
    run = Run(Scenario(world="circles2d:n=40", seed=7), batch=50)
    paths, world, memory = [tmp_path / "x.mcap", tmp_path / "x.rrd"], run.problem.world, Memory()
    run.execute([
        memory, BackgroundSink(McapSink(paths[0], run.manifest, world)),
        BackgroundSink(RerunSink(run.manifest, world, path=paths[1])),
    ])  # fmt: skip
    log, epoch = memory.events(), run.manifest.epoch_ns
    assert check(run.manifest, world, log) == []
    assert log.last.t < 60e9
    for path in paths:
        recording = read(path)
        assert recording.manifest.epoch_ns == epoch
        assert first_difference([log], recording.batches()) is None
    with paths[0].open("rb") as file:
        stamps = [m.log_time for *_, m in make_reader(file).iter_messages(log_time_order=False)]
    assert (np.diff(np.array(sorted(stamps))) > 0).all()
    assert 0 <= epoch <= stamps[0]
    assert max(stamps) == epoch + log.last.t
    branch = BranchedRun(read(paths[0]), seed=5, iteration=3)
    sink = McapSink(tmp_path / "branch.mcap", branch.manifest, world)
    branch.execute([sink])
    written = read(tmp_path / "branch.mcap")
    assert check(written.manifest, written.world, written.events(), figures=written.result) == []


WRITERS = (
    ("plan", "--out", "{}/x.mcap"),
    ("plan", "--rrd", "{}/x.rrd"),
    ("plan", "--from", "run.mcap", "--at-iteration", "3", "--seed", "2", "--out", "{}/x.mcap"),
    ("recover", "run.mcap", "--out", "{}/x.mcap"),
    ("recover", "run.mcap", "--out", "{}/x.rrd"),
    ("replay", "run.mcap", "--rrd", "{}/x.rrd"),
    ("export", "run.mcap", "--foxglove", "{}/x.mcap"),
    ("export", "run.mcap", "--foxglove", "x.mcap", "--layout", "{}/x.json"),
    ("plot", "run.mcap", "--out", "{}/x.png", "--dpi", "40"),
    ("worlds", "make", "circles2d:n=3", "--out", "{}/x.json"),
)


@pytest.fixture
def sealed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Give a folder that may not be written to, as root may everywhere."""
    folder = tmp_path / "sealed"
    folder.mkdir(mode=0o555)
    allowed = os.access

    def access(path: Any, mode: int, **options: Any) -> bool:
        if mode & os.W_OK and Path(path) == Path("sealed"):
            return False
        return allowed(path, mode, **options)

    monkeypatch.setattr(os, "access", access)
    yield folder
    assert list(folder.iterdir()) == []
    folder.chmod(0o755)


@pytest.fixture
def recording(brrt: Callable[..., Result]) -> Path:
    """Record a run beside that folder."""
    assert brrt("plan", "--world", "circles2d:n=40", "--seed", "7", "--out", "run.mcap").code == 0
    return Path("run.mcap")


def test_read_only_folder(brrt: Callable[..., Result], recording: Path, sealed: Path) -> None:
    """Each command that writes says so ahead of all work, in one line, and leaves nothing."""
    before = recording.read_bytes()
    for command in WRITERS:
        done = brrt(*(word.format(sealed.name) for word in command))
        assert (done.code, done.out) == (2, ""), command
        assert done.err.count("\n") == 1
        assert "sealed/x." in done.err
        assert "no permission to write there" in done.err
    assert recording.read_bytes() == before


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="there is no /proc here")
def test_folder_that_takes_nothing_after_all(
    brrt: Callable[..., Result], recording: Path, tmp_path: Path
) -> None:
    """Where the system says no only once a file is made, it is one line as well."""
    for command in WRITERS:
        done = brrt(*(word.format("/proc") for word in command))
        assert done.code == 2, command
        assert done.err.splitlines()[-1].startswith("brrt: cannot write /proc/x."), done.err
        assert "Traceback" not in done.err
    assert [path.name for path in tmp_path.iterdir()] == ["run.mcap"]
