"""World files: choice of the loader, specifications of files, and errors."""

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
    """Return the name of the loader that is chosen for a file."""
    message = refused(lambda: load_world(path, {"none of these": "1"}))
    return message.split("parameter of loader ")[1].split()[0]


# Which loader


@pytest.mark.parametrize("name", GOOD)
def test_by_ending_and_by_content_alone(name: str, folder: Path) -> None:
    """The same file with its own suffix, in capitals, an unknown one or none is read equally."""
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
    """The content decides; a file that none recognises goes to the first loader."""
    (tmp_path / name).write_text(content)
    assert loader_of(tmp_path / name) == loader


def test_many_comments_do_not_hold_up_the_choice(tmp_path: Path) -> None:
    """Recognising a file takes linear time."""
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
    """Names of existing files are not split; others are split at `:name=` or `#`."""
    monkeypatch.chdir(tmp_path)
    for name in ("a", "a.map", "a:1#2.map"):
        Path(name).touch()
    assert FileSpec.parse(spec) == (Path(path), params, query)


def test_parameters_and_queries_reach_the_loader(folder: Path) -> None:
    """Parameters and queries are passed on, and the world's name is the specification."""
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
    """A file named in a TOML is first searched in the TOML's folder."""
    toml = folder / "run.toml"
    for spec in ("map.yaml:unknown=free", "grid.scen#1", "world.json"):
        toml.write_text(f"world = {json.dumps(spec)}\n")
        assert Scenario.load(toml).world == f"{folder}/{spec}"
    (folder / "circles2d").touch()
    for spec in ("circles2d:n=3", "circles2d", "none.map#1"):
        toml.write_text(f"world = {json.dumps(spec)}\n")
        assert Scenario.load(toml).world == spec


def test_loaders_describe_themselves() -> None:
    """Every loader has a first line, suffixes, and parameters with meanings."""
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
    """Every real world loads, except the one whose image is missing on purpose."""
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
