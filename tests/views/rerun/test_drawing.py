"""Drawings beside the exact events, and drawings of files."""

from pathlib import Path

import numpy as np
import pytest

from brrt import McapSink, Run, Sink, read
from brrt.views.rerun import sink
from brrt.views.rerun.drawing import draw_run
from brrt.views.rerun.sink import RerunSink
from tests.support.drawings import PLANNERS, as_set, rows_below, scenario, visible


@pytest.mark.parametrize("planner", PLANNERS)
def test_round_trip_of_every_planner(planner: str, tmp_path: Path) -> None:
    """Both formats give back the same log, and the drawing is small."""
    run = Run(scenario(planner, execute=True))
    files = [tmp_path / "run.mcap", tmp_path / "run.rrd"]
    sinks: list[Sink] = [
        McapSink(files[0], run.manifest, run.problem.world),
        RerunSink(run.manifest, run.problem.world, path=files[1]),
    ]
    run.execute(sinks)
    a, b = (read(path).events() for path in files)
    assert a.tables.keys() == b.tables.keys()
    for kind, table in a.tables.items():
        for name in table.dtype.names or ():
            assert all(map(np.array_equal, table[name], b[kind][name]))
    # An empty recording takes 350 kB, most of it the layout.
    assert files[1].stat().st_size <= 400_000 + 160 * len(b)


def test_same_drawing_live_and_from_a_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In other batches, a run gives the same drawing in the end."""
    monkeypatch.setattr(sink, "_BATCH", 1)
    live, again, file = (tmp_path / name for name in ("live.rrd", "again.rrd", "run.mcap"))
    run = Run(scenario("rrt-star"), batch=300)
    world = run.problem.world
    run.execute([RerunSink(run.manifest, world, path=live), McapSink(file, run.manifest, world)])
    done: list[int] = []
    draw_run(again, read(file), progress=done.append)
    assert done == sorted(done)
    assert done[-1] == len(read(file).events())
    pages = [rows_below(path, "/world/tree/start_pages/", ":strips") for path in (live, again)]
    for seq in (10**9, 5000):
        assert len(visible(pages[0], seq)) > 100
    assert as_set(visible(pages[0], 10**9)) == as_set(visible(pages[1], 10**9))
