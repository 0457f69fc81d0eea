"""A world drawn with characters, as large as the terminal allows."""

from typing import TYPE_CHECKING

import numpy as np
from rich.color import Color
from rich.style import Style
from rich.text import Text

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from brrt.worlds import World

    Floats = NDArray[np.float64]

_SAMPLES = 4
"""Sample points in a pixel along each axis."""
_DEPTH = 32
"""Sample points along the line of sight, in 3D."""
_FAINT = 0.25
"""Covered share of a pixel with an obstacle too thin for the sample points."""
_SHADES = {2: (0.05, 0.22, 0.45, 0.75), 3: (0.02, 0.12, 0.3, 0.6)}
"""Covered shares from which on characters get darker, by dimension."""
_BLOCKS, _LETTERS = " ░▒▓█", " .:*#"
_FRAMES = {True: tuple("┌─┐│└┘"), False: tuple("+-+|++")}


def draw_world(world: "World", columns: int, rows: int, *, blocks: bool) -> Text:
    """Draw a world, in 3D from above and from the side.

    Darker characters are covered more by obstacles, in 3D along the whole line of sight.

    Args:
        world: The world.
        columns: Maximum characters in a line.
        rows: Maximum lines.
        blocks: Whether to use block characters; otherwise ASCII.
    """
    if world.dim == 2:
        return Text("\n").join(_panel(world, (0, 1), columns, rows, blocks=blocks))
    half = (columns - 2) // 2
    above = _panel(world, (0, 1), half, rows - 1, blocks=blocks)
    beside = _panel(world, (0, 2), half, rows - 1, blocks=blocks)
    above.insert(0, Text("from above: x to the right, y up"[: half + 1]))
    beside.insert(0, Text("from the side: x to the right, z up"[:half]))
    width = max(len(line) for line in above)
    lines = []
    for i in range(max(len(above), len(beside))):
        line = above[i].copy() if i < len(above) else Text()
        if i < len(beside):
            line.pad_right(width + 2 - len(line))
            line += beside[i]
        lines.append(line)
    return Text("\n").join(lines)


def _panel(
    world: "World", axes: tuple[int, int], columns: int, rows: int, *, blocks: bool
) -> list[Text]:
    """Draw a world in a frame, seen along the third axis if there is one."""
    from brrt.views.colours import GOAL, START

    size = (world.upper - world.lower)[list(axes)]
    # A character is about twice as high as wide: it contains two pixels, one above the other.
    pixel = max(size[0] / (columns - 2), size[1] / (2 * (rows - 2)))
    width, height = (max(1, round(side / pixel)) for side in size)
    height += height % 2
    share = _shares(world, axes, width, height)
    if world.y_down:
        share = share[::-1]
    upper, lower = share[-1::-2], share[-2::-2]
    mean = (upper + lower) / 2
    shades = _BLOCKS if blocks else _LETTERS
    letters = np.array(list(shades))[np.searchsorted(_SHADES[world.dim], mean, "right")]
    if blocks:
        letters[upper - lower > 0.5] = "▀"
        letters[lower - upper > 0.5] = "▄"
    corner, edge, corner2, side, corner3, corner4 = _FRAMES[blocks]
    lines = [Text(f"{side}{''.join(line)}{side}") for line in letters]
    for point, mark, colour in ((world.start, "S", START), (world.goal, "G", GOAL)):
        if point is not None:
            at = (point - world.lower)[list(axes)] / size
            column = min(max(int(at[0] * width), 0), width - 1)
            down = at[1] if world.y_down else 1 - at[1]
            row = min(max(int(down * len(lines)), 0), len(lines) - 1)
            lines[row] = (
                lines[row][: column + 1]
                + Text(mark, Style(color=Color.from_rgb(*colour), bold=True))
                + lines[row][column + 2 :]
            )
    bar = edge * width
    return [Text(f"{corner}{bar}{corner2}"), *lines, Text(f"{corner3}{bar}{corner4}")]


def _shares(world: "World", axes: tuple[int, int], width: int, height: int) -> "Floats":
    """Return the covered share of each pixel, rows from below; shape (height, width)."""
    from brrt.worlds.free_space import occupied

    counts = dict(zip(axes, (width * _SAMPLES, height * _SAMPLES), strict=True))
    if world.dim == 3:
        counts = {axis: -(-n // 2) for axis, n in counts.items()}
    each = [counts.get(axis, _DEPTH) for axis in range(world.dim)]
    places = [
        low + (np.arange(n) + 0.5) * (high - low) / n
        for low, high, n in zip(world.lower, world.upper, each, strict=True)
    ]
    grid = np.stack(np.meshgrid(*places, indexing="ij"), axis=-1)
    hit = occupied(world, grid.reshape(-1, world.dim)).reshape(each).astype(np.float64)
    flat = np.moveaxis(hit, axes, (0, 1)).reshape(each[axes[0]], each[axes[1]], -1).mean(axis=2)
    share = flat.reshape(width, -1, height, flat.shape[1] // height).mean(axis=(1, 3)).T
    thin = _FAINT * _thin(world, width, height) if world.dim == 2 else 0.0
    return np.asarray(np.maximum(share, thin))


def _thin(world: "World", width: int, height: int) -> "NDArray[np.bool_]":
    """Return which pixels an obstacle touches that is thinner than the points' distance."""
    from brrt.worlds import World
    from brrt.worlds.obstacle_arrays import obstacle_arrays
    from brrt.worlds.rasterize import Raster

    cell = (world.upper - world.lower) / (width, height)
    least = float(cell.min()) / _SAMPLES
    sides = world.boxes[:, 2:] - world.boxes[:, :2]
    thin = World(
        "thin",
        world.lower,
        world.upper,
        world.balls[2 * world.balls[:, 2] < least],
        world.boxes[sides.min(axis=1) < least],
        polygons=tuple(polygon for polygon in world.polygons if len(polygon) == 2),
    )
    raster = Raster(world.lower, cell, (width, height))
    return raster.blocked(obstacle_arrays(thin)).T
