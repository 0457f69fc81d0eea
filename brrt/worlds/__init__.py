"""Worlds: a generator is one class and one line here, a file format one function and one line."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from brrt.errors import BrrtError, unknown
from brrt.files import read_text
from brrt.settings import pairs
from brrt.worlds.blocks import load_blocks
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
from brrt.worlds.movingai import load_grid
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

LOADERS: Mapping[str, Callable[[Path, str], World]] = {
    ".json": lambda path, text: _named(str(path), World.from_json(text)),
    ".map": load_grid,
    ".txt": load_blocks,
}
"""Readers of world files by the file's ending."""

_MAX_BYTES = 256_000_000


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
    path = Path(spec)
    if not spec:
        raise unknown("world", spec, GENERATORS)
    if path.suffix in LOADERS or path.exists():
        return load_world(path)
    if "/" in spec or path.suffix:
        raise BrrtError(f"{spec}: no such file")
    raise unknown("world", name, GENERATORS)


def load_world(path: Path) -> World:
    """Read a world from a file.

    Raises:
        BrrtError: The file cannot be read, or is not a world.
    """
    if path.suffix not in LOADERS:
        raise BrrtError(f"{path}: not a world that brrt reads; it reads {', '.join(LOADERS)}")
    text = read_text(path, "a world", _MAX_BYTES)
    try:
        return LOADERS[path.suffix](path, text)
    except BrrtError as error:
        message = str(error)
        raise BrrtError(
            message if message.startswith(str(path)) else f"{path}: {message}"
        ) from None


def _named(name: str, world: World) -> World:
    return replace(world, name=name)


__all__ = ["GENERATORS", "LOADERS", "Generator", "Grid", "World", "load_world", "make_world"]
