"""Circles and queries of OMPL's planar tests (`Circles2D.h` there)."""

import re
from array import array
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from brrt.digits import at_least, digits_within, join_numbers
from brrt.errors import BrrtError
from brrt.files import is_file, lines_of
from brrt.settings import param
from brrt.worlds.arrays import Floats
from brrt.worlds.loaders.loader import (
    Loader,
    file_named_by_user,
    finite,
    read_world_text,
    refuse_query,
    whole,
)
from brrt.worlds.world import World

_ROW = rb"\d+(?:[ \t]++[-+]?[0-9.][-+.0-9eE]*+){3}\s*?(?:\n|\Z)"
_CIRCLES = re.compile(rb"\A(?:\xef\xbb\xbf)?\s*+(?:units:|x\s+y\s+r\b|" + _ROW + rb")")
"""The unit, the header, or a row: files written by hand may have only rows."""
_QUERIES = re.compile(rb"\A(?:\xef\xbb\xbf)?\s*+\d+\s++(?:start|goal):")
_MOST = 10**9


@dataclass(frozen=True, slots=True)
class OmplCircles(Loader):
    """2D circles of OMPL's tests: rows `i x y r`; a file of queries takes the circles beside it.

    The bounds are those of the circles, as in OMPL. `circle_queries.txt#7` is query 7, with the
    circles of `circle_obstacles.txt`.
    """

    margin: float = param(0.0, "distance between the outermost circles and the bounds", low=0)
    obstacles: str | None = param(None, "file of the circles, for queries in another folder")

    endings = (".txt",)
    queries = "a query by its number (7), in a file of queries"

    @classmethod
    def recognises(cls, head: bytes) -> bool:
        """Whether the file begins with `units:`, `x y r`, a row of four, or a query."""
        return bool(_CIRCLES.match(head) or _QUERIES.match(head))

    def read(self, path: Path, query: str, /) -> World:
        """Read circles and, from a file of queries, start and goal."""
        text = read_world_text(path)
        if _QUERIES.match(text[:4096].encode()) is None:
            refuse_query(path, query)
            return self._make(path, _circles(str(path), text), None, ())
        number, ends, count = _find_query(path, text, query)
        notes = [] if query else [f"{path}: query {number} of {count:,}; choose one as {path}#7"]
        source = self._obstacles_file(path)
        return self._make(path, _circles(str(source), read_world_text(source)), ends, tuple(notes))

    def _make(
        self, path: Path, circles: Floats, ends: Floats | None, notes: tuple[str, ...]
    ) -> World:
        lower = (circles[:, :2] - circles[:, 2:]).min(axis=0) - self.margin
        upper = (circles[:, :2] + circles[:, 2:]).max(axis=0) + self.margin
        if not (lower < upper).all():
            raise BrrtError(f"{path}: the bounds of the circles have no area; give {path}:margin=1")
        start, goal = (None, None) if ends is None else ends
        for what, end in (("start", start), ("goal", goal)):
            if end is not None and not ((lower <= end) & (end <= upper)).all():
                by = float(np.maximum(lower - end, end - upper).max()) + self.margin
                raise BrrtError(
                    f"{path}: the {what} {join_numbers(end, digits_within(lower, upper))} is "
                    f"outside the bounds of the circles; give {path}:margin={at_least(by, 2)}"
                )
        return World(str(path), lower, upper, balls=circles, start=start, goal=goal, notes=notes)

    def _obstacles_file(self, path: Path) -> Path:
        if self.obstacles is not None:
            return file_named_by_user(path, self.obstacles)
        beside = path.with_name(path.name.replace("queries", "obstacles"))
        if beside == path or not is_file(beside):
            missing = "" if beside == path else f"; there is no {beside.name} in the folder"
            raise BrrtError(
                f"{path}: a file of queries without its circles{missing}; "
                f"give {path}:obstacles=PATH"
            )
        return beside


def _circles(name: str, text: str) -> Floats:
    """Read rows of number, x, y and radius after the unit and the header, if any; (n, 3)."""
    numbers = array("d")
    for number, line in lines_of(name, text):
        words = line.split()
        if not words or words[0] == "units:" or (words == ["x", "y", "r"] and not numbers):
            continue
        where = f"{name}:{number}"
        if len(words) != 4:
            raise BrrtError(f"{where}: {len(words)} words; there must be 4: number, x, y, radius")
        x, y, radius = finite(where, words)[1:]
        if radius < 0:
            raise BrrtError(f"{where}: the radius must be at least 0, not {radius:g}")
        numbers.extend((x, y, radius))
    if not numbers:
        raise BrrtError(f"{name}: no circles; each is a line of number, x, y, radius")
    return np.array(numbers).reshape(-1, 3)


def _find_query(path: Path, text: str, query: str) -> tuple[int, Floats, int]:
    """Return a query's number, its start and goal, shape (2, 2), and the number of queries."""
    wanted = whole(f"{path}#{query[:40]}", "a query", query, 0, _MOST) if query else None
    found: dict[str, list[float]] = {}
    count = 0
    for where, number, what, words in _ends(path, text):
        count += what == "goal"
        wanted = number if wanted is None else wanted
        if number == wanted:
            if what in found:
                raise BrrtError(f"{where}: a second {what} of query {number}")
            found[what] = finite(where, words)
    if wanted is None or len(found) < 2:
        there = f"it has only a {next(iter(found))}" if found else f"there are {count:,}"
        raise BrrtError(f"{path}: no query {wanted}; {there}")
    return wanted, np.array([found["start"], found["goal"]]), count


def _ends(path: Path, text: str) -> Iterator[tuple[str, int, str, list[str]]]:
    """Yield place for messages, query, `start` or `goal`, and coordinates, line by line."""
    for line_number, line in lines_of(str(path), text):
        words = line.split()
        where = f"{path}:{line_number}"
        if words and (len(words) != 4 or words[1] not in ("start:", "goal:")):
            raise BrrtError(f"{where}: a line must read 'NUMBER start: X Y' or 'NUMBER goal: X Y'")
        if words:
            yield where, whole(where, "a query", words[0], 0, _MOST), words[1][:-1], words[2:]
