"""What stands still: the world, start and goal; and how thick, how high and how dark things are."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from brrt.robots import Robot
from brrt.scenario.manifest import Manifest
from brrt.views.colours import GOAL, OBSTACLE, OBSTACLE_3D, OUTLINE, START, Colour
from brrt.views.foxglove.messages import MAP, MARKERS, Marker, Shape, array, occupancy
from brrt.worlds.world import World

_POINT = 0.0012
"""A point of the screen in a window that shows the whole world, as a part of the world."""
_LAYER = 0.001
"""Height of a layer of a 2D world, likewise; only their order is seen from above."""
_MARK = 0.018
"""Diameter of a mark, likewise."""
_SEE_THROUGH = 0.45

WORLD, MAP_TOPIC, ENDS = "/viz/world", "/viz/map", ("/viz/start", "/viz/goal")

UNDER, GROUND, LINES, PATHS, BODIES, MARKS = (layer * _LAYER for layer in (-2, -1, 0, 1, 2, 3))
"""Heights of layers of a 2D world, as parts of the world."""


def segments(
    world: World, points: NDArray[np.floating], colour: Colour, width: float, layer: float = LINES
) -> Marker:
    """Return lines, each between two points, of a width in points of the screen."""
    z, scale = layer * world.extent, (width * _POINT * world.extent, 0.0, 0.0)
    return Marker(Shape.LINES, colour, scale, points, z=z)


def mark(world: World, place: NDArray[np.floating], colour: Colour, layer: float = MARKS) -> Marker:
    """Return a dot."""
    size, z = _MARK * world.extent, layer * world.extent
    shape = Shape.CYLINDER if world.dim == 2 else Shape.SPHERE
    thick = _LAYER * world.extent if world.dim == 2 else size
    return Marker(shape, colour, (size, size, thick), place=place, z=z)


def outline(robot: Robot, q: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the edges of the body at a configuration, two points each, shape (2 n, 2)."""
    parts = [np.stack([part, np.roll(part, -1, axis=0)], axis=1) for part in robot.outline(q)]
    return np.concatenate([np.empty((0, 2, 2)), *parts]).reshape(-1, 2)


def still(manifest: Manifest, world: World) -> Iterator[tuple[str, str, bytes]]:
    """Yield topic, type and message of what stands there from the beginning."""
    markers = _flat(world) if world.dim == 2 else _deep(world)
    yield WORLD, MARKERS, array([*_bounds(world), *markers])
    if world.grid is not None:
        yield MAP_TOPIC, MAP, occupancy(world.grid, UNDER * world.extent)
    robot = manifest.make_robot()
    ends = zip(ENDS, (manifest.start, manifest.goal), (START, GOAL), strict=True)
    for topic, end, colour in ends:
        q = np.array(end)
        yield topic, MARKERS, array(list(_end(world, robot, q, colour, topic)))


def _end(
    world: World, robot: Robot, q: NDArray[np.float64], colour: Colour, topic: str
) -> Iterator[Marker]:
    place, size = robot.places(q[None])[0], 1.5 * _MARK * world.extent
    yield mark(world, place, colour)
    below = place - size * np.eye(world.dim)[-1]
    text, z = topic.rpartition("/")[-1], MARKS * world.extent
    yield Marker(Shape.TEXT, colour, (0.0, 0.0, size), place=below, text=text, z=z)
    body = outline(robot, q)
    if len(body):
        yield segments(world, body, colour, 3.0, BODIES)


def _bounds(world: World) -> Iterator[Marker]:
    """Yield the edges of the bounds."""
    corners = np.array(np.meshgrid(*zip(world.lower, world.upper, strict=True))).T
    corners = corners.reshape(-1, world.dim)
    apart = (corners[:, None] != corners[None]).sum(axis=2)
    pairs = np.argwhere(np.triu(apart == 1))
    yield segments(world, corners[pairs].reshape(-1, world.dim), OUTLINE, 1.0, GROUND)


def _flat(world: World) -> Iterator[Marker]:
    """Yield the obstacles of a 2D world but its grid."""
    extent = world.extent
    for x, y, radius in world.balls:
        size = (2 * radius, 2 * radius, _LAYER * extent)
        yield Marker(Shape.CYLINDER, OBSTACLE, size, place=np.array([x, y]), z=GROUND * extent)
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
        yield Marker(Shape.TRIANGLES, OBSTACLE, size, triangles, z=GROUND * extent)
    # An edge keeps in sight what is too thin to have an inside.
    edges = [np.stack([hull, np.roll(hull, -1, axis=0)], axis=1) for hull in hulls]
    if edges:
        yield segments(world, np.concatenate(edges).reshape(-1, 2), OBSTACLE, 1.5, GROUND)


def _deep(world: World) -> Iterator[Marker]:
    """Yield the obstacles of a 3D world."""
    for box in world.boxes:
        low, high = box[:3], box[3:]
        size, middle = tuple((high - low).tolist()), (low + high) / 2
        yield Marker(Shape.CUBE, OBSTACLE_3D, size, place=middle, alpha=_SEE_THROUGH)
    for *centre, radius in world.balls:
        size = (2 * radius,) * 3
        place = np.array(centre)
        yield Marker(Shape.SPHERE, OBSTACLE_3D, size, place=place, alpha=_SEE_THROUGH)
