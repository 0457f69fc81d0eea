"""A wall clock that jumps while a run is recorded."""

import time
from itertools import chain, repeat
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader

from brrt import McapSink, Memory, Run, Scenario, first_difference, read, verify
from brrt.formats.background import BackgroundSink
from brrt.runs.branch import BranchedRun
from brrt.views.rerun.sink import RerunSink
from tests.conftest import findings_of

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
    """It gives the begin of the run only; events and syncing use the monotonic clock."""
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
    assert findings_of(run.manifest, world, log) == []
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
    assert verify(written).holds
