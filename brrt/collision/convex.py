"""Convex shapes in the plane, as complex numbers, and how far they are apart.

Arrays of many shapes have the vertices or axes of a shape along their first axis: numpy is slow
along a short last one.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Complex = NDArray[np.complex128]


class ConvexShapes(NamedTuple):
    """Convex shapes, padded to equal length by repeating their first vertex and axis.

    Attributes:
        vertices: Vertices, shape (k, n).
        axes: Outward normals of the sides, for a line segment also its directions, shape (m, n).
        radius: By how much each shape is inflated, shape (n,).
    """

    vertices: Complex
    axes: Complex
    radius: Floats


def convex_shapes(hulls: list[Floats], radius: Floats | None = None) -> ConvexShapes:
    """Convert convex polygons, line segments and points, shape (k, 2) each, counter-clockwise."""
    vertices, axes = [], []
    for hull in hulls:
        z = hull[:, 0] + 1j * hull[:, 1]
        sides = np.roll(z, -1) - z
        sides = sides[sides != 0]
        sides = sides / np.abs(sides)
        along = sides if len(sides) == 2 else sides[:0]
        vertices.append(z)
        axes.append(np.concatenate([-1j * sides, along]) if len(sides) else np.ones(1, complex))
    return ConvexShapes(
        _padded(vertices), _padded(axes), np.zeros(len(hulls)) if radius is None else radius
    )


def _padded(rows: list[Complex]) -> Complex:
    most = max((len(row) for row in rows), default=1)
    padded = [np.concatenate([row, np.full(most - len(row), row[0])]) for row in rows]
    return np.ascontiguousarray(np.array(padded, complex).reshape(-1, most).T)


def along(axis: Complex, z: Complex) -> Floats:
    """Return the coordinates of points along an axis, shape (k, n) for (n,) and (k, n)."""
    return np.asarray(axis.real * z.real + axis.imag * z.imag)


def separation(
    one: Complex, normals: Complex, other: Complex, others: Complex
) -> tuple[Floats, Complex]:
    """Return the greatest separation along a normal of either shape, and that normal.

    Args:
        one: Vertices of shapes, shape (k, n).
        normals: Their axes, shape (m, n).
        other: Vertices of others.
        others: Their axes.

    Returns:
        The separations, above 0 where the shapes are disjoint, and the axes, from the one to the
        other; shapes (n,).
    """
    # Relative to a vertex, so that shapes far from the origin are not rounded more.
    one, other = one - one[0], other - one[0]
    best, axis = np.full(one.shape[1], -np.inf), np.zeros(one.shape[1], complex)
    for direction in (*normals, *-others):
        apart = along(direction, other).min(axis=0) - along(direction, one).max(axis=0)
        better = apart > best
        best, axis = np.where(better, apart, best), np.where(better, direction, axis)
    return best, axis


def distances(
    one: Complex, normals: Complex, other: Complex, others: Complex
) -> tuple[Floats, Complex]:
    """Return distances as `separation` does, where shapes are disjoint those of nearest points."""
    apart, axis = separation(one, normals, other, others)
    best = np.full(len(apart), np.inf)
    for points, shape, sides, sign in ((one, other, others, -1), (other, one, normals, 1)):
        for point in points:
            gap, way = from_point(shape, sides, point)
            nearer = (gap < best) & (apart >= 0)
            best, axis = np.where(nearer, gap, best), np.where(nearer, sign * way, axis)
    return np.where(apart < 0, apart, best), axis


def from_point(shape: Complex, normals: Complex, point: Complex) -> tuple[Floats, Complex]:
    """Return distances of points from shapes, below 0 inside, and the direction to the point.

    Args:
        shape: Vertices, shape (k, n).
        normals: Axes, shape (m, n).
        point: The points, shape (n,).
    """
    offset, sides = point - shape, np.roll(shape, -1, axis=0) - shape
    square = np.abs(sides) ** 2
    part = (offset * sides.conj()).real / np.where(square > 0, square, 1.0)
    ways = offset - np.clip(part, 0, 1) * sides
    gaps = np.abs(ways)
    nearest = gaps.argmin(axis=0)[None]
    gap = np.take_along_axis(gaps, nearest, 0)[0]
    way = np.take_along_axis(ways, nearest, 0)[0]
    deepest, _ = separation(shape, normals, point[None], normals[:0])
    return np.where(deepest < 0, deepest, gap), way / np.where(gap > 0, gap, 1.0)
