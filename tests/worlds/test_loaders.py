"""World files: which loader reads what, how files are named, and what is refused in one line."""

import json
from pathlib import Path

import pytest

from brrt import Scenario
from brrt.worlds import LOADERS, FileSpec, load_world, make_world
from tests.support.world_files import (
    BLOCKS,
    CIRCLES,
    FORMATS,
    GEOJSON,
    GOOD,
    QUERIES,
    REAL,
    refused,
    write,
)  # fmt: skip


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with a file of each format."""
    write(tmp_path)
    return tmp_path


def loader_of(path: Path) -> str:
    """The name of the loader that is chosen for a file: that which settings are checked by."""
    message = refused(lambda: load_world(path, {"none of these": "1"}))
    return message.split("parameter of loader ")[1].split()[0]


# Which loader


@pytest.mark.parametrize("name", GOOD)
def test_by_ending_and_by_content_alone(name: str, folder: Path) -> None:
    """The same file under its own ending, in capitals, a strange one or none is read the same."""
    world = load_world(folder / name)
    assert world.name == str(folder / name)
    assert loader_of(folder / name) == FORMATS[name]
    for other in (Path(name).stem + Path(name).suffix.upper(), f"{name}.bak", Path(name).stem):
        (folder / name).rename(folder / other)
        assert loader_of(folder / other) == FORMATS[name]
        (folder / other).rename(folder / name)


@pytest.mark.parametrize(
    ("name", "content", "loader"),
    [
        ("w.json", GEOJSON, "geojson"),
        ("w.json", "{}", "brrt"),
        ("w.json", "", "brrt"),
        ("w.txt", CIRCLES, "circles"),
        ("w.txt", QUERIES, "circles"),
        ("w.txt", "# about\n\n \n#x\nBLOCK 1", "blocks"),
        ("w.txt", "wall", "blocks"),
        ("w.map", BLOCKS, "movingai"),
    ],
)
def test_endings_that_several_loaders_have(
    name: str, content: str, loader: str, tmp_path: Path
) -> None:
    """The content decides; what none recognises goes to the first, whose errors are clear."""
    (tmp_path / name).write_text(content)
    assert loader_of(tmp_path / name) == loader


def test_many_comments_do_not_hold_up_the_choice(tmp_path: Path) -> None:
    """A beginning that matches in many ways is looked at once."""
    (tmp_path / "w.txt").write_text("# #" * 20_000 + "\nwall")
    assert "60,000 characters" in refused(lambda: load_world(tmp_path / "w.txt"))


# How files are named


@pytest.mark.parametrize(
    ("spec", "path", "params", "query"),
    [
        ("a.map", "a.map", "", ""),
        ("none.map", "none.map", "", ""),
        ("a.map:unknown=free", "a.map", "unknown=free", ""),
        ("none.map:unknown=free", "none.map", "unknown=free", ""),
        ("a.map#12", "a.map", "", "12"),
        ("none.map#12", "none.map", "", "12"),
        ("a.map#bucket=3", "a.map", "", "bucket=3"),
        ("a.map:map=x,margin=1#12", "a.map", "map=x,margin=1", "12"),
        ("a.map:map=b#c.map#12", "a.map", "map=b#c.map", "12"),
        ("a:1#2.map", "a:1#2.map", "", ""),
        ("a:1#2.map:x=1#3", "a:1#2.map", "x=1", "3"),
        ("a:1#3.map", "a", "1", "3.map"),
        ("x:1#3.map", "x:1", "", "3.map"),
        (r"C:\maps\none.yaml", r"C:\maps\none.yaml", "", ""),
        (r"C:\maps\none.yaml:unknown=free#1", r"C:\maps\none.yaml", "unknown=free", "1"),
        (r"a.map:image=C:\x.png", "a.map", r"image=C:\x.png", ""),
        ("", ".", "", ""),
        ("x" * 5000 + ":n=1", "x" * 5000, "n=1", ""),
        ("a\0b", "a\0b", "", ""),
    ],
)
def test_specifications(
    spec: str, path: str, params: str, query: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What exists as a file is never taken apart; what does not is cut at `:name=` or `#`."""
    monkeypatch.chdir(tmp_path)
    for name in ("a", "a.map", "a:1#2.map"):
        Path(name).touch()
    assert FileSpec.parse(spec) == (Path(path), params, query)


def test_parameters_and_queries_reach_the_loader(folder: Path) -> None:
    """And the world is called what the user said."""
    spec = f"{folder}/circle_queries.txt:margin=1#7"
    world = make_world(spec)
    assert world.name == spec
    assert world.lower.tolist() == [-2, -1]
    assert world.start is not None
    assert world.start.tolist() == [1, 4]
    assert "resolution must be above 0" in refused(
        lambda: make_world(f"{folder}/image.pgm:resolution=0")
    )
    assert refused(lambda: make_world(f"{folder}/grid.map#1")) == (
        f"{folder}/grid.map: this file has no queries to choose from; omit '#1'"
    )


def test_worlds_beside_a_scenario(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A file that a TOML names is looked for beside it first, with whatever follows its name."""
    toml = folder / "run.toml"
    for spec in ("map.yaml:unknown=free", "grid.scen#1", "world.json"):
        toml.write_text(f"world = {json.dumps(spec)}\n")
        assert Scenario.load(toml).world == f"{folder}/{spec}"
    (folder / "circles2d").touch()
    for spec in ("circles2d:n=3", "circles2d", "none.map#1"):
        toml.write_text(f"world = {json.dumps(spec)}\n")
        assert Scenario.load(toml).world == spec


def test_loaders_describe_themselves() -> None:
    """What lists print: a line about it, endings, and parameters with their meaning."""
    for loader in LOADERS.values():
        assert (loader.__doc__ or "").split("\n")[0].endswith(".")
        assert loader.endings
        assert all(row["doc"] for row in loader.describe())


# Real files


@pytest.mark.parametrize(
    "path",
    [p for p in sorted(REAL.glob("*/*")) if p.suffix != ".json" and p.parent.name != "robots"]
    or [None],
    ids=lambda p: p.name if p else "none",
)
def test_real_worlds(path: Path | None) -> None:
    """Every world that others made loads, but for the one whose image is missing by intent."""
    if path is None:
        pytest.skip("no real worlds here")
    if path.name == "invalid_image.yaml":
        remedy = f"the image 'invalid.png' does not exist; give {path}:image=PATH"
        assert refused(lambda: load_world(path)) == f"{path}:1: image: {remedy}"
        assert make_world(f"{path}:image=testmap.png").grid is not None
        return
    world = load_world(path)
    for end in (world.start, world.goal):
        assert end is None or world.obstacle_at(end) is None
    assert sum(len(o) for o in (world.boxes, world.balls)) or (
        world.grid and world.grid.cells.any()
    )
