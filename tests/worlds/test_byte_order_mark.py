"""Files that begin with a byte order mark, as editors on Windows write them."""

import codecs
from pathlib import Path

import pytest

from brrt import Scenario, load_world
from brrt.robots import Polygon, load_robot
from tests.support.world_files import GOOD, GRID, write

TEXTS = [name for name in GOOD if name not in ("image.pgm", "circle_queries.txt")]


def mark(path: Path) -> None:
    """Put the mark of UTF-8 before a file's text."""
    path.write_bytes(codecs.BOM_UTF8 + path.read_bytes())


@pytest.mark.parametrize("name", TEXTS)
def test_worlds(name: str, tmp_path: Path) -> None:
    """In all text formats."""
    write(tmp_path)
    plain = load_world(tmp_path / name)
    for other in TEXTS:
        mark(tmp_path / other)
    marked = load_world(tmp_path / name)
    assert marked.to_json() == plain.to_json()


@pytest.mark.parametrize("name", ["grid.map", "grid.scen"])
def test_worlds_without_an_ending(name: str, tmp_path: Path) -> None:
    """A format is recognised by how the file begins."""
    write(tmp_path)
    mark(tmp_path / name)
    bare = (tmp_path / name).rename(tmp_path / "bare")
    (tmp_path / "grid.map").write_text(GRID)
    assert load_world(bare).grid is not None


def test_queries(tmp_path: Path) -> None:
    """Circles with the queries beside them."""
    write(tmp_path)
    plain = load_world(f"{tmp_path}/circle_obstacles.txt")
    mark(tmp_path / "circle_queries.txt")
    assert load_world(f"{tmp_path}/circle_obstacles.txt").to_json() == plain.to_json()


def test_scenarios_and_robots(tmp_path: Path) -> None:
    """TOML knows no mark, and JSON forbids it."""
    (tmp_path / "s.toml").write_text('world = "empty2d"\nseed = 3\n')
    robot = Polygon(4, 2).to_json()
    (tmp_path / "r.json").write_text(robot)
    for name in ("s.toml", "r.json"):
        mark(tmp_path / name)
    assert load_robot(tmp_path / "r.json") == Polygon(4, 2)
    assert Scenario.load(tmp_path / "s.toml") == Scenario(world="empty2d", seed=3)
