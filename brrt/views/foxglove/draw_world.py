"""Static markers: the world, start and goal; and the sizes, heights and forms of all markers."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from brrt.robots import Robot
from brrt.scenario.manifest import Manifest
from brrt.views.colours import GOAL, OBSTACLE, OBSTACLE_3D, OUTLINE, START, Colour
from brrt.views.foxglove.messages import (
    MAP,
    MARKERS,
    Marker,
    MarkerType,
    fits,
    marker_array,
    occupancy,
)
from brrt.worlds.world import World

_POINT = 0.0012
"""Size of a point of the screen in a window that shows the whole world, as a part of the world's
extent, like all sizes here."""
_LAYER = 0.001
"""Height of a layer of a 2D world; from above only their order is visible."""
_DOT = 0.018
"""Diameter of a dot."""
_ALPHA_3D = 0.45

WORLD, MAP_TOPIC, ENDS = "/viz/world", "/viz/map", ("/viz/start", "/viz/goal")

UNDER, GROUND, LINES, PATHS, BODIES, DOTS = (layer * _LAYER for layer in (-2, -1, 0, 1, 2, 3))
"""Heights of the layers of a 2D world."""


def line_list(
    world: World, points: NDArray[np.floating], colour: Colour, width: float, layer: float = LINES
) -> Marker:
    """Return lines, each between two points, with a width in points of the screen."""
    z, scale = layer * world.extent, (width * _POINT * world.extent, 0.0, 0.0)
    return Marker(MarkerType.LINES, colour, scale, points, z=z)


def dot(world: World, place: NDArray[np.floating], colour: Colour) -> Marker:
    """Return a disc in 2D, a ball in 3D."""
    size, flat = _DOT * world.extent, world.dim == 2
    shape = MarkerType.CYLINDER if flat else MarkerType.SPHERE
    scale = (size, size, _LAYER * world.extent if flat else size)
    return Marker(shape, colour, scale, place=place, z=DOTS * world.extent)


def outline(robot: Robot, q: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the edges of the body at a configuration, two points each, shape (2 n, d)."""
    edges, line = _edges(robot.outline(q)), robot.skeleton(q[None])[0]
    return edges if len(line) < 2 else pairs_along(line)


def pairs_along(line: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the pieces of a line, shape (k, d), two points each, shape (2 (k - 1), d)."""
    return np.stack([line[:-1], line[1:]], axis=1).reshape(-1, line.shape[1])


def static_messages(manifest: Manifest, world: World) -> Iterator[tuple[str, str, bytes]]:
    """Yield topic, type and message of everything that never changes."""
    if world.grid is not None and not fits(world.grid):
        world = world.without_grid()
    markers = _obstacles_2d(world) if world.dim == 2 else _obstacles_3d(world)
    yield WORLD, MARKERS, marker_array([_bounds(world), *markers])
    if world.grid is not None:
        yield MAP_TOPIC, MAP, occupancy(world.grid, UNDER * world.extent)
    robot = manifest.make_robot()
    ends = zip(ENDS, (manifest.start, manifest.goal), (START, GOAL), strict=True)
    for topic, end, colour in ends:
        q = np.array(end)
        yield topic, MARKERS, marker_array(list(_end(world, robot, q, colour, topic)))


def _end(
    world: World, robot: Robot, q: NDArray[np.float64], colour: Colour, topic: str
) -> Iterator[Marker]:
    """Yield a dot, its name below it, and the body."""
    place, size = robot.places(q[None])[0], 1.5 * _DOT * world.extent
    yield dot(world, place, colour)
    below = place - size * np.eye(world.dim)[-1]
    text, z = topic.rpartition("/")[-1], DOTS * world.extent
    yield Marker(MarkerType.TEXT, colour, (0.0, 0.0, size), place=below, text=text, z=z)
    body = outline(robot, q)
    if len(body):
        yield line_list(world, body, colour, 3.0, BODIES)


def _bounds(world: World) -> Marker:
    """Return the edges of the bounds."""
    corners = np.array(np.meshgrid(*zip(world.lower, world.upper, strict=True))).T
    corners = corners.reshape(-1, world.dim)
    different = (corners[:, None] != corners[None]).sum(axis=2)
    pairs = np.argwhere(np.triu(different == 1))
    return line_list(world, corners[pairs].reshape(-1, world.dim), OUTLINE, 1.0, GROUND)


def _obstacles_2d(world: World) -> Iterator[Marker]:
    """Yield the obstacles of a 2D world except its grid."""
    extent = world.extent
    for x, y, radius in world.balls:
        size = (2 * radius, 2 * radius, _LAYER * extent)
        place = np.array([x, y])
        yield Marker(MarkerType.CYLINDER, OBSTACLE, size, place=place, z=GROUND * extent)
    boxes = list(world.boxes[:, [0, 1, 2, 1, 2, 3, 0, 3]].reshape(-1, 4, 2))
    outside = [] if world.grid is None else world.grid.outside(world.lower, world.upper)
    hulls = [*boxes, *world.polygons, *outside]
    fans = [
        np.stack([np.broadcast_to(hull[0], hull[2:].shape), hull[1:-1], hull[2:]], axis=1)
        for hull in hulls
        if len(hull) > 2
    ]
    if fans:
        triangles = np.concatenate(fans).reshape(-1, 2)
        size = (1.0, 1.0, 1.0)
        yield Marker(MarkerType.TRIANGLES, OBSTACLE, size, triangles, z=GROUND * extent)
    if hulls:  # an edge shows what is too thin to have an inside
        yield line_list(world, _edges(hulls), OBSTACLE, 1.5, GROUND)


def _edges(hulls: list[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Return the edges of polygons, two points each, shape (2 n, 2)."""
    edges = [np.stack([hull, np.roll(hull, -1, axis=0)], axis=1) for hull in hulls]
    return np.concatenate([np.empty((0, 2, 2)), *edges]).reshape(-1, 2)


def _obstacles_3d(world: World) -> Iterator[Marker]:
    for box in world.boxes:
        low, high = box[:3], box[3:]
        size, middle = tuple((high - low).tolist()), (low + high) / 2
        yield Marker(MarkerType.CUBE, OBSTACLE_3D, size, place=middle, alpha=_ALPHA_3D)
    for *centre, radius in world.balls:
        size, place = (2 * radius,) * 3, np.array(centre)
        yield Marker(MarkerType.SPHERE, OBSTACLE_3D, size, place=place, alpha=_ALPHA_3D)
