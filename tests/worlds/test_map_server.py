"""Maps of ROS's map_server and plain images: which pixels are blocked, and where they are."""

import time
import zlib
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from brrt.worlds import Grid, World, load_world, make_world
from brrt.worlds.loaders.pixels import Pixels, read_pixels
from brrt.worlds.loaders.ros import occupancy
from tests.support.world_files import PGM, REAL, YAML, refused


def naive_occupancy(
    code: int, white: int, alpha: int, mode: str, occupied: float, free: float, *, negate: bool
) -> int:
    """Return what nav2's map server publishes for one pixel, by its documentation."""
    if mode == "raw":
        value = round(code / white * 255)
        return value if value <= 100 else -1
    if alpha < 255:
        return -1
    dark = code / white if negate else (white - code) / white
    if dark <= free:
        return 0
    if dark >= occupied:
        return 100
    return -1 if mode == "trinary" else int((dark - free) / (occupied - free) * 100 + 0.5)


@given(
    st.sampled_from(["trinary", "scale", "raw"]), st.sampled_from([255, 65535]), st.booleans(),
    st.tuples(st.integers(0, 100), st.integers(0, 100)).filter(lambda t: t[0] != t[1]),
    st.integers(0, 2**32),
)  # fmt: skip
def test_occupancy(
    mode: str, white: int, negate: bool, percents: tuple[int, int], seed: int
) -> None:
    """Every mode, depth and threshold, pixel by pixel, also values equal to a threshold."""
    rng = np.random.default_rng(seed)
    free, occupied = sorted(p / 100 for p in percents)
    edges = [round((1 - t if not negate else t) * white) for t in (free, occupied)]
    drawn = rng.integers(0, white, 5, endpoint=True)
    grey = np.array([*edges, 0, white, 99, 100, 101, *drawn])
    alpha = rng.choice([0, 254, 255], grey.shape)
    for opacity in (None, alpha.astype(np.uint8)):
        grid = grey[None].astype(np.uint8) if white == 255 else grey[None].astype(np.uint16)
        pixels = Pixels(grid, None if opacity is None else opacity[None], white)
        values = occupancy(pixels, mode, occupied, free, negate=negate)
        opacities = [255] * len(grey) if opacity is None else alpha.tolist()
        assert values[0].tolist() == [
            naive_occupancy(code, white, a, mode, occupied, free, negate=negate)
            for code, a in zip(grey.tolist(), opacities, strict=True)
        ]


def grid_of(world: World) -> Grid:
    """Return a world's grid, which must exist."""
    assert world.grid is not None
    return world.grid


def test_map_server(tmp_path: Path) -> None:
    """Rows start at the bottom, unknown cells count as requested, the origin has a yaw."""
    (tmp_path / "m.pgm").write_text("P2\n3 2\n# rows of light\n255\n0 255 205\n255 255 100\n")
    path = tmp_path / "m.yaml"
    path.write_text(YAML.replace("image.pgm", "m.pgm").replace("[1, 2, 0]", "[1, 2, 0.5]"))
    world = load_world(path)
    grid = grid_of(world)
    assert grid.cells.tolist() == [[False, False, True], [True, False, True]]
    assert (grid.origin.tolist(), grid.resolution, grid.yaw) == ([1, 2], 0.5, 0.5)
    (note,) = world.notes
    assert note.startswith(f"{path}: 2 of 6 cells are unknown and count as blocked; {path}:unknown")
    free = make_world(f"{path}:unknown=free")
    assert grid_of(free).cells.tolist() == [[False, False, False], [True, False, False]]
    assert "count as free" in free.notes[0]
    # Up from the origin by half a cell, in the turned grid.
    middle = np.array([1, 2]) + 0.25 * np.array(
        [np.cos(0.5) - np.sin(0.5), np.cos(0.5) + np.sin(0.5)]
    )
    assert free.obstacle_at(middle) is None
    path.write_text(YAML.replace("image.pgm", "m.pgm") + "mode: scale\n")
    # (255 - 205) / 255 = 0.196078 is 0 %, and (255 - 100) / 255 = 0.6078 is 91 %.
    assert make_world(f"{path}:occupied=92").notes == ()
    assert grid_of(make_world(f"{path}:occupied=92")).cells.tolist() == [
        [False, False, False], [True, False, False],
    ]  # fmt: skip
    assert grid_of(make_world(f"{path}:occupied=91")).cells[0].tolist() == [False, False, True]
    path.write_text(YAML.replace("image.pgm", "m.pgm") + "mode: raw\n")
    assert grid_of(make_world(str(path))).cells.tolist() == [
        [True, True, True],
        [False, True, True],
    ]


BAD = [
    (YAML.replace("image.pgm", "none.png"), ":1: image: the image 'none.png' does not exist; give"),
    (YAML.replace("image.pgm", "../a.pgm"), ":1: image: '../a.pgm' is outside the file's folder"),
    (YAML.replace("image.pgm", "/etc/a.pgm"), ":1: image: '/etc/a.pgm' is outside the file's"),
    (YAML.replace("image.pgm", r"C:\a.pgm"), r":1: image: 'C:\\a.pgm' is outside the file's"),
    (YAML.replace("image.pgm", "a/../../b.pgm"), ":1: image: 'a/../../b.pgm' is outside the"),
    (YAML.replace("image.pgm", "''"), ":1: image: the image ''"),
    (YAML.replace("image.pgm", "[a]"), ":1: image must be a single value"),
    (YAML.replace("image.pgm", "a" * 5000), ":1: image: the image 'aaaa"),
    (YAML.replace("image.pgm", "!!python/name:os.system x"), ":1: image must be a plain value"),
    (
        YAML.replace("image.pgm", "!!python/object/apply:os.system ['touch hacked']"),
        ":1: image must be a plain value, without the tag 'tag:yaml.org,2002:python/object/app",
    ),
    (YAML.replace("0.5", "0"), ":2: resolution must be above 0, not 0"),
    (YAML.replace("0.5", "-1"), ":2: resolution must be above 0, not -1"),
    (YAML.replace("0.5", ".inf"), ":2: resolution: '.inf' is not all numbers"),
    (YAML.replace("0.5", "inf"), ":2: resolution: a number is not finite"),
    (YAML.replace("0.5", "1e300"), ":2: resolution: a number is beyond 1e+100"),
    (YAML.replace("0.5", "fine"), ":2: resolution: 'fine' is not all numbers"),
    (YAML.replace("0.5", "'9' 9"), ":2: not YAML: "),
    (YAML.replace("[1, 2, 0]", "[1, 2]"), ":3: origin must be 3 numbers: [x, y, yaw]"),
    (YAML.replace("[1, 2, 0]", "1"), ":3: origin must be 3 numbers"),
    (YAML.replace("[1, 2, 0]", "[1, 2, nan]"), ":3: origin: a number is not finite"),
    (YAML.replace("[1, 2, 0]", "[1, 2, [0]]"), ":3: origin must be a single value"),
    (YAML.replace("negate: 0", "negate: maybe"), ":4: negate must be 0 or 1, not 'maybe'"),
    (YAML.replace("0.65", "0.1"), ":6: free_thresh 0.196 must be below occupied_thresh 0.1"),
    (YAML.replace("0.65", "0.196"), ":6: free_thresh 0.196 must be below occupied_thresh 0.196"),
    (YAML.replace("0.65", "65"), ":5: occupied_thresh must be from 0 to 1, not 65"),
    (YAML.replace("0.196", "-1"), ":6: free_thresh must be from 0 to 1, not -1"),
    (YAML + "mode: colour\n", ":7: mode must be trinary, scale or raw, not 'colour'"),
    (YAML + "negate: 1\n", ":7: a second field 'negate'"),
    (YAML + "{", ":7: not YAML: "),
    (YAML + "---\n" + YAML, ":7: not YAML: but found another document"),
    ("- image\n- resolution", ": not a map's YAML: it must consist of fields"),
    ("image: x\n", ": the field 'resolution' is missing; a map has one"),
    *(
        ("".join(f"{line}\n" for line in YAML.splitlines() if not line.startswith(name)),
         f": the field {name!r} is missing; a map has one")
        for name in ("image", "resolution", "origin", "negate", "occupied_thresh", "free_thresh")
    ),
]  # fmt: skip


@pytest.mark.parametrize(("text", "message"), BAD)
def test_bad_yaml(text: str, message: str, tmp_path: Path) -> None:
    """The error is one line with file, line number and field."""
    (tmp_path / "image.pgm").write_bytes(PGM)
    path = tmp_path / "m.yaml"
    path.write_text(text)
    assert refused(lambda: load_world(path)).startswith(f"{path}{message}")
    assert not Path("hacked").exists()


def test_strange_fields_are_said(tmp_path: Path) -> None:
    """Unknown fields are reported: they may be misspelt."""
    (tmp_path / "image.pgm").write_bytes(PGM)
    path = tmp_path / "m.yaml"
    path.write_text(YAML + "".join(f'"\\n{i}{"x" * 100}": 1\n' for i in range(50)))
    notes = load_world(path).notes
    assert len(notes) == 10
    assert all(note.isprintable() and len(note) < len(str(path)) + 90 for note in notes)
    path.write_text(YAML + "modus: raw\n")
    assert load_world(path).notes == (f"{path}:7: 'modus' is not a field of a map; ignored",)


def test_the_image_may_be_named_by_another_way_to_the_folder(tmp_path: Path) -> None:
    """Absolutely, with `..`, or through a link, as long as the folder is the file's own."""
    (tmp_path / "maps" / "below").mkdir(parents=True)
    (tmp_path / "link").symlink_to(tmp_path / "maps")
    (tmp_path / "maps" / "image.pgm").write_bytes(PGM)
    (tmp_path / "maps" / "below" / "image.pgm").write_bytes(PGM)
    path = tmp_path / "maps" / "m.yaml"
    for name in (
        f"{tmp_path}/maps/image.pgm", f"{tmp_path}/maps/below/image.pgm", "../maps/image.pgm",
        "below/../image.pgm", f"{tmp_path}/link/image.pgm", f"{tmp_path}/maps/../maps/image.pgm",
    ):  # fmt: skip
        path.write_text(YAML.replace("image.pgm", name))
        for file in (path, tmp_path / "link" / "m.yaml"):
            assert grid_of(load_world(file)).cells.tolist() == [[True, False]]
    (tmp_path / "mapsimage.pgm").write_bytes(PGM)
    for name in (f"{tmp_path}/mapsimage.pgm", "../mapsimage.pgm", "below/../../mapsimage.pgm"):
        path.write_text(YAML.replace("image.pgm", name))
        assert "is outside the file's folder; if it is right, give" in refused(
            partial(load_world, path)
        )


def test_the_image_may_be_named_by_the_user(tmp_path: Path) -> None:
    """The user may name an image in any folder."""
    (tmp_path / "maps").mkdir()
    path = tmp_path / "maps" / "m.yaml"
    path.write_text(YAML.replace("image.pgm", "/nowhere/a.png"))
    for place in (tmp_path / "a.pgm", tmp_path / "maps" / "b.pgm"):
        place.write_bytes(PGM)
    for name in (tmp_path / "a.pgm", "b.pgm"):
        assert grid_of(make_world(f"{path}:image={name}")).cells.tolist() == [[True, False]]


# Images


def saved(image: Image.Image, path: Path) -> Path:
    """Save an image in a file."""
    image.save(path)
    return path


def test_images(tmp_path: Path) -> None:
    """Dark is blocked, the lowest row is at y = 0; threshold, resolution and inversion."""
    shades = np.array([[0, 127, 128], [255, 254, 100]], np.uint8)
    path = saved(Image.fromarray(shades), tmp_path / "m.png")
    world = load_world(path)
    assert grid_of(world).cells.tolist() == [[False, False, True], [True, True, False]]
    assert world.upper.tolist() == [3, 2]
    assert make_world(f"{path}:resolution=0.5").upper.tolist() == [1.5, 1]
    for spec, blocked in {
        "threshold=1": shades < 255, "threshold=0.01": shades < 3, "invert=yes": shades > 127,
        "invert=yes,threshold=0.01": shades > 252,
    }.items():  # fmt: skip
        assert (grid_of(make_world(f"{path}:{spec}")).cells == blocked[::-1]).all()


@pytest.mark.parametrize(
    "name", ["m.png", "m.pgm", "m.pbm", "m.ppm", "m.bmp", "m.jpg", "m.jpeg", "m.pnm"]
)
@pytest.mark.parametrize("mode", ["1", "L", "RGB"])
def test_kinds_of_images(name: str, mode: str, tmp_path: Path) -> None:
    """Black and white give the same cells in all formats."""
    squares = np.kron(np.array([[0, 1, 1], [1, 0, 1]], np.uint8), np.ones((16, 16), np.uint8))
    image = Image.fromarray(squares * 255).convert("1" if name == "m.pbm" else mode)
    cells = grid_of(load_world(saved(image, tmp_path / name))).cells
    assert (cells[::-1] == (squares == 0)).all()


def test_transparent_pixels_are_free(tmp_path: Path) -> None:
    """Transparent pixels are free, with any colour, inversion and storage."""
    image = np.array([[[0, 0], [0, 255], [0, 128], [255, 0], [255, 255]]], np.uint8)
    path = saved(Image.fromarray(image, "LA"), tmp_path / "m.png")
    blocked = [False, True, True, False, False]
    assert grid_of(make_world(f"{path}:threshold=0.51")).cells.tolist() == [blocked]
    inverted = [False, False, False, False, True]
    assert grid_of(make_world(f"{path}:invert=true")).cells.tolist() == [inverted]
    palette = Image.fromarray(np.array([[0, 1]], np.uint8), "P")
    palette.putpalette([0, 0, 0, 0, 0, 0])
    palette.save(tmp_path / "p.png", transparency=1)
    assert grid_of(load_world(tmp_path / "p.png")).cells.tolist() == [[True, False]]


def test_deep_images(tmp_path: Path) -> None:
    """16-bit images are not reduced to 8 bits."""
    shades = np.array([[32767, 32768]], np.uint16)
    for name in ("m.png", "m.pgm"):
        path = saved(Image.fromarray(shades), tmp_path / name)
        assert read_pixels(path).grey.tolist() == shades.tolist()
        assert grid_of(load_world(path)).cells.tolist() == [[True, False]]


def lying(path: Path, width: int, height: int) -> Path:
    """Write a small PNG, PGM or BMP whose header states a size."""
    saved(Image.new("L", (3, 3)), path)
    data = bytearray(path.read_bytes())
    if path.suffix == ".pgm":
        data = data.replace(b"3 3", f"{width} {height}".encode())
    elif path.suffix == ".bmp":
        data[18:26] = width.to_bytes(4, "little") + height.to_bytes(4, "little")
    else:
        data[16:24] = width.to_bytes(4, "big") + height.to_bytes(4, "big")
        data[29:33] = zlib.crc32(data[12:29]).to_bytes(4, "big")
    path.write_bytes(data)
    return path


@pytest.mark.parametrize("name", ["m.png", "m.pgm", "m.bmp"])
def test_images_that_lie(name: str, tmp_path: Path) -> None:
    """A header with too many pixels is refused before anything is decoded."""
    for width, height in ((100_000, 100_000), (8193, 8192), (70_000, 2000)):
        path = lying(tmp_path / name, width, height)
        assert "a map has at most 67,108,864" in refused(partial(load_world, path))
    for width, height in ((1000, 1000), (2**31 - 1, 1), (0, 5)):
        path = lying(tmp_path / name, width, height)
        assert refused(partial(load_world, path)).startswith(f"{path}: ")


def test_slow_images_are_small(tmp_path: Path) -> None:
    """A run-length BMP and a text PNM with millions of pixels are refused at once."""
    runs = lying(tmp_path / "m.bmp", 8000, 8000)
    data = bytearray(runs.read_bytes())
    data[30] = 1
    runs.write_bytes(data)
    (tmp_path / "text.pgm").write_bytes(b"P2 8000 8000 255\n" + b"0 " * 99)
    (tmp_path / "odd.pgm").write_bytes(b"P5 8000 8000 100\n" + bytes(99))
    start = time.perf_counter()
    for name in ("m.bmp", "text.pgm", "odd.pgm"):
        error = refused(partial(load_world, tmp_path / name))
        assert error == (f"{tmp_path / name}: this kind of image is slow to decode; save it as PNG")
    assert time.perf_counter() - start < 1


@pytest.mark.parametrize("name", ["m.png", "m.pgm", "m.bmp", "m.jpg"])
def test_cut_images(name: str, tmp_path: Path) -> None:
    """An image cut anywhere is refused or complete."""
    noise = np.random.default_rng(0).integers(0, 256, (20, 20), np.uint8)
    path = saved(Image.fromarray(noise), tmp_path / name)
    data = path.read_bytes()
    for length in range(0, len(data) - 20, 7):
        path.write_bytes(data[:length])
        assert refused(lambda: load_world(path)).startswith(f"{path}: ")


@pytest.mark.skipif(not REAL.exists(), reason="no real maps here")
def test_real_maps() -> None:
    """TenByTen, tb3_sandbox, and testmap, whose origin is turned by 1 rad."""
    folder = REAL / "ros_maps"
    turned = grid_of(load_world(folder / "testmap.yaml"))
    assert (turned.cells.shape, turned.origin.tolist(), turned.yaw) == ((10, 10), [2, 3], 1)
    assert (turned.cells == grid_of(load_world(folder / "testmap.pgm")).cells).all()
    sandbox = load_world(folder / "tb3_sandbox.yaml")
    assert sandbox.lower.tolist() == [-10, -10]
    assert sandbox.upper == pytest.approx([9.2, 9.2])
    assert "138,683 of 147,456 cells are unknown and count as blocked" in sandbox.notes[0]
    free = make_world(f"{folder / 'tb3_sandbox.yaml'}:unknown=free")
    assert grid_of(sandbox).cells.sum() - grid_of(free).cells.sum() == 138_683
    assert grid_of(load_world(folder / "TenByTen.yaml")).cells.shape == (10, 10)
