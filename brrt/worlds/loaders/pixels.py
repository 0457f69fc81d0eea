"""Image files as arrays of grey values, for image and ROS maps."""

import warnings
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brrt.errors import BrrtError
from brrt.files import open_file

if TYPE_CHECKING:
    from PIL.ImageFile import ImageFile

ENDINGS = (".png", ".pgm", ".pbm", ".ppm", ".pnm", ".bmp", ".jpg", ".jpeg", ".webp", ".gif")
MAGIC = (
    b"\x89PNG", b"P1", b"P2", b"P3", b"P4", b"P5", b"P6", b"BM", b"\xff\xd8\xff", b"RIFF", b"GIF8",
)  # fmt: skip
_FORMATS = ("PNG", "PPM", "BMP", "JPEG", "WEBP", "GIF")
"""Not TIFF: libtiff writes its own remarks about a file to stderr."""

_MOST_BYTES = 1_000_000_000
_MOST_PIXELS = 2**26
"""Maximum size of an image, 8192 x 8192: its grid takes 64 MiB."""

_SLOW = {"bmp_rle": 0, "ppm": 2**22, "ppm_plain": 2**22}
"""Maximum pixels of what Pillow decodes in Python: PNM in text or of odd depth, run-length BMP.

A BMP that claims to be run-length encoded need not contain any runs: 200 bytes could take a minute.
"""
_CHUNK = 2**20

_ORIENTATION = 0x0112
"""The tag of EXIF that says how an image is turned or mirrored when it is shown; 1: not at all."""

_GREY_STEPS = {"L;2": 85, "L;4": 17}
"""What Pillow multiplies greys of 2 and 4 bits by when it decodes a PNG."""


class Pixels(NamedTuple):
    """An image; the first row is the top one.

    Attributes:
        grey: Grey values from 0 (black) to `white`, 8 or 16 bits, shape (h, w).
        alpha: From 0 (transparent) to 255 (opaque), shape (h, w); None if all is opaque.
        white: 255 or 65535.
        turned: Whether the file says that the image is shown turned or mirrored.
    """

    grey: NDArray[np.uint8] | NDArray[np.uint16]
    alpha: NDArray[np.uint8] | None
    white: int
    turned: bool = False


def read_pixels(path: Path, *, upright: bool = True) -> Pixels:
    """Read an image, of several frames the first, as viewers show it.

    Colours are converted to luma (ITU-R 601-2), as map_server does.

    Args:
        path: The file.
        upright: Turn the image as its EXIF orientation says.

    Raises:
        BrrtError: The image cannot be read, is damaged, or has too many pixels.
    """
    from PIL import Image, UnidentifiedImageError  # noqa: PLC0415 - as slow to import as all of brrt

    try:
        return _decode(path, upright=upright)
    except BrrtError:
        raise
    except Image.DecompressionBombError:
        raise _too_many(path, "far too many") from None
    except UnidentifiedImageError:
        raise BrrtError(f"{path}: not an image in one of {', '.join(_FORMATS)}") from None
    except OSError as error:
        raise BrrtError(f"{path}: {error.strerror or _one_line(error)}") from None
    except Exception as error:  # noqa: BLE001 - decoders raise anything on damaged files
        raise BrrtError(f"{path}: a damaged image: {_one_line(error)}") from None


def _decode(path: Path, *, upright: bool) -> Pixels:
    from PIL import Image  # noqa: PLC0415

    size = path.stat().st_size
    if size > _MOST_BYTES:
        raise BrrtError(
            f"{path}: {size:,} bytes are too many; an image has at most {_MOST_BYTES:,}"
        )
    ignoring = warnings.catch_warnings(action="ignore")
    with ignoring, open_file(path) as file, Image.open(file, formats=_FORMATS) as image:
        width, height = image.size
        if width * height > _MOST_PIXELS:
            raise _too_many(path, f"{width:,} x {height:,}")
        codec = image.tile[0].codec_name if image.tile else ""
        if codec in _SLOW and width * height > _SLOW[codec]:
            raise BrrtError(f"{path}: this kind of image is slow to decode; save it as PNG")
        _scale_transparency(image)
        turned = _turn(image, upright=upright)
        return _convert(image)._replace(turned=turned)


def _scale_transparency(image: "ImageFile") -> None:
    """Bring the transparent colour of a PNG, stated in the file's depth, to that of the pixels."""
    depth, clear = image.tile[0].args if image.tile else "", image.info.get("transparency")
    if isinstance(clear, int) and depth in _GREY_STEPS:
        image.info["transparency"] = clear * _GREY_STEPS[depth]
    elif isinstance(clear, tuple) and depth == "RGB;16B":
        image.info["transparency"] = tuple(value >> 8 for value in clear)


def _turn(image: "ImageFile", *, upright: bool) -> bool:
    """Decode an image and, if `upright`, turn it as it is shown; return whether it is turned."""
    from PIL import ImageOps  # noqa: PLC0415

    image.load()
    orientation = 1
    with suppress(Exception):  # viewers show images with damaged EXIF as they are
        orientation = image.getexif().get(_ORIENTATION, 1)
        if upright:
            ImageOps.exif_transpose(image, in_place=True)
    return orientation in range(2, 9)


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())[:120] or type(error).__name__


def look_up(table: NDArray[Any], grey: NDArray[Any]) -> NDArray[Any]:
    """Return `table[grey]`, in chunks: numpy converts the index to 64 bits."""
    flat = grey.reshape(-1)
    found = np.empty(flat.shape, table.dtype)
    for i in range(0, flat.size, _CHUNK):
        found[i : i + _CHUNK] = table[flat[i : i + _CHUNK]]
    return found.reshape(grey.shape)


def _too_many(path: Path, pixels: str) -> BrrtError:
    return BrrtError(f"{path}: {pixels} pixels in the header; a map has at most {_MOST_PIXELS:,}")


def _convert(image: "ImageFile") -> Pixels:
    if image.mode == "F":
        raise ValueError("floating-point numbers; save it as grey")
    clear = image.info.get("transparency")
    if image.mode.startswith("I"):  # grey of 16 bits, which Pillow converts to 8
        deep = np.clip(np.asarray(image), 0, 65535).astype(np.uint16)
        alpha = None if clear is None else np.where(deep == clear, 0, 255).astype(np.uint8)
        return Pixels(deep, alpha, 65535)
    if not image.has_transparency_data:
        return Pixels(np.asarray(image.convert("L")), None, 255)
    rgba = image.convert("RGBA")
    return Pixels(np.asarray(rgba.convert("L")), np.asarray(rgba.getchannel("A")), 255)
