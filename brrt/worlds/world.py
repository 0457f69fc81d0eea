"""A world: bounds and obstacles."""

import json
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Self

import numpy as np

from brrt.digits import digits_within, join_numbers, tell_apart
from brrt.errors import BrrtError, unknown
from brrt.files import parse_json, replacing
from brrt.worlds.arrays import Floats, box_around, check_lengths, read_numbers
from brrt.worlds.convex import convex_polygons, gap, rectangle
from brrt.worlds.occupancy import Grid

SCHEMA, VERSION, VERSION_WITH_GRID, VERSION_UNBOUNDED = "brrt.world", 1, 2, 3
"""Worlds with a grid, and without bounds, have their own versions: an older brrt refuses them."""

_FIELDS = ("lower", "upper", "balls", "boxes", "start", "goal", "polygons", "grid", "y_down",
           "bounded")  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class World:
    """Axis-aligned bounds in 2D or 3D with closed obstacles: touching one is a collision.

    Attributes:
        name: Its specification: a generator with its parameters, or a file.
        lower: Least corner of the bounds, shape (d,).
        upper: Greatest corner of the bounds, shape (d,).
        balls: Circles or spheres, one a row: centre, radius; shape (n, d + 1).
        boxes: Axis-aligned boxes, one a row: least corner, greatest corner; shape (m, 2 d).
        start: Suggested start position, shape (d,).
        goal: Suggested goal position, shape (d,).
        polygons: Convex polygons, in 2D only; vertices counter-clockwise, shape (k, 2) each. Two
            vertices make a line segment.
        grid: Occupancy grid, in 2D only.
        notes: Remarks of the generator or loader for the user; not saved.
        y_down: Whether y points down when the world is drawn, as in image coordinates.
        bounded: Whether there are bounds; otherwise `lower` and `upper` are what is drawn.

    Raises:
        BrrtError: A shape is wrong, a number is not finite, or a minimum exceeds its maximum.
    """

    name: str
    lower: Floats
    upper: Floats
    balls: Floats = field(default_factory=lambda: np.empty((0, 0)))
    boxes: Floats = field(default_factory=lambda: np.empty((0, 0)))
    start: Floats | None = None
    goal: Floats | None = None
    polygons: tuple[Floats, ...] = ()
    grid: Grid | None = None
    notes: tuple[str, ...] = ()
    y_down: bool = False
    bounded: bool = True

    @classmethod
    def of_grid(
        cls,
        name: str,
        grid: Grid,
        start: Floats | None = None,
        goal: Floats | None = None,
        notes: tuple[str, ...] = (),
        *,
        y_down: bool = False,
    ) -> Self:
        """Make a world whose only obstacle is an occupancy grid; its bounds enclose the grid."""
        lower, upper = grid.corners.min(axis=0), grid.corners.max(axis=0)
        ends: dict[str, Any] = {"start": start, "goal": goal}
        return cls(name, lower, upper, **ends, grid=grid, notes=notes, y_down=y_down)

    def __post_init__(self) -> None:
        """Convert the arrays to float64 and check them."""
        for name in ("lower", "upper", "start", "goal"):
            value = getattr(self, name)
            if value is not None or name in ("lower", "upper"):
                point = read_numbers(f"world: {name}", value, "a row of numbers", (None,))
                object.__setattr__(self, name, point)
        dim = len(self.lower)
        if dim not in (2, 3) or len(self.upper) != dim:
            both = f"{dim} in lower and {len(self.upper)} in upper"
            raise BrrtError(f"world: bounds must have 2 or 3 coordinates, not {both}")
        for name, end in (("start", self.start), ("goal", self.goal)):
            if end is not None and len(end) != dim:
                raise BrrtError(f"world: {name} must be {dim} numbers, not {len(end)}")
        for name, width in (("balls", dim + 1), ("boxes", 2 * dim)):
            what = f"rows of {width} numbers"
            rows = read_numbers(f"world: {name}", getattr(self, name), what, (None, width))
            object.__setattr__(self, name, rows)
        if not isinstance(self.polygons, list | tuple | np.ndarray):
            raise BrrtError("world: polygons must be a list of polygons, each a list of vertices")
        if len(self.polygons) and dim != 2:
            raise BrrtError(f"world: polygons are for 2D worlds; this one is {dim}D, use boxes")
        polygons = convex_polygons("world: polygons", list(self.polygons))
        object.__setattr__(self, "polygons", polygons)
        self._check_ranges(dim)

    def _check_ranges(self, dim: int) -> None:
        """Check that minima are below maxima, and that the grid fits the dimension."""
        if not (self.lower < self.upper).all():
            i = int((self.lower < self.upper).argmin())
            bounds = " to ".join(tell_apart(float(self.lower[i]), float(self.upper[i])))
            raise BrrtError(
                f"world: each upper bound must be above its lower bound, but {'xyz'[i]} is from "
                f"{bounds}"
            )
        check_lengths("world: sides of the bounds", self.upper - self.lower)
        crossed = (self.boxes[:, :dim] > self.boxes[:, dim:]).any(axis=1)
        if crossed.any():
            i = int(crossed.argmax())
            row = ", ".join(tell_apart(*self.boxes[i].tolist()))
            raise BrrtError(f"world: boxes[{i}] has a minimum above its maximum: {row}")
        if (self.balls[:, dim] < 0).any():
            i = int((self.balls[:, dim] < 0).argmax())
            radius = self.balls[i, dim]
            raise BrrtError(f"world: balls[{i}]: the radius must be at least 0, not {radius:g}")
        check_lengths("world: radii of balls", self.balls[:, dim])
        for name in ("y_down", "bounded"):
            if not isinstance(getattr(self, name), bool):
                raise BrrtError(f"world: {name} must be true or false")
        if self.grid is not None and dim != 2:
            raise BrrtError(f"world: grids are for 2D worlds; this one is {dim}D")

    @classmethod
    def unknown(cls, points: Floats) -> Self:
        """Return a world of which nothing is known, drawn around points of shape (n, d)."""
        return cls("none", *box_around(points), bounded=False)

    @property
    def dim(self) -> int:
        """2 or 3."""
        return len(self.lower)

    @property
    def extent(self) -> float:
        """The longest side of the bounds."""
        return float((self.upper - self.lower).max())

    def text(self, point: Iterable[float]) -> str:
        """Write a point, shape (d,), in digits that tell it apart from others in the bounds."""
        return join_numbers(point, digits_within(self.lower, self.upper))

    def inside(self, point: Sequence[float] | Floats) -> bool:
        """Whether a point, shape (d,), lies within the closed bounds."""
        p = np.asarray(point)
        return bool(((self.lower <= p) & (p <= self.upper)).all())

    def obstacle_at(self, point: Sequence[float] | Floats) -> str | None:
        """Describe the first obstacle that touches a point, shape (d,); None if there is none."""
        p = np.asarray(point, dtype=np.float64)
        d = self.dim
        in_box = ((self.boxes[:, :d] <= p) & (p <= self.boxes[:, d:])).all(axis=1)
        if in_box.any():
            return self._box_text(int(in_box.argmax()))
        for i, ball in enumerate(self.balls):
            if math.dist(ball[:d], p) <= ball[d]:
                return self._ball_text(i)
        if d == 3:
            return None
        if self.grid is not None and self.grid.covers(p[None]).any():
            return f"the map's blocked cells at {self.text(p)}"
        return self._polygon_at(p[None])

    def obstacle_touching(self, shape: Floats) -> str | None:
        """Describe the first obstacle of a 2D world that touches a shape; None if there is none.

        Args:
            shape: A point, a line segment or a convex polygon, counter-clockwise; shape (k, 2).
        """
        low, high = shape.min(axis=0), shape.max(axis=0)
        near = ((self.boxes[:, :2] <= high) & (low <= self.boxes[:, 2:])).all(axis=1)
        for i in np.flatnonzero(near).tolist():
            corners = rectangle(*self.boxes[i].tolist())
            flat = (self.boxes[i, :2] == self.boxes[i, 2:]).any()
            if gap(shape, np.unique(corners, axis=0) if flat else corners) <= 0:
                return self._box_text(i)
        radii = self.balls[:, 2:]
        near = ((self.balls[:, :2] - radii <= high) & (low <= self.balls[:, :2] + radii)).all(1)
        for i in np.flatnonzero(near).tolist():
            if gap(shape, self.balls[i : i + 1, :2]) <= self.balls[i, 2]:
                return self._ball_text(i)
        if self.grid is not None and self.grid.touches(shape):
            return f"the map's blocked cells about {self.text(shape.mean(axis=0))}"
        return self._polygon_at(shape)

    def _polygon_at(self, shape: Floats) -> str | None:
        low, high = shape.min(axis=0), shape.max(axis=0)
        for i, polygon in enumerate(self.polygons):
            apart = (polygon.max(axis=0) < low).any() or (high < polygon.min(axis=0)).any()
            if not apart and gap(shape, polygon) <= 0:
                return f"polygon {i} (about {self.text(polygon.mean(axis=0))})"
        return None

    def _box_text(self, i: int) -> str:
        low, high = np.split(self.boxes[i], 2)
        return f"box {i} ({self.text(low)} to {self.text(high)})"

    def _ball_text(self, i: int) -> str:
        *centre, radius = self.balls[i]
        return f"ball {i} (centre {self.text(centre)}, radius {radius:g})"

    def without_grid(self) -> "World":
        """Return the same world with boxes, or polygons if it is turned, in place of its grid."""
        if self.grid is None:
            return self
        boxes, polygons = self.boxes, self.polygons
        hulls = self.grid.hulls(self.grid.rectangles.astype(np.float64))
        if self.grid.yaw == 0:
            boxes = np.concatenate([boxes, hulls[:, 0::2].reshape(-1, 4)])
        else:
            polygons += tuple(hulls)
        polygons += tuple(self.grid.outside(self.lower, self.upper))
        return replace(self, boxes=boxes, polygons=polygons, grid=None)

    def to_json(self) -> str:
        """Return the world as JSON; `from_json` reads back exactly the same numbers."""
        version = VERSION if self.grid is None else VERSION_WITH_GRID
        data: dict[str, Any] = {"schema": SCHEMA, "version": version, "name": self.name}
        for name in ("lower", "upper", "start", "goal", "balls", "boxes"):
            value = getattr(self, name)
            if value is not None:
                data[name] = value.tolist()
        if self.polygons:
            data["polygons"] = [polygon.tolist() for polygon in self.polygons]
        if self.grid is not None:
            data["grid"] = self.grid.as_json()
        if self.y_down:
            data["y_down"] = True
        if not self.bounded:
            data |= {"version": VERSION_UNBOUNDED, "bounded": False}
        return json.dumps(data)

    @classmethod
    def from_json(cls, text: str | bytes) -> Self:
        """Read what `to_json` wrote.

        Raises:
            BrrtError: The text is not such a world.
        """
        data = parse_json(text, "a JSON world")
        if not isinstance(data, dict) or data.get("schema") != SCHEMA:
            raise BrrtError(f'not a brrt world: the field "schema" must be "{SCHEMA}"')
        if data.get("version") not in (VERSION, VERSION_WITH_GRID, VERSION_UNBOUNDED):
            raise BrrtError(
                f"world version {data.get('version')!r} is not {VERSION}, {VERSION_WITH_GRID} or "
                f"{VERSION_UNBOUNDED}; update brrt"
            )
        for name in ("lower", "upper"):
            if name not in data:
                raise BrrtError(f'not a brrt world: the field "{name}" is missing')
        for name in data:
            if name not in (*_FIELDS, "schema", "version", "name"):
                raise unknown("field of a world", name, _FIELDS)
        found = {name: data[name] for name in _FIELDS if name in data}
        if "grid" in found:
            found["grid"] = Grid.from_json(found["grid"])
        return cls(str(data.get("name", "")), **found)

    def save(self, path: Path | str) -> None:
        """Write the world as JSON; an existing file is replaced once the new one is complete.

        Raises:
            BrrtError: The file cannot be written.
        """
        if Path(path).suffix != ".json":
            raise BrrtError(f"{path}: the name must end in .json, so that brrt recognises the file")
        with replacing(Path(path)) as unfinished:
            unfinished.write_text(self.to_json() + "\n")

    def __repr__(self) -> str:
        counts = [f"{len(getattr(self, name))} {name}" for name in ("balls", "boxes", "polygons")]
        cells = [] if self.grid is None else ["{} x {} cells".format(*self.grid.cells.shape)]
        ends = [
            f"{name} {self.text(point)}"
            for name, point in (("start", self.start), ("goal", self.goal))
            if point is not None
        ]
        some = [count for count in counts if not count.startswith("0 ")]
        bounds = f"{self.text(self.lower)} to {self.text(self.upper)}"
        parts = [repr(self.name), bounds, *some, *cells, *ends]
        return f"<World {'; '.join(parts)}>"
