"""A small file of each format that loaders read, and ways to corrupt it."""

import json
import re
from collections.abc import Callable
from pathlib import Path
from random import Random

import numpy as np
import pytest

from brrt import BrrtError
from brrt.worlds import World

REAL = Path(__file__).parents[3] / "shared" / "worlds"

BLOCKS = "boundary 0 0 0 9 9 9\nblock 1 1 1 2 2 2\n"
GRID = "type octile\nheight 2\nwidth 3\nmap\n.@.\n...\n"
SCENARIOS = "version 1\n0\tgrid.map\t3\t2\t0\t0\t2\t0\t4.0\n3\tgrid.map\t3\t2\t0\t1\t2\t1\t2\n"
CIRCLES = "units: meter\n\tx\ty\tr\n1\t5\t5\t2\n2\t0\t1\t1\n"
QUERIES = "0\tstart:\t1\t2\n0\tgoal:\t1\t3\n7\tstart:\t1\t4\n7\tgoal:\t1\t5\n"
YAML = (
    "image: image.pgm\nresolution: 0.5\norigin: [1, 2, 0]\nnegate: 0\n"
    "occupied_thresh: 0.65\nfree_thresh: 0.196\n"
)
PGM = b"P5\n# dark, light\n2 1\n255\n\x00\xff"
SQUARE = [[0, 0], [4, 0], [4, 4], [0, 4], [0, 0]]
GEOJSON = json.dumps({"type": "Polygon", "coordinates": [SQUARE]})
JSON = World("w", np.zeros(2), np.ones(2)).to_json()

GOOD: dict[str, str | bytes] = {
    "blocks.txt": BLOCKS,
    "grid.map": GRID,
    "grid.scen": SCENARIOS,
    "circle_obstacles.txt": CIRCLES,
    "circle_queries.txt": QUERIES,
    "map.yaml": YAML,
    "image.pgm": PGM,
    "polygon.geojson": GEOJSON,
    "world.json": JSON,
}
"""A file of each format; they belong into one folder."""

FORMATS = {
    "blocks.txt": "blocks", "grid.map": "movingai", "grid.scen": "scenarios", "map.yaml": "ros",
    "circle_obstacles.txt": "circles", "circle_queries.txt": "circles", "image.pgm": "image",
    "polygon.geojson": "geojson", "world.json": "brrt",
}  # fmt: skip


def write(folder: Path) -> None:
    """Write a file of each format into a folder."""
    for name, content in GOOD.items():
        (folder / name).write_bytes(content if isinstance(content, bytes) else content.encode())


def refused(action: Callable[[], object]) -> str:
    """Return the message of the BrrtError that an action raises; it must be one short line."""
    with pytest.raises(BrrtError) as error:
        action()
    message = str(error.value)
    assert len(message.splitlines()) == 1
    assert len(message) < 600
    return message


HOSTILE = (
    b"nan", b"-inf", b"1e999", b"-1", b"0", b"1e308", b"99999999999999999999", b"2147483648", b"x",
    b"", b"\xc2\xb2", b"\x00", b"null", b"[", b"]]", b"{", b"}", b'"', b"#", b":", b",", b"&a",
    b"*a", b"<<", b"!!python/name:os.system", b"../../x", b"/etc/passwd", b"Feature",
    b"GeometryCollection", b"boundary", b"start:", b"version", b"type octile", b"1e-300", b"0x10",
    b"65535", b"true",
)  # fmt: skip
"""Words that replace others."""

WORDS = re.compile(rb"[^\s,:\[\]{}\"]+")


def corrupted(data: bytes, rng: Random) -> bytes:
    """Change a file in one to four places: bytes, words, lines, or its length."""
    for _ in range(rng.randint(1, 4)):
        at = rng.randint(0, len(data))
        match rng.randint(0, 6):
            case 0:  # a byte becomes another
                data = data[:at] + bytes([rng.randint(0, 255)]) + data[at + 1 :]
            case 1:  # a bit is flipped
                bit = bytes([data[at] ^ 1 << rng.randint(0, 7)]) if at < len(data) else b""
                data = data[:at] + bit + data[at + 1 :]
            case 2 | 3:  # a word becomes a hostile one
                words = list(WORDS.finditer(data))
                start, end = rng.choice(words).span() if words else (at, at)
                data = data[:start] + rng.choice(HOSTILE) + data[end:]
            case 4:  # the end is missing
                data = data[:at]
            case 5:  # a line is missing, or there twice
                lines = data.split(b"\n")
                i = rng.randint(0, len(lines) - 1)
                data = b"\n".join(
                    lines[:i] + lines[i : i + 1] * rng.choice((0, 2)) + lines[i + 1 :]
                )
            case _:  # something is there again, elsewhere
                to = rng.randint(0, len(data))
                data = data[:to] + data[at : at + rng.randint(1, 30)] + data[to:]
    return data
