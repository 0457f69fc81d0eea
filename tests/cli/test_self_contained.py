"""A recording is all that is needed: the files of world and robot may be gone, or be others."""

import json
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from brrt import Memory, RecordingError, Scenario, World, first_difference, read
from brrt.errors import BrrtError
from brrt.robots import Polygon
from brrt.scenario.manifest import Manifest
from brrt.testing import golden
from tests.conftest import Result, recorded
from tests.support.files import FORMATS, write

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


@contextmanager
def watched_files() -> Iterator[list[str]]:
    """Collect the names of all files that are opened."""
    names, watching = list[str](), True

    def watch(event: str, args: tuple[Any, ...]) -> None:
        if watching and event == "open":
            names.append(str(args[0]))

    sys.addaudithook(watch)  # which cannot be taken off again
    yield names
    watching = False


@pytest.mark.parametrize("suffix", FORMATS)
@pytest.mark.parametrize("trap", ["/trap", "./trap", "trap", "trap.json", "polygo:length=1"])
def test_no_file_that_a_recording_names_is_opened(
    trap: str, suffix: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """A recording without its robot is refused, and what it names may be a silent pipe."""
    if trap == "/trap":
        trap = str(tmp_path / "trap")
    if ":" not in trap:
        os.mkfifo(tmp_path / Path(trap).name)
    run, log = recorded(Scenario(world="circles2d:n=9", seed=1, iterations=60))
    texts, path = run.manifest.to_strings(), tmp_path / f"run{suffix}"
    scenario = {**json.loads(texts["scenario"]), "robot": trap, "world": trap}
    del texts["robot"]
    texts["scenario"] = json.dumps(scenario)
    monkeypatch.setattr(Manifest, "to_strings", lambda _: texts)
    write(path, run, log)
    monkeypatch.undo()
    monkeypatch.chdir(tmp_path)
    with watched_files() as names, pytest.raises(RecordingError, match="has no robot, and") as no:
        read(path)
    assert str(no.value).isprintable()
    assert Path(trap).name not in {Path(name).name for name in names}


def test_a_manifest_states_its_robot() -> None:
    """Before a program writes a recording that cannot be read."""
    manifest = recorded(Scenario(world="circles2d:n=9", seed=1, iterations=60))[0].manifest
    named = replace(manifest.scenario, robot="mine.json")
    assert replace(manifest, scenario=named).robot is not None
    with pytest.raises(BrrtError, match=r"names the file 'mine\.json', which is not opened"):
        replace(manifest, scenario=named, robot=None)
    assert replace(manifest, robot=None).make_robot() == manifest.make_robot()
