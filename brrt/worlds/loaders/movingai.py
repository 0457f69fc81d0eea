"""Grid maps and scenarios of the MovingAI benchmarks (Sturtevant 2012): octile ASCII."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

import numpy as np

from brrt.errors import BrrtError
from brrt.files import is_file, lines_of, read_bytes, read_text
from brrt.settings import param
from brrt.worlds.arrays import Bools, Floats
from brrt.worlds.loaders.loader import (
    MOST_BYTES,
    Loader,
    file_named_by_user,
    file_named_in,
    finite,
    whole,
)
from brrt.worlds.occupancy import Grid
from brrt.worlds.world import World

FREE, BLOCKED = ".GS", "@OTW"

_HEADER = ("type", "height", "width", "map")
_LONGEST = 100_000
"""Maximum number of rows or columns."""

_CHARACTERS = (FREE + BLOCKED).encode()
_MEANING = bytes((chr(code) in BLOCKED) + 2 * (code not in _CHARACTERS) for code in range(256))
"""Meaning of each byte: 0 free, 1 blocked, 2 neither."""


@dataclass(frozen=True, slots=True)
class GridMap(Loader):
    """2D grid maps of the MovingAI benchmarks: `.` free, `@` blocked; x to the right, y down.

    Coordinates are the file's: cell (i, j) is [i, i + 1] x [j, j + 1], row 0 is the first line.
    """

    endings = (".map",)

    @classmethod
    def recognises(cls, head: bytes) -> bool:
        """Whether the first word is `type`."""
        return head.split(None, 1)[:1] == [b"type"]

    def read(self, path: Path, _query: str, /) -> World:
        """Read a map."""
        return World.of_grid(str(path), _grid(_read_cells(path)), y_down=True)


@dataclass(frozen=True, slots=True)
class GridScenarios(Loader):
    """Queries on MovingAI maps: `x.scen#12` is number 12, from 0; `x.scen#bucket=3` its first.

    Start and goal are cell centres. The map is looked for in the folder of the file, by its path
    or by its bare name.
    """

    map: str | None = param(None, "file of the map, if it is not in the scenarios' folder")

    endings = (".scen",)
    queries = "a scenario by its number from 0 on (12), or the first of a bucket (bucket=3)"

    @classmethod
    def recognises(cls, head: bytes) -> bool:
        """Whether the first word is `version`."""
        return head.split(None, 1)[:1] == [b"version"]

    def read(self, path: Path, query: str, /) -> World:
        """Read a scenario and its map."""
        number, line, count = _find_scenario(path, query)
        where = f"{path}:{number}"
        words = [w.strip() for w in (line.split("\t") if "\t" in line else line.split())]
        if len(words) != 9:
            raise BrrtError(
                f"{where}: {len(words)} fields; there must be 9: bucket, map, width, height, "
                f"start x y, goal x y, length"
            )
        source = self._map_file(where, path, words[1])
        cells = _read_cells(source)
        for what, word, size in zip(("width", "height"), words[2:4], cells.T.shape, strict=True):
            if whole(where, what, word, 1, _LONGEST) != size:
                raise BrrtError(f"{where}: {what} {word}, but {source} has {what} {size}")
        start = _centre(where, "start", words[4:6], cells)
        goal = _centre(where, "goal", words[6:8], cells)
        (length,) = finite(where, words[8:])
        notes = [f"{where}: the stated length of the best path in 8 directions is {length:.10g}"]
        if not query:
            notes.insert(0, f"{path}: scenario 0 of {count:,}; choose another as {path}#12")
        return World.of_grid(str(path), _grid(cells), start, goal, tuple(notes), y_down=True)

    def _map_file(self, where: str, path: Path, name: str) -> Path:
        if self.map is not None:
            return file_named_by_user(path, self.map)
        bare = path.parent / PurePosixPath(name.replace("\\", "/")).name
        if is_file(bare):
            return bare
        remedy = f"{path}:map=PATH"
        named = file_named_in(where, path, name, remedy)
        if not is_file(named):
            raise BrrtError(f"{where}: its map {name[:80]!r} does not exist; give {remedy}")
        return named


def _read_cells(path: Path) -> Bools:
    return parse_cells(str(path), read_bytes(path, "a world", MOST_BYTES))


def _grid(cells: Bools) -> Grid:
    return Grid(cells, np.zeros(2), 1.0)


def _find_scenario(path: Path, query: str) -> tuple[int, str, int]:
    """Return the number of a scenario's line, the line, and the number of scenarios."""
    scenarios = _scenarios(path)
    bucket = query.removeprefix("bucket=") if query.startswith("bucket=") else None
    if bucket is None:
        wanted = whole(f"{path}#{query[:40]}", "a scenario", query or "0", 0, 10**9)
    else:
        whole(f"{path}#{query[:40]}", "a bucket", bucket, 0, 10**9)
    found, count = None, 0
    for number, line in scenarios:
        first = line.split(None, 1)[0]
        if found is None and (count == wanted if bucket is None else first == bucket):
            found = number, line
        count += 1
    if found is None and bucket is not None:
        raise BrrtError(f"{path}: no scenario of bucket {bucket}")
    if found is None:
        raise BrrtError(f"{path}: no scenario {wanted}; there are {count:,}, counted from 0")
    return *found, count


def _scenarios(path: Path) -> Iterator[tuple[int, str]]:
    lines = lines_of(str(path), read_text(path, "a list of scenarios", MOST_BYTES))
    _, version = next(lines)
    if version.split() not in (["version", "1"], ["version", "1.0"]):
        raise BrrtError(f"{path}:1: the first line must be 'version 1', not {version[:40]!r}")
    return ((number, line) for number, line in lines if line.strip())


def _centre(where: str, what: str, words: list[str], cells: Bools) -> Floats:
    height, width = cells.shape
    x = whole(where, f"the {what}'s x", words[0], 0, width - 1)
    y = whole(where, f"the {what}'s y", words[1], 0, height - 1)
    if cells[y, x]:
        raise BrrtError(f"{where}: the {what}, cell {x} {y}, is blocked in the map")
    return np.array([x + 0.5, y + 0.5])


def parse_cells(name: str, data: bytes) -> Bools:
    """Read a header (`type octile`, `height H`, `width W`, `map`) and H rows of W characters.

    Args:
        name: Name of the file, for messages.
        data: Contents of the file.

    Returns:
        Which cells are blocked, shape (H, W); row 0 is the file's first.

    Raises:
        BrrtError: The header is wrong, a row is missing or too many, or a character is unknown.
    """
    if b"\r" in data:
        data = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    *head, rest = [*data.split(b"\n", len(_HEADER)), b""][: len(_HEADER) + 1]
    height, width = _parse_header(name, head)
    rest = rest.rstrip()
    rows = rest.count(b"\n") + bool(rest)
    if rows != height:
        raise BrrtError(f"{name}: {rows:,} rows below 'map'; the header states height {height}")
    codes = np.frombuffer((rest + b"\n").translate(_MEANING), np.uint8)
    if len(codes) == height * (width + 1):
        meaning = codes.reshape(height, width + 1)[:, :width]
        if meaning.max() <= 1:
            return np.ascontiguousarray(meaning == 1)
    raise _wrong_row(name, width, rest)


def _wrong_row(name: str, width: int, rows: bytes) -> BrrtError:
    """Return the error for the first wrong row."""
    number, row = next(
        (number, row)
        for number, row in enumerate(rows.split(b"\n"), len(_HEADER) + 1)
        if len(row) != width or row.strip(_CHARACTERS)
    )
    text = row.decode("utf-8", "replace")
    if len(text) != width:
        return BrrtError(
            f"{name}:{number}: {len(text):,} characters; the header states width {width}"
        )
    return BrrtError(
        f"{name}:{number}: unknown character {text.strip(FREE + BLOCKED)[0]!r}; a cell is one of "
        f"{FREE} (free) or {BLOCKED} (blocked)"
    )


def _parse_header(name: str, head: list[bytes]) -> tuple[int, int]:
    """Return height and width, which may be in either order."""
    sizes = {"height": 0, "width": 0}
    lines = [line[:200].decode("utf-8-sig", "replace") for line in head]
    for number, wanted in enumerate(_HEADER, 1):
        words = lines[number - 1].split() if number <= len(lines) else []
        where = f"{name}:{number}"
        if wanted == "type" and words != ["type", "octile"]:
            raise BrrtError(f"{where}: a grid map begins with the line 'type octile'")
        if wanted == "map" and words != ["map"]:
            raise BrrtError(f"{where}: this must be the line 'map', below height and width")
        if wanted in sizes:
            if len(words) != 2 or words[0] not in sizes or sizes[words[0]]:
                raise BrrtError(f"{where}: there must be a line 'height H' and a line 'width W'")
            sizes[words[0]] = whole(where, words[0], words[1], 1, _LONGEST)
    return sizes["height"], sizes["width"]
