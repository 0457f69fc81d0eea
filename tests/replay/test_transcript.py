"""A run told in plain text: what it says is what happened, on every machine the same."""

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import brrt
from brrt.events import Kind
from brrt.replay.transcript import transcript
from tests.conftest import Result

RECORDINGS = Path(__file__).parents[2] / "recordings"
FILES = sorted(RECORDINGS.glob("*.mcap"))


@pytest.mark.parametrize("path", FILES, ids=lambda p: p.stem)
def test_counts_are_the_logs(path: Path) -> None:
    """All that is counted adds up to the events of each kind, whatever the phases."""
    recording = brrt.read(path)
    text, events = transcript(recording), recording.events()
    for kind, word in ((Kind.SAMPLE, "samples?"), (Kind.REJECT, "rejected"), (Kind.MOVE, "moves?"),
                       (Kind.EDGE, "nodes?"), (Kind.EXPAND, "cells? expanded")):  # fmt: skip
        told = re.findall(rf"^[\d,]*\s+([\d,]+) {word}\b", text, re.MULTILINE)
        assert sum(int(number.replace(",", "")) for number in told) == len(events[kind])
    paths = events[Kind.PATH]
    assert text.count("first path") == min(1, len(paths))
    for cost in {paths["cost"][0], paths["cost"][-1]} if len(paths) else ():
        assert f"cost {cost:.6g}," in text


@pytest.mark.parametrize("size", [1, 7, 100])
def test_batches_do_not_matter(size: int) -> None:
    """However the events are cut into batches, the account is one."""
    recording = brrt.read(RECORDINGS / "circles2d-rrt-star.mcap")
    events = recording.events()
    parts, before = [], 0
    for end in range(size, len(events) + size, size):
        part = events.until(seq=end - 1)
        tables = {kind: table[table["seq"] >= before] for kind, table in part.tables.items()}
        parts.append(brrt.Events(events.dof, {k: t for k, t in tables.items() if len(t)}))
        before = end
    assert transcript(replace(recording, batches=lambda: parts)) == transcript(recording)


def test_no_time_and_no_folder(tmp_path: Path) -> None:
    """Runs of one seed are told alike, wherever the world lies and whatever the clock says."""
    world = brrt.make_world("circles2d:n=30,seed=2")
    texts = []
    for folder in ("one", "two"):
        (tmp_path / folder).mkdir()
        world.save(tmp_path / folder / "w.json")
        scenario = brrt.Scenario(world=str(tmp_path / folder / "w.json"), seed=5)
        texts.append(transcript(brrt.Run(scenario).record()))
    assert texts[0] == texts[1]
    assert "w.json" in texts[0]
    assert str(tmp_path) not in texts[0]


def test_failure_says_how_near_it_came() -> None:
    """The nearest node is the one nearest by the robot's metric."""
    recording = brrt.read(RECORDINGS / "spheres3d-unsolved.mcap")
    edges = recording.events()[Kind.EDGE]
    far = recording.robot().distance(edges["q"], np.array(recording.manifest.goal))
    best = edges[far.argmin()]
    text = transcript(recording)
    assert "no path" in text
    assert f"node {best['node']:,} of iteration {best['iteration']:,}, {far.min():.6g}" in text


def test_replay_prints_it(brrt: Callable[..., Result]) -> None:
    """As a user asks for it; whole, and up to an instant."""
    path = str(RECORDINGS / "circles2d-rrt.mcap")
    done = brrt("replay", path, "--text")
    assert done.out == Path(path).with_suffix(".txt").read_text("utf-8")
    early = brrt("replay", path, "--text", "--at-iteration", "20")
    assert "20 samples" in early.out
    assert "ends" not in early.out
    assert brrt("replay", path, "--text", "--json").code == 2
