"""Polygons of GeoJSON files (RFC 7946), cut into convex pieces."""

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from brrt.errors import BrrtError
from brrt.files import parse_json, read_text
from brrt.settings import param
from brrt.worlds.arrays import Floats, read_numbers
from brrt.worlds.loaders.loader import MOST_BYTES, Loader, nothing_to_choose
from brrt.worlds.world import World

_MEMBERS = {"FeatureCollection": "features", "GeometryCollection": "geometries"}
_KINDS = ("FeatureCollection", "Feature", "GeometryCollection", "MultiPolygon", "Polygon")
_BEGINS = re.compile(rf'"type"\s*:\s*"(?:{"|".join((*_KINDS, "Point"))})"'.encode())
_LEFT_OUT = ("Point", "MultiPoint", "LineString", "MultiLineString")
_ENDS = ("start", "goal")
_DEEPEST = 20
"""Collections within collections, at most; the standard advises against any."""
_MOST_VERTICES = 200_000
"""Of a file; cutting takes time that grows with the square of a polygon's."""


@dataclass(slots=True)
class _Found:
    """What a file holds.

    Attributes:
        polygons: Where each stands, for messages, and its rings: outline first, holes after.
        ends: Start and goal.
        others: How many geometries of each other kind there are.
        vertices: Of all polygons together.
    """

    polygons: list[tuple[str, list[Floats]]] = field(default_factory=list)
    ends: dict[str, Floats] = field(default_factory=dict)
    others: dict[str, int] = field(default_factory=dict)
    vertices: int = 0


@dataclass(frozen=True, slots=True)
class GeoJson(Loader):
    """2D polygons of GeoJSON, holes too; needs shapely: pip install 'brrt[geojson]'.

    Coordinates are taken as plane ones, as they stand. Point features with the property `role` or
    `name` `start` or `goal` are the query.
    """

    margin: float | None = param(
        None,
        "room around all there is; auto: a tenth of the longer side, none where there is a bbox",
        low=0,
    )

    endings = (".geojson", ".json")

    @classmethod
    def recognises(cls, head: bytes) -> bool:
        """Whether a type of GeoJSON stands near the beginning."""
        return _BEGINS.search(head) is not None

    def load(self, path: Path, query: str) -> World:
        """Read polygons.

        Raises:
            BrrtError: It is no GeoJSON, a polygon crosses itself, or shapely is not there.
        """
        nothing_to_choose(path, query)
        data = parse_json(read_text(path, "a world", MOST_BYTES), "JSON")
        found = _Found()
        _collect(found, str(path), "", data, 0)
        try:
            from brrt.worlds.loaders.convex_decomposition import convex_pieces  # noqa: PLC0415 - shapely
        except ImportError:
            raise BrrtError(
                f"{path}: reading GeoJSON needs shapely: pip install 'brrt[geojson]'"
            ) from None
        pieces = [p for where, rings in found.polygons for p in convex_pieces(where, rings)]
        lower, upper = self._bounds(path, data, found)
        notes = tuple(
            f"{path}: {count:,} of type {kind} left out; polygons are obstacles"
            for kind, count in found.others.items()
        )
        return World(
            str(path), lower, upper, polygons=tuple(pieces), start=found.ends.get("start"),
            goal=found.ends.get("goal"), notes=notes,
        )  # fmt: skip

    def _bounds(self, path: Path, data: dict[str, Any], found: _Found) -> tuple[Floats, Floats]:
        box = data.get("bbox")
        if box is not None:
            values = _positions(f"{path}: bbox", [box], (4, 6))[0]
            lower, upper = values[:2], values[len(values) // 2 :][:2]
        else:
            corners = [rings[0] for _, rings in found.polygons]
            corners += [end[None] for end in found.ends.values()]
            if not corners:
                raise BrrtError(f"{path}: no polygons in it, no start, no goal, and no bbox")
            points = np.concatenate(corners)
            lower, upper = points.min(axis=0), points.max(axis=0)
        margin = self.margin
        if margin is None:
            margin = 0.0 if box is not None else float((upper - lower).max()) / 10
        if not (lower - margin < upper + margin).all():
            raise BrrtError(f"{path}: its bounds span no area; give room: {path}:margin=1")
        return lower - margin, upper + margin


def _collect(found: _Found, path: str, where: str, data: Any, depth: int) -> None:
    """Gather the polygons and the query from an object and from what it holds."""
    if not isinstance(data, dict) or not isinstance(data.get("type"), str):
        raise BrrtError(f"{path}: {where}not an object of GeoJSON with a type")
    if depth > _DEEPEST:
        raise BrrtError(f"{path}: collections are nested more than {_DEEPEST} deep")
    kind = data["type"]
    if kind in _MEMBERS:
        name = _MEMBERS[kind]
        for i, member in enumerate(_list(f"{path}: {where}{name}", data.get(name))):
            _collect(found, path, f"{where}{name}[{i}]: ", member, depth + 1)
    elif kind == "Feature":
        _feature(found, path, where, data, depth)
    elif kind in ("Polygon", "MultiPolygon"):
        coordinates = data.get("coordinates")
        many = [coordinates] if kind == "Polygon" else coordinates
        for i, rings in enumerate(_list(f"{path}: {where}coordinates", many)):
            part = f"polygon {i}: " if kind == "MultiPolygon" else ""
            _polygon(found, path, f"{path}: {where}{part}", rings)
    elif kind in _LEFT_OUT:
        found.others[kind] = found.others.get(kind, 0) + 1
    else:
        raise BrrtError(f"{path}: {where}unknown type {kind[:40]!r} of GeoJSON")


def _feature(found: _Found, path: str, where: str, data: dict[str, Any], depth: int) -> None:
    end, geometry = _end(data), data.get("geometry")
    if end and isinstance(geometry, dict) and geometry.get("type") == "Point":
        if end in found.ends:
            raise BrrtError(f"{path}: {where}a second {end}")
        spot = _positions(f"{path}: {where}{end}", [geometry.get("coordinates")], (2, 3, 4))
        found.ends[end] = spot[0, :2]
    elif geometry is not None:
        _collect(found, path, where, geometry, depth + 1)


def _polygon(found: _Found, path: str, where: str, coordinates: Any) -> None:
    rings = []
    for i, ring in enumerate(_list(f"{where}coordinates", coordinates)):
        what = f"{where}ring {i}"
        points = _positions(what, ring, (2, 3, 4))[:, :2]
        if len(points) < 4 or (points[0] != points[-1]).any():
            raise BrrtError(f"{what} must have 4 or more positions and end where it begins")
        found.vertices += len(points)
        rings.append(np.ascontiguousarray(points))
    if found.vertices > _MOST_VERTICES:
        raise BrrtError(f"{path}: more than {_MOST_VERTICES:,} vertices; simplify the polygons")
    if rings:
        found.polygons.append((where, rings))


def _end(feature: dict[str, Any]) -> str | None:
    """Return whether a feature is the start or the goal."""
    properties = feature.get("properties")
    if isinstance(properties, dict):
        for name in ("role", "name"):
            if properties.get(name) in _ENDS:
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
