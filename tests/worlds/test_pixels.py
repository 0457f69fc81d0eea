"""Pictures are read as viewers show them: orientation, transparency, depths, frames."""

import struct
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image, ImageOps

from brrt.worlds import load_world
from brrt.worlds.loaders.pixels import read_pixels
from tests.support.world_files import YAML

BARS = np.zeros((16, 32), np.uint8)
BARS[:, :8], BARS[:4] = 255, 90
"""A picture without symmetry, in blocks of 8 as JPEG has them."""


def chunk(kind: bytes, data: bytes) -> bytes:
    """Return a chunk of a PNG."""
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def png(
    path: Path, depth: int, colour: int, width: int, row: bytes, *more: tuple[bytes, bytes]
) -> Path:
    """Write a PNG of one row of pixels, as the specification says, without Pillow."""
    header = struct.pack(">IIBBBBB", width, 1, depth, colour, 0, 0, 0)
    parts = [(b"IHDR", header), *more, (b"IDAT", zlib.compress(b"\0" + row)), (b"IEND", b"")]
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + b"".join(chunk(*part) for part in parts))
    return path


def cells_of(path: Path) -> Any:
    """Return which cells of a map are blocked, the top row first."""
    grid = load_world(path).grid
    assert grid is not None
    return grid.cells[::-1].tolist()


@pytest.mark.parametrize("name", ["m.jpg", "m.png", "m.webp"])
@pytest.mark.parametrize("orientation", range(10))
def test_orientation(name: str, orientation: int, tmp_path: Path) -> None:
    """A picture is turned and mirrored by its EXIF orientation, which map_server ignores."""
    exif = Image.Exif()
    exif[0x0112] = orientation
    lossless: dict[str, Any] = {"lossless": True} if name == "m.webp" else {}
    path = tmp_path / name
    Image.fromarray(BARS).save(path, exif=exif, **lossless)
    turn: dict[int, Callable[[Any], Any]] = {
        2: np.fliplr, 3: lambda a: np.rot90(a, 2), 4: np.flipud, 5: np.transpose,
        6: lambda a: np.rot90(a, -1), 7: lambda a: np.rot90(a, 2).T, 8: np.rot90,
    }  # fmt: skip
    shown = turn.get(orientation, np.copy)(BARS)
    assert read_pixels(path).grey == pytest.approx(shown, abs=2)
    assert cells_of(path) == (shown < 128).tolist()
    (tmp_path / "m.yaml").write_text(YAML.replace("image.pgm", name) + "mode: raw\n")
    world = load_world(tmp_path / "m.yaml")
    assert world.grid is not None
    assert world.grid.cells[::-1].tolist() == (BARS > 50).tolist()
    ignored = f"{tmp_path / 'm.yaml'}: its image's EXIF orientation is ignored"
    assert any(n.startswith(ignored) for n in world.notes) == (orientation in range(2, 9))


def test_deep_grey_is_turned(tmp_path: Path) -> None:
    """Grey of 16 bits keeps its depth when it is turned."""
    exif = Image.Exif()
    exif[0x0112] = 6
    Image.fromarray(BARS.astype(np.uint16) * 100 + 1).save(tmp_path / "m.png", exif=exif)
    assert (read_pixels(tmp_path / "m.png").grey == np.rot90(BARS, -1) * np.uint16(100) + 1).all()


@pytest.mark.parametrize("exif", [b"", b"Exif\0\0", b"Exif\0\0garbage", b"Exif\0\0II*\0\xff\xff"])
@pytest.mark.parametrize("name", ["m.jpg", "m.png", "m.webp"])
def test_damaged_exif(exif: bytes, name: str, tmp_path: Path) -> None:
    """A picture with damaged EXIF is shown as it is stored."""
    Image.fromarray(BARS).save(tmp_path / name, exif=exif)
    assert cells_of(tmp_path / name) == (BARS < 128).tolist()


def words(*values: int) -> bytes:
    """Return numbers of 16 bits as PNG has them."""
    return struct.pack(f">{len(values)}H", *values)


DEPTHS = [
    (1, 0, b"\x50", words(0), [0, 255, 0, 255]),
    (1, 0, b"\x50", words(1), [255, 0, 255, 0]),
    (2, 0, b"\x1b", words(2), [255, 255, 0, 255]),
    (4, 0, b"\x0a\xf0", words(10), [255, 0, 255, 255]),
    (8, 0, b"\x00\x01\xff\x00", words(0), [0, 255, 255, 0]),
    (16, 0, words(0, 1, 65535, 0), words(0), [0, 255, 255, 0]),
    (16, 0, words(256, 257, 1, 255), words(257), [255, 0, 255, 255]),
    (8, 2, bytes([1, 2, 3, 3, 2, 1, 1, 2, 3, 0, 0, 0]), words(1, 2, 3), [0, 255, 0, 255]),
    (16, 2, words(1000, 2000, 3000) * 2 + words(0, 0, 0) * 2, words(1000, 2000, 3000),
     [0, 0, 255, 255]),
    (2, 3, b"\x1b", b"\xff\x80\x00", [255, 128, 0, 255]),
    (16, 4, words(0, 65535, 0, 0, 65535, 0, 65535, 65535), b"", [255, 0, 0, 255]),
    (16, 6, words(0, 0, 0, 65535, 9, 9, 9, 0) * 2, b"", [255, 0, 255, 0]),
]  # fmt: skip


@pytest.mark.parametrize(("depth", "colour", "row", "clear", "opacity"), DEPTHS)
def test_transparency_of_every_depth(
    depth: int, colour: int, row: bytes, clear: bytes, opacity: list[int], tmp_path: Path
) -> None:
    """Transparent colours and channels of a PNG of any depth: free, or unknown to map_server."""
    palette = [(b"PLTE", bytes([0, 0, 0, 9, 9, 9, 1, 1, 1, 255, 255, 255]))] * (colour == 3)
    more = [*palette, (b"tRNS", clear)] if clear else palette
    path = png(tmp_path / "m.png", depth, colour, 4, row, *more)
    pixels = read_pixels(path)
    assert pixels.alpha is not None
    assert pixels.alpha.tolist() == [opacity]
    dark = pixels.grey < 0.5 * pixels.white
    assert cells_of(path) == [(dark[0] & (np.array(opacity) > 128)).tolist()]
    for mode in ("trinary", "scale"):
        (tmp_path / "m.yaml").write_text(YAML.replace("image.pgm", "m.png") + f"mode: {mode}\n")
        unknown = sum(a < 255 for a in opacity)
        assert f"{unknown} of 4 cells are unknown" in load_world(tmp_path / "m.yaml").notes[0]


def test_inks(tmp_path: Path) -> None:
    """CMYK is read as it is shown."""
    Image.fromarray(BARS).convert("RGB").convert("CMYK").save(tmp_path / "m.jpg")
    assert cells_of(tmp_path / "m.jpg") == (BARS < 128).tolist()


@pytest.mark.parametrize("name", ["m.gif", "m.png", "m.webp"])
def test_first_frame(name: str, tmp_path: Path) -> None:
    """Of several frames or pages the first is read."""
    first = Image.fromarray(BARS)
    lossless: dict[str, Any] = {"lossless": True} if name == "m.webp" else {}
    rest = [ImageOps.invert(first), first.point(lambda _: 0)]
    first.save(tmp_path / name, save_all=True, append_images=rest, duration=50, **lossless)
    assert cells_of(tmp_path / name) == (BARS < 128).tolist()
