"""Pixels of image files, as grey values: what image and ROS maps are made from."""

import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brrt.errors import BrrtError

if TYPE_CHECKING:
    from PIL.Image import Image as Picture

ENDINGS = (".png", ".pgm", ".pbm", ".ppm", ".pnm", ".bmp", ".jpg", ".jpeg")
MAGIC = (b"\x89PNG", b"P1", b"P2", b"P3", b"P4", b"P5", b"P6", b"BM", b"\xff\xd8\xff")
_FORMATS = ("PNG", "PPM", "BMP", "JPEG")

_MOST_BYTES = 1_000_000_000
_MOST_PIXELS = 2**26
"""Of an image, 8192 x 8192: a grid of them takes 64 MiB."""

_SLOW = {"bmp_rle": 0, "ppm": 2**22, "ppm_plain": 2**22}
"""Pixels, at most, of what Pillow decodes in Python: PNM in text or of odd depth, BMP in runs.

A BMP that promises runs need not have them, so 200 bytes could take a minute.
"""
_CHUNK = 2**20


class Pixels(NamedTuple):
    """An image; the first row is the top one.

    Attributes:
        grey: Grey values from 0 (black) to `white`, 8 or 16 bits, shape (h, w).
        alpha: From 0 (transparent) to 255 (opaque), shape (h, w); None where all is opaque.
        white: 255 or 65535.
    """

    grey: NDArray[np.uint8] | NDArray[np.uint16]
    alpha: NDArray[np.uint8] | None
    white: int


def read_pixels(path: Path) -> Pixels:
    """Read an image; colours become grey by their luma (ITU-R 601-2), as map servers do it.

    Raises:
        BrrtError: It cannot be read, is broken, or claims more pixels than there may be.
    """
    from PIL import Image, UnidentifiedImageError  # noqa: PLC0415 - costs as much as all of brrt

    try:
        return _decoded(path)
    except BrrtError:
        raise
    except Image.DecompressionBombError:
        raise BrrtError(_too_many(path, "far too many")) from None
    except UnidentifiedImageError:
        raise BrrtError(f"{path}: not an image that brrt reads; {', '.join(_FORMATS)}") from None
    except OSError as error:
        raise BrrtError(f"{path}: {error.strerror or _line(error)}") from None
    except Exception as error:  # noqa: BLE001 - decoders raise what they like on broken files
        raise BrrtError(f"{path}: a broken image: {_line(error)}") from None


def _decoded(path: Path) -> Pixels:
    from PIL import Image  # noqa: PLC0415

    size = path.stat().st_size
    if size > _MOST_BYTES:
        raise BrrtError(f"{path}: {size:,} bytes are too many; an image has {_MOST_BYTES:,}")
    ignoring = warnings.catch_warnings(action="ignore")
    with ignoring, Image.open(path, formats=_FORMATS) as image:
        width, height = image.size
        if width * height > _MOST_PIXELS:
            raise BrrtError(_too_many(path, f"{width:,} x {height:,}"))
        codec = image.tile[0].codec_name if image.tile else ""
        if codec in _SLOW and width * height > _SLOW[codec]:
            raise BrrtError(f"{path}: a kind of image that is slow to decode; save it as PNG")
        return _grey(image)


def _line(error: Exception) -> str:
    return " ".join(str(error).split())[:120] or type(error).__name__


def look_up(table: NDArray[Any], grey: NDArray[Any]) -> NDArray[Any]:
    """Return `table[grey]` without the index in 64 bits that numpy would make of all of it."""
    flat = grey.reshape(-1)
    found = np.empty(flat.shape, table.dtype)
    for i in range(0, flat.size, _CHUNK):
        found[i : i + _CHUNK] = table[flat[i : i + _CHUNK]]
    return found.reshape(grey.shape)


def _too_many(path: Path, pixels: str) -> str:
    return f"{path}: the header claims {pixels} pixels; a map has at most {_MOST_PIXELS:,}"


def _grey(image: "Picture") -> Pixels:
    if image.mode == "F":
        raise ValueError("floating-point numbers; save it as grey")
    if image.mode.startswith("I"):
        deep = np.clip(np.asarray(image), 0, 65535).astype(np.uint16)
        return Pixels(deep, None, 65535)
    if not image.has_transparency_data:
        return Pixels(np.asarray(image.convert("L")), None, 255)
    seen = image.convert("RGBA")
    return Pixels(np.asarray(seen.convert("L")), np.asarray(seen.getchannel("A")), 255)
