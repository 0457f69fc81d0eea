"""Grid maps of the MovingAI benchmarks (Sturtevant 2012): octile ASCII."""

from pathlib import Path

import numpy as np

from brrt.errors import BrrtError
from brrt.worlds.occupancy import Grid
from brrt.worlds.world import World

FREE, BLOCKED = ".GS", "@OTW"

_KNOWN = dict.fromkeys(map(ord, FREE + BLOCKED))

_HEADER = ("type", "height", "width", "map")
_LONGEST = 100_000
"""Rows or columns, at most."""


def parse_grid(name: str, text: str) -> World:
    """Read a header (`type octile`, `height H`, `width W`, `map`) and H rows of W characters.

    Coordinates are the file's: x to the right, y down; cell (i, j) is [i, i + 1] x [j, j + 1].

    Args:
        name: Name of the world, and of the file in messages.
        text: The file's text.

    Raises:
        BrrtError: The header is wrong, a row is missing or too many, or a character is unknown.
    """
    lines = text.splitlines()
    height, width = _header(name, lines)
    rows = lines[len(_HEADER) :]
    while len(rows) > height and not rows[-1].strip():
        rows.pop()
    if len(rows) != height:
        raise BrrtError(f"{name}: {len(rows)} rows below 'map'; the header says height {height}")
    for number, row in enumerate(rows, len(_HEADER) + 1):
        if len(row) != width:
            raise BrrtError(
                f"{name}:{number}: {len(row)} characters; the header says width {width}"
            )
        strange = row.translate(_KNOWN)
        if strange:
            raise BrrtError(
                f"{name}:{number}: unknown character {strange[0]!r}; a cell is one of {FREE} "
                f"(free) or {BLOCKED} (blocked)"
            )
    codes = np.frombuffer("".join(rows).encode(), np.uint8).reshape(height, width)
    cells = np.isin(codes, np.frombuffer(BLOCKED.encode(), np.uint8))
    return World.of_grid(name, Grid(cells, np.zeros(2), 1.0))


def _header(name: str, lines: list[str]) -> tuple[int, int]:
    """Read height and width; they may stand in either order."""
    sizes = {"height": 0, "width": 0}
    for number, wanted in enumerate(_HEADER, 1):
        words = lines[number - 1].split() if number <= len(lines) else []
        where = f"{name}:{number}"
        if wanted == "type" and words != ["type", "octile"]:
            raise BrrtError(f"{where}: a grid map begins with the line 'type octile'")
        if wanted == "map" and words != ["map"]:
            raise BrrtError(f"{where}: there must be the line 'map' here, below height and width")
        if wanted in sizes:
            if len(words) != 2 or words[0] not in sizes or sizes[words[0]]:
                raise BrrtError(f"{where}: there must be a line 'height H' and a line 'width W'")
            sizes[words[0]] = _size(where, *words)
    return sizes["height"], sizes["width"]


def _size(where: str, word: str, value: str) -> int:
    if (
        not (value.isascii() and value.isdigit())
        or len(value) > 9
        or not 0 < int(value) <= _LONGEST
    ):
        raise BrrtError(
            f"{where}: {word} must be a whole number from 1 to {_LONGEST:,}, not {value[:40]!r}"
        )
    return int(value)


def load_grid(path: Path, text: str) -> World:
    """Read a map file whose text is at hand."""
    return parse_grid(str(path), text)
