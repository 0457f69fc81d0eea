"""World files: which loader reads what, how files are named, and what is refused in one line."""

import json
import os
import subprocess
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from brrt import BrrtError, Scenario
from brrt.worlds import LOADERS, World, load_world, make_world
from brrt.worlds.loaders.loader import FileSpec
from tests.conftest import Result

REAL = Path(__file__).parents[2] / "shared" / "worlds"

BLOCKS = "boundary 0 0 0 9 9 9\nblock 1 1 1 2 2 2\n"
GRID = "type octile\nheight 2\nwidth 3\nmap\n.@.\n...\n"
SCENARIOS = "version 1\n0\tgrid.map\t3\t2\t0\t0\t2\t0\t4.0\n3\tgrid.map\t3\t2\t0\t1\t2\t1\t2\n"
CIRCLES = "units: meter\n\tx\ty\tr\n1\t5\t5\t2\n2\t0\t1\t1\n"
QUERIES = "0\tstart:\t1\t2\n0\tgoal:\t1\t3\n7\tstart:\t1\t4\n7\tgoal:\t1\t5\n"
YAML = (
    "image: image.pgm\nresolution: 0.5\norigin: [1, 2, 0]\nnegate: 0\n"
    "occupied_thresh: 0.65\nfree_thresh: 0.196\n"
)
PGM = b"P5\n# dark, light\n2 1\n255\n\x00\xff"
SQUARE = [[0, 0], [4, 0], [4, 4], [0, 4], [0, 0]]
GEOJSON = json.dumps({"type": "Polygon", "coordinates": [SQUARE]})
JSON = World("w", np.zeros(2), np.ones(2)).to_json()

GOOD: dict[str, str | bytes] = {
    "blocks.txt": BLOCKS,
    "grid.map": GRID,
    "grid.scen": SCENARIOS,
    "circle_obstacles.txt": CIRCLES,
    "circle_queries.txt": QUERIES,
    "map.yaml": YAML,
    "image.pgm": PGM,
    "polygon.geojson": GEOJSON,
    "world.json": JSON,
}
"""A file of each format, in a folder together."""

FORMATS = {
    "blocks.txt": "blocks", "grid.map": "movingai", "grid.scen": "scenarios", "map.yaml": "ros",
    "circle_obstacles.txt": "circles", "circle_queries.txt": "circles", "image.pgm": "image",
    "polygon.geojson": "geojson", "world.json": "brrt",
}  # fmt: skip


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with a file of each format."""
    for name, content in GOOD.items():
        (tmp_path / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    return tmp_path


def refused(action: Callable[[], object]) -> str:
    """The message of the BrrtError that an action raises: one line, not endless."""
    with pytest.raises(BrrtError) as error:
        action()
    message = str(error.value)
    assert len(message.splitlines()) == 1
    assert len(message) < 600
    return message


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
        f"{folder}/grid.map: there is nothing to choose in it; leave '#1' away"
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


# Bad files


@pytest.mark.parametrize("name", [*GOOD, "none", "none.zip"])
@pytest.mark.parametrize(
    "content", [b"", bytes(range(256)) * 9, b"\0" * 5000, b"\xff\xfe\0a", b"\n" * 9, b"#" * 99]
)
def test_no_worlds(name: str, content: bytes, tmp_path: Path) -> None:
    """Empty, binary and blank files, under every ending and none."""
    (tmp_path / name).write_bytes(content)
    assert refused(lambda: make_world(str(tmp_path / name))).startswith(str(tmp_path / name))


@pytest.mark.parametrize("name", GOOD)
def test_folders_missing_and_locked_files(name: str, tmp_path: Path) -> None:
    """The message is the system's own."""
    path = tmp_path / name
    assert "No such file or directory" in refused(lambda: make_world(str(path)))
    path.mkdir()
    assert refused(lambda: make_world(str(path))).startswith(f"{path}: ")
    path.rmdir()
    path.touch(mode=0)
    tmp_path.chmod(0o711)
    if os.geteuid() == 0:  # locks are for others
        os.seteuid(65534)
    try:
        assert refused(lambda: load_world(path)).endswith("Permission denied")
    finally:
        if os.getuid() == 0:
            os.seteuid(0)


WATCHED = """
import json, resource, sys, time
from brrt import BrrtError
from brrt.worlds import make_world
from brrt.worlds.loaders import fields, pieces
import PIL.Image

def used():
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024

before = used()
for spec in sys.argv[1:]:
    start, message = time.perf_counter(), "loaded"
    try:
        make_world(spec)
    except BrrtError as error:
        message = str(error)
    print(json.dumps([message, used() - before, time.perf_counter() - start]))
"""


def watched(*specs: Path | str) -> list[tuple[str, int, float]]:
    """What loading each says, the MB that all up to it take above brrt itself, and its seconds."""
    done = subprocess.run(
        [sys.executable, "-c", WATCHED, *map(str, specs)],
        capture_output=True, text=True, check=False, timeout=100,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    found = [json.loads(line) for line in done.stdout.splitlines()]
    assert len(found) == len(specs)
    return [(message, used, seconds) for message, used, seconds in found]


def test_a_file_of_5_gigabytes_is_refused_unread(tmp_path: Path) -> None:
    """By its size; a file of unknown ending by its first bytes."""
    paths = [tmp_path / f"w{end}" for end in (".txt", ".json", ".map", ".scen", ".yaml", ".pgm")]
    for path in (*paths, tmp_path / "w"):
        with path.open("wb") as file:
            file.write(GRID.encode())
            file.truncate(5_000_000_000)
    for message, used, seconds in watched(*paths, tmp_path / "w"):
        assert "5,000,000,000 bytes are too many" in message
        assert used < 30
        assert seconds < 1


@pytest.mark.parametrize("size", [100_000_000, 60_000_000])
def test_endless_lines(size: int, tmp_path: Path) -> None:
    """A line of 100 MB is refused by its size; one that fits is refused before it is split."""
    begin = {
        "blocks.txt": "boundary ", "w.map": GRID[:-4], "w.scen": SCENARIOS,
        "circles.txt": CIRCLES, "w.yaml": "image: ",
    }  # fmt: skip
    for name, text in begin.items():
        (tmp_path / name).write_bytes(text.encode() + b"1 " * (size // 2))
    for message, used, seconds in watched(*(tmp_path / name for name in begin)):
        assert "characters" in message or "too many" in message
        assert used < (30 if size > 64_000_000 else 400)
        assert seconds < 10


@pytest.mark.parametrize("device", ["/dev/zero", "/dev/urandom"])
def test_endless_files(device: str, tmp_path: Path) -> None:
    """What never ends is read up to the limit, whatever it is called."""
    for name in ("w.map", "w.txt", "w.json", "w.scen", "w.yaml", "w.png", "w"):
        (tmp_path / name).symlink_to(device)
    message, used, _ = watched(tmp_path / "w.map")[0]
    assert "it does not end" in message
    assert used < 200
    for name in ("w.txt", "w.json", "w.scen", "w.yaml", "w.png", "w"):
        assert refused(partial(load_world, tmp_path / name))


BOMBS = {
    "list.json": "[" * 100_000,
    "world.json": '{"schema": "brrt.world", "lower": ' + "[" * 100_000,
    "w.geojson": '{"type": "Feature", "geometry":' * 50_000,
    "list.yaml": "[" * 60_000,
    "table.yaml": "image: " + "{a: " * 15_000,
    "items.yaml": "- " * 30_000,
    "keys.yaml": "? " * 30_000,
}


def test_nesting_bombs(tmp_path: Path) -> None:
    """Lists in lists in lists."""
    for name, content in BOMBS.items():
        (tmp_path / name).write_text(content)
    for name, (message, used, seconds) in zip(
        BOMBS, watched(*(tmp_path / name for name in BOMBS)), strict=True
    ):
        assert message.startswith(f"{tmp_path / name}: not ")
        assert used < 100
        assert seconds < 20


def test_collections_in_collections(tmp_path: Path) -> None:
    """What JSON can nest is still too deep for a map."""
    inner: object = {"type": "GeometryCollection", "geometries": []}
    for _ in range(50):
        inner = {"type": "GeometryCollection", "geometries": [inner]}
    (tmp_path / "w.json").write_text(json.dumps(inner))
    assert "nested more than 20 deep" in refused(lambda: load_world(tmp_path / "w.json"))


LAUGHS = "a0: &a0 [x, x]\n" + "".join(
    f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]\n" for i in range(1, 30)
)
MERGES = "a0: &a0 {x: 1}\n" + "".join(
    f"a{i}: &a{i} {{<<: [{', '.join([f'*a{i - 1}'] * 9)}]}}\n" for i in range(1, 30)
)


def test_a_billion_laughs_are_none(folder: Path) -> None:
    """Aliases stay references: nothing is multiplied."""
    for name, bomb in (("aliases", LAUGHS), ("merges", MERGES)):
        (folder / f"{name}.yaml").write_text(bomb + YAML)
    for message, used, seconds in watched(folder / "aliases.yaml", folder / "merges.yaml"):
        assert message == "loaded"
        assert used < 50
        assert seconds < 5
    (folder / "map.yaml").write_text(LAUGHS + YAML.replace("[1, 2, 0]", "*a29"))
    assert "map.yaml:30: origin must be" in refused(lambda: load_world(folder / "map.yaml"))


def test_the_command_line_says_it_in_one_line(folder: Path, brrt: Callable[..., Result]) -> None:
    """Bad input ends with 2 and one line that names the file."""
    (folder / "grid.map").write_text(GRID.replace("height 2", "height 3"))
    for spec in ("grid.map", "grid.scen#1", "grid.scen#99", "none.yaml", "map.yaml:occupied=101"):
        done = brrt("plan", "--world", folder / spec)
        assert done.code == 2
        assert done.err.startswith(f"brrt: {folder / spec.split('#')[0].split(':')[0]}")
        assert done.err.count("\n") == 1


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
        remedy = "there is no image 'invalid.png' here; say where: invalid_image.yaml:image=PATH"
        assert refused(lambda: load_world(path)) == f"{path}:1: image: {remedy}"
        assert make_world(f"{path}:image=testmap.png").grid is not None
        return
    world = load_world(path)
    for end in (world.start, world.goal):
        assert end is None or world.obstacle_at(end) is None
    assert sum(len(o) for o in (world.boxes, world.balls)) or (
        world.grid and world.grid.cells.any()
    )
