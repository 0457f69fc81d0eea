"""Grid maps: every cell of the file is free or blocked in the world, and bad files say where."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from brrt.errors import BrrtError
from brrt.worlds import make_world
from brrt.worlds.loaders.movingai import BLOCKED, FREE, parse_cells

GRIDS = Path(__file__).parents[2] / "shared" / "worlds" / "movingai"
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
    """As files from elsewhere do."""
    for end in ("\n", "\r\n", "\r"):
        text = end.join(["type octile", "width 3", "height 2", "map", ".@.", "...", "", ""])
        cells = parse_cells("grid", text.encode())
        assert cells.tolist() == [[False, True, False], [False, False, False]]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "grid:1: a grid map begins with the line 'type octile'"),
        ("type tile\n", "grid:1: a grid map begins with the line 'type octile'"),
        ("type octile\nheight 2\n", "grid:3: there must be a line 'height H' and a line 'width W'"),
        ("type octile\nheight 2\nheight 2\nmap\n", "grid:3: there must be a line 'height H'"),
        ("type octile\nheight 2 2\nwidth 3\nmap\n", "grid:2: there must be a line 'height H'"),
        ("type octile\nheight 0\nwidth 3\nmap\n", "grid:2: height must be a whole number from 1"),
        ("type octile\nheight -2\nwidth 3\nmap\n", "grid:2: height must be a whole number from 1"),
        ("type octile\nheight ²\nwidth 3\nmap\n", "grid:2: height must be a whole number from 1"),
        ("type octile\nheight 2\nwidth 1e9\nmap\n", "grid:3: width must be a whole number from 1"),
        (f"type octile\nheight 2\nwidth {'9' * 5000}\nmap\n", "grid:3: width must be a whole"),
        ("type octile\nheight 2\nwidth 3\n...\n...\n", "grid:4: there must be the line 'map'"),
        (HEAD + "...\n", "grid: 1 rows below 'map'; the header says height 2"),
        (HEAD + "...\n...\n...\n", "grid: 3 rows below 'map'; the header says height 2"),
        (HEAD + "...\n....\n", "grid:6: 4 characters; the header says width 3"),
        (HEAD + ".X.\n...\n", "grid:5: unknown character 'X'; a cell is one of .GS (free) or @OTW"),
        (HEAD + "...\n.é.\n", "grid:6: unknown character 'é'"),
    ],
)
def test_errors_say_where(text: str, message: str) -> None:
    """One line, with the number of the line at fault."""
    with pytest.raises(BrrtError) as error:
        parse_cells("grid", text.encode())
    assert str(error.value).startswith(message)
    assert "\n" not in str(error.value)


def test_real_maps() -> None:
    """Real files load; their sizes are in their names or headers."""
    if not GRIDS.exists():
        pytest.skip("no grid maps here")
    for name, size in (("arena", (49, 49)), ("den312d", (65, 81)), ("maze-32-32-2", (32, 32))):
        world = make_world(str(GRIDS / f"{name}.map"))
        assert world.upper.tolist() == list(size)
        assert world.grid is not None
        assert world.grid.cells.any()
