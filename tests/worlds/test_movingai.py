"""Grid maps of MovingAI: cells, scenarios, and errors with line numbers."""

import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from brrt.errors import BrrtError
from brrt.worlds import World, load_world, make_world
from brrt.worlds.loaders.movingai import BLOCKED, FREE, parse_cells
from tests.support.world_files import refused

GRIDS = Path(__file__).parents[3] / "shared" / "worlds" / "movingai"
HEAD = "type octile\nheight 2\nwidth 3\nmap\n"


@given(
    st.integers(1, 12), st.integers(1, 12), st.integers(0, 2**32), st.sampled_from([0.2, 0.7, 1])
)
def test_cells_are_the_files(rows: int, columns: int, seed: int, part: float) -> None:
    """Blocked characters are blocked cells, in the file's coordinates."""
    rng = np.random.default_rng(seed)
    cells = rng.random((rows, columns)) < part
    text = "\n".join(
        "".join(str(rng.choice(list(BLOCKED if cell else FREE))) for cell in row) for row in cells
    )
    text = f"type octile\nheight {rows}\nwidth {columns}\nmap\n{text}\n"
    assert (parse_cells("grid", text.encode()) == cells).all()


def test_header_may_stand_in_either_order_and_lines_end_in_any_way() -> None:
    """Line ends, blank lines at the end and a byte order mark are accepted."""
    for end in ("\n", "\r\n", "\r"):
        text = end.join(["type octile", "width 3", "height 2", "map", ".@.", "...", "", ""])
        cells = parse_cells("grid", text.encode())
        assert cells.tolist() == [[False, True, False], [False, False, False]]


@pytest.mark.parametrize(
    "text",
    [
        "height 2\nwidth 3\nmap\n.@.\n...\n",
        "width 3\nheight 2\nmap\n.@.\n...",
        "height 2\nwidth 3\ntype octile\nmap\n.@.\n...\n",
        "TYPE Octile\nHeight 2\nWIDTH 3\nMap\n.@.\n...\n",
        "\n\nheight 2\n\nwidth 3 \n\nmap\t\n\n.@. \n...\t\n\n \n",
        "\ufeffheight 2\r\nwidth 3\r\nmap\r\n.@.\r\n...",
    ],
)
def test_headers_vary(text: str, tmp_path: Path) -> None:
    """The type may be missing; order, capitals, blank lines and spaces at line ends are free."""
    wanted = [[False, True, False], [False, False, False]]
    assert parse_cells("grid", text.encode()).tolist() == wanted
    for name in ("a.map", "a.unknown", "grid.map"):
        (tmp_path / name).write_bytes(text.encode())
        grid = load_world(tmp_path / name).grid
        assert grid is not None
        assert grid.cells.tolist() == wanted
    for version in ("", "\n", "version 1\n", "Version 1.0 \n\n"):
        line = "0\tgrid.map\t3\t2\t0\t0\t2\t0\t4.0"
        (tmp_path / "a.scen").write_text(f"{version}{line}\r\n{line.replace('0', '1', 1)}")
        world = make_world(f"{tmp_path}/a.scen#1")
        assert ends(world) == [[0.5, 0.5], [2.5, 0.5]]
        assert "0 of 2; choose" in load_world(tmp_path / "a.scen").notes[0]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "grid:1: there must be a line 'height H' and a line 'width W', and then the"),
        ("type tile\n", "grid:1: the type of a grid map is 'octile'"),
        ("map\n...\n...\n", "grid:1: there must be a line 'height H' and a line 'width W'"),
        ("\n" * 99 + HEAD + "...\n...\n", "grid:20: there must be a line 'height H'"),
        (HEAD + "\n\n...\n.X.\n", "grid:8: unknown character 'X'"),
        ("type octile\nheight 2\n", "grid:3: there must be a line 'height H' and a line 'width W'"),
        ("type octile\nheight 2\nheight 2\nmap\n", "grid:3: there must be a line 'height H'"),
        ("type octile\nheight 2 2\nwidth 3\nmap\n", "grid:2: there must be a line 'height H'"),
        ("type octile\nheight 0\nwidth 3\nmap\n", "grid:2: height must be a whole number from 1"),
        ("type octile\nheight -2\nwidth 3\nmap\n", "grid:2: height must be a whole number from 1"),
        ("type octile\nheight ²\nwidth 3\nmap\n", "grid:2: height must be a whole number from 1"),
        ("type octile\nheight 2\nwidth 1e9\nmap\n", "grid:3: width must be a whole number from 1"),
        (f"type octile\nheight 2\nwidth {'9' * 5000}\nmap\n", "grid:3: width must be a whole"),
        ("type octile\nheight 2\nwidth 3\n...\n...\n", "grid:4: this must be the line 'map'"),
        (HEAD + "...\n", "grid: 1 rows below 'map'; the header states height 2"),
        (HEAD + "...\n...\n...\n", "grid: 3 rows below 'map'; the header states height 2"),
        (HEAD + "...\n....\n", "grid:6: 4 characters; the header states width 3"),
        (HEAD + ".X.\n...\n", "grid:5: unknown character 'X'; a cell is one of .GS (free) or @OTW"),
        (HEAD + "...\n.é.\n", "grid:6: unknown character 'é'"),
    ],
)
def test_errors_say_where(text: str, message: str) -> None:
    """The error is one line with the number of the wrong line."""
    with pytest.raises(BrrtError) as error:
        parse_cells("grid", text.encode())
    assert str(error.value).startswith(message)
    assert "\n" not in str(error.value)


# Scenarios


MAP = "type octile\nheight 2\nwidth 3\nmap\n.@.\n...\n"
LIST = (
    "version 1\n"
    "0\tmaps/grid.map\t3\t2\t0\t0\t0\t1\t1\n"
    "3\tmaps/grid.map\t3\t2\t0\t1\t2\t1\t2.0\n"
    "3\tmaps/grid.map\t3\t2\t2\t0\t0\t1\t2.41421356\n\n"
)


@pytest.fixture
def scen(tmp_path: Path) -> Path:
    """Write scenarios with their map in the same folder."""
    (tmp_path / "grid.map").write_text(MAP)
    path = tmp_path / "grid.map.scen"
    path.write_text(LIST)
    return path


def ends(world: World) -> list[list[float]]:
    """Start and goal."""
    assert world.start is not None
    assert world.goal is not None
    return [world.start.tolist(), world.goal.tolist()]


def test_scenarios(scen: Path) -> None:
    """A scenario is chosen by number or bucket; by default it is the first, with a note."""
    for query, start, goal in (
        ("", [0.5, 0.5], [0.5, 1.5]), ("#0", [0.5, 0.5], [0.5, 1.5]),
        ("#2", [2.5, 0.5], [0.5, 1.5]), ("#bucket=3", [0.5, 1.5], [2.5, 1.5]),
    ):  # fmt: skip
        assert ends(make_world(f"{scen}{query}")) == [start, goal]
    first = f"{scen}: scenario 0 of 3; choose another as {scen}#12"
    length = f"{scen}:2: the stated length of the best path in 8 directions is 1"
    assert load_world(scen).notes == (first, length)
    (note,) = make_world(f"{scen}#2").notes
    assert note == f"{scen}:4: the stated length of the best path in 8 directions is 2.41421356"
    assert make_world(f"{scen}#2").name == f"{scen}#2"


def test_where_the_map_is_looked_for(scen: Path, tmp_path: Path) -> None:
    """The map is searched by its bare name, then by its path, or where the user says."""
    (tmp_path / "maps").mkdir()
    (tmp_path / "grid.map").rename(tmp_path / "maps" / "grid.map")
    assert load_world(scen).grid is not None
    (tmp_path / "maps" / "grid.map").rename(tmp_path / "maps" / "other.map")
    remedy = f"give {scen}:map=PATH"
    error = refused(lambda: load_world(scen))
    assert error == f"{scen}:2: its map 'maps/grid.map' does not exist; {remedy}"
    assert make_world(f"{scen}:map={tmp_path}/maps/other.map#1").grid is not None
    assert make_world(f"{scen}:map=maps/other.map#1").grid is not None
    inner = tmp_path / "lists"
    inner.mkdir()
    for name in ("../maps/other.map", f"{tmp_path}/maps/other.map"):
        (inner / "s.scen").write_text(LIST.replace("maps/grid.map", name))
        error = refused(lambda: load_world(inner / "s.scen"))
        assert (
            f"s.scen:2: {name[:80]!r} is outside the file's folder; if it is right, give" in error
        )


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("version 1", "version 2", ":1: the first line must be 'version 1', not 'version 2'"),
        ("version 1\n", "edition 1\n", ":1: the first line must be 'version 1', not 'edition 1'"),
        (LIST, "version 1\n\n", ": no scenario 0; there are 0, counted from 0"),
        ("\t1\n", "\n", ":2: 8 fields; there must be 9: bucket, map, width, height, start x y"),
        ("\t3\t2\t0\t0", "\t2\t3\t0\t0", ":2: width 2, but "),
        ("\t3\t2\t0\t0", "\t3\t3\t0\t0", ":2: height 3, but "),
        ("\t3\t2\t0\t0", "\t3\tx\t0\t0", ":2: height must be a whole number from 1 to 100,000"),
        ("\t2\t0\t0\t0", "\t2\t3\t0\t0", ":2: the start's x must be a whole number from 0 to 2"),
        ("\t2\t0\t0\t0", "\t2\t-1\t0\t0", ":2: the start's x must be a whole number from 0"),
        ("\t2\t0\t0\t0", "\t2\t1\t0\t0", ":2: the start, cell 1 0, is blocked in the map"),
        ("\t0\t1\t1\n", "\t0\t2\t1\n", ":2: the goal's y must be a whole number from 0 to 1"),
        ("\t0\t1\t1\n", "\t1\t0\t1\n", ":2: the goal, cell 1 0, is blocked in the map"),
        ("\t0\t1\t1\n", "\t0\t1\tfar\n", ":2: 'far' is not all numbers"),
        ("\t0\t1\t1\n", "\t0\t1\tnan\n", ":2: a number is not finite"),
    ],
)  # fmt: skip
def test_bad_scenarios(old: str, new: str, message: str, scen: Path) -> None:
    """The error is one line with file and line number."""
    assert old in LIST
    scen.write_text(LIST.replace(old, new, 1))
    assert refused(lambda: load_world(scen)).startswith(f"{scen}{message}")


@pytest.mark.parametrize(
    ("query", "message"),
    [
        ("3", ": no scenario 3; there are 3, counted from 0"),
        ("-1", "#-1: a scenario must be a whole number from 0"),
        ("x", "#x: a scenario must be a whole number from 0"),
        ("bucket=2", ": no scenario of bucket 2"),
        ("bucket=", "#bucket=: a bucket must be a whole number from 0"),
    ],
)
def test_no_such_scenario(query: str, message: str, scen: Path) -> None:
    """The error states how many scenarios there are."""
    assert refused(lambda: make_world(f"{scen}#{query}")).startswith(f"{scen}{message}")


def test_a_million_cells_load_at_once(tmp_path: Path) -> None:
    """A map of 1024 x 1024 loads in well under a second."""
    cells = np.random.default_rng(0).random((1024, 1024)) < 0.3
    rows = np.where(cells, ord("T"), ord(".")).astype(np.uint8)
    head = b"type octile\nheight 1024\nwidth 1024\nmap\n"
    (tmp_path / "w.map").write_bytes(head + b"\n".join(bytes(row) for row in rows) + b"\n")
    start = time.perf_counter()
    world = load_world(tmp_path / "w.map")
    assert time.perf_counter() - start < 0.5
    assert world.grid is not None
    assert (world.grid.cells == cells).all()


@pytest.mark.skipif(not GRIDS.exists(), reason="no grid maps here")
def test_real_maps() -> None:
    """Real files load with the sizes of their names or headers."""
    for name, size in (("arena", (49, 49)), ("den312d", (65, 81)), ("maze-32-32-2", (32, 32))):
        world = make_world(str(GRIDS / f"{name}.map"))
        assert world.upper.tolist() == list(size)
        assert world.grid is not None
        assert world.grid.cells.any()
