"""Pixels of a picture by their colour, and the frame of the world in it."""

import io
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from brrt import World
from brrt.views.colours import OUTLINE, Colour

Mask = NDArray[np.bool_]


def opened(png: bytes) -> NDArray[np.int64]:
    """Return a picture as colours, shape (rows, columns, 3)."""
    with Image.open(io.BytesIO(png)) as image:
        return np.asarray(image.convert("RGB"), np.int64)


def of_colour(picture: NDArray[np.int64], colour: Colour, tolerance: int = 12) -> Mask:
    """Return which pixels have a colour, up to a tolerance."""
    return np.asarray((np.abs(picture - colour) <= tolerance).all(axis=-1))


def near(mask: Mask, reach: int) -> Mask:
    """Return which pixels have one of the mask in a square around them."""
    grown = mask.copy()
    for axis in (0, 1):
        rows = grown.copy()
        for step in range(1, reach + 1):
            rows |= np.roll(grown, step, axis) | np.roll(grown, -step, axis)
        grown = rows
    return grown


@dataclass(frozen=True)
class Frame:
    """Where a 2D world is in a picture: the pixels of its edges."""

    world: World
    left: float
    right: float
    top: float
    bottom: float

    def pixels(self, points: NDArray[np.float64]) -> NDArray[np.int64]:
        """Return rows and columns of points, shape (n, 2)."""
        part = (points - self.world.lower) / (self.world.upper - self.world.lower)
        column = self.left + part[:, 0] * (self.right - self.left)
        row = self.bottom + part[:, 1] * (self.top - self.bottom)
        return np.rint(np.stack([row, column], axis=1)).astype(np.int64)


def frame(
    picture: NDArray[np.int64], world: World, tolerance: int = 8, share: float = 0.5
) -> Frame:
    """Find the outline of the world: no other straight lines of its colour are as long.

    Args:
        picture: The picture, shape (rows, columns, 3).
        world: The world in it.
        tolerance: See `of_colour`.
        share: Least length of a line as a part of the longest one.
    """
    outline = of_colour(picture, OUTLINE, tolerance)
    columns, rows = outline.sum(axis=0), outline.sum(axis=1)
    across, down = (np.flatnonzero(count > share * count.max()) for count in (columns, rows))
    middle = [(line.min() + line.max()) / 2 for line in (across, down)]
    edges = [
        float(part.mean())
        for line, half in zip((across, down), middle, strict=True)
        for part in (line[line < half], line[line > half])
    ]
    return Frame(world, *edges)
