"""Worlds of walls: gaps, passages, dividing walls, enclosures, and none at all."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from brrt.settings import param
from brrt.worlds.generators.box_subtraction import subtract_box
from brrt.worlds.generators.generator import Fixed, Floats, ObstacleSet, no_fit


@dataclass(frozen=True, slots=True)
class Empty(Fixed):
    """Nothing but bounds; start and goal stand in opposite corners."""

    def layout(self) -> ObstacleSet:
        """Leave the map empty."""
        return ObstacleSet()


@dataclass(frozen=True, slots=True)
class Empty2D(Empty):
    """A square map without obstacles."""

    dim: ClassVar[int] = 2


@dataclass(frozen=True, slots=True)
class Empty3D(Empty):
    """A cube without obstacles."""

    dim: ClassVar[int] = 3


@dataclass(frozen=True, slots=True)
class GapWall(Fixed):
    """A wall across the middle of the map with one square gap; start and goal stand in corners."""

    usual: ClassVar[tuple[float, float]] = (0.06, 0.04)
    """Width of the gap and thickness of the wall, as fractions of the size."""

    gap: float | None = param(None, "width of the gap; auto: 0.06 of the size", above=0)
    wall: float | None = param(None, "thickness of the wall; auto: 0.04 of the size", above=0)
    position: float = param(
        0.75, "where along y the gap is: 0 at one end, 1 at the other", low=0, high=1
    )

    def __post_init__(self) -> None:
        """Check that gap and wall fit the map."""
        Fixed.__post_init__(self)
        if self.width > self.size:
            raise no_fit("gap", self.width, self.size)
        if self.thickness > 0.8 * self.size:
            raise no_fit("wall", self.thickness, 0.8 * self.size)

    @property
    def width(self) -> float:
        """Of the gap."""
        return self.usual[0] * self.size if self.gap is None else self.gap

    @property
    def thickness(self) -> float:
        """Of the wall."""
        return self.usual[1] * self.size if self.wall is None else self.wall

    def places(self) -> list[float]:
        """Return where the gap is along the axes that the wall spans, 0 to 1 each."""
        return [self.position]

    def ends(self, room: float) -> tuple[Floats, Floats]:
        """Return opposite corners; no more than half way to the wall."""
        return self.corners(room, (1 - self.thickness / self.size) / 4)

    def layout(self) -> ObstacleSet:
        """Build the wall around the gap."""
        first = np.array(self.places()) * (self.size - self.width)
        low, high = np.zeros(self.dim), np.full(self.dim, self.size)
        low[0] = (self.size - self.thickness) / 2
        high[0] = (self.size + self.thickness) / 2
        hole = [[low[0], *first], [high[0], *(first + self.width)]]
        return ObstacleSet(boxes=subtract_box(low, high, hole))


@dataclass(frozen=True, slots=True)
class Gap2D(GapWall):
    """A wall across a square map with one gap."""

    dim: ClassVar[int] = 2


@dataclass(frozen=True, slots=True)
class Gap3D(GapWall):
    """A wall across a cube with one square gap."""

    dim: ClassVar[int] = 3

    height: float = param(
        0.25, "where along z the gap is: 0 at the floor, 1 at the ceiling", low=0, high=1
    )

    def places(self) -> list[float]:
        """Return where the gap is along y and z."""
        return [self.position, self.height]


@dataclass(frozen=True, slots=True)
class Passage2D(Gap2D):
    """A long narrow passage through a thick wall across a square map."""

    usual: ClassVar[tuple[float, float]] = (0.03, 0.5)

    gap: float | None = param(None, "width of the passage; auto: 0.03 of the size", above=0)
    wall: float | None = param(None, "its length; auto: 0.5 of the size", above=0)


@dataclass(frozen=True, slots=True)
class Passage3D(Gap3D):
    """A long narrow passage, square in section, through a thick wall across a cube."""

    usual: ClassVar[tuple[float, float]] = (0.08, 0.5)

    gap: float | None = param(None, "width of the passage; auto: 0.08 of the size", above=0)
    wall: float | None = param(None, "its length; auto: 0.5 of the size", above=0)


@dataclass(frozen=True, slots=True)
class Walls(Fixed):
    """Walls that divide the map, each open along another side; start and goal stand in corners."""

    sides: ClassVar[tuple[tuple[int, bool], ...]]
    """Axis and end of it at which the walls are open, in turn."""

    walls: int = param(3, "number of walls", low=0, high=1000)
    gap: float | None = param(None, "width of the openings; auto: 0.1 of the size", above=0)
    wall: float | None = param(
        None, "thickness of the walls; auto: 0.2 of their distance, at most 0.03 of the size",
        above=0,
    )  # fmt: skip

    def __post_init__(self) -> None:
        """Check that openings and walls fit the map."""
        Fixed.__post_init__(self)
        if self.width > self.size:
            raise no_fit("gap", self.width, self.size)
        if self.thickness > 0.9 * self.pitch:
            raise no_fit("wall", self.thickness, 0.9 * self.pitch)

    @property
    def width(self) -> float:
        """Of the openings."""
        return 0.1 * self.size if self.gap is None else self.gap

    @property
    def pitch(self) -> float:
        """From wall to wall."""
        return 0.8 * self.size / max(self.walls, 1)

    @property
    def thickness(self) -> float:
        """Of the walls."""
        return min(0.2 * self.pitch, 0.03 * self.size) if self.wall is None else self.wall

    def ends(self, room: float) -> tuple[Floats, Floats]:
        """Return opposite corners; no more than half way to the next wall."""
        return self.corners(room, 0.05 + (self.pitch - self.thickness) / self.size / 4)

    def layout(self) -> ObstacleSet:
        """Build wall after wall, along x."""
        boxes = [np.empty((0, 2 * self.dim))]
        for i in range(self.walls):
            low, high = np.zeros(self.dim), np.full(self.dim, self.size)
            middle = 0.1 * self.size + (i + 0.5) * self.pitch
            low[0], high[0] = middle - self.thickness / 2, middle + self.thickness / 2
            hole = np.stack([low, high])
            axis, at_end = self.sides[i % len(self.sides)]
            hole[:, axis] = (self.size - self.width, self.size) if at_end else (0.0, self.width)
            boxes.append(subtract_box(low, high, hole))
        return ObstacleSet(boxes=np.concatenate(boxes))


@dataclass(frozen=True, slots=True)
class Walls2D(Walls):
    """Walls that divide a square map, open at alternating ends."""

    dim: ClassVar[int] = 2
    sides: ClassVar[tuple[tuple[int, bool], ...]] = ((1, True), (1, False))


@dataclass(frozen=True, slots=True)
class Walls3D(Walls):
    """Walls that divide a cube, open along one side after the other."""

    dim: ClassVar[int] = 3
    sides: ClassVar[tuple[tuple[int, bool], ...]] = ((1, True), (2, False), (1, False), (2, True))


@dataclass(frozen=True, slots=True)
class Enclosure(Fixed):
    """Start and goal each in the middle of a box that is open on the side away from the other."""

    side: float | None = param(None, "side of the boxes; auto: 0.25 of the size", above=0)
    wall: float | None = param(None, "thickness of their walls; auto: 0.1 of the side", above=0)
    gap: float | None = param(None, "width of their openings; auto: the whole side", above=0)

    def __post_init__(self) -> None:
        """Check that walls and openings fit the boxes, and those the map."""
        Fixed.__post_init__(self)
        if self.outside > 0.4 * self.size:
            raise no_fit("side", self.outside, 0.4 * self.size)
        if self.thickness > 0.45 * self.outside:
            raise no_fit("wall", self.thickness, 0.45 * self.outside)
        inside = self.outside - 2 * self.thickness
        if self.gap is not None and self.gap > inside:
            raise no_fit("gap", self.gap, inside)

    @property
    def outside(self) -> float:
        """Side of the boxes."""
        return 0.25 * self.size if self.side is None else self.side

    @property
    def thickness(self) -> float:
        """Of the walls."""
        return 0.1 * self.outside if self.wall is None else self.wall

    def ends(self, _room: float, /) -> tuple[Floats, Floats]:
        """Return the middle of the boxes."""
        start, goal = np.full((2, self.dim), 0.5 * self.size)
        start[0], goal[0] = 0.25 * self.size, 0.75 * self.size
        return start, goal

    def layout(self) -> ObstacleSet:
        """Build the box of the start, and its mirror image."""
        middle, _ = self.ends(0.0)
        inner = self.outside / 2 - self.thickness
        gap = 2 * inner if self.gap is None else self.gap
        boxes = shell(middle, self.outside, self.thickness, gap)
        mirror = boxes.copy()
        mirror[:, 0], mirror[:, self.dim] = self.size - boxes[:, self.dim], self.size - boxes[:, 0]
        return ObstacleSet(boxes=np.concatenate([boxes, mirror]))


def shell(middle: Floats, side: float, wall: float, gap: float) -> Floats:
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
    hollow = np.stack([low + wall, high - wall])
    return np.concatenate([subtract_box(low, front, opening), subtract_box(rest, high, hollow)])


@dataclass(frozen=True, slots=True)
class Enclosure2D(Enclosure):
    """Start and goal each in a square that is open on the side away from the other."""

    dim: ClassVar[int] = 2


@dataclass(frozen=True, slots=True)
class Enclosure3D(Enclosure):
    """Start and goal each in a box that is open on the side away from the other."""

    dim: ClassVar[int] = 3
