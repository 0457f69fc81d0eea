"""Bug traps: easy to get into, hard to get out of."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from brrt.settings import param
from brrt.worlds.arrays import Floats
from brrt.worlds.generators.box_subtraction import subtract_box
from brrt.worlds.generators.generator import Fixed, Length, ObstacleSet
from brrt.worlds.generators.walls import hollow_box

_LIPS = np.deg2rad(150)
"""Angle around the trap, seen from its back, at which the wall turns inwards."""
_STEPS = 6
"""Number of rings of the funnel in 3D."""


@dataclass(frozen=True, slots=True)
class BugTrap(Fixed):
    """A hollow body whose only way out is a funnel that reaches far into it.

    The start is inside, between the funnel and the back; the goal is outside, behind the back, so
    that paths lead through the inlet and around the body.
    """

    side: float | None = param(None, "size of the trap; auto: 0.6 of the map's", above=0)
    gap: float | None = param(None, "width of the inlet; auto: 0.06 of the trap's size", above=0)
    wall: float | None = param(
        None, "thickness of its walls; auto: 0.04 of the trap's size", above=0
    )

    across = Length("side", 0.6)
    inlet = Length("gap", 0.06, of="across")
    thickness = Length("wall", 0.04, of="across")

    def __post_init__(self) -> None:
        """Check that inlet and walls fit the trap, and the trap the map."""
        Fixed.__post_init__(self)
        self.check_fits(
            ("side", self.across, 0.8 * self.size),
            ("gap", self.inlet, 0.3 * self.across),
            ("wall", self.thickness, 0.1 * self.across),
        )

    def ends(self, _room: float, /) -> tuple[Floats, Floats]:
        """Return a point between inlet and back, and one behind the back."""
        start, goal = np.full((2, self.dim), 0.5 * self.size)
        start[0] += 0.25 * self.across
        goal[0] = 0.95 * self.size
        return start, goal


@dataclass(frozen=True, slots=True)
class BugTrap2D(BugTrap):
    """A round trap on a square map; the way out is a funnel that reaches far into it."""

    dim: ClassVar[int] = 2

    def obstacles(self) -> ObstacleSet:
        """Return a strip along a line: inlet, funnel, lip, around the back, and mirrored."""
        radius = (self.across - self.thickness) / 2
        beside = (self.inlet + self.thickness) / 2
        around = np.linspace(0, _LIPS, 13)
        half = np.concatenate(
            [
                radius * np.stack([np.cos(around), np.sin(around)], axis=1),
                [[-0.4 * radius, beside], [0.0, beside]],
            ]
        )
        line = np.concatenate([half[:0:-1] * [1, -1], half])
        return ObstacleSet(polygons=tuple(_strip(line, self.thickness) + self.size / 2))


@dataclass(frozen=True, slots=True)
class BugTrap3D(BugTrap):
    """A hollow cube as a trap; the way out is a stepped funnel that reaches far into it."""

    dim: ClassVar[int] = 3

    def obstacles(self) -> ObstacleSet:
        """Return the cube with a mouth, and rings from there inwards, each narrower."""
        middle = np.full(3, self.size / 2)
        mouth = 0.5 * self.across
        widths = np.linspace(mouth, self.inlet, _STEPS + 1)
        length = 0.5 * self.across / _STEPS
        boxes = [hollow_box(middle, self.across, self.thickness, mouth)]
        for i, width in enumerate(widths[1:]):
            low, high = (middle + sign * (widths[i] / 2 + self.thickness) for sign in (-1, 1))
            low[0] = middle[0] - self.across / 2 + i * length
            high[0] = low[0] + length
            hole = np.stack([middle - width / 2, middle + width / 2])
            hole[:, 0] = low[0], high[0]
            boxes.append(subtract_box(low, high, hole))
        return ObstacleSet(boxes=np.concatenate(boxes))


def _strip(line: Floats, width: float) -> Floats:
    """Return quadrilaterals along a line that share their ends, shape (n - 1, 4, 2).

    Args:
        line: Points, shape (n, 2); no sharp turns, and no parts shorter than the width.
        width: Width of the strip.
    """
    along = np.diff(line, axis=0)
    along /= np.hypot(*along.T)[:, None]
    left = np.stack([-along[:, 1], along[:, 0]], axis=1)
    # At a turn the sides meet on its bisector.
    both = np.concatenate([left[:1], left[:-1] + left[1:], left[-1:]])
    aside = both / np.concatenate([[1], (both[1:-1] * left[1:]).sum(axis=1), [1]])[:, None]
    one, other = line - aside * width / 2, line + aside * width / 2
    return np.stack([one[:-1], one[1:], other[1:], other[:-1]], axis=1)
