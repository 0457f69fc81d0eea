"""GeoJSON: convex pieces are exactly the polygons, and errors name the place."""

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely.geometry import Polygon

from brrt.worlds import World, load_world, make_world
from brrt.worlds.convex import convex_polygon
from brrt.worlds.loaders.convex_decomposition import convex_pieces
from tests.support.world_files import SQUARE, refused

L = [[0, 0], [4, 0], [4, 1], [1, 1], [1, 4], [0, 4], [0, 0]]
HOLE = [[1, 1], [1, 2], [2, 2], [2, 1], [1, 1]]


def loaded(data: Any, tmp_path: Path, spec: str = "") -> World:
    """Load a GeoJSON object."""
    path = tmp_path / "w.geojson"
    path.write_text(data if isinstance(data, str) else json.dumps(data))
    return make_world(f"{path}{spec}")


def feature(geometry: Any, **properties: Any) -> dict[str, Any]:
    """A feature of a geometry."""
    return {"type": "Feature", "properties": properties or None, "geometry": geometry}


def of(kind: str, coordinates: Any) -> dict[str, Any]:
    """A geometry."""
    return {"type": kind, "coordinates": coordinates}


@st.composite
def stars(draw: st.DrawFn) -> list[np.ndarray[Any, Any]]:
    """Draw a star-shaped polygon with star-shaped holes."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    count = draw(st.integers(3, 40))
    grain = draw(st.sampled_from([1e-3, 0.5, 0.0]))
    angles = np.sort(rng.random(count) * 2 * np.pi)
    radii = 8 + 4 * rng.random(count)
    rings = [_ring(np.zeros(2), angles, radii)]
    for middle in rng.permutation([[-2, -2], [2, -2], [2, 2], [-2, 2]])[: draw(st.integers(0, 4))]:
        angles = np.linspace(0, 2 * np.pi, draw(st.integers(3, 9)), endpoint=False)
        rings.append(_ring(middle, angles, 0.3 + 1.5 * rng.random(len(angles))))
    if grain:
        rings = [np.round(ring / grain) * grain for ring in rings]
    return rings


def _ring(middle: Any, angles: Any, radii: Any) -> Any:
    ring = middle + np.stack([np.cos(angles), np.sin(angles)], axis=-1) * radii[:, None]
    return np.concatenate([ring, ring[:1]])


@settings(max_examples=150)
@given(stars())
def test_pieces_are_the_polygon(rings: list[Any]) -> None:
    """Pieces are convex, do not overlap, and cover exactly the polygon."""
    polygon = Polygon(rings[0], rings[1:])
    if not polygon.is_valid:
        assert "not a polygon that encloses an area" in refused(lambda: convex_pieces("", rings))
        return
    pieces = convex_pieces("", rings)
    for piece in pieces:
        corners = convex_polygon("piece", piece)
        assert set(map(tuple, corners)) <= {tuple(v) for ring in rings for v in ring}
    shapes = [Polygon(piece) for piece in pieces]
    assert sum(shape.area for shape in shapes) == pytest.approx(polygon.area, rel=1e-12)
    assert shapely.unary_union(shapes).symmetric_difference(polygon).area < 1e-9
    points = np.random.default_rng(0).uniform(-12, 12, (500, 2))
    inside = shapely.contains_xy(polygon, points)
    assert (sum(shapely.contains_xy(shape, points) for shape in shapes) == inside).all()


def test_triangles_are_joined() -> None:
    """A convex polygon is one piece, an L two, a frame a few."""
    ring = [np.array(SQUARE, float)]
    assert [len(p) for p in convex_pieces("", ring)] == [4]
    assert [len(p) for p in convex_pieces("", [ring[0][::-1]])] == [4]
    assert len(convex_pieces("", [np.array(L, float)])) == 2
    assert len(convex_pieces("", [*ring, np.array(HOLE, float)])) <= 5
    angles = np.linspace(0, 2 * np.pi, 200, endpoint=False)
    assert len(convex_pieces("", [_ring(np.zeros(2), angles, np.ones(200))])) == 1


def test_closed_polygons_and_open_holes(tmp_path: Path) -> None:
    """The polygon is blocked with its border; the inside of a hole is free, its border is not."""
    world = loaded(of("Polygon", [SQUARE, HOLE]), tmp_path)
    for x, y, hit in (
        (0.5, 0.5, True), (1.5, 1.5, False), (1, 1.5, True), (2, 2, True), (4, 2, True),
        (4.01, 2, False), (1.01, 1.01, False), (3, 3, True),
    ):  # fmt: skip
        assert (world.obstacle_at([x, y]) is not None) == hit


def test_a_bbox_across_the_antimeridian(tmp_path: Path) -> None:
    """The message names the two longitudes, and no margin is advised, or accepted."""
    data = of("Polygon", [SQUARE])

    def message(box: list[int], margin: str = "") -> str:
        return refused(lambda: loaded(data | {"bbox": box}, tmp_path, margin))

    for margin in ("", ":margin=1", ":margin=200"):
        crossed = message([177, -20, -178, -16], margin)
        assert "bbox: west 177 is greater than east -178; coordinates are used as plane" in crossed
    for box in ([0, 5, 4, 3], [0, 5, 0, 4, 3, 9]):
        assert "bbox: south 5 is greater than north 3; swap them" in message(box)
    assert "the bounds have no area; give" in message([0, 5, 4, 5])
    assert loaded(data | {"bbox": [0, 5, 4, 5]}, tmp_path, ":margin=1").upper.tolist() == [5, 6]


def test_all_kinds(tmp_path: Path) -> None:
    """Collections of features and geometries, multipolygons, the query, ignored types."""
    far = [[x + 10, y] for x, y in SQUARE]
    data = {
        "type": "FeatureCollection",
        "features": [
            feature(of("MultiPolygon", [[SQUARE], [far]]), height=3),
            feature({"type": "GeometryCollection", "geometries": [of("Polygon", [L])]}),
            feature(of("Point", [5, 5]), role="start"),
            feature(of("Point", [6, 6, 100]), name="goal"),
            feature(of("Point", [7, 7]), name="well"),
            feature(of("LineString", [[0, 0], [1, 1]])),
            feature(None),
        ],
    }
    world = loaded(data, tmp_path)
    assert len(world.polygons) == 4
    assert world.start is not None
    assert world.goal is not None
    assert (world.start.tolist(), world.goal.tolist()) == ([5, 5], [6, 6])
    assert (world.lower.tolist(), world.upper.tolist()) == ([-1.4, -1.4], [15.4, 7.4])
    assert [note.split(": ")[1] for note in world.notes] == [
        "1 of type Point ignored; only polygons are obstacles",
        "1 of type LineString ignored; only polygons are obstacles",
    ]
    assert loaded(data, tmp_path, ":margin=2").lower.tolist() == [-2, -2]
    boxed = data | {"bbox": [-1, -2, 20, 30]}
    assert loaded(boxed, tmp_path).upper.tolist() == [20, 30]
    assert loaded(boxed, tmp_path, ":margin=1").upper.tolist() == [21, 31]
    assert loaded(data | {"bbox": [-1, -2, 0, 20, 30, 9]}, tmp_path).upper.tolist() == [20, 30]
    empty = {"type": "FeatureCollection", "features": [], "bbox": [0, 0, 1, 1]}
    assert loaded(empty, tmp_path).polygons == ()


BOW = [[0, 0], [4, 4], [4, 0], [0, 4], [0, 0]]


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ("{", ": not JSON: "),
        ("[]", ": not an object of GeoJSON with a type"),
        ({"type": "Circle\n" * 99}, ": unknown type 'Circle\\n"),
        ({"type": 3}, ": not an object of GeoJSON with a type"),
        ({"type": "FeatureCollection"}, ": features must be a list"),
        ({"type": "FeatureCollection", "features": [3]}, ": features[0]: not an object of GeoJSON"),
        ({"type": "FeatureCollection", "features": []}, ": it contains no polygons, no start"),
        (of("Polygon", None), ": coordinates must be a list"),
        (of("Polygon", [[]]), ": ring 0 must be positions of 2 or 3 or 4 numbers"),
        (of("Polygon", [[[0, 0], [1]]]), ": ring 0 must be positions"),
        (of("Polygon", [[["a", "b"]]]), ": ring 0 must be positions"),
        (of("Polygon", [SQUARE[:-1]]), ": ring 0 must have 4 or more positions and end where it"),
        (of("Polygon", [SQUARE[:2] + SQUARE[:1]]), ": ring 0 must have 4 or more"),
        (of("Polygon", [SQUARE, SQUARE[:-1]]), ": ring 1 must have 4 or more"),
        (of("Polygon", [[[x, y + 1e200] for x, y in SQUARE]]), ": ring 0 must be finite numbers"),
        (json.dumps(of("Polygon", [SQUARE])).replace("4", "NaN"), ": ring 0 must be finite"),
        (of("Polygon", [BOW]), ": not a polygon that encloses an area: Self-intersection at 2 2"),
        (of("Polygon", [[[0, 0]] * 4]), ": not a polygon that encloses an area: Too few points"),
        (of("Polygon", [HOLE, SQUARE]), ": not a polygon that encloses an area: Hole lies outside"),
        (
            {"type": "FeatureCollection",
             "features": [feature(of("Polygon", [L])), feature(of("MultiPolygon", [[L], [BOW]]))]},
            ": features[1]: polygon 1: not a polygon that encloses an area: Self-intersection at",
        ),
        (
            {"type": "FeatureCollection",
             "features": [feature(of("Point", [1, 1]), role="start")] * 2},
            ": features[1]: a second start",
        ),
        (feature(of("Point", [1, "x"]), role="goal"), ": goal must be positions of"),
        (feature(of("Point", [1, 2]), role="goal"), ": the bounds have no area; give "),
        (of("Polygon", [SQUARE]) | {"bbox": [0, 0, 1]}, ": bbox must be positions of 4 or 6"),
        (of("Polygon", [SQUARE]) | {"bbox": [0, 0, 0, 1]}, ": the bounds have no area"),
        (of("Polygon", [SQUARE * 60_000]), ": more than 200,000 vertices; simplify the polygons"),
        (of("Polygon", [SQUARE * 7000]), ": more than 30,000 vertices; simplify the polygon"),
    ],
)  # fmt: skip
def test_bad_geojson(data: Any, message: str, tmp_path: Path) -> None:
    """The error is one line with the file and the feature."""
    error = refused(lambda: loaded(data, tmp_path))
    assert error.startswith(f"{tmp_path / 'w.geojson'}{message}")


def test_without_shapely(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without shapely the error is one line."""
    monkeypatch.setitem(sys.modules, "shapely", None)
    monkeypatch.delitem(sys.modules, "brrt.worlds.loaders.convex_decomposition", raising=False)
    path = tmp_path / "w.geojson"
    path.write_text(json.dumps(of("Polygon", [SQUARE])))
    assert refused(lambda: load_world(path)) == (
        f"{path}: reading GeoJSON needs shapely: pip install 'brrt[geojson]'"
    )
