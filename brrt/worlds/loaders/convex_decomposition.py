"""Convex decomposition of polygons with holes, by shapely."""

from collections import deque

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import Polygon

from brrt.errors import BrrtError
from brrt.worlds.arrays import Floats

Piece = tuple[int, ...]
"""Vertices by their numbers, counter-clockwise."""

_CLEARLY = 1e-9
"""Sine of a corner's angle below which rounding leaves open whether the corner is convex."""

MOST_VERTICES = 30_000
"""Maximum vertices of a polygon: decomposition then takes seconds, growing with their square."""


def convex_pieces(where: str, rings: list[Floats]) -> list[Floats]:
    """Decompose a polygon into convex pieces whose vertices are its own.

    A convex polygon is returned as it is. Others are triangulated (constrained Delaunay), and
    triangles are merged over common edges as long as the result is convex (Hertel and Mehlhorn
    1983).

    Args:
        where: File and place, for messages.
        rings: The outline and its holes, each closed, shape (k, 2).

    Returns:
        Pieces that touch and do not overlap, vertices counter-clockwise, shape (k, 2) each.

    Raises:
        BrrtError: The polygon crosses itself or touches itself along a line, or has no area.
    """
    if sum(map(len, rings)) > MOST_VERTICES:
        raise BrrtError(f"{where}more than {MOST_VERTICES:,} vertices; simplify the polygon")
    with np.errstate(all="ignore"):
        polygon = Polygon(rings[0], rings[1:])
        if not polygon.is_valid:
            why, _, place = shapely.is_valid_reason(polygon).partition("[")
            at = f" at {place.rstrip(']')}" if place else ""
            raise BrrtError(f"{where}not a polygon that encloses an area: {why}{at}")
        outline = rings[0][:-1]
        if len(rings) == 1 and _is_convex(outline):
            ccw = shapely.is_ccw(polygon.exterior)
            return [outline if ccw else np.ascontiguousarray(outline[::-1])]
        triangles = shapely.get_parts(shapely.constrained_delaunay_triangles(polygon))
    corners = shapely.get_coordinates(triangles).reshape(-1, 4, 2)[:, :3]
    vertices, numbers = np.unique(corners.reshape(-1, 2), axis=0, return_inverse=True)
    turned = _turn(*corners.transpose(1, 0, 2)) < 0
    numbered = numbers.reshape(-1, 3)
    numbered[turned] = numbered[turned][:, ::-1]
    return [vertices[list(piece)] for piece in _merge(vertices, numbered)]


def _turn(a: Floats, b: Floats, c: Floats) -> Floats:
    """Return the sine of the turn at `b`, left being positive; shape (n,)."""
    u, v = b - a, c - b
    area = u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]
    length = np.hypot(*np.moveaxis(u, -1, 0)) * np.hypot(*np.moveaxis(v, -1, 0))
    return np.asarray(area / np.maximum(length, np.finfo(float).tiny))


def _is_convex(outline: Floats) -> bool:
    """Whether a simple polygon clearly turns in one direction, or not at all, at every vertex."""
    turns = _turn(np.roll(outline, 1, axis=0), outline, np.roll(outline, -1, axis=0))
    clear = (turns == 0) | (np.abs(turns) > _CLEARLY)
    return bool(clear.all() and ((turns >= 0).all() or (turns <= 0).all()))


def _merge(vertices: Floats, triangles: NDArray[np.intp]) -> list[Piece]:
    """Merge pieces over their common edges where the result is convex."""
    pieces: dict[int, Piece] = {i: tuple(t) for i, t in enumerate(triangles.tolist())}
    owner = {edge: i for i, piece in pieces.items() for edge in _edges(piece)}
    waiting = deque(edge for edge in owner if edge[0] < edge[1] and edge[::-1] in owner)
    while waiting:
        edge = waiting.popleft()
        one, other = owner[edge], owner[edge[::-1]]
        merged = _merge_pair(pieces[one], pieces[other], edge)
        if one == other or not _is_convex_at(vertices, merged, edge):
            continue
        for side in _edges(pieces.pop(other)):
            owner[side] = one
        pieces[one] = merged
    return list(pieces.values())


def _edges(piece: Piece) -> list[tuple[int, int]]:
    return list(zip(piece, (*piece[1:], piece[0]), strict=True))


def _merge_pair(one: Piece, other: Piece, edge: tuple[int, int]) -> Piece:
    """Return the outline of two pieces with a common edge, which leads from a to b in `one`."""
    a, b = edge
    i, j = one.index(b), other.index(a)
    return (*one[i:], *one[:i], *(*other[j:], *other[:j])[1:-1])


def _is_convex_at(vertices: Floats, piece: Piece, edge: tuple[int, int]) -> bool:
    """Whether a piece's corners at two vertices are clearly convex, or exactly straight."""
    for vertex in edge:
        i = piece.index(vertex)
        before, after = piece[i - 1], piece[(i + 1) % len(piece)]
        turn = float(_turn(vertices[before], vertices[vertex], vertices[after]))
        if turn != 0 and turn < _CLEARLY:
            return False
    return True
