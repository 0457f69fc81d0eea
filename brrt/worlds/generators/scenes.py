"""Fixed 3D scenes, of our own design, in the style of the maps of a planning course."""

from abc import abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from brrt.settings import param
from brrt.worlds.arrays import Floats
from brrt.worlds.generators.box_subtraction import subtract_box
from brrt.worlds.generators.generator import Fixed, ObstacleSet

Point = tuple[float, float, float]
Box = tuple[float, float, float, float, float, float]


@dataclass(frozen=True, slots=True)
class Scene(Fixed):
    """A scene whose numbers are percent of its longest side."""

    dim: ClassVar[int] = 3
    far: ClassVar[Point]
    """Greatest corner of the bounds; the longest side is 100."""
    start: ClassVar[Point]
    goal: ClassVar[Point]

    size: float = param(100.0, "longest side of the map", above=0)

    @abstractmethod
    def boxes(self) -> list[Box] | Floats:
        """Return the obstacles as least and greatest corner."""

    def upper(self) -> Floats:
        """Return the greatest corner of the bounds, shape (3,)."""
        return np.array(self.far) * (self.size / 100)

    def ends(self, _room: float, /) -> tuple[Floats, Floats]:
        """Return the scene's own start and goal."""
        scale = self.size / 100
        return np.array(self.start) * scale, np.array(self.goal) * scale

    def obstacles(self) -> ObstacleSet:
        """Return the scaled boxes."""
        return ObstacleSet(boxes=np.array(self.boxes(), np.float64) * (self.size / 100))


@dataclass(frozen=True, slots=True)
class Cube3D(Scene):
    """A single cube between start and goal."""

    far: ClassVar[Point] = (100, 60, 60)
    start: ClassVar[Point] = (10, 30, 30)
    goal: ClassVar[Point] = (90, 30, 30)

    def boxes(self) -> list[Box]:
        """Return the cube."""
        return [(32, 12, 12, 68, 48, 48)]


@dataclass(frozen=True, slots=True)
class Window3D(Scene):
    """A wall with a window, a low wall before it and a cupboard behind it."""

    far: ClassVar[Point] = (100, 60, 50)
    start: ClassVar[Point] = (8, 48, 6)
    goal: ClassVar[Point] = (92, 24, 6)

    def boxes(self) -> Floats:
        """Return the wall around the window, then the low wall and the cupboard."""
        wall = subtract_box((46, 0, 0), (50, 60, 50), [(46, 18, 24), (50, 30, 36)])
        return np.concatenate([wall, [(22, 0, 0, 25, 60, 18), (62, 6, 0, 72, 42, 40)]])


@dataclass(frozen=True, slots=True)
class Tower3D(Scene):
    """A tower of seven floors; openings in the ceilings lead up, each in another corner."""

    far: ClassVar[Point] = (40, 40, 100)
    start: ClassVar[Point] = (6, 6, 5)
    goal: ClassVar[Point] = (6, 6, 95)

    def boxes(self) -> Floats:
        """Return a pillar through all floors, then the ceilings."""
        corners = ((27, 27), (3, 27), (27, 3), (3, 3), (27, 27), (3, 27))
        floors = [np.array([(16, 16, 0, 24, 24, 100)], np.float64)]
        for floor, (x, y) in enumerate(corners, 1):
            z = 100 * floor / 7
            hole = [(x, y, z - 1), (x + 10, y + 10, z + 1)]
            floors.append(subtract_box((0, 0, z - 1), (40, 40, z + 1), hole))
        return np.concatenate(floors)


@dataclass(frozen=True, slots=True)
class Room3D(Scene):
    """A furnished room: from under the table, through the door, to behind the sofa."""

    far: ClassVar[Point] = (100, 70, 30)
    start: ClassVar[Point] = (34, 32, 3)
    goal: ClassVar[Point] = (96, 30, 4)

    def boxes(self) -> Floats:
        """Return table, chairs, lamp, shelf, counter, sofa, and the wall with a door."""
        table: list[Box] = [
            (22, 24, 7, 46, 40, 8),
            *((x, y, 0, x + 1.5, y + 1.5, 7) for x in (22, 44.5) for y in (24, 38.5)),
        ]
        seats = [(x, y) for y in (19, 39.5) for x in (25, 37)]
        chairs = [part for x, y in seats for part in _chair(x, y, back_first=y < 30)]
        lamp: list[Box] = [(33.7, 31.7, 22, 34.3, 32.3, 30), (30, 28, 18, 38, 36, 22)]
        boards: list[Box] = [(5, 65, z, 45, 70, z + 0.6) for z in (0, 5.4, 10.8, 16.2, 21.6)]
        shelf: list[Box] = [
            (4.4, 65, 0, 5, 70, 22.2), *boards, (24.7, 65, 0, 25.3, 70, 22.2),
            (45, 65, 0, 45.6, 70, 22.2),
        ]  # fmt: skip
        counter: list[Box] = [(0, 0, 0, 40, 6, 9), (0, 0, 16, 40, 4, 23), (50, 0, 0, 58, 7, 20)]
        sofa: list[Box] = [
            (79, 18, 0, 89, 42, 4.5), (88, 18, 4.5, 91, 42, 9.5), (79, 18, 4.5, 88, 20.5, 7),
            (79, 39.5, 4.5, 88, 42, 7),
        ]  # fmt: skip
        wall = subtract_box((68, 0, 0), (70, 70, 30), [(68, 52, 0), (70, 61, 21)])
        return np.concatenate([table, chairs, lamp, shelf, counter, sofa, wall])


def _chair(x: float, y: float, *, back_first: bool) -> list[Box]:
    """Return seat, back and legs of a chair whose seat begins at (x, y)."""
    back = y if back_first else y + 5.4
    legs = [(x + i, y + j, 0.0, x + i + 0.6, y + j + 0.6, 4.2) for i in (0, 5.4) for j in (0, 5.4)]
    return [(x, y, 4.2, x + 6, y + 6, 4.8), (x, back, 4.8, x + 6, back + 0.6, 10), *legs]


@dataclass(frozen=True, slots=True)
class Hurdles3D(Scene):
    """Hurdles to fly over and beams to fly under, in turn."""

    far: ClassVar[Point] = (100, 24, 20)
    start: ClassVar[Point] = (4, 12, 3)
    goal: ClassVar[Point] = (96, 12, 3)

    def boxes(self) -> list[Box]:
        """Return hurdles on the floor and beams at the ceiling, of different heights."""
        hurdles = ((9, 10), (29, 14), (49, 16), (69, 13), (89, 9))
        beams = ((19, 5), (39, 7), (59, 4), (79, 6))
        boxes: list[Box] = [(x, 0, 0, x + 2, 24, z) for x, z in hurdles]
        return [*boxes, *((x, 0, z, x + 2, 24, 20) for x, z in beams)]


@dataclass(frozen=True, slots=True)
class Offset3D(Scene):
    """Walls with one hole each, at different places."""

    far: ClassVar[Point] = (100, 40, 40)
    start: ClassVar[Point] = (5, 20, 20)
    goal: ClassVar[Point] = (95, 20, 20)

    def boxes(self) -> Floats:
        """Return the walls around the holes."""
        holes = ((4, 4), (28, 24), (6, 28), (26, 5), (3, 18), (28, 28))
        walls = []
        for number, (y, z) in enumerate(holes):
            x = 13 + 14 * number
            hole = [(x, y, z), (x + 3, y + 8, z + 8)]
            walls.append(subtract_box((x, 0, 0), (x + 3, 40, 40), hole))
        return np.concatenate(walls)
