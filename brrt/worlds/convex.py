"""Convex polygons in the plane: reading them, and the distance between them."""

import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np

from brrt.digits import digits_within, join_numbers
from brrt.errors import BrrtError
from brrt.worlds.arrays import LEAST, Floats, check_lengths, read_numbers

_ROUNDING = 1e-9
"""A vertex of a convex polygon may be concave by this sine of its angle: files are rounded."""

_MOST_VERTICES = 30_000
"""Of a polygon: the time to check it grows with the square of them."""

_MOST_EDGES = 24
"""Number of a polygon's edges that `inscribed` takes into account."""


def rectangle(x0: float, y0: float, x1: float, y1: float) -> Floats:
    """Return the corners of an axis-aligned rectangle, counter-clockwise, shape (4, 2)."""
    return np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]], np.float64)


def convex_polygon(name: str, values: Any) -> Floats:
    """Read a convex polygon; two vertices make a line segment.

    Repeated vertices and vertices on an edge are dropped.

    Args:
        name: What it is called in messages.
        values: Vertices in either direction, shape (k, 2).

    Returns:
        The vertices counter-clockwise, shape (k, 2).

    Raises:
        BrrtError: It is not a convex polygon in the plane.
    """
    what = "2 or more vertices, each a pair of numbers"
    vertices = read_numbers(name, values, what, (None, 2))
    if len(vertices) < 2:
        raise BrrtError(f"{name} must be {what}")
    if len(vertices) > _MOST_VERTICES:
        raise BrrtError(
            f"{name} has {len(vertices):,} vertices, and may have at most {_MOST_VERTICES:,}; "
            "leave some out"
        )
    vertices = vertices[(vertices != np.roll(vertices, 1, axis=0)).any(axis=1)]
    if len(vertices) < 2:
        raise BrrtError(f"{name} must have 2 or more different vertices; these are all the same")
    check_lengths(f"{name}: the size", np.ptp(vertices, axis=0).max(keepdims=True))
    return vertices if len(vertices) == 2 else _hull_of_convex(name, vertices)


def convex_polygons(name: str, values: Sequence[Any]) -> tuple[Floats, ...]:
    """Read convex polygons as `convex_polygon` does, many at a time.

    Args:
        name: What they are called in messages.
        values: Vertices of each, shape (k, 2).

    Raises:
        BrrtError: One is not a convex polygon in the plane.
    """
    found: list[Floats | None] = [None] * len(values)
    by_length: dict[int, list[int]] = {}
    for i, value in enumerate(values):
        if isinstance(value, list | np.ndarray) and 2 < len(value) <= _MOST_VERTICES:
            by_length.setdefault(len(value), []).append(i)
    for length, which in by_length.items():
        try:
            several = read_numbers(name, [values[i] for i in which], "", (None, length, 2))
        except BrrtError:
            continue
        cross, lengths, angles = _turns(several)
        # Clearly convex and counter-clockwise: nothing to drop, reverse or refuse.
        clear = (cross > _ROUNDING * lengths).all(axis=1) & (np.abs(angles - 2 * np.pi) < 1)
        clear &= np.ptp(several, axis=1).max(axis=1) >= LEAST
        for i, polygon in zip(np.flatnonzero(clear).tolist(), several[clear], strict=True):
            found[which[i]] = polygon
    return tuple(
        convex_polygon(f"{name}[{i}]", values[i]) if polygon is None else polygon
        for i, polygon in enumerate(found)
    )


def _hull_of_convex(name: str, vertices: Floats) -> Floats:
    """Check that a polygon is convex, up to rounding; return its hull, counter-clockwise."""
    if _cross(vertices - vertices[0], np.roll(vertices, -1, axis=0) - vertices[0]).sum() < 0:
        vertices = np.ascontiguousarray(vertices[::-1])
    turns, lengths, angle = _turns(vertices)
    concave = turns < -_ROUNDING * lengths
    if concave.any() or abs(angle - 2 * np.pi) > 1:
        digits = digits_within(vertices.min(axis=0), vertices.max(axis=0))
        text = join_numbers(vertices[int(turns.argmin())], digits)
        raise BrrtError(f"{name} is not convex at ({text}); split it into convex polygons")
    while len(vertices) > 2 and (turns <= 0).any():
        vertices = np.delete(vertices, int(turns.argmin()), axis=0)
        turns, _, _ = _turns(vertices)
    if len(vertices) == 2:
        raise BrrtError(f"{name} has no area; give a line segment as its two ends")
    return vertices


def _cross(a: Floats, b: Floats) -> Floats:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def _turns(vertices: Floats) -> tuple[Floats, Floats, Floats]:
    """Measure how polygons turn at each vertex.

    Args:
        vertices: One polygon, or several with the same number of vertices, shape (..., k, 2).

    Returns:
        Cross product of the two edges at each vertex, shape (..., k), the product of their lengths,
        shape (..., k), and the sum of all turning angles, shape (...).
    """
    after = np.roll(vertices, -1, axis=-2) - vertices
    before = np.roll(after, 1, axis=-2)
    cross = _cross(before, after)
    angle = np.arctan2(cross, (before * after).sum(axis=-1)).sum(axis=-1)
    sizes = [np.hypot(along[..., 0], along[..., 1]) for along in (before, after)]
    return cross, sizes[0] * sizes[1], np.asarray(angle)


def axes_of(vertices: Floats) -> Floats:
    """Return a shape's candidate separating axes, as unit vectors.

    These are the outward normals of a polygon that is counter-clockwise; the normals and the
    directions of a line segment, as if it were a rectangle; none for a point.

    Args:
        vertices: One shape, or several with the same number of vertices, shape (..., k, 2).

    Returns:
        Directions, shape (..., m, 2).
    """
    k = vertices.shape[-2]
    if k < 2:
        return np.empty((*vertices.shape[:-2], 0, 2))
    along = np.roll(vertices, -1, axis=-2) - vertices
    # Divide by the largest component first: the squares of tiny ones would underflow.
    along /= np.abs(along).max(axis=-1, keepdims=True)
    along /= np.hypot(along[..., 0], along[..., 1])[..., None]
    normals = np.stack([along[..., 1], -along[..., 0]], axis=-1)
    return np.concatenate([normals, along], axis=-2) if k == 2 else normals


def gap(one: Floats, other: Floats) -> float:
    """Return a lower bound of the distance between two convex shapes (separating axes).

    It is at most 0 if they touch. Where a vertex is closest to an edge it is exact but for 2e-15 of
    the lengths involved, by which it is too small.

    Args:
        one: A point, a line segment or a convex polygon, counter-clockwise; shape (k, 2).
        other: Another, shape (m, 2).
    """
    one, other = one - other[0], other - other[0]
    axes = np.concatenate([axes_of(one), -axes_of(other)])
    for point, shape in ((one, other), (other, one)):
        if len(point) == 1:
            # A vertex may be closest to the point; then no edge's normal shows the distance.
            between = shape - point
            nearest = between[np.hypot(*between.T).argmin()]
            size = np.hypot(*nearest)
            sign = 1 if point is one else -1
            axes = np.concatenate([axes, [sign * nearest / size] if size else np.empty((0, 2))])
    if len(axes) == 0:
        return 0.0
    apart = ((other @ axes.T).min(axis=0) - (one @ axes.T).max(axis=0)).max()
    return float(apart - 2e-15 * max(np.abs(one).max(), np.abs(other).max()))


def touching_pair(shapes: list[Floats], apart: int) -> tuple[int, int] | None:
    """Return the first two shapes, at least `apart` places from each other, that touch, or None."""
    for (i, one), (j, other) in itertools.combinations(enumerate(shapes), 2):
        if j - i >= apart and gap(one, other) <= 0:
            return i, j
    return None


def inscribed(polygon: Floats) -> tuple[Floats, float]:
    """Return centre, shape (2,), and radius of the largest disc within a convex polygon.

    The centre has the same distance from three edges, so all triples of edges are tried. For a
    polygon of more than 24 edges only 24 are, and the disc may be smaller than the largest.

    Args:
        polygon: Vertices counter-clockwise, shape (k, 2); two make a line segment.
    """
    middle = polygon.mean(axis=0)
    if len(polygon) < 3:
        return middle, 0.0
    normals = axes_of(polygon)
    ends = (normals * polygon).sum(axis=1)
    some = np.linspace(0, len(polygon) - 1, min(len(polygon), _MOST_EDGES)).astype(np.int64)
    triples = np.array(list(itertools.combinations(some.tolist(), 3)))
    rows = np.concatenate([normals[triples], np.ones((*triples.shape, 1))], axis=2)
    regular = np.abs(np.linalg.det(rows)) > _ROUNDING
    found = np.linalg.solve(rows[regular], ends[triples[regular]][..., None])[:, :2, 0]
    centres = np.concatenate([middle[None], found])
    radii = (ends - centres @ normals.T).min(axis=1)
    best = int(radii.argmax())
    return centres[best], float(radii[best])
