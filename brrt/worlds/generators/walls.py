"""Worlds of walls: gaps, passages, dividing walls, enclosures, and an empty map."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from brrt.settings import param
from brrt.worlds.arrays import Floats
from brrt.worlds.generators.box_subtraction import subtract_box
from brrt.worlds.generators.generator import Fixed, Length, ObstacleSet


@dataclass(frozen=True, slots=True)
class Empty2D(Fixed):
    """A square map without obstacles."""

    dim: ClassVar[int] = 2

    def obstacles(self) -> ObstacleSet:
        """Return no obstacles."""
        return ObstacleSet()


@dataclass(frozen=True, slots=True)
class Empty3D(Empty2D):
    """A cube without obstacles."""

    dim: ClassVar[int] = 3


@dataclass(frozen=True, slots=True)
class Gap2D(Fixed):
    """A wall across a square map with one gap."""

    dim: ClassVar[int] = 2

    gap: float | None = param(None, "width of the gap; auto: 0.06 of the size", above=0)
    wall: float | None = param(None, "thickness of the wall; auto: 0.04 of the size", above=0)
    position: float = param(
        0.75, "where along y the gap is: 0 at one end, 1 at the other", low=0, high=1
    )

    width = Length("gap", 0.06)
    thickness = Length("wall", 0.04)

    def __post_init__(self) -> None:
        """Check that gap and wall fit the map."""
        Fixed.__post_init__(self)
        self.check_fits(("gap", self.width, self.size), ("wall", self.thickness, 0.8 * self.size))

    def positions(self) -> list[float]:
        """Return where the gap is along the axes that the wall spans, 0 to 1 each."""
        return [self.position]

    def ends(self, room: float) -> tuple[Floats, Floats]:
        """Return opposite corners, at most half way to the wall."""
        return self.opposite_corners(room, (1 - self.thickness / self.size) / 4)

    def obstacles(self) -> ObstacleSet:
        """Return the wall around the gap."""
        first = np.array(self.positions()) * (self.size - self.width)
        low, high = np.zeros(self.dim), np.full(self.dim, self.size)
        low[0] = (self.size - self.thickness) / 2
        high[0] = (self.size + self.thickness) / 2
        hole = [[low[0], *first], [high[0], *(first + self.width)]]
        return ObstacleSet(boxes=subtract_box(low, high, hole))


@dataclass(frozen=True, slots=True)
class Gap3D(Gap2D):
    """A wall across a cube with one square gap."""

    dim: ClassVar[int] = 3

    height: float = param(
        0.25, "where along z the gap is: 0 at the floor, 1 at the ceiling", low=0, high=1
    )

    def positions(self) -> list[float]:
        """Return where the gap is along y and z."""
        return [self.position, self.height]


@dataclass(frozen=True, slots=True)
class Passage2D(Gap2D):
    """A long narrow passage through a thick wall across a square map."""

    gap: float | None = param(None, "width of the passage; auto: 0.03 of the size", above=0)
    wall: float | None = param(None, "its length; auto: 0.5 of the size", above=0)

    width = Length("gap", 0.03)
    thickness = Length("wall", 0.5)


@dataclass(frozen=True, slots=True)
class Passage3D(Gap3D):
    """A long narrow passage, square in section, through a thick wall across a cube."""

    gap: float | None = param(None, "width of the passage; auto: 0.08 of the size", above=0)
    wall: float | None = param(None, "its length; auto: 0.5 of the size", above=0)

    width = Length("gap", 0.08)
    thickness = Length("wall", 0.5)


@dataclass(frozen=True, slots=True)
class Walls2D(Fixed):
    """Walls that divide a square map, open at alternating ends."""

    dim: ClassVar[int] = 2
    openings: ClassVar[tuple[tuple[int, bool], ...]] = ((1, True), (1, False))
    """Axis along which walls are open, in turn, and whether at its upper end."""

    walls: int = param(3, "number of walls", low=0, high=1000)
    gap: float | None = param(None, "width of the openings; auto: 0.1 of the size", above=0)
    wall: float | None = param(
        None, "thickness of the walls; auto: 0.2 of their distance, at most 0.03 of the size",
        above=0,
    )  # fmt: skip

    width = Length("gap", 0.1)

    def __post_init__(self) -> None:
        """Check that openings and walls fit the map."""
        Fixed.__post_init__(self)
        self.check_fits(("gap", self.width, self.size), ("wall", self.thickness, 0.9 * self.pitch))

    @property
    def pitch(self) -> float:
        """Distance from wall to wall."""
        return 0.8 * self.size / max(self.walls, 1)

    @property
    def thickness(self) -> float:
        """Thickness of the walls."""
        return min(0.2 * self.pitch, 0.03 * self.size) if self.wall is None else self.wall

    def ends(self, room: float) -> tuple[Floats, Floats]:
        """Return opposite corners, at most half way to the next wall."""
        return self.opposite_corners(room, 0.05 + (self.pitch - self.thickness) / self.size / 4)

    def obstacles(self) -> ObstacleSet:
        """Return the walls, along x."""
        boxes = [np.empty((0, 2 * self.dim))]
        for i in range(self.walls):
            low, high = np.zeros(self.dim), np.full(self.dim, self.size)
            middle = 0.1 * self.size + (i + 0.5) * self.pitch
            low[0], high[0] = middle - self.thickness / 2, middle + self.thickness / 2
            hole = np.stack([low, high])
            axis, at_end = self.openings[i % len(self.openings)]
            hole[:, axis] = (self.size - self.width, self.size) if at_end else (0.0, self.width)
            boxes.append(subtract_box(low, high, hole))
        return ObstacleSet(boxes=np.concatenate(boxes))


@dataclass(frozen=True, slots=True)
class Walls3D(Walls2D):
    """Walls that divide a cube, open along one side after the other."""

    dim: ClassVar[int] = 3
    openings: ClassVar[tuple[tuple[int, bool], ...]] = (
        (1, True), (2, False), (1, False), (2, True),
    )  # fmt: skip


@dataclass(frozen=True, slots=True)
class Enclosure2D(Fixed):
    """Start and goal each in a square that is open on the side away from the other."""

    dim: ClassVar[int] = 2

    side: float | None = param(None, "side of the boxes; auto: 0.25 of the size", above=0)
    wall: float | None = param(None, "thickness of their walls; auto: 0.1 of the side", above=0)
    gap: float | None = param(None, "width of their openings; auto: the whole side", above=0)

    outside = Length("side", 0.25)
    thickness = Length("wall", 0.1, of="outside")

    def __post_init__(self) -> None:
        """Check that walls and openings fit the boxes, and the boxes the map."""
        Fixed.__post_init__(self)
        self.check_fits(
            ("side", self.outside, 0.4 * self.size),
            ("wall", self.thickness, 0.45 * self.outside),
            ("gap", self.gap or 0.0, self.outside - 2 * self.thickness),
        )

    def ends(self, _room: float, /) -> tuple[Floats, Floats]:
        """Return the middles of the boxes."""
        start, goal = np.full((2, self.dim), 0.5 * self.size)
        start[0], goal[0] = 0.25 * self.size, 0.75 * self.size
        return start, goal

    def obstacles(self) -> ObstacleSet:
        """Return the box around the start and its mirror image around the goal."""
        middle, _ = self.ends(0.0)
        inner = self.outside / 2 - self.thickness
        gap = 2 * inner if self.gap is None else self.gap
        boxes = hollow_box(middle, self.outside, self.thickness, gap)
        mirror = boxes.copy()
        mirror[:, 0], mirror[:, self.dim] = self.size - boxes[:, self.dim], self.size - boxes[:, 0]
        return ObstacleSet(boxes=np.concatenate([boxes, mirror]))


@dataclass(frozen=True, slots=True)
class Enclosure3D(Enclosure2D):
    """Start and goal each in a box that is open on the side away from the other."""

    dim: ClassVar[int] = 3


def hollow_box(middle: Floats, side: float, wall: float, gap: float) -> Floats:
    """Return the walls of a hollow box with a square opening on its lower side along x.

    Args:
        middle: Its middle, shape (d,).
        side: Length of its sides.
        wall: Thickness of its walls.
        gap: Width of the opening.

    Returns:
        Boxes as least and greatest corner, shape (k, 2 d).
    """
    low, high = middle - side / 2, middle + side / 2
    front = high.copy()
    front[0] = low[0] + wall
    rest = low.copy()
    rest[0] = front[0]
    opening = np.stack([middle - gap / 2, middle + gap / 2])
    opening[:, 0] = low[0], front[0]
    inside = np.stack([low + wall, high - wall])
    return np.concatenate([subtract_box(low, front, opening), subtract_box(rest, high, inside)])
