"""Worlds of cells and openings between them: mazes, rooms and a spiral."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from brrt.digits import against_limits
from brrt.errors import BrrtError
from brrt.settings import param
from brrt.worlds.arrays import Bools, Floats, Ints
from brrt.worlds.generators.box_subtraction import merge_cells
from brrt.worlds.generators.generator import Fixed, Length, ObstacleSet, Seeded

_WALL = 0.1
"""Default thickness of walls, as a fraction of the distance from cell to cell."""


def spanning_tree(shape: tuple[int, ...], rng: np.random.Generator) -> Ints:
    """Draw a random spanning tree of a grid of cells by depth-first search.

    Such trees have long winding branches.

    Args:
        shape: Number of cells along each axis.
        rng: Random number generator.

    Returns:
        Pairs of neighbours, as flat indices, shape (cells - 1, 2).
    """
    steps = np.concatenate(
        [np.eye(len(shape), dtype=np.int64), -np.eye(len(shape), dtype=np.int64)]
    )
    places = np.stack(np.unravel_index(np.arange(np.prod(shape)), shape), axis=1)
    around = places[:, None] + steps
    within = ((around >= 0) & (around < shape)).all(axis=2)
    flat = np.ravel_multi_index(tuple(np.moveaxis(around, 2, 0)), shape, mode="clip")
    untried = rng.permuted(np.where(within, flat, -1), axis=1).tolist()
    visited = bytearray(len(untried))
    visited[0] = True
    stack, pairs = [0], []
    while stack:
        cell = stack[-1]
        while untried[cell]:
            other = untried[cell].pop()
            if other >= 0 and not visited[other]:
                visited[other] = True
                pairs.append((cell, other))
                stack.append(other)
                break
        else:
            stack.pop()
    return np.array(pairs, np.int64).reshape(-1, 2)


def walls_between(shape: tuple[int, ...], open_pairs: Ints, edges: Floats) -> ObstacleSet:
    """Return the walls between cells, except between some pairs.

    Args:
        shape: Number of cells along each axis.
        open_pairs: Neighbours without a wall between them, as flat indices, shape (n, 2).
        edges: Where cells and walls begin and end alternately, shape (2 cells,).
    """
    blocked = np.ones([2 * n - 1 for n in shape], np.bool_)
    blocked[(slice(None, None, 2),) * len(shape)] = False
    one, other = (np.array(np.unravel_index(cells, shape)) for cells in open_pairs.T)
    blocked[tuple(one + other)] = False
    return ObstacleSet(boxes=merge_cells(blocked, edges))


def _edges(size: float, cells: int, wall: float) -> Floats:
    """Return where cells and walls begin and end alternately, up to the size, (2 cells,)."""
    corridor = (size - (cells - 1) * wall) / cells
    edges = np.arange(cells)[:, None] * (corridor + wall) + [0, corridor]
    edges[-1, 1] = size
    return edges.ravel()


def _check_wall(size: float, cells: int, wall: float) -> None:
    most = size / (cells - 1) if cells > 1 else size
    if wall >= most:
        text, _, limit = against_limits(wall, -np.inf, most)
        raise BrrtError(f"wall {text} leaves no room for {cells} cells; make it below {limit}")


@dataclass(frozen=True, slots=True)
class Maze2D(Seeded):
    """A perfect maze on a square map: exactly one way leads from any cell to any other.

    Start and goal are in the middle of opposite corner cells.
    """

    dim: ClassVar[int] = 2

    cells: int = param(10, "cells along each side", low=2, high=300)
    corridor: float | None = param(
        None, "width of the corridors; auto: what the walls leave", above=0
    )
    wall: float | None = param(
        None, "thickness of the walls; auto: what the corridors leave, or a tenth", above=0
    )

    def __post_init__(self) -> None:
        """Check that corridors and walls fit the map."""
        Seeded.__post_init__(self)
        if self.corridor is not None and self.wall is not None:
            raise BrrtError(
                "corridor and wall follow from each other, size and cells; give one of them"
            )
        if self.corridor is not None and self.corridor * self.cells >= self.size:
            text, _, limit = against_limits(self.corridor, -np.inf, self.size / self.cells)
            raise BrrtError(
                f"corridor {text} leaves no room for walls between {self.cells} cells; make it "
                f"below {limit}"
            )
        _check_wall(self.size, self.cells, self.thickness)

    @property
    def thickness(self) -> float:
        """Thickness of the walls."""
        if self.corridor is not None:
            return (self.size - self.cells * self.corridor) / (self.cells - 1)
        return _WALL * self.size / self.cells if self.wall is None else self.wall

    def ends(self, _room: float, /) -> tuple[Floats, Floats]:
        """Return the middles of two opposite corner cells."""
        edges = _edges(self.size, self.cells, self.thickness)
        first, last = edges[:2].mean(), edges[-2:].mean()
        return np.full(self.dim, first), np.full(self.dim, last)

    def obstacles(self, rng: np.random.Generator) -> ObstacleSet:
        """Draw which cells are connected, and return the other walls."""
        shape = (self.cells,) * self.dim
        edges = _edges(self.size, self.cells, self.thickness)
        return walls_between(shape, spanning_tree(shape, rng), edges)


@dataclass(frozen=True, slots=True)
class Maze3D(Maze2D):
    """A perfect maze in a cube, with ways up and down as well."""

    dim: ClassVar[int] = 3

    cells: int = param(5, "cells along each side", low=2, high=40)


@dataclass(frozen=True, slots=True)
class Rooms2D(Seeded):
    """Rooms in rows, with doors at random places in the walls between them.

    Doors connect all the rooms; some of the other walls have one too. Start and goal are in the
    middle of opposite corner rooms.
    """

    dim: ClassVar[int] = 2

    rooms: int = param(4, "rooms along each side", low=1, high=100)
    door: float | None = param(None, "width of the doors; auto: 0.3 of a room", above=0)
    wall: float | None = param(
        None, "thickness of the walls; auto: 0.1 of a room with its wall", above=0
    )
    loops: float = param(0.3, "share of the walls that need no door and have one", low=0, high=1)

    width = Length("door", 0.3, of="side")

    def __post_init__(self) -> None:
        """Check that doors and walls fit."""
        Seeded.__post_init__(self)
        _check_wall(self.size, self.rooms, self.thickness)
        if self.width > self.side:
            text, _, limit = against_limits(self.width, -np.inf, self.side)
            raise BrrtError(f"door {text} does not fit; a room's side is {limit}")

    @property
    def thickness(self) -> float:
        """Thickness of the walls."""
        return _WALL * self.size / self.rooms if self.wall is None else self.wall

    @property
    def side(self) -> float:
        """Side of a room."""
        return (self.size - (self.rooms - 1) * self.thickness) / self.rooms

    def ends(self, _room: float, /) -> tuple[Floats, Floats]:
        """Return the middles of two opposite corner rooms."""
        return np.full(2, self.side / 2), np.full(2, self.size - self.side / 2)

    def obstacles(self, rng: np.random.Generator) -> ObstacleSet:
        """Draw which walls have doors and where, and return the rest of the walls."""
        shape = (self.rooms, self.rooms)
        has_door = np.zeros((2, self.rooms, self.rooms), np.bool_)
        x, y = np.unravel_index(np.sort(spanning_tree(shape, rng), axis=1).T, shape)
        has_door[np.where(x[1] > x[0], 0, 1), x[0], y[0]] = True
        has_door |= rng.random(has_door.shape) < self.loops
        places = rng.random(has_door.shape)
        walls = [self._wall(0, i, has_door[0, i], places[0, i]) for i in range(self.rooms - 1)]
        walls += [
            self._wall(1, i, has_door[1, :, i], places[1, :, i]) for i in range(self.rooms - 1)
        ]
        return ObstacleSet(boxes=np.concatenate([np.empty((0, 4)), *walls]))

    def _wall(self, axis: int, i: int, has_door: Bools, places: Floats) -> Floats:
        """Return the wall between rows i and i + 1, across the map, except for its doors."""
        pitch = self.side + self.thickness
        doors = np.arange(self.rooms) * pitch + places * (self.side - self.width)
        doors = doors[has_door]
        begin = np.append(0.0, doors + self.width)
        end = np.append(doors, self.size)
        near = np.full(len(begin), i * pitch + self.side)
        along, across = (begin, end), (near, near + self.thickness)
        (x0, x1), (y0, y1) = (across, along) if axis == 0 else (along, across)
        return np.stack([x0, y0, x1, y1], axis=1)[begin < end]


@dataclass(frozen=True, slots=True)
class Spiral2D(Fixed):
    """One corridor that winds from a corner of a square map to its middle."""

    dim: ClassVar[int] = 2

    turns: int = param(3, "times that the corridor goes around the middle", low=1, high=100)
    wall: float | None = param(
        None, "thickness of the walls; auto: 0.1 of a corridor with its wall", above=0
    )

    def __post_init__(self) -> None:
        """Check that the walls fit the map."""
        Fixed.__post_init__(self)
        _check_wall(self.size, self.cells, self.thickness)

    @property
    def cells(self) -> int:
        """Number of corridor widths across the map, including the middle."""
        return 2 * self.turns + 1

    @property
    def thickness(self) -> float:
        """Thickness of the walls."""
        return _WALL * self.size / self.cells if self.wall is None else self.wall

    def ends(self, _room: float, /) -> tuple[Floats, Floats]:
        """Return the middle of the corridor's first cell, and of the map."""
        first = _edges(self.size, self.cells, self.thickness)[:2].mean()
        return np.full(2, first), np.full(2, self.size / 2)

    def obstacles(self) -> ObstacleSet:
        """Walk inwards along the cells that were not visited, always turning left."""
        shape = (self.cells, self.cells)
        left = np.arange(self.cells**2).reshape(shape)
        way = []
        while left.size:
            way.append(left[:, 0])
            left = np.rot90(left[:, 1:], -1)
        cells = np.concatenate(way)
        pairs = np.stack([cells[:-1], cells[1:]], axis=1)
        return walls_between(shape, pairs, _edges(self.size, self.cells, self.thickness))
