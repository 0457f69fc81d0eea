"""Drawn paths, moves and bodies are those of the events."""

from pathlib import Path

import numpy as np
import pytest

from brrt import Kind, Run
from brrt.views.rerun.draw import paths
from brrt.views.rerun.layout import CELL_ENTITY, TAIL_ENTITY
from tests.support.drawings import drawn, items_of, rows_of, scenario


def test_improved_paths(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Improved paths are drawn if they are clearly better, or the last of a batch."""
    path = tmp_path / "run.rrd"
    log = drawn(path, scenario("rrt-star"))
    improved = log[Kind.PATH][log[Kind.PATH]["stage"] == 2]
    rows = rows_of(path, "/world/path/improved", ":strips")
    assert 1 < len(rows) <= len(improved)
    assert np.array_equal(rows[-1][1][0], improved[-1]["waypoints"].astype(np.float32))
    assert set(improved["cost"]) <= set(items_of(path, "/series/cost", ":scalars"))
    monkeypatch.setattr(paths, "_LEAST_GAIN", 0.5)
    drawn(path, scenario("rrt-star"), batch=100_000)
    assert len(rows_of(path, "/world/path/improved", ":strips")) < 5


def test_moves(tmp_path: Path) -> None:
    """The trace has every move of every trial, and the robot is where it moved to."""
    path, given = tmp_path / "run.rrd", scenario("lrta-star")
    moves = drawn(path, given)[Kind.MOVE]
    assert moves["trial"].max() == 1
    lines = np.array(items_of(path, "/world/trace", ":strips"))
    assert np.array_equal(lines[:, 1], moves["q"].astype(np.float32))
    start = np.array(Run(given).manifest.start, np.float32)
    first = moves["step"] == 1
    assert np.array_equal(lines[first, 0], [start, start])
    assert np.array_equal(lines[1:, 0][~first[1:]], lines[:-1, 1][~first[1:]])
    halves = rows_of(path, CELL_ENTITY, ":half_sizes")
    assert [half for _, (half,) in halves] == [[1.0, 1.0]] * len(moves)
    for entity, name in (
        ("/world/robot", ":positions"), (TAIL_ENTITY, ":positions"), (CELL_ENTITY, ":centers"),
    ):  # fmt: skip
        places = rows_of(path, entity, name)
        assert [at for at, _ in places] == moves["seq"].tolist()
        assert np.array_equal([place for _, (place,) in places], moves["q"].astype(np.float32))


def test_body(tmp_path: Path) -> None:
    """The body is drawn along the path, at new nodes, and where the robot moves."""
    path = tmp_path / "run.rrd"
    given = scenario("rrt", robot="polygon", world="squares2d:n=8,seed=3", execute=True)
    log = drawn(path, given)
    bodies = rows_of(path, "/world/path/bodies", ":strips")
    assert [at for at, _ in bodies] == log[Kind.PATH]["seq"].tolist()
    assert all(0 < len(row) <= 30 for _, row in bodies)
    moved = rows_of(path, "/world/robot/body", ":strips")
    assert len(moved) == len(log[Kind.MOVE])
    (outline,) = Run(given).manifest.make_robot().outline(log[Kind.MOVE]["q"][-1])
    assert np.array_equal(moved[-1][1][0][:-1], outline.astype(np.float32))
    assert len(rows_of(path, "/world/newest/start", ":strips")) > 5
