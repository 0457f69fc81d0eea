"""Occupancy grids: square cells in the plane, each blocked or free."""

import base64
import binascii
import math
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Self

import numpy as np

from brrt.errors import BrrtError
from brrt.worlds.arrays import Bools, Floats, Ints, check_lengths, read_numbers
from brrt.worlds.convex import gap, rectangle

MOST_CELLS = 1 << 26
"""Maximum number of cells: 8192 x 8192."""

_TOLERANCE = 1e-9
"""A point counts as within the grid up to this part of its longest side outside it."""

_FIELDS = ("rows", "columns", "origin", "resolution", "yaw", "cells")


@dataclass(frozen=True, eq=False)
class Grid:
    """Square cells in the plane; blocked cells are closed, and the outside of the grid is blocked.

    Attributes:
        cells: Whether each cell is blocked, shape (rows, columns). Cell [0, 0] is at the origin;
            columns count along the grid's x axis, rows along its y axis.
        origin: Corner of cell [0, 0], shape (2,).
        resolution: Side of a cell.
        yaw: Angle in radians by which the grid is turned about its origin, counter-clockwise.

    Raises:
        BrrtError: The cells are not a 2D array of truth values, or a number is out of range.
    """

    cells: Bools
    origin: Floats
    resolution: float
    yaw: float = 0.0

    def __post_init__(self) -> None:
        """Convert cells and numbers to their types and check them."""
        cells = np.asarray(self.cells)
        if cells.ndim != 2 or not cells.size or cells.dtype.kind not in "buif":
            raise BrrtError("grid: cells must be a 2D array of truth values, rows by columns")
        if cells.size > MOST_CELLS:
            raise BrrtError(f"grid: {cells.size:,} cells are more than {MOST_CELLS:,}")
        if cells.dtype != np.bool_ and not ((cells == 0) | (cells == 1)).all():
            raise BrrtError("grid: a cell must be 1 (blocked) or 0 (free)")
        object.__setattr__(self, "cells", np.ascontiguousarray(cells, np.bool_))
        origin = read_numbers("grid: origin", self.origin, "2 finite numbers", (2,))
        object.__setattr__(self, "origin", origin)
        for name in ("resolution", "yaw"):
            number = read_numbers(f"grid: {name}", getattr(self, name), "a finite number", ())
            object.__setattr__(self, name, float(number))
        if self.resolution <= 0:
            raise BrrtError(f"grid: resolution must be above 0, not {self.resolution:g}")
        check_lengths("grid: resolution", np.array([self.resolution]))
        read_numbers("grid: corners", self.corners, "", (4, 2))

    @property
    def size(self) -> Floats:
        """Width and height, shape (2,)."""
        return self.resolution * np.array(self.cells.shape[::-1], np.float64)

    @property
    def corners(self) -> Floats:
        """The grid's corners counter-clockwise from the origin, shape (4, 2)."""
        return self.to_world(rectangle(0, 0, *self.size))

    @property
    def axes(self) -> tuple[float, float]:
        """Cosine and sine of the yaw."""
        return math.cos(self.yaw), math.sin(self.yaw)

    def to_world(self, points: Floats) -> Floats:
        """Transform points from the grid's frame, in lengths, to the world's; shape (..., 2)."""
        cos, sin = self.axes
        x, y = points[..., 0], points[..., 1]
        return np.asarray(self.origin + np.stack([cos * x - sin * y, sin * x + cos * y], axis=-1))

    def to_cells(self, points: Floats) -> Floats:
        """Transform points of the world to columns and rows, with fractions; shape (..., 2)."""
        cos, sin = self.axes
        away = points - self.origin
        x, y = away[..., 0], away[..., 1]
        turned = np.stack([cos * x + sin * y, cos * y - sin * x], axis=-1)
        return np.asarray(turned / self.resolution)

    def covers(self, points: Floats) -> Bools:
        """Whether each point, shape (n, 2), touches a blocked cell or is outside the grid."""
        at = self.to_cells(np.asarray(points, np.float64))
        sides = np.array(self.cells.shape[::-1])
        beyond = _TOLERANCE * sides.max()
        hit = ((at < -beyond) | (at > sides + beyond)).any(axis=-1)
        # A point on the border of cells touches each of them.
        low = np.clip(np.ceil(at).astype(np.int64) - 1, 0, sides - 1)
        high = np.clip(np.floor(at).astype(np.int64), 0, sides - 1)
        for column in (low[..., 0], high[..., 0]):
            for row in (low[..., 1], high[..., 1]):
                hit |= self.cells[row, column]
        return np.asarray(hit)

    def touches(self, shape: Floats) -> bool:
        """Whether a shape touches a blocked cell or reaches outside the grid.

        Args:
            shape: A point, a line segment or a convex polygon, counter-clockwise; shape (k, 2).
        """
        if self.covers(shape).any():
            return True
        shape, blocked = self.to_cells(shape), self.rectangles
        low, high = shape.min(axis=0), shape.max(axis=0)
        near = ((blocked[:, :2] <= high) & (low <= blocked[:, 2:])).all(axis=1)
        return any(gap(shape, rectangle(*row)) <= 0 for row in blocked[near].tolist())

    def contains_box(self, lower: Floats, upper: Floats) -> bool:
        """Whether an axis-aligned box lies within the grid, up to rounding."""
        at = self.to_cells(rectangle(*lower, *upper))
        sides = np.array(self.cells.shape[::-1])
        slack = _TOLERANCE * sides.max()
        return bool((at >= -slack).all() and (at <= sides + slack).all())

    @cached_property
    def rectangles(self) -> Ints:
        """The blocked cells as rectangles that do not overlap.

        Runs of blocked cells with the same ends in consecutive rows form one rectangle.

        Returns:
            First column, first row, last column + 1, last row + 1 of each, shape (n, 4).
        """
        found: list[tuple[int, int, int, int]] = []
        open_since: dict[tuple[int, int], int] = {}
        for y, row in enumerate(np.pad(self.cells, ((0, 1), (1, 1)))):
            ends = np.flatnonzero(row[1:] != row[:-1]).tolist()
            runs = set(zip(ends[::2], ends[1::2], strict=True))
            ended = [run for run in open_since if run not in runs]
            found += [(low, open_since.pop((low, high)), high, y) for low, high in ended]
            for run in runs:
                open_since.setdefault(run, y)
        return np.array(sorted(found), np.int64).reshape(-1, 4)

    def hulls(self, rectangles: Floats) -> Floats:
        """Return the corners in the world, shape (n, 4, 2), of rectangles in cells, (n, 4)."""
        x0, y0, x1, y1 = (rectangles * self.resolution).T
        corners = np.stack([x0, y0, x1, y0, x1, y1, x0, y1], axis=-1).reshape(-1, 4, 2)
        return self.to_world(corners)

    def outside(self, lower: Floats, upper: Floats) -> list[Floats]:
        """Return convex polygons, shape (k, 2) each, that cover a box's part outside the grid."""
        if self.contains_box(lower, upper):
            return []
        box, corners = rectangle(*lower, *upper), self.corners
        found = []
        for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
            normal = np.array([b[1] - a[1], a[0] - b[0]]) / math.dist(a, b)
            beyond = _clipped(box, (box - a) @ normal)
            if len(beyond) > 2 and ((beyond - a) @ normal).max() > _TOLERANCE * self.size.max():
                found.append(beyond)
        return found

    def as_json(self) -> dict[str, Any]:
        """Return the grid for JSON: cells as bits row by row, deflated, in base64."""
        rows, columns = self.cells.shape
        packed = zlib.compress(np.packbits(self.cells).tobytes(), 6)
        return {
            "rows": rows,
            "columns": columns,
            "origin": self.origin.tolist(),
            "resolution": self.resolution,
            "yaw": self.yaw,
            "cells": base64.b64encode(packed).decode(),
        }

    @classmethod
    def from_json(cls, data: Any) -> Self:
        """Read what `as_json` returned.

        Raises:
            BrrtError: It is something else.
        """
        if not isinstance(data, Mapping) or set(data) != set(_FIELDS):
            raise BrrtError(f"grid: must be an object with the fields {', '.join(_FIELDS)}")
        rows, columns = data["rows"], data["columns"]
        for name, value in (("rows", rows), ("columns", columns)):
            if not isinstance(value, int) or isinstance(value, bool) or value < 1:
                raise BrrtError(f"grid: {name} must be a whole number above 0")
        if rows * columns > MOST_CELLS:
            raise BrrtError(f"grid: {rows} x {columns} cells are more than {MOST_CELLS:,}")
        packed = _inflated(data["cells"], -(-rows * columns // 8))
        bits = np.unpackbits(np.frombuffer(packed, np.uint8), count=rows * columns)
        cells = bits.reshape(rows, columns).astype(np.bool_)
        return cls(cells, data["origin"], data["resolution"], data["yaw"])


def _inflated(text: Any, size: int) -> bytes:
    """Decode base64 and inflate to `size` bytes, in bounded memory."""
    try:
        inflate = zlib.decompressobj()
        packed = inflate.decompress(base64.b64decode(text, validate=True), size + 1)
    except (TypeError, ValueError, binascii.Error, zlib.error):
        raise BrrtError("grid: cells must be deflated bits in base64") from None
    if len(packed) != size:
        raise BrrtError(f"grid: cells must be {size:,} bytes, a bit for each of rows x columns")
    return packed


def _clipped(box: Floats, side: Floats) -> Floats:
    """Return the part of a convex polygon, (n, 2), where `side`, (n,), is above 0; (k, 2)."""
    kept = []
    for i in range(len(box)):
        j = i - 1
        if (side[i] > 0) != (side[j] > 0):
            kept.append(box[j] + (box[i] - box[j]) * (side[j] / (side[j] - side[i])))
        if side[i] > 0:
            kept.append(box[i])
    return np.array(kept).reshape(-1, 2)
