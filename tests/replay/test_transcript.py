"""Transcripts: true to the log, and the same on every machine."""

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
from tests.support.logs import split

RECORDINGS = Path(__file__).parents[2] / "recordings"
FILES = sorted(RECORDINGS.glob("*.mcap"))


@pytest.mark.parametrize("path", FILES, ids=lambda p: p.stem)
def test_counts_are_the_logs(path: Path) -> None:
    """The counts of all phases add up to the events of each kind."""
    recording = brrt.read(path)
    text, events = transcript(recording), recording.events()
    for kind, word in ((Kind.SAMPLE, "samples?"), (Kind.REJECT, "rejected"), (Kind.MOVE, "moves?"),
                       (Kind.EDGE, "nodes?"), (Kind.EXPAND, "cells? expanded")):  # fmt: skip
        counts = re.findall(rf"^[\d,]*\s+([\d,]+) {word}\b", text, re.MULTILINE)
        assert sum(int(number.replace(",", "")) for number in counts) == len(events[kind])
    paths = events[Kind.PATH]
    assert text.count("first path") == min(1, len(paths))
    for cost in {paths["cost"][0], paths["cost"][-1]} if len(paths) else ():
        assert f"cost {cost:.6g}," in text


@pytest.mark.parametrize("size", [1, 7, 100])
def test_batches_do_not_matter(size: int) -> None:
    """However the events are split into batches, the transcript is the same."""
    recording = brrt.read(RECORDINGS / "circles2d-rrt-star.mcap")
    parts = split(recording.events(), size)
    assert transcript(replace(recording, batches=lambda: parts)) == transcript(recording)


def test_no_time_and_no_folder(tmp_path: Path) -> None:
    """Runs of one seed have one transcript, whatever the folder and the clock."""
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


def test_failures_name_the_nearest_node() -> None:
    """It is the nearest one in the robot's metric."""
    recording = brrt.read(RECORDINGS / "spheres3d-unsolved.mcap")
    edges = recording.events()[Kind.EDGE]
    far = recording.robot().distance(edges["q"], np.array(recording.manifest.goal))
    best = edges[far.argmin()]
    text = transcript(recording)
    assert "no path" in text
    assert f"node {best['node']:,} of iteration {best['iteration']:,}, {far.min():.6g}" in text


def test_replay_prints_the_transcript(brrt: Callable[..., Result]) -> None:
    """The whole one, and one up to an instant."""
    path = str(RECORDINGS / "circles2d-rrt.mcap")
    done = brrt("replay", path, "--text")
    assert done.out == Path(path).with_suffix(".txt").read_text("utf-8")
    early = brrt("replay", path, "--text", "--at-iteration", "20")
    assert "20 samples" in early.out
    assert "ends" not in early.out
    assert brrt("replay", path, "--text", "--json").code == 2
