"""brrt's own worlds."""

import re
from dataclasses import dataclass, replace
from pathlib import Path

from brrt.files import read_text
from brrt.worlds.loaders.loader import MOST_BYTES, Loader, nothing_to_choose
from brrt.worlds.world import World


@dataclass(frozen=True, slots=True)
class JsonWorld(Loader):
    """brrt's own worlds, 2D and 3D, as `World.save` and `brrt worlds make` write them."""

    endings = (".json",)

    @classmethod
    def recognises(cls, head: bytes) -> bool:
        """Whether the schema stands near the beginning, where it is written."""
        return head.lstrip(b"\xef\xbb\xbf \t\r\n").startswith(b"{") and bool(
            re.search(rb'"schema"\s*:\s*"brrt\.world"', head)
        )

    def load(self, path: Path, query: str) -> World:
        """Read a world.

        Raises:
            BrrtError: The text is not such a world.
        """
        nothing_to_choose(path, query)
        return replace(World.from_json(read_text(path, "a world", MOST_BYTES)), name=str(path))
