"""A loader of world files."""

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np

from brrt import BrrtError, World
from brrt.files import lines_of
from brrt.worlds.loaders.loader import Loader, finite, read_world_text


@dataclass(frozen=True, slots=True)
class Pillars(Loader):
    """2D pillars: a line `size WIDTH HEIGHT`, then a line `X Y RADIUS` for each."""

    endings: ClassVar[tuple[str, ...]] = (".pillars",)

    @classmethod
    def recognises(cls, head: bytes) -> bool:
        """Whether the file begins with the size."""
        return head.startswith(b"size ")

    def read(self, path: Path, _query: str, /) -> World:
        """Read the pillars."""
        upper, pillars = None, []
        for number, line in lines_of(str(path), read_world_text(path)):
            words, where = line.split(), f"{path}:{number}"
            if not words:
                continue
            size = words[0] == "size"
            numbers = finite(where, words[1:] if size else words)
            if len(numbers) != (2 if size else 3):
                raise BrrtError(f"{where}: a line reads size WIDTH HEIGHT, or X Y RADIUS")
            if size:
                upper = np.array(numbers)
            else:
                pillars.append(numbers)
        if upper is None:
            raise BrrtError(f"{path}: no line begins with size; add size WIDTH HEIGHT")
        return World(str(path), np.zeros(2), upper, balls=np.array(pillars).reshape(-1, 3))
