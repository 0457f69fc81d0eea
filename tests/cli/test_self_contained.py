"""A recording is all that is needed: the files of world and robot may be gone, or be others."""

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from brrt import Memory, World, first_difference, read
from brrt.robots import Polygon
from brrt.testing import golden
from tests.conftest import Result

READERS = (
    ("replay", "run.mcap", "--json"),
    ("replay", "run.rrd", "--text"),
    ("replay", "run.mcap", "--node", "1"),
    ("replay", "run.mcap", "--check", "run.rrd"),
    ("replay", "run.mcap", "--rrd", "again.rrd"),
    ("verify", "run.mcap"),
    ("verify", "run.rrd", "--rerun"),
    ("diff", "run.mcap", "run.rrd"),
    ("explain", "run.mcap"),
    ("plot", "run.mcap", "--out", "tree.png", "--dpi", "50"),
    ("export", "run.mcap", "--foxglove", "viz.mcap", "--layout", "layout.json"),
    ("recover", "run.mcap", "--out", "whole.rrd"),
    ("plan", "--from", "run.mcap", "--at-iteration", "3", "--seed", "5", "--out", "branch.mcap"),
)


@pytest.mark.parametrize("gone", [True, False])
@pytest.mark.parametrize("name", ["walker", "walker.json"])
def test_recordings_are_self_contained(
    name: str, gone: bool, brrt: Callable[..., Result], tmp_path: Path
) -> None:
    """From another folder, where nothing or something else has the names of the files."""
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    ball = np.array([[5.0, 5.0, 1.0]])
    World("mine", np.zeros(2), np.full(2, 10.0), balls=ball).save(Path("mine.json"))
    Path(name).write_text(Polygon(1.0, 0.5).to_json())
    made = brrt(
        "plan", "--world", "mine.json", "--robot", name, "--planner", "rrt", "--param", "step=1",
        "--start", "1,1,0", "--goal", "9,9,1", "--clock", "logical", "--out", "elsewhere/run.mcap",
        "--rrd", "elsewhere/run.rrd", "--json",
    )  # fmt: skip
    assert made.code == 0, made.err
    for file in ("mine.json", name):
        Path(file).unlink()
        if not gone:
            (elsewhere / file).write_text("something else")
    os.chdir(elsewhere)
    for command in READERS:
        done = brrt(*command)
        assert done.code == 0, (command, done.out, done.err)
        if command[-1] == "--json":
            assert done.json == made.json
    for file in ("whole.rrd", "again.rrd"):
        assert first_difference([read("run.mcap").events()], read(file).batches()) is None
    log = Memory()
    golden.reproduced(Path("run.mcap")).execute([log])
    assert first_difference([read("run.mcap").events()], [log.events()]) is None
