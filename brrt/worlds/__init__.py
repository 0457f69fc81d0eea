"""Worlds: bounds and obstacles, generated from a seed or loaded from a file.

A new generator or file format is one class and one line in a registry below.
"""

from codecs import BOM_UTF8
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from brrt.errors import BrrtError, unknown
from brrt.files import is_file, is_there, read_bytes
from brrt.registry import Registry
from brrt.settings import parse_pairs
from brrt.worlds.file_spec import FileSpec
from brrt.worlds.occupancy import Grid
from brrt.worlds.world import World

if TYPE_CHECKING:
    from brrt.worlds.generators.generator import Generator
    from brrt.worlds.loaders.loader import Loader

_GENERATORS = "brrt.worlds.generators"
_LOADERS = "brrt.worlds.loaders"

GENERATORS: "Registry[type[Generator]]" = Registry(
    {
        "circles2d": f"{_GENERATORS}.scattered:Circles2D",
        "squares2d": f"{_GENERATORS}.scattered:Squares2D",
        "boxes2d": f"{_GENERATORS}.scattered:Boxes2D",
        "polygons2d": f"{_GENERATORS}.scattered:Polygons2D",
        "boxes3d": f"{_GENERATORS}.scattered:Boxes3D",
        "spheres3d": f"{_GENERATORS}.scattered:Spheres3D",
        "forest2d": f"{_GENERATORS}.forests:Forest2D",
        "forest3d": f"{_GENERATORS}.forests:Forest3D",
        "maze2d": f"{_GENERATORS}.mazes:Maze2D",
        "maze3d": f"{_GENERATORS}.mazes:Maze3D",
        "rooms2d": f"{_GENERATORS}.mazes:Rooms2D",
        "spiral2d": f"{_GENERATORS}.mazes:Spiral2D",
        "gap2d": f"{_GENERATORS}.walls:Gap2D",
        "gap3d": f"{_GENERATORS}.walls:Gap3D",
        "passage2d": f"{_GENERATORS}.walls:Passage2D",
        "passage3d": f"{_GENERATORS}.walls:Passage3D",
        "walls2d": f"{_GENERATORS}.walls:Walls2D",
        "walls3d": f"{_GENERATORS}.walls:Walls3D",
        "enclosure2d": f"{_GENERATORS}.walls:Enclosure2D",
        "enclosure3d": f"{_GENERATORS}.walls:Enclosure3D",
        "bugtrap2d": f"{_GENERATORS}.bug_traps:BugTrap2D",
        "bugtrap3d": f"{_GENERATORS}.bug_traps:BugTrap3D",
        "empty2d": f"{_GENERATORS}.walls:Empty2D",
        "empty3d": f"{_GENERATORS}.walls:Empty3D",
        "cube3d": f"{_GENERATORS}.scenes:Cube3D",
        "window3d": f"{_GENERATORS}.scenes:Window3D",
        "tower3d": f"{_GENERATORS}.scenes:Tower3D",
        "room3d": f"{_GENERATORS}.scenes:Room3D",
        "hurdles3d": f"{_GENERATORS}.scenes:Hurdles3D",
        "offset3d": f"{_GENERATORS}.scenes:Offset3D",
    },
    group="brrt.worlds",
    base=f"{_GENERATORS}.generator:Generator",
)

LOADERS: "Registry[type[Loader]]" = Registry(
    {
        "brrt": f"{_LOADERS}.json_world:JsonWorld",
        "blocks": f"{_LOADERS}.blocks:Blocks",
        "circles": f"{_LOADERS}.ompl:OmplCircles",
        "movingai": f"{_LOADERS}.movingai:GridMap",
        "scenarios": f"{_LOADERS}.movingai:GridScenarios",
        "ros": f"{_LOADERS}.ros:RosMap",
        "image": f"{_LOADERS}.image:ImageMap",
        "geojson": f"{_LOADERS}.geojson:GeoJson",
    },
    group="brrt.loaders",
    base=f"{_LOADERS}.loader:Loader",
)
"""Where several have the same suffix and none recognises a file, the first of them reads it."""

_HEAD_BYTES = 65_536
"""How much of a file is read to recognise its format."""

_LONGEST_MESSAGE = 400
"""Maximum characters of a message after the file's name; messages quote what a file contains."""


def make_world(
    spec: str,
    start: NDArray[np.float64] | None = None,
    goal: NDArray[np.float64] | None = None,
    room: float = 0.0,
) -> World:
    """Generate a world or load one from a file.

    Args:
        spec: A generator with parameters, such as `circles2d:n=50,max_radius=5`, or a file, such
            as `map.yaml:unknown=free` or `arena.map.scen#12`.
        start: Where the query starts, shape (d,). Scattered obstacles and trees of a generated
            world that are close to it are left out; the others do not depend on the query.
        goal: Where it ends.
        room: How close, in addition to 1 % of the world's size.

    Raises:
        BrrtError: There is no such generator or file, or a parameter is wrong.
    """
    name, _, rest = spec.partition(":")
    if name in GENERATORS:
        generator = GENERATORS[name].parse(f"world {name}", parse_pairs(f"world {spec}", rest))
        return generator.make(spec, start, goal, room)
    path, params, query = FileSpec.parse(spec)
    if not spec:
        raise unknown("world", spec, GENERATORS)
    if is_there(path) or _loaders_for(path):
        world = load_world(path, parse_pairs(f"world {spec}", params), query)
        return replace(world, name=spec) if params or query else world
    if "/" in str(path) or path.suffix:
        raise BrrtError(f"{path}: no such file")
    raise unknown("world", name, GENERATORS)


def world_beside(folder: Path, spec: str) -> str:
    """Return `spec` relative to a folder if that is an existing file, and `spec` otherwise."""
    beside = str(folder / spec)
    exists = spec.partition(":")[0] not in GENERATORS and is_file(FileSpec.parse(beside).path)
    return beside if exists else spec


def load_world(path: Path | str, params: Mapping[str, Any] | None = None, query: str = "") -> World:
    """Load a world from a file; `brrt worlds list` shows the formats.

    Args:
        path: The file. Its suffix and its first bytes decide which loader reads it.
        params: Settings of the loader.
        query: Which start and goal, of a file with several, such as "12".

    Raises:
        BrrtError: The file cannot be read or is not a world.
    """
    path = Path(path)
    try:
        name, loader = _choose_loader(path)
        return loader.parse(f"loader {name}", params or {}).load(path, query)
    except BrrtError as error:
        message = str(error)
        if not message.startswith(str(path)):
            message = f"{path}: {message}"
        most = len(str(path)) + _LONGEST_MESSAGE
        raise BrrtError(message if len(message) <= most else message[:most] + " ...") from None


def _choose_loader(path: Path) -> tuple[str, "type[Loader]"]:
    """Choose a loader by the suffix and, if several or none have it, by the file's first bytes.

    Loaders of plug-ins are asked once none of brrt's own has the suffix or recognises the file.
    """
    candidates = _loaders_for(path)
    if len(candidates) == 1 and not is_file(path):
        return candidates[0]
    if is_there(path) and not is_file(path):
        raise BrrtError(f"{path}: not a regular file, and its name has no {_suffixes()}")
    head = read_bytes(path, "a world", _HEAD_BYTES, rest=False).removeprefix(BOM_UTF8)
    own = candidates or LOADERS.own.items()
    found = next(((name, loader) for name, loader in own if loader.recognises(head)), None)
    if found is not None:
        return found
    others = LOADERS.plugins()
    for name, loader in _with_suffix(path, others) if candidates else others.items():
        if loader.recognises(head):
            return name, loader
    if candidates:
        return candidates[0]
    raise BrrtError(f"{path}: unknown format; brrt loads worlds from {_suffixes()}")


def _loaders_for(path: Path) -> list[tuple[str, "type[Loader]"]]:
    """Return brrt's own loaders for a suffix, or those of plug-ins if it has none."""
    return _with_suffix(path, LOADERS.own) or _with_suffix(path, LOADERS.plugins())


def _with_suffix(
    path: Path, loaders: "Mapping[str, type[Loader]]"
) -> list[tuple[str, "type[Loader]"]]:
    suffix = path.suffix.lower()
    return [(name, loader) for name, loader in loaders.items() if suffix in loader.endings]


def _suffixes() -> str:
    suffixes = (suffix for loader in LOADERS.working().values() for suffix in loader.endings)
    return ", ".join(dict.fromkeys(suffixes))


__all__ = [
    "GENERATORS",
    "LOADERS",
    "FileSpec",
    "Grid",
    "World",
    "load_world",
    "make_world",
    "world_beside",
]
