"""The `boundary` / `block` text format of 3D course maps."""

import re
from array import array
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from brrt.digits import tell_apart
from brrt.errors import BrrtError
from brrt.files import lines_of
from brrt.worlds.arrays import Floats
from brrt.worlds.loaders.loader import Loader, finite, read_world_text
from brrt.worlds.world import World

_CORNERS, _COLOUR = 6, 3
_BEGINS = re.compile(
    rb"\A(?:\xef\xbb\xbf)?(?:\s++|#[^\r\n]*+)*+(?:boundary|block)\b", re.IGNORECASE
)

_MOST_NOTES = 10
"""Number of blocks outside the boundary that have a note of their own."""


@dataclass(frozen=True, slots=True)
class Blocks(Loader):
    """3D maps of `boundary` and `block` lines, each with xmin ymin zmin xmax ymax zmax r g b.

    Comments from `#` on, blank lines, tabs and CRLF are allowed; the colour may be omitted. A block
    may reach beyond the boundary, as blocks of real maps do; a note reports it.
    """

    endings = (".txt",)

    @classmethod
    def recognises(cls, head: bytes) -> bool:
        """Whether the first word is `boundary` or `block`."""
        return _BEGINS.match(head) is not None

    def read(self, path: Path, _query: str, /) -> World:
        """Read a map."""
        name = str(path)
        boundary: list[float] | None = None
        numbers, lines = array("d"), array("q")
        for number, line in lines_of(name, read_world_text(path)):
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
                numbers.extend(corners)
                lines.append(number)
            elif boundary is None:
                boundary = corners
            else:
                raise BrrtError(f"{where}: a second boundary; a map has one")
        if boundary is None:
            raise BrrtError(f"{name}: no 'boundary' line; a map has one")
        if any(low == high for low, high in zip(boundary[:3], boundary[3:], strict=True)):
            raise BrrtError(f"{name}: the boundary has no volume")
        lower, upper = np.array(boundary).reshape(2, 3)
        boxes = np.array(numbers).reshape(-1, _CORNERS)
        notes = tuple(_notes_outside(name, lower, upper, boxes, lines))
        return World(name, lower, upper, boxes=boxes, notes=notes)


def _corners(where: str, words: list[str]) -> list[float]:
    if len(words) not in (_CORNERS, _CORNERS + _COLOUR):
        raise BrrtError(
            f"{where}: {len(words)} numbers; there must be 6 (xmin ymin zmin xmax ymax zmax), "
            f"or 9 with a colour"
        )
    numbers = finite(where, words)
    for axis, low, high in zip("xyz", numbers[:3], numbers[3:6], strict=True):
        if low > high:
            texts = tell_apart(low, high)
            raise BrrtError(f"{where}: {axis}min {texts[0]} is above {axis}max {texts[1]}")
    return numbers[:_CORNERS]


def _notes_outside(
    name: str, lower: Floats, upper: Floats, boxes: Floats, lines: Sequence[int]
) -> Iterator[str]:
    """Report which blocks reach outside the boundary, and by how much.

    Args:
        name: Name of the file.
        lower: Least corner of the boundary.
        upper: Greatest corner.
        boxes: The blocks, shape (n, 6).
        lines: Line number of each.
    """
    beyond = np.maximum(lower - boxes[:, :3], boxes[:, 3:] - upper)
    apart = np.any((boxes[:, 3:] < lower) | (upper < boxes[:, :3]), axis=1)
    outside = np.flatnonzero((beyond > 0).any(axis=1)).tolist()
    for i in outside[:_MOST_NOTES]:
        by = " and ".join(
            f"{by:g} in {axis}" for axis, by in zip("xyz", beyond[i], strict=True) if by > 0
        )
        how = "is entirely outside" if apart[i] else "reaches outside"
        yield f"{name}: block in line {lines[i]} {how} the boundary by {by}"
    if len(outside) > _MOST_NOTES:
        yield f"{name}: {len(outside) - _MOST_NOTES:,} more blocks reach outside the boundary"
