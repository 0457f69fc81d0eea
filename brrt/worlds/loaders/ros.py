"""Maps of ROS's map_server: a YAML file that describes an image (nav2's `map_io.cpp`)."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from brrt.digits import tell_apart
from brrt.errors import BrrtError
from brrt.files import is_there
from brrt.settings import param
from brrt.worlds.loaders.loader import Loader, file_named_by_user, file_named_in
from brrt.worlds.loaders.pixels import Pixels, look_up, read_pixels
from brrt.worlds.occupancy import Grid
from brrt.worlds.world import World

if TYPE_CHECKING:
    from brrt.worlds.loaders.yaml_fields import YamlFields

_MOST_BYTES = 64_000
"""Maximum size of the YAML file; real ones have 200 bytes."""

_REQUIRED = ("image", "resolution", "origin", "occupied_thresh", "free_thresh", "negate")
_MOST_NOTES = 10
_MODES = ("trinary", "scale", "raw")
_TRUTH = {"0": False, "false": False, "no": False, "1": True, "true": True, "yes": True}
_OCCUPIED, _UNKNOWN = 100, -1
_HALF = 50.0


@dataclass(frozen=True, slots=True)
class RosMap(Loader):
    """2D maps of ROS's map_server: a yaml beside its PGM or PNG; modes trinary, scale and raw.

    As in nav2, a pixel's occupancy is its darkness (its lightness with `negate`); cells
    at or above `occupied_thresh` are occupied (100), those at or below `free_thresh` free (0),
    transparent ones unknown; those between are unknown too or, in mode `scale`, 1 to 99. In mode
    `raw` the pixel's value is its occupancy, and values above 100 are unknown.
    """

    unknown: Literal["blocked", "free"] = param("blocked", "how unknown cells count")
    occupied: float = param(
        _HALF, "scale and raw: occupancy from which on cells are blocked", above=0, high=100,
        unit="%",
    )  # fmt: skip
    image: str | None = param(None, "file of the image, instead of the one that the yaml names")

    endings = (".yaml", ".yml")

    @classmethod
    def recognises(cls, head: bytes) -> bool:
        """Whether the fields `image` and `resolution` are there."""
        return all(
            re.search(rb"^\s*" + field + rb"\s*:", head, re.MULTILINE)
            for field in (b"image", b"resolution")
        )

    def read(self, path: Path, _query: str, /) -> World:
        """Read a map and its image."""
        from brrt.worlds.loaders.yaml_fields import YamlFields  # noqa: PLC0415 - yaml is slow

        fields = YamlFields.read(path, _MOST_BYTES)
        for name in _REQUIRED:
            if name not in fields.nodes:
                raise BrrtError(f"{path}: the field {name!r} is missing; a map has one")
        resolution = fields.number("resolution")
        if resolution <= 0:
            raise BrrtError(f"{fields.where('resolution')} must be above 0, not {resolution:g}")
        x, y, yaw = fields.numbers("origin", "x, y, yaw")
        mode, negate, (occupied, free) = _mode(fields), _negate(fields), _thresholds(fields)
        pixels = self._pixels(path, fields)
        values = occupancy(pixels, mode, occupied, free, negate=negate)
        unknown = values == _UNKNOWN
        if mode == "trinary" and self.occupied != _HALF:
            raise BrrtError(f"{path}: occupied is for the modes scale and raw; this is trinary")
        blocked = values >= self.occupied
        if self.unknown == "blocked":
            blocked |= unknown
        grid = Grid(np.ascontiguousarray(blocked[::-1]), np.array([x, y]), resolution, yaw)
        notes = [*self._notes(path, fields, int(unknown.sum()), unknown.size)]
        if pixels.turned:
            notes.append(f"{path}: its image's EXIF orientation is ignored, as map_server does")
        return World.of_grid(str(path), grid, notes=tuple(notes))

    def _notes(self, path: Path, fields: "YamlFields", unknown: int, cells: int) -> Iterator[str]:
        foreign = [name for name in fields.nodes if name not in (*_REQUIRED, "mode")]
        for name in foreign[:_MOST_NOTES]:
            line = fields.nodes[name].start_mark.line + 1
            yield f"{path}:{line}: {name[:40]!r} is not a field of a map; ignored"
        if unknown:
            other = "free" if self.unknown == "blocked" else "blocked"
            yield (
                f"{path}: {unknown:,} of {cells:,} cells are unknown and count as {self.unknown}; "
                f"{path}:unknown={other} makes them {other}"
            )

    def _pixels(self, path: Path, fields: "YamlFields") -> Pixels:
        if self.image is not None:
            return read_pixels(file_named_by_user(path, self.image), upright=False)
        where, name = fields.where("image"), fields.text("image")
        remedy = f"{path}:image=PATH"
        image = file_named_in(where, path, name, remedy)
        if not name or not is_there(image):
            raise BrrtError(f"{where}: the image {name[:80]!r} does not exist; give {remedy}")
        return read_pixels(image, upright=False)


def occupancy(
    pixels: Pixels, mode: str, occupied: float, free: float, *, negate: bool
) -> NDArray[np.int8]:
    """Return the occupancy that a map server publishes: 0 to 100, or -1 for unknown.

    Args:
        pixels: The image.
        mode: `trinary`, `scale` or `raw`.
        occupied: Darkness from which on a cell is occupied, 0 to 1.
        free: Darkness up to which a cell is free, below `occupied`.
        negate: Use lightness instead of darkness; not in mode raw.

    Returns:
        Shape (h, w), the image's top row first.
    """
    codes = np.arange(pixels.white + 1)
    dark = (codes if negate else pixels.white - codes) / pixels.white
    if mode == "raw":
        value = np.floor(codes / pixels.white * 255 + 0.5)
        value[value > _OCCUPIED] = _UNKNOWN
    else:
        between = np.floor((dark - free) / (occupied - free) * 100 + 0.5)
        value = between if mode == "scale" else np.full(len(codes), float(_UNKNOWN))
        value[dark >= occupied] = _OCCUPIED
        value[dark <= free] = 0
    values = look_up(value.astype(np.int8), pixels.grey)
    if pixels.alpha is not None and mode != "raw":
        values[pixels.alpha < 255] = _UNKNOWN
    return values


def _thresholds(fields: "YamlFields") -> tuple[float, float]:
    """Return the occupied and the free threshold."""
    occupied, free = fields.number("occupied_thresh"), fields.number("free_thresh")
    for name, value in (("occupied_thresh", occupied), ("free_thresh", free)):
        if not 0 <= value <= 1:
            raise BrrtError(f"{fields.where(name)} must be from 0 to 1, not {value!r}")
    if free >= occupied:
        texts = tell_apart(free, occupied)
        raise BrrtError(
            f"{fields.where('free_thresh')} {texts[0]} must be below occupied_thresh {texts[1]}"
        )
    return occupied, free


def _negate(fields: "YamlFields") -> bool:
    word = fields.text("negate").lower()
    if word not in _TRUTH:
        raise BrrtError(f"{fields.where('negate')} must be 0 or 1, not {word[:40]!r}")
    return _TRUTH[word]


def _mode(fields: "YamlFields") -> str:
    mode = fields.text("mode") if "mode" in fields.nodes else "trinary"
    if mode not in _MODES:
        raise BrrtError(f"{fields.where('mode')} must be trinary, scale or raw, not {mode[:40]!r}")
    return mode
