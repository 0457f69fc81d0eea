"""Convex shapes in the plane, as numpy sees them: reading them, and how far apart they are."""

import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrt.errors import BrrtError

Floats = NDArray[np.float64]

GREATEST = 1e100
"""Kernels square coordinates; beyond this they could not decide."""

_SLIGHTLY_BENT = 1e-9
"""A vertex may lie this part of its edges inside the hull: rounding does that to written files."""

_MOST_EDGES = 24
"""Edges of a polygon that a disc within is fitted to."""


def convex_polygon(name: str, values: Any) -> Floats:
    """Read a convex polygon; two vertices make a line segment.

    Vertices that repeat, or that lie on an edge, are left out.

    Args:
        name: What it is called in messages.
        values: Vertices in either sense of rotation, shape (k, 2).

    Returns:
        The vertices counter-clockwise, shape (k, 2).

    Raises:
        BrrtError: It is not a convex polygon in the plane.
    """
    what = f"{name} must be 2 or more vertices, each a pair of numbers"
    try:
        vertices = np.array(values, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise BrrtError(what) from None
    if vertices.ndim != 2 or vertices.shape[1] != 2 or len(vertices) < 2:
        raise BrrtError(what)
    if not (np.abs(vertices) <= GREATEST).all():
        raise BrrtError(f"{name} must hold finite numbers up to {GREATEST:g} only")
    vertices = vertices[(vertices != np.roll(vertices, 1, axis=0)).any(axis=1)]
    if len(vertices) < 2:
        raise BrrtError(f"{name} must have 2 or more different vertices; these are all the same")
    return vertices if len(vertices) == 2 else _hull_of_convex(name, vertices)


def convex_polygons(name: str, values: Sequence[Any]) -> tuple[Floats, ...]:
    """Read convex polygons, as `convex_polygon` reads one; most need no second look.

    Args:
        name: What they are called in messages.
        values: Vertices of each, shape (k, 2).

    Raises:
        BrrtError: One is not a convex polygon in the plane.
    """
    found: list[Floats | None] = [None] * len(values)
    alike: dict[int, list[int]] = {}
    for i, value in enumerate(values):
        if isinstance(value, list | np.ndarray) and len(value) > 2:
            alike.setdefault(len(value), []).append(i)
    for which in alike.values():
        try:
            several = np.array([values[i] for i in which], np.float64)
        except (TypeError, ValueError, OverflowError):
            continue
        if several.ndim != 3 or several.shape[2] != 2 or not (np.abs(several) <= GREATEST).all():
            continue
        cross, lengths, angles = _turns(several)
        # Told from flat and from bent by more than rounding: nothing to leave out, and no doubt.
        sure = (cross > _SLIGHTLY_BENT * lengths).all(axis=1) & (np.abs(angles - 2 * np.pi) < 1)
        for i, polygon in zip(np.flatnonzero(sure).tolist(), several[sure], strict=True):
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
    bent = turns < -_SLIGHTLY_BENT * lengths
    if bent.any() or abs(angle - 2 * np.pi) > 1:
        at = vertices[int(turns.argmin())]
        raise BrrtError(
            f"{name} is not convex at ({at[0]:g}, {at[1]:g}); split it into convex polygons"
        )
    while len(vertices) > 2 and (turns <= 0).any():
        vertices = np.delete(vertices, int(turns.argmin()), axis=0)
        turns, _, _ = _turns(vertices)
    if len(vertices) == 2:
        raise BrrtError(f"{name} has no area; give a line segment as its two ends")
    return vertices


def _cross(a: Floats, b: Floats) -> Floats:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def _turns(vertices: Floats) -> tuple[Floats, Floats, Floats]:
    """At each vertex the cross and the lengths' product of its edges; the angle of all turns.

    Args:
        vertices: Of one polygon or of several with as many vertices each, shape (..., k, 2).

    Returns:
        Shapes (..., k), (..., k) and (...).
    """
    after = np.roll(vertices, -1, axis=-2) - vertices
    before = np.roll(after, 1, axis=-2)
    cross = _cross(before, after)
    angle = np.arctan2(cross, (before * after).sum(axis=-1)).sum(axis=-1)
    sizes = [np.hypot(along[..., 0], along[..., 1]) for along in (before, after)]
    return cross, sizes[0] * sizes[1], np.asarray(angle)


def axes_of(vertices: Floats) -> Floats:
    """Directions that decide whether something is apart from shapes, of unit length.

    The outward normals of a polygon, counter-clockwise; a line segment's normals and directions,
    as if it were a rectangle; none for a point.

    Args:
        vertices: Of one shape or of several with as many vertices each, shape (..., k, 2).

    Returns:
        Directions, shape (..., m, 2).
    """
    k = vertices.shape[-2]
    if k < 2:
        return np.empty((*vertices.shape[:-2], 0, 2))
    along = np.roll(vertices, -1, axis=-2) - vertices
    # Divided by the greatest component first: the squares of tiny ones would vanish.
    along /= np.abs(along).max(axis=-1, keepdims=True)
    along /= np.hypot(along[..., 0], along[..., 1])[..., None]
    normals = np.stack([along[..., 1], -along[..., 0]], axis=-1)
    return np.concatenate([normals, along], axis=-2) if k == 2 else normals


def gap(one: Floats, other: Floats) -> float:
    """Lower bound of the distance between the hulls of two sets of vertices (separating axes).

    Not above zero if they touch; exact, but for 2e-15 of the lengths at hand by which it errs on
    the safe side, where a vertex faces an edge.

    Args:
        one: A point, a line segment or a convex polygon, counter-clockwise; shape (k, 2).
        other: Another, shape (m, 2).
    """
    one, other = one - other[0], other - other[0]
    axes = np.concatenate([axes_of(one), -axes_of(other)])
    for point, shape in ((one, other), (other, one)):
        if len(point) == 1:
            # The nearest point of a shape may be a vertex, and then no edge shows the distance.
            between = shape - point
            nearest = between[np.hypot(*between.T).argmin()]
            size = np.hypot(*nearest)
            sign = 1 if point is one else -1
            axes = np.concatenate([axes, [sign * nearest / size] if size else np.empty((0, 2))])
    if len(axes) == 0:
        return 0.0
    apart = ((other @ axes.T).min(axis=0) - (one @ axes.T).max(axis=0)).max()
    return float(apart - 2e-15 * max(np.abs(one).max(), np.abs(other).max()))


def touching_pair(parts: list[Floats], apart: int) -> tuple[int, int] | None:
    """Return the first two shapes that touch and are at least `apart` in the list, or None."""
    for (i, one), (j, other) in itertools.combinations(enumerate(parts), 2):
        if j - i >= apart and gap(one, other) <= 0:
            return i, j
    return None


def inscribed(polygon: Floats) -> tuple[Floats, float]:
    """Return the middle, shape (2,), and the radius of a largest disc within a convex polygon.

    The middle is as far from three edges, or four that are parallel in pairs: all triples are
    tried. Of polygons with many vertices only some edges are, so that the disc may be smaller than
    the largest; it is within in any case.

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
    sound = np.abs(np.linalg.det(rows)) > _SLIGHTLY_BENT
    found = np.linalg.solve(rows[sound], ends[triples[sound]][..., None])[:, :2, 0]
    places = np.concatenate([middle[None], found])
    radii = (ends - places @ normals.T).min(axis=1)
    best = int(radii.argmax())
    return places[best], float(radii[best])
