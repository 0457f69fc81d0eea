"""Polygons of GeoJSON files (RFC 7946), decomposed into convex ones."""

import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from brrt.digits import tell_apart
from brrt.errors import BrrtError
from brrt.files import parse_json
from brrt.settings import param
from brrt.worlds.arrays import Floats, check_lengths, read_numbers
from brrt.worlds.loaders.loader import Loader, read_world_text
from brrt.worlds.world import World

_MEMBERS = {"FeatureCollection": "features", "GeometryCollection": "geometries"}
_KINDS = ("FeatureCollection", "Feature", "GeometryCollection", "MultiPolygon", "Polygon")
_BEGINS = re.compile(rf'"type"\s*:\s*"(?:{"|".join((*_KINDS, "Point"))})"'.encode())
_IGNORED = ("Point", "MultiPoint", "LineString", "MultiLineString")
_DEEPEST = 20
"""Maximum depth of nested collections; the standard advises against nesting."""
_MOST_VERTICES = 200_000
"""Maximum vertices in a file; decomposition time grows with the square of a polygon's."""


@dataclass(frozen=True, slots=True)
class GeoJson(Loader):
    """2D polygons of GeoJSON, holes too; needs shapely: pip install 'brrt[geojson]'.

    Coordinates are used as they are, as plane ones. Point features whose property `role` or `name`
    is `start` or `goal` are the query.
    """

    margin: float | None = param(
        None,
        "distance from everything to the bounds; auto: a tenth of the longer side, 0 with a bbox",
        low=0,
    )

    endings = (".geojson", ".json")

    @classmethod
    def recognises(cls, head: bytes) -> bool:
        """Whether a GeoJSON type is named near the beginning."""
        return _BEGINS.search(head) is not None

    def read(self, path: Path, _query: str, /) -> World:
        """Read polygons."""
        data = parse_json(read_world_text(path), "JSON")
        found = _Geometries(path)
        found.add(data, "", 0)
        try:
            from brrt.worlds.loaders.convex_decomposition import convex_pieces  # noqa: PLC0415
        except ImportError:
            raise BrrtError(
                f"{path}: reading GeoJSON needs shapely: pip install 'brrt[geojson]'"
            ) from None
        pieces = [p for where, rings in found.polygons for p in convex_pieces(where, rings)]
        lower, upper = self._bounds(path, data, found)
        notes = tuple(
            f"{path}: {count:,} of type {kind} ignored; only polygons are obstacles"
            for kind, count in found.ignored.items()
        )
        start, goal = (found.ends.get(name) for name in ("start", "goal"))
        return World(
            str(path), lower, upper, polygons=tuple(pieces), start=start, goal=goal, notes=notes
        )

    def _bounds(
        self, path: Path, data: dict[str, Any], found: "_Geometries"
    ) -> tuple[Floats, Floats]:
        box = data.get("bbox")
        if box is not None:
            values = _positions(f"{path}: bbox", [box], (4, 6))[0]
            lower, upper = values[:2], values[len(values) // 2 :][:2]
            _check_box(path, lower.tolist(), upper.tolist())
        else:
            corners = [rings[0] for _, rings in found.polygons]
            corners += [end[None] for end in found.ends.values()]
            if not corners:
                raise BrrtError(f"{path}: it contains no polygons, no start, no goal, and no bbox")
            points = np.concatenate(corners)
            lower, upper = points.min(axis=0), points.max(axis=0)
        margin = self.margin
        if margin is None:
            margin = 0.0 if box is not None else float((upper - lower).max()) / 10
        if not (lower - margin < upper + margin).all():
            raise BrrtError(f"{path}: the bounds have no area; give {path}:margin=1")
        return lower - margin, upper + margin


class _Geometries:
    """The polygons, start and goal of a file.

    Args:
        path: The file, for messages.

    Attributes:
        polygons: Place of each polygon, for messages, and its rings: outline first, then holes.
        ends: Start and goal, as far as they are there.
        ignored: Number of geometries of each other type.
    """

    def __init__(self, path: Path) -> None:
        self.polygons: list[tuple[str, list[Floats]]] = []
        self.ends: dict[str, Floats] = {}
        self.ignored: Counter[str] = Counter()
        self._path, self._vertices = path, 0

    def add(self, data: Any, where: str, depth: int) -> None:
        """Add the polygons and the query of an object and of its members.

        Args:
            data: The object.
            where: Its place in the file, for messages.
            depth: Number of objects around it.

        Raises:
            BrrtError: It is not a GeoJSON object, or one of its members is not.
        """
        if not isinstance(data, dict) or not isinstance(data.get("type"), str):
            raise BrrtError(f"{self._path}: {where}not an object of GeoJSON with a type")
        if depth > _DEEPEST:
            raise BrrtError(f"{self._path}: collections are nested more than {_DEEPEST} deep")
        kind, place = data["type"], f"{self._path}: {where}"
        if kind in _MEMBERS:
            name = _MEMBERS[kind]
            for i, member in enumerate(_list(f"{place}{name}", data.get(name))):
                self.add(member, f"{where}{name}[{i}]: ", depth + 1)
        elif kind == "Feature":
            self._add_feature(data, where, depth)
        elif kind in ("Polygon", "MultiPolygon"):
            coordinates = data.get("coordinates")
            many = [coordinates] if kind == "Polygon" else coordinates
            for i, rings in enumerate(_list(f"{place}coordinates", many)):
                part = f"polygon {i}: " if kind == "MultiPolygon" else ""
                self._add_polygon(rings, f"{place}{part}")
        elif kind in _IGNORED:
            self.ignored[kind] += 1
        else:
            raise BrrtError(f"{place}unknown type {kind[:40]!r} of GeoJSON")

    def _add_feature(self, data: dict[str, Any], where: str, depth: int) -> None:
        end, geometry = _end(data), data.get("geometry")
        if end and isinstance(geometry, dict) and geometry.get("type") == "Point":
            place = f"{self._path}: {where}"
            if end in self.ends:
                raise BrrtError(f"{place}a second {end}")
            spot = _positions(f"{place}{end}", [geometry.get("coordinates")], (2, 3, 4))
            self.ends[end] = spot[0, :2]
        elif geometry is not None:
            self.add(geometry, where, depth + 1)

    def _add_polygon(self, coordinates: Any, place: str) -> None:
        rings = []
        for i, ring in enumerate(_list(f"{place}coordinates", coordinates)):
            what = f"{place}ring {i}"
            points = _positions(what, ring, (2, 3, 4))[:, :2]
            if len(points) < 4 or (points[0] != points[-1]).any():
                raise BrrtError(f"{what} must have 4 or more positions and end where it begins")
            check_lengths(f"{what}: the size", np.ptp(points, axis=0).max(keepdims=True))
            self._vertices += len(points)
            rings.append(np.ascontiguousarray(points))
        if self._vertices > _MOST_VERTICES:
            raise BrrtError(
                f"{self._path}: more than {_MOST_VERTICES:,} vertices; simplify the polygons"
            )
        if rings:
            self.polygons.append((place, rings))


def _check_box(path: Path, lower: list[float], upper: list[float]) -> None:
    """Check that a bbox is not crossed, as one across the antimeridian is (RFC 7946, 5.2)."""
    west, east = tell_apart(lower[0], upper[0])
    south, north = tell_apart(lower[1], upper[1])
    if lower[0] > upper[0]:
        raise BrrtError(
            f"{path}: bbox: west {west} is greater than east {east}; coordinates are used as plane "
            f"ones, so add 360 to those beyond the antimeridian, or swap the two"
        )
    if lower[1] > upper[1]:
        raise BrrtError(f"{path}: bbox: south {south} is greater than north {north}; swap them")


def _end(feature: dict[str, Any]) -> str | None:
    """Return `start` or `goal` if a feature is one of them."""
    properties = feature.get("properties")
    if isinstance(properties, dict):
        for name in ("role", "name"):
            if properties.get(name) in ("start", "goal"):
                return str(properties[name])
    return None


def _list(where: str, values: Any) -> Iterator[Any]:
    if not isinstance(values, list):
        raise BrrtError(f"{where} must be a list")
    return iter(values)


def _positions(where: str, values: Any, lengths: tuple[int, ...]) -> Floats:
    """Read rows of numbers, all of one of the lengths; shape (n, length)."""
    what = f"positions of {' or '.join(map(str, lengths))} numbers"
    rows = read_numbers(where, values, what, (None, None))
    if rows.shape[1] not in lengths:
        raise BrrtError(f"{where} must be {what}")
    return rows
