"""Worlds in brrt's own JSON."""

import re
from dataclasses import dataclass, replace
from pathlib import Path

from brrt.worlds.loaders.loader import Loader, read_world_text
from brrt.worlds.world import World


@dataclass(frozen=True, slots=True)
class JsonWorld(Loader):
    """brrt's own worlds, 2D and 3D, as `World.save` and `brrt worlds make` write them."""

    endings = (".json",)

    @classmethod
    def recognises(cls, head: bytes) -> bool:
        """Whether brrt's schema is named near the beginning."""
        return head.lstrip(b"\xef\xbb\xbf \t\r\n").startswith(b"{") and bool(
            re.search(rb'"schema"\s*:\s*"brrt\.world"', head)
        )

    def read(self, path: Path, _query: str, /) -> World:
        """Read a world."""
        return replace(World.from_json(read_world_text(path)), name=str(path))
