"""A world: bounds and obstacles."""

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from brrt.errors import BrrtError, unknown
from brrt.files import replacing
from brrt.settings import pairs
from brrt.worlds.convex import GREATEST, convex_polygons, gap
from brrt.worlds.occupancy import Grid

SCHEMA, VERSION, VERSION_WITH_GRID = "brrt.world", 1, 2
"""A brrt that knows no grids must not read a world without its grid."""

_FIELDS = ("lower", "upper", "balls", "boxes", "start", "goal", "polygons", "grid", "y_down")
Floats = NDArray[np.float64]


def _numbers_of(name: str, values: Any, what: str) -> Floats:
    """Read numbers from JSON or from a user; none may be so large that its square overflows."""
    try:
        array = np.array(values, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise BrrtError(f"world: {_first_wrong(name, values)} must be {what}") from None
    if not np.isfinite(array).all():
        raise BrrtError(f"world: {name} must hold finite numbers only")
    if (np.abs(array) > GREATEST).any():
        raise BrrtError(f"world: {name} must hold numbers up to {GREATEST:g} only")
    return array


def _first_wrong(name: str, values: Any) -> str:
    """Name the first row that is not like the first one, or all of them."""
    if isinstance(values, list) and values and isinstance(values[0], list):
        for i, row in enumerate(values):
            numbers = isinstance(row, list) and all(isinstance(x, int | float) for x in row)
            if not numbers or len(row) != len(values[0]):
                return f"{name}[{i}] and all others"
    return name


def _point(name: str, values: Any) -> Floats:
    array = _numbers_of(name, values, "a row of numbers")
    if array.ndim != 1:
        raise BrrtError(f"world: {name} must be a row of numbers")
    return array


def _rows(name: str, values: Any, width: int) -> Floats:
    what = f"rows of {width} numbers"
    array = _numbers_of(name, values, what)
    if array.size == 0:
        return np.empty((0, width))
    if array.ndim != 2 or array.shape[1] != width:
        raise BrrtError(f"world: {name} must be {what}")
    return array


def _polygons(values: Any, dim: int) -> tuple[Floats, ...]:
    if not isinstance(values, list | tuple | np.ndarray):
        raise BrrtError("world: polygons must be a list of polygons, each a list of vertices")
    if len(values) and dim != 2:
        raise BrrtError(f"world: polygons stand in the plane, and this world is {dim}D; use boxes")
    return convex_polygons("world: polygons", list(values))


@dataclass(frozen=True, slots=True, eq=False)
class World:
    """Axis-aligned bounds in 2D or 3D with closed obstacles: touching one is a collision.

    Attributes:
        name: What the user asked for: a generator with its parameters, or a file.
        lower: Least corner of the bounds, shape (d,).
        upper: Greatest corner of the bounds, shape (d,).
        balls: Circles or spheres, one a row: centre, radius; shape (n, d + 1).
        boxes: Axis-aligned boxes, one a row: least corner, greatest corner; shape (m, 2 d).
        start: Suggested start position, shape (d,).
        goal: Suggested goal position, shape (d,).
        polygons: Convex polygons, in 2D alone; vertices counter-clockwise, shape (k, 2) each. Two
            vertices make a line segment.
        grid: Occupancy grid, in 2D alone.
        notes: What the user should know of how the world came about; not saved.
        y_down: Whether pictures have y pointing down, as the file that the world is from has it.

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
        """Make a world of an occupancy grid alone, as large as the grid."""
        lower, upper = grid.corners.min(axis=0), grid.corners.max(axis=0)
        ends: dict[str, Any] = {"start": start, "goal": goal}
        return cls(name, lower, upper, **ends, grid=grid, notes=notes, y_down=y_down)

    def __post_init__(self) -> None:
        """Bring the arrays to float64 and check them."""
        for name in ("lower", "upper", "start", "goal"):
            if getattr(self, name) is not None or name in ("lower", "upper"):
                object.__setattr__(self, name, _point(name, getattr(self, name)))
        dim = len(self.lower)
        if dim not in (2, 3) or len(self.upper) != dim:
            both = f"{dim} in lower and {len(self.upper)} in upper"
            raise BrrtError(f"world: bounds must have 2 or 3 coordinates, not {both}")
        for name, end in (("start", self.start), ("goal", self.goal)):
            if end is not None and len(end) != dim:
                raise BrrtError(f"world: {name} must be {dim} numbers, not {len(end)}")
        for name, width in (("balls", dim + 1), ("boxes", 2 * dim)):
            object.__setattr__(self, name, _rows(name, getattr(self, name), width))
        object.__setattr__(self, "polygons", _polygons(self.polygons, dim))
        self._check_ranges(dim)

    def _check_ranges(self, dim: int) -> None:
        """See that what has two sides has them in order."""
        if not (self.lower < self.upper).all():
            bounds = f"{_numbers(self.lower)} to {_numbers(self.upper)}"
            raise BrrtError(f"world: each upper bound must be above its lower bound, not {bounds}")
        crossed = (self.boxes[:, :dim] > self.boxes[:, dim:]).any(axis=1)
        if crossed.any():
            i = int(crossed.argmax())
            row = _numbers(self.boxes[i])
            raise BrrtError(f"world: boxes[{i}] has a minimum above its maximum: {row}")
        if (self.balls[:, dim] < 0).any():
            i = int((self.balls[:, dim] < 0).argmax())
            radius = self.balls[i, dim]
            raise BrrtError(f"world: balls[{i}]: the radius must not be below zero: {radius:g}")
        if not isinstance(self.y_down, bool):
            raise BrrtError("world: y_down must be true or false")
        if self.grid is not None and dim != 2:
            raise BrrtError(f"world: a grid lies in the plane, and this world is {dim}D")

    @property
    def dim(self) -> int:
        """2 or 3."""
        return len(self.lower)

    @property
    def extent(self) -> float:
        """The longest side of the bounds."""
        return float((self.upper - self.lower).max())

    def inside(self, point: Sequence[float] | Floats) -> bool:
        """Whether a point, shape (d,), lies within the closed bounds."""
        p = np.asarray(point)
        return bool(((self.lower <= p) & (p <= self.upper)).all())

    def obstacle_at(self, point: Sequence[float] | Floats) -> str | None:
        """Name the first obstacle that touches a point, shape (d,), or return None."""
        p = np.asarray(point, dtype=np.float64)
        d = self.dim
        in_box = ((self.boxes[:, :d] <= p) & (p <= self.boxes[:, d:])).all(axis=1)
        if in_box.any():
            i = int(in_box.argmax())
            return f"box {i} ({_numbers(self.boxes[i, :d])} to {_numbers(self.boxes[i, d:])})"
        for i, ball in enumerate(self.balls):
            if math.dist(ball[:d], p) <= ball[d]:
                return f"ball {i} (centre {_numbers(ball[:d])}, radius {ball[d]:g})"
        if d == 3:
            return None
        if self.grid is not None and self.grid.covers(p[None]).any():
            return f"the map's blocked cells at {_numbers(p)}"
        return self._polygon_at(p[None])

    def obstacle_touching(self, shape: Floats) -> str | None:
        """Name the first obstacle of a 2D world that touches a shape, or return None.

        Args:
            shape: A point, a line segment or a convex polygon, counter-clockwise; shape (k, 2).
        """
        least, most = shape.min(axis=0), shape.max(axis=0)
        near = ((self.boxes[:, :2] <= most) & (least <= self.boxes[:, 2:])).all(axis=1)
        for i in np.flatnonzero(near).tolist():
            (a, b), (c, d) = self.boxes[i].reshape(2, 2)
            corners = np.array([[a, b], [c, b], [c, d], [a, d]])
            if gap(shape, np.unique(corners, axis=0) if a == c or b == d else corners) <= 0:
                return f"box {i} ({_numbers(self.boxes[i, :2])} to {_numbers(self.boxes[i, 2:])})"
        radii = self.balls[:, 2:]
        near = ((self.balls[:, :2] - radii <= most) & (least <= self.balls[:, :2] + radii)).all(1)
        for i in np.flatnonzero(near).tolist():
            x, y, radius = self.balls[i]
            if gap(shape, np.array([[x, y]])) <= radius:
                return f"ball {i} (centre {x:g}, {y:g}, radius {radius:g})"
        if self.grid is not None and self._in_cells(self.grid.to_cells(shape)):
            return f"the map's blocked cells about {_numbers(shape.mean(axis=0))}"
        return self._polygon_at(shape)

    def _in_cells(self, shape: Floats) -> bool:
        """Whether a shape touches blocked cells or leaves the grid; in columns and rows, (k, 2)."""
        assert self.grid is not None  # noqa: S101 - the caller's
        if self.grid.covers(self.grid.to_world(shape * self.grid.resolution)).any():
            return True
        least, most, taken = shape.min(axis=0), shape.max(axis=0), self.grid.rectangles
        near = ((taken[:, :2] <= most) & (least <= taken[:, 2:])).all(axis=1)
        return any(
            gap(shape, np.array([[a, b], [c, b], [c, d], [a, d]], np.float64)) <= 0
            for a, b, c, d in taken[near].tolist()
        )

    def solid(self) -> "World":
        """Return the same world with boxes instead of its grid, polygons if that is turned."""
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

    def _polygon_at(self, shape: Floats) -> str | None:
        least, most = shape.min(axis=0), shape.max(axis=0)
        for i, polygon in enumerate(self.polygons):
            apart = (polygon.max(axis=0) < least).any() or (most < polygon.min(axis=0)).any()
            if not apart and gap(shape, polygon) <= 0:
                return f"polygon {i} (about {_numbers(polygon.mean(axis=0))})"
        return None

    def to_json(self) -> str:
        """Return the world as text that `from_json` reads back to the same numbers."""
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
        return json.dumps(data)

    @classmethod
    def from_json(cls, text: str | bytes) -> Self:
        """Read what `to_json` wrote.

        Raises:
            BrrtError: The text is not such a world.
        """
        try:
            data = json.loads(text)
        except (ValueError, RecursionError) as error:
            raise BrrtError(f"not a JSON world: {error}") from None
        if not isinstance(data, dict) or data.get("schema") != SCHEMA:
            raise BrrtError(f'not a brrt world: the field "schema" must be "{SCHEMA}"')
        if data.get("version") not in (VERSION, VERSION_WITH_GRID):
            raise BrrtError(
                f"world version {data.get('version')!r} is not {VERSION} or {VERSION_WITH_GRID}; "
                f"update brrt"
            )
        for name in ("lower", "upper"):
            if name not in data:
                raise BrrtError(f'not a whole brrt world: the field "{name}" is missing')
        for name in data:
            if name not in (*_FIELDS, "schema", "version", "name"):
                raise unknown("field of a world", name, _FIELDS)
        found = {name: data[name] for name in _FIELDS if name in data}
        if "grid" in found:
            found["grid"] = Grid.from_json(found["grid"])
        return cls(str(data.get("name", "")), **found)

    @classmethod
    def load(cls, path: Path | str, query: str = "", **parameters: Any) -> "World":
        """Read a world from a file of any kind that brrt knows; see `brrt worlds list`.

        Args:
            path: The file, or what the command line takes, as `map.yaml:unknown=free`.
            query: Which start and goal, of a file that has several, such as "12".
            parameters: Settings of the loader.

        Raises:
            BrrtError: The file cannot be read, or is not a world.
        """
        from brrt.worlds import FileSpec, load_world  # noqa: PLC0415 - it imports this module

        spec = FileSpec.parse(str(path))
        given = pairs(f"world {path}", spec.params)
        return load_world(spec.path, {**given, **parameters}, query or spec.query)

    @classmethod
    def generate(cls, generator: str, **parameters: Any) -> "World":
        """Generate a world: `World.generate("boxes3d", n=80, seed=3)`; see `brrt worlds list`.

        Its name is what the command line takes, so that a scenario can name it.

        Raises:
            BrrtError: There is no such generator or parameter, or a value is of no use.
        """
        from brrt.worlds import GENERATORS, make_world  # noqa: PLC0415 - it imports this module

        if generator not in GENERATORS:
            raise unknown("world", generator, GENERATORS)
        given = (f"{name}={_text(value)}" for name, value in parameters.items())
        return make_world(f"{generator}:{','.join(given)}".removesuffix(":"))

    @classmethod
    def circles(cls, **parameters: Any) -> "World":
        """Generate circles in 2D: `World.circles(n=50, seed=3)`."""
        return cls.generate("circles2d", **parameters)

    @classmethod
    def squares(cls, **parameters: Any) -> "World":
        """Generate axis-aligned squares in 2D: `World.squares(n=50, seed=3)`."""
        return cls.generate("squares2d", **parameters)

    @classmethod
    def spheres(cls, **parameters: Any) -> "World":
        """Generate spheres in 3D: `World.spheres(n=50, seed=3)`."""
        return cls.generate("spheres3d", **parameters)

    def save(self, path: Path | str) -> None:
        """Write the world as JSON; the file appears when it is whole.

        Raises:
            BrrtError: It cannot be written.
        """
        if Path(path).suffix != ".json":
            raise BrrtError(
                f"{path}: the name must end in .json, or brrt takes it for another file"
            )
        with replacing(Path(path)) as unfinished:
            unfinished.write_text(self.to_json() + "\n")

    def plot(self, ax: Any = None) -> Any:
        """Draw the world by matplotlib into axes, new ones by default; return the axes.

        Raises:
            BrrtError: matplotlib is missing, or the axes are not for this world.
        """
        from brrt.views.matplotlib.draw_world import plot  # noqa: PLC0415 - matplotlib is an extra

        return plot(self, ax)

    def __repr__(self) -> str:
        counts = [f"{len(getattr(self, name))} {name}" for name in ("balls", "boxes", "polygons")]
        cells = [] if self.grid is None else ["{} x {} cells".format(*self.grid.cells.shape)]
        ends = [
            f"{name} {_numbers(point)}"
            for name, point in (("start", self.start), ("goal", self.goal))
            if point is not None
        ]
        some = [count for count in counts if not count.startswith("0 ")]
        bounds = f"{_numbers(self.lower)} to {_numbers(self.upper)}"
        parts = [repr(self.name), bounds, *some, *cells, *ends]
        return f"<World {'; '.join(parts)}>"


def _text(value: Any) -> str:
    """Write a value as the command line takes it."""
    if value is None:
        return "auto"
    return str(value).lower() if isinstance(value, bool | np.bool_) else str(value)


def _numbers(values: Floats) -> str:
    return ", ".join(f"{v:g}" for v in values)
