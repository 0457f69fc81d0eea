"""Worlds: a generator is one class and one line here, and so is a file format."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrt.errors import BrrtError, unknown
from brrt.files import is_file, is_there, read_bytes
from brrt.settings import pairs
from brrt.worlds.generators.courses import (
    Cube3D,
    Hurdles3D,
    Offset3D,
    Room3D,
    Tower3D,
    Window3D,
)
from brrt.worlds.generators.forests import Forest2D, Forest3D
from brrt.worlds.generators.generator import Generator
from brrt.worlds.generators.mazes import Maze2D, Maze3D, Rooms2D, Spiral2D
from brrt.worlds.generators.scattered import (
    Boxes2D,
    Boxes3D,
    Circles2D,
    Polygons2D,
    Spheres3D,
    Squares2D,
)
from brrt.worlds.generators.traps import BugTrap2D, BugTrap3D
from brrt.worlds.generators.walls import (
    Empty2D,
    Empty3D,
    Enclosure2D,
    Enclosure3D,
    Gap2D,
    Gap3D,
    Passage2D,
    Passage3D,
    Walls2D,
    Walls3D,
)
from brrt.worlds.loaders.blocks import Blocks
from brrt.worlds.loaders.geojson import GeoJson
from brrt.worlds.loaders.image import ImageMap
from brrt.worlds.loaders.json_world import JsonWorld
from brrt.worlds.loaders.loader import FileSpec, Loader
from brrt.worlds.loaders.movingai import GridMap, Scenarios
from brrt.worlds.loaders.ompl import Circles
from brrt.worlds.loaders.ros import RosMap
from brrt.worlds.occupancy import Grid
from brrt.worlds.world import World

GENERATORS: Mapping[str, type[Generator]] = {
    "circles2d": Circles2D,
    "squares2d": Squares2D,
    "boxes2d": Boxes2D,
    "polygons2d": Polygons2D,
    "boxes3d": Boxes3D,
    "spheres3d": Spheres3D,
    "forest2d": Forest2D,
    "forest3d": Forest3D,
    "maze2d": Maze2D,
    "maze3d": Maze3D,
    "rooms2d": Rooms2D,
    "spiral2d": Spiral2D,
    "gap2d": Gap2D,
    "gap3d": Gap3D,
    "passage2d": Passage2D,
    "passage3d": Passage3D,
    "walls2d": Walls2D,
    "walls3d": Walls3D,
    "enclosure2d": Enclosure2D,
    "enclosure3d": Enclosure3D,
    "bugtrap2d": BugTrap2D,
    "bugtrap3d": BugTrap3D,
    "empty2d": Empty2D,
    "empty3d": Empty3D,
    "cube3d": Cube3D,
    "window3d": Window3D,
    "tower3d": Tower3D,
    "room3d": Room3D,
    "hurdles3d": Hurdles3D,
    "offset3d": Offset3D,
}

LOADERS: Mapping[str, type[Loader]] = {
    "brrt": JsonWorld,
    "blocks": Blocks,
    "circles": Circles,
    "movingai": GridMap,
    "scenarios": Scenarios,
    "ros": RosMap,
    "image": ImageMap,
    "geojson": GeoJson,
}
"""By name; of those with the same ending, the first takes what none recognises."""

_HEAD = 65_536
"""Bytes that show what a file is."""

_LONGEST = 400
"""Characters of a message beyond the file's name: what a file holds may be quoted in it."""


def make_world(
    spec: str,
    start: NDArray[np.float64] | None = None,
    goal: NDArray[np.float64] | None = None,
    room: float = 0.0,
) -> World:
    """Make the world that a user names.

    Args:
        spec: A generator with parameters, such as `circles2d:n=50,max_radius=5`, or a file.
        start: Point that a generator keeps free, shape (d,).
        goal: Another.
        room: Distance to keep free around them, beyond a generator's own clearance.

    Raises:
        BrrtError: There is no such world, or it is not usable.
    """
    name, _, rest = spec.partition(":")
    if name in GENERATORS:
        settings = GENERATORS[name].parse(f"world {name}", pairs(f"world {spec}", rest))
        return settings.make(spec, start, goal, room)
    path, params, query = FileSpec.parse(spec)
    if not spec:
        raise unknown("world", spec, GENERATORS)
    if is_there(path) or _of_ending(path):
        world = load_world(path, pairs(f"world {spec}", params), query)
        return replace(world, name=spec) if params or query else world
    if "/" in str(path) or path.suffix:
        raise BrrtError(f"{path}: no such file")
    raise unknown("world", name, GENERATORS)


def world_beside(folder: Path, spec: str) -> str:
    """Return the specification of a file that lies in a folder, if it does, or else as it is."""
    beside = str(folder / spec)
    there = spec.partition(":")[0] not in GENERATORS and is_file(FileSpec.parse(beside).path)
    return beside if there else spec


def load_world(path: Path, params: Mapping[str, Any] | None = None, query: str = "") -> World:
    """Read a world from a file.

    Args:
        path: The file; its ending and what it begins with choose the loader.
        params: Settings of the loader.
        query: Which start and goal, of a file that has several.

    Raises:
        BrrtError: The file cannot be read, or is not a world.
    """
    try:
        name, loader = _loader(path)
        return loader.parse(f"loader {name}", params or {}).load(path, query)
    except BrrtError as error:
        message = str(error)
        if not message.startswith(str(path)):
            message = f"{path}: {message}"
        most = len(str(path)) + _LONGEST
        raise BrrtError(message if len(message) <= most else message[:most] + " ...") from None


def _loader(path: Path) -> tuple[str, type[Loader]]:
    """Choose by the ending and, where that does not decide, by content."""
    named = _of_ending(path)
    if len(named) == 1:
        return named[0]
    if is_there(path) and not is_file(path):
        raise BrrtError(f"{path}: not a file whose beginning tells what it is; {_READS}")
    head = read_bytes(path, "a world", _HEAD, rest=False)
    for name, loader in named or LOADERS.items():
        if loader.recognises(head):
            return name, loader
    if named:
        return named[0]
    raise BrrtError(f"{path}: not a world that brrt reads; {_READS}")


def _of_ending(path: Path) -> list[tuple[str, type[Loader]]]:
    ending = path.suffix.lower()
    return [(name, loader) for name, loader in LOADERS.items() if ending in loader.endings]


_READS = "it reads " + ", ".join(
    dict.fromkeys(ending for loader in LOADERS.values() for ending in loader.endings)
)

__all__ = [
    "GENERATORS",
    "LOADERS",
    "FileSpec",
    "Generator",
    "Grid",
    "Loader",
    "World",
    "load_world",
    "make_world",
    "world_beside",
]
