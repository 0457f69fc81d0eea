"""Plain images as grid maps."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from brrt.settings import param
from brrt.worlds.loaders.loader import Loader
from brrt.worlds.loaders.pixels import ENDINGS, MAGIC, read_pixels
from brrt.worlds.occupancy import Grid
from brrt.worlds.world import World


@dataclass(frozen=True, slots=True)
class ImageMap(Loader):
    """2D maps drawn in a PNG, PNM, BMP, JPEG, WebP or GIF: dark pixels are blocked.

    The image is read as viewers show it: turned by its EXIF orientation, of several frames the
    first. The lowest row of pixels is at y = 0, the leftmost column at x = 0. Transparent pixels
    are free; partly transparent ones are drawn over a free background.
    """

    threshold: float = param(
        0.5, "darker pixels are blocked; 0 is black, 1 is white", above=0, high=1
    )
    resolution: float = param(1.0, "side of a pixel", above=0, unit="m")
    invert: bool = param(False, "light pixels are blocked, and dark ones free")

    endings = ENDINGS

    @classmethod
    def recognises(cls, head: bytes) -> bool:
        """Whether the file begins like one of these images."""
        return head.startswith(MAGIC)

    def read(self, path: Path, _query: str, /) -> World:
        """Read a map."""
        pixels = read_pixels(path)
        free = pixels.white - pixels.grey if self.invert else pixels.grey
        blocked = free < self.threshold * pixels.white
        if pixels.alpha is not None:
            wide = np.uint16 if pixels.white == 255 else np.uint32
            over = free * pixels.alpha.astype(wide) + wide(pixels.white) * (255 - pixels.alpha)
            blocked = over < self.threshold * 255 * pixels.white
        cells = np.ascontiguousarray(blocked[::-1])
        return World.of_grid(str(path), Grid(cells, np.zeros(2), self.resolution))
