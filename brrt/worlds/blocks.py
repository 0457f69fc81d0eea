"""The `boundary` / `block` text format of 3D course maps."""

import math
from pathlib import Path

import numpy as np

from brrt.errors import BrrtError
from brrt.worlds.world import World

_CORNERS, _COLOUR = 6, 3


def parse_blocks(name: str, text: str) -> World:
    """Read lines of `boundary` or `block`, each with xmin ymin zmin xmax ymax zmax r g b.

    Comments from `#` on, blank lines, tabs and CRLF are allowed; the colour may be left out. A
    block may reach beyond the boundary, as blocks of real maps do.

    Args:
        name: Name of the world, and of the file in messages.
        text: The file's text.

    Raises:
        BrrtError: A line is wrong, or there is not exactly one boundary.
    """
    boundary: list[float] | None = None
    blocks: list[list[float]] = []
    for number, line in enumerate(text.splitlines(), 1):
        words = line.split("#", 1)[0].split()
        if not words:
            continue
        where = f"{name}:{number}"
        keyword = words[0].lower()
        if keyword not in ("boundary", "block"):
            raise BrrtError(
                f"{where}: unknown keyword {words[0][:40]!r}; a line begins with "
                f"'boundary' or 'block'"
            )
        corners = _corners(where, words[1:])
        if keyword == "block":
            blocks.append(corners)
        elif boundary is None:
            boundary = corners
        else:
            raise BrrtError(f"{where}: a second boundary; a map has one")
    if boundary is None:
        raise BrrtError(f"{name}: no 'boundary' line; a map has one")
    if any(low == high for low, high in zip(boundary[:3], boundary[3:], strict=True)):
        raise BrrtError(f"{name}: the boundary has no volume")
    return World(name, np.array(boundary[:3]), np.array(boundary[3:]), boxes=np.array(blocks))


def _corners(where: str, words: list[str]) -> list[float]:
    if len(words) not in (_CORNERS, _CORNERS + _COLOUR):
        raise BrrtError(
            f"{where}: {len(words)} numbers; there must be 6 (xmin ymin zmin xmax ymax zmax), "
            f"or 9 with a colour"
        )
    try:
        numbers = [float(word) for word in words]
    except ValueError:
        raise BrrtError(f"{where}: {' '.join(words)[:60]!r} is not all numbers") from None
    if not all(map(math.isfinite, numbers)):
        raise BrrtError(f"{where}: a number is not finite")
    for axis, low, high in zip("xyz", numbers[:3], numbers[3:6], strict=True):
        if low > high:
            raise BrrtError(f"{where}: {axis}min {low:g} is above {axis}max {high:g}")
    return numbers[:_CORNERS]


def load_blocks(path: Path, text: str) -> World:
    """Read a map file whose text is at hand."""
    return parse_blocks(str(path), text)
