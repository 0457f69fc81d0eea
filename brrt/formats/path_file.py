"""Paths in files of other programs: CSV or text, JSON, and arrays of numpy (.npy)."""

import io
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from brrt.errors import BrrtError
from brrt.files import lines_of, parse_json, read_bytes, read_text
from brrt.worlds.arrays import GREATEST

Floats = NDArray[np.float64]

MOST_WAYPOINTS = 1_000_000
_MOST_BYTES = 256_000_000
_WHAT = "a path"

_LISTS = ("path", "waypoints", "poses", "states", "points")
"""Fields of a JSON object that may hold the waypoints."""

_ALIASES = {"theta": ("yaw", "heading")}
"""Other names of coordinates."""


def read_path(path: Path, names: Sequence[str]) -> Floats:
    """Read the waypoints of a path.

    Columns of a file that names them are found by name, and others are ignored: the robot's names,
    q1, q2 ... in their order, the names of `brrt export`, or yaw or heading for theta. Without
    names each row has exactly the robot's numbers in the robot's order.

    Args:
        path: A file that ends in .csv, .txt, .json or .npy.
        names: The robot's names of the numbers in a configuration.

    Returns:
        Shape (n, dof), n at least 1.

    Raises:
        BrrtError: The file cannot be read, or is no such path.
    """
    readers: Mapping[str, Callable[[Path, Sequence[str]], Floats]] = {
        ".csv": _read_csv, ".txt": _read_csv, ".tsv": _read_csv, ".json": _read_json,
        ".npy": _read_npy,
    }  # fmt: skip
    reader = readers.get(path.suffix.lower())
    if reader is None:
        raise BrrtError(f"{path}: a path is a .csv, .txt, .json or .npy file; rename or convert it")
    rows = reader(path, names)
    if not len(rows):
        raise BrrtError(f"{path}: no waypoint; write one configuration a row")
    return rows


def _read_csv(path: Path, names: Sequence[str]) -> Floats:
    """Read columns between commas, semicolons, tabs or blanks, with or without a header."""
    rows: list[list[float]] = []
    columns: list[int] | None = None
    for number, line in lines_of(str(path), read_text(path, _WHAT, _MOST_BYTES)):
        where, text = f"{path}:{number}", line.strip()
        if text.startswith("#") and columns is None and not rows:  # as numpy writes a header
            columns = _columns_of(_cells(text.lstrip("# ")), names)
        elif text and not text.startswith("#"):
            cells = _cells(text)
            if columns is None and not rows and not any(map(_is_number, cells)):
                columns = _columns(where, cells, names)
                continue
            rows.append(_row(where, cells, names, columns))
            _check_count(str(path), len(rows))
    return np.array(rows, np.float64).reshape(-1, len(names))


def _cells(text: str) -> list[str]:
    """Split a line; a semicolon goes before a comma, which may be a decimal one."""
    separator = next((mark for mark in ";,\t" if mark in text), None)
    cells = [cell.strip().strip("\"'").strip() for cell in text.split(separator)]
    return cells[:-1] if len(cells) > 1 and not cells[-1] else cells


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _row(
    where: str, cells: list[str], names: Sequence[str], columns: list[int] | None
) -> list[float]:
    """Return the numbers of a line."""
    if columns is None and len(cells) != len(names):
        raise BrrtError(
            f"{where}: {len(cells)} columns; without a header that names them a row has "
            f"{len(names)}: {', '.join(names)}"
        )
    row = []
    for name, k in zip(names, columns or range(len(names)), strict=True):
        if k >= len(cells):
            raise BrrtError(f"{where}: the row ends before column {k + 1}, {name}; add the number")
        row.append(_number(f"{where}: column {k + 1}, {name}", cells[k]))
    return row


def _number(where: str, value: Any) -> float:
    """Return a finite number; `where` names its file, row and column."""
    is_text = isinstance(value, str)
    if is_text or (isinstance(value, int | float) and not isinstance(value, bool)):
        try:
            number = float("none" if is_text and "_" in value else value)
        except (ValueError, OverflowError):
            number = np.nan
        if abs(number) < GREATEST:
            return number
    text = repr(value)
    text = text if len(text) <= 40 else f"{text[:37]}..."
    raise BrrtError(f"{where}: {text} is not a finite number; write one such as 1.5")


def _columns_of(header: Sequence[str], names: Sequence[str]) -> list[int] | None:
    """Return which column has each coordinate; None unless each has one."""
    plain = [cell.strip().lower() for cell in header]
    found = []
    for k, name in enumerate(names):
        known = (name.lower(), f"q{k + 1}", f"q_{name.lower()}", *_ALIASES.get(name, ()))
        place = next((plain.index(each) for each in known if each in plain), None)
        if place is None:
            return None
        found.append(place)
    return found


def _columns(where: str, header: Sequence[str], names: Sequence[str]) -> list[int]:
    """Return which column has each coordinate.

    Raises:
        BrrtError: A coordinate has none, or has two.
    """
    found = _columns_of(header, names)
    if found is None:
        missing = next(
            name for k, name in enumerate(names) if not _columns_of(header, names[: k + 1])
        )
        raise BrrtError(
            f"{where}: no column {missing!r} among {', '.join(header):.200}; name the columns "
            f"{', '.join(names)}"
        )
    for k in found:
        if [cell.lower() for cell in header].count(header[k].lower()) > 1:
            raise BrrtError(f"{where}: two columns are called {header[k]!r}; rename one")
    return found


def _read_json(path: Path, names: Sequence[str]) -> Floats:
    """Read a list of rows, or of objects with names; an object may have it as one of `_LISTS`."""
    text = read_text(path, _WHAT, _MOST_BYTES)
    try:
        data = parse_json(text, "a JSON path")
    except BrrtError as error:
        raise BrrtError(f"{path}: {error}") from None
    if isinstance(data, dict):
        data = next((data[name] for name in _LISTS if name in data), None)
    if not isinstance(data, list):
        raise BrrtError(
            f"{path}: must be a list of waypoints, or an object with one as {_LISTS[0]!r}"
        )
    _check_count(str(path), len(data))
    rows = [_json_row(f"{path}: waypoint {i}", value, names) for i, value in enumerate(data)]
    return np.array(rows, np.float64).reshape(-1, len(names))


def _json_row(where: str, value: Any, names: Sequence[str]) -> list[float]:
    if isinstance(value, dict):
        keys = list(value)
        value = [value[keys[k]] for k in _columns(where, keys, names)]
    if not isinstance(value, list) or len(value) != len(names):
        raise BrrtError(f"{where}: must be {len(names)} numbers: {', '.join(names)}")
    return [_number(f"{where}: {name}", x) for name, x in zip(names, value, strict=True)]


def _read_npy(path: Path, names: Sequence[str]) -> Floats:
    """Read an array of rows, or one with named fields; one of Python objects is refused."""
    file = io.BytesIO(read_bytes(path, _WHAT, _MOST_BYTES))
    try:
        version = npy.read_magic(file)
        read_header = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
        shape, _, dtype = read_header(file)
        size = int(np.prod(shape, dtype=np.float64)) * max(dtype.itemsize, 1)
        if size > file.getbuffer().nbytes:  # before memory is taken for it
            raise ValueError(f"the header states {size:,} bytes")  # noqa: TRY301 - reported below
        file.seek(0)
        array = np.load(file, allow_pickle=False)
    except (ValueError, EOFError, OSError, SyntaxError, OverflowError, TypeError) as error:
        raise BrrtError(f"{path}: not an array of numbers: {str(error)[:120]}") from None
    if array.dtype.names is not None and array.ndim == 1:
        fields = list(array.dtype.names)
        chosen = [fields[k] for k in _columns(str(path), fields, names)]
        if any(array.dtype[name].kind not in "iuf" for name in chosen):
            raise BrrtError(f"{path}: fields {', '.join(chosen)} must be numbers")
        array = np.stack([array[name].astype(np.float64) for name in chosen], axis=-1)
    if array.dtype.kind not in "iuf" or array.ndim != 2 or array.shape[1] != len(names):
        raise BrrtError(
            f"{path}: must be numbers of shape (n, {len(names)}): {', '.join(names)}; it is "
            f"{array.dtype} of shape {array.shape}"
        )
    _check_count(str(path), len(array))
    rows = array.astype(np.float64)
    wrong = np.argwhere(~(np.abs(rows) < GREATEST))
    if len(wrong):
        i, k = wrong[0].tolist()
        _number(f"{path}: waypoint {i}: {names[k]}", float(rows[i, k]))
    return np.asarray(rows)


def _check_count(name: str, count: int) -> None:
    if count > MOST_WAYPOINTS:
        raise BrrtError(f"{name}: more than {MOST_WAYPOINTS:,} waypoints; judge it in parts")
