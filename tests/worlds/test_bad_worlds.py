"""Files that are not worlds: one line, exit code 2, bounded memory and time."""

import json
import os
import subprocess
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest

from brrt.worlds import load_world, make_world
from tests.conftest import Result
from tests.support.world_files import CIRCLES, GOOD, GRID, SCENARIOS, YAML, refused, write


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with a file of each format."""
    write(tmp_path)
    return tmp_path


@pytest.mark.parametrize("name", [*GOOD, "none", "none.zip"])
@pytest.mark.parametrize(
    "content", [b"", bytes(range(256)) * 9, b"\0" * 5000, b"\xff\xfe\0a", b"\n" * 9, b"#" * 99]
)
def test_no_worlds(name: str, content: bytes, tmp_path: Path) -> None:
    """Empty, binary and blank files with every suffix and none are refused."""
    (tmp_path / name).write_bytes(content)
    assert refused(lambda: make_world(str(tmp_path / name))).startswith(str(tmp_path / name))


@pytest.mark.parametrize("name", GOOD)
def test_folders_missing_and_locked_files(name: str, tmp_path: Path) -> None:
    """The message is the operating system's."""
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
from brrt.worlds.loaders import convex_decomposition, yaml_fields
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
    """Return message, peak memory so far in MB above brrt's own, and seconds of each file."""
    done = subprocess.run(
        [sys.executable, "-c", WATCHED, *map(str, specs)],
        capture_output=True, text=True, check=False, timeout=100,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    found = [json.loads(line) for line in done.stdout.splitlines()]
    assert len(found) == len(specs)
    return [(message, used, seconds) for message, used, seconds in found]


def test_a_file_of_5_gigabytes_is_refused_unread(tmp_path: Path) -> None:
    """A large file is refused by its size, one of unknown suffix by its first bytes."""
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
    """A line of 100 MB is refused by its size, a shorter one before it is split."""
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
    """A device is not read."""
    for name in ("w.map", "w.txt", "w.json", "w.scen", "w.yaml", "w.png", "w"):
        (tmp_path / name).symlink_to(device)
    message, used, _ = watched(tmp_path / "w.map")[0]
    assert message.endswith("w.map: a pipe or a device; save it to a file first")
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
    """Deeply nested lists are refused."""
    for name, content in BOMBS.items():
        (tmp_path / name).write_text(content)
    for name, (message, used, seconds) in zip(
        BOMBS, watched(*(tmp_path / name for name in BOMBS)), strict=True
    ):
        assert message.startswith(f"{tmp_path / name}: not ")
        assert used < 100
        assert seconds < 20


def test_too_much_of_everything(tmp_path: Path) -> None:
    """Millions of lists or lines are refused in bounded memory."""
    head = '{"schema": "brrt.world", "version": 1, "lower": [0, 0], "upper": [1, 1], '
    files = {
        "lists.json": head + '"boxes": [' + "[]," * 20_000_000 + "[]]}",
        "name.json": head + '"' + "a" * 5_000_000 + '": 1}',
        "version.json": head.replace("1,", '"' + "v" * 5_000_000 + '",', 1) + '"boxes": []}',
        "lines.txt": "boundary 0 0 0 9 9 9\n" + "\n" * 5_000_000,
    }
    for name, content in files.items():
        (tmp_path / name).write_text(content)
    for message, used, seconds in watched(*(tmp_path / name for name in files)):
        assert len(message) < len(str(tmp_path)) + 450
        assert used < 700
        assert seconds < 30


def test_collections_in_collections(tmp_path: Path) -> None:
    """Collections nested more deeply than a map needs are refused."""
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
    """YAML aliases are not expanded."""
    for name, bomb in (("aliases", LAUGHS), ("merges", MERGES)):
        (folder / f"{name}.yaml").write_text(bomb + YAML)
    for message, used, seconds in watched(folder / "aliases.yaml", folder / "merges.yaml"):
        assert message == "loaded"
        assert used < 50
        assert seconds < 5
    (folder / "map.yaml").write_text(LAUGHS + YAML.replace("[1, 2, 0]", "*a29"))
    assert "map.yaml:30: origin must be" in refused(lambda: load_world(folder / "map.yaml"))


def test_the_command_line_says_it_in_one_line(folder: Path, brrt: Callable[..., Result]) -> None:
    """Bad input gives exit code 2 and one line that names the file."""
    (folder / "grid.map").write_text(GRID.replace("height 2", "height 3"))
    for spec in ("grid.map", "grid.scen#1", "grid.scen#99", "none.yaml", "map.yaml:occupied=101"):
        done = brrt("plan", "--world", folder / spec)
        assert done.code == 2
        assert done.err.startswith(f"brrt: {folder / spec.split('#')[0].split(':')[0]}")
        assert done.err.count("\n") == 1
