"""Grid maps and scenarios of the MovingAI benchmarks (Sturtevant 2012): octile ASCII."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain
from pathlib import Path, PurePosixPath

import numpy as np

from brrt.errors import BrrtError
from brrt.files import is_file, is_there, lines_of, read_bytes, read_text
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

_HEADER_LINES = 20
"""Maximum lines of the header, blank ones included."""

_LONGEST = 100_000
"""Maximum number of rows or columns."""

_FIELDS = 9
"""Fields of a scenario."""

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
        """Whether the first word is one of a map's header."""
        first = head.removeprefix(b"\xef\xbb\xbf").split(None, 1)[:1]
        return bool(first) and first[0].lower() in (b"type", b"height", b"width")

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
        return head.split(None, 1)[:1] == [b"version"]  # may be missing where the suffix decides

    def read(self, path: Path, query: str, /) -> World:
        """Read a scenario and its map."""
        number, line, count = _find_scenario(path, query)
        where = f"{path}:{number}"
        words = [w.strip() for w in (line.split("\t") if "\t" in line else line.split())]
        if len(words) != _FIELDS:
            raise BrrtError(
                f"{where}: {len(words)} fields; there must be {_FIELDS}: bucket, map, width, "
                f"height, start x y, goal x y, length"
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
        if not is_there(named):
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
    text = read_text(path, "a list of scenarios", MOST_BYTES)
    lines = ((number, line) for number, line in lines_of(str(path), text) if line.strip())
    number, first = next(lines, (1, ""))
    words = first.lower().split()
    if words[:1] != ["version"] and len(words) >= _FIELDS:
        return chain([(number, first)], lines)
    if words not in (["version", "1"], ["version", "1.0"]):
        raise BrrtError(f"{path}:{number}: the first line must be 'version 1', not {first[:40]!r}")
    return lines


def _centre(where: str, what: str, words: list[str], cells: Bools) -> Floats:
    height, width = cells.shape
    x = whole(where, f"the {what}'s x", words[0], 0, width - 1)
    y = whole(where, f"the {what}'s y", words[1], 0, height - 1)
    if cells[y, x]:
        raise BrrtError(f"{where}: the {what}, cell {x} {y}, is blocked in the map")
    return np.array([x + 0.5, y + 0.5])


def parse_cells(name: str, data: bytes) -> Bools:
    """Read a header (`type octile`, `height H`, `width W`, `map`) and H rows of W characters.

    The type may be missing, the lines before `map` may be in any order and in capitals, and there
    may be blank lines around the rows and spaces at the end of a line.

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
    height, width, number, begin = _parse_header(name, data)
    rest = data[begin:].lstrip(b"\n")
    first = number + 1 + len(data) - begin - len(rest)
    rest = rest.rstrip()
    if b" " in rest or b"\t" in rest:
        rest = b"\n".join(row.rstrip(b" \t") for row in rest.split(b"\n"))
    rows = rest.count(b"\n") + bool(rest)
    if rows != height:
        raise BrrtError(f"{name}: {rows:,} rows below 'map'; the header states height {height}")
    codes = np.frombuffer((rest + b"\n").translate(_MEANING), np.uint8)
    if len(codes) == height * (width + 1):
        meaning = codes.reshape(height, width + 1)[:, :width]
        if meaning.max() <= 1:
            return np.ascontiguousarray(meaning == 1)
    raise _wrong_row(name, width, rest, first)


def _wrong_row(name: str, width: int, rows: bytes, first: int) -> BrrtError:
    """Return the error for the first wrong row; `first` is the number of the first row's line."""
    number, row = next(
        (number, row)
        for number, row in enumerate(rows.split(b"\n"), first)
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


def _parse_header(name: str, data: bytes) -> tuple[int, int, int, int]:
    """Return height, width, the number of the line `map`, and where the next one begins."""
    sizes: dict[str, int] = {}
    number, begin = 0, 0
    for number, line in enumerate(data.split(b"\n", _HEADER_LINES)[:_HEADER_LINES], 1):
        begin += len(line) + 1
        words = line[:200].decode("utf-8-sig", "replace").lower().split()
        where = f"{name}:{number}"
        if words == ["map"] and len(sizes) == 2:
            return sizes["height"], sizes["width"], number, begin
        if words[:1] == ["type"]:
            if words != ["type", "octile"]:
                raise BrrtError(f"{where}: the type of a grid map is 'octile'")
        elif len(words) == 2 and words[0] in ("height", "width") and words[0] not in sizes:
            sizes[words[0]] = whole(where, words[0], words[1], 1, _LONGEST)
        elif words:
            break
    missing = "this must be the line 'map', below height and width"
    if len(sizes) < 2:
        missing = "there must be a line 'height H' and a line 'width W', and then the line 'map'"
    raise BrrtError(f"{name}:{number}: {missing}")
