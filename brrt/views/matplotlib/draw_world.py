"""Worlds drawn by matplotlib, which is an extra: pip install 'brrt[plot]'."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrt.errors import BrrtError
from brrt.files import replacing
from brrt.views.colours import GOAL, OBSTACLE_3D, OUTLINE, PAPER_OBSTACLE, START, rgb
from brrt.worlds.occupancy import Grid
from brrt.worlds.world import World

Floats = NDArray[np.float64]

_INCHES, _DPI = 6.0, 200
_LIGHT = np.array([-0.35, -0.55, 0.75])
_ALPHA_3D = 0.45
_SEAM = 0.25
"""Line width, in points, that closes hairlines between obstacles that touch."""
_AROUND, _AROUND_ROUGH = 24, 8
"""Faces around a sphere, and around each of very many; from pole to pole there are half of them."""
_SMOOTH_FACES, _MOST_FACES = 40_000, 200_000
"""Faces of all spheres up to which they are smooth, and of all obstacles in 3D: a million take
seconds and gigabytes."""


def save_world(world: World, path: Path) -> None:
    """Draw a world into a .png, .svg or .pdf file, which appears once it is complete.

    Raises:
        BrrtError: matplotlib is missing, or the file cannot be written.
    """
    matplotlib = need_matplotlib()
    width, height = (world.upper - world.lower)[:2] if world.dim == 2 else (1.0, 1.0)
    # The picture of a very long world is at least a fifth as high as it is wide.
    size = np.maximum(np.array([width, height]) / max(width, height), 0.2) * _INCHES
    figure = matplotlib.figure.Figure(figsize=tuple(size), dpi=_DPI)
    plot_world(world, figure.add_subplot(projection=None if world.dim == 2 else "3d"))
    save_figure(figure, path, bbox_inches="tight")


def save_figure(figure: Any, path: Path, **how: Any) -> None:
    """Write a figure without a date, so that equal figures give equal files.

    The file appears once it is complete. `how` are other arguments of `savefig`.

    Raises:
        BrrtError: The file cannot be written.
    """
    dates = {".png": "Creation Time", ".svg": "Date", ".pdf": "CreationDate"}
    undated = {dates[path.suffix]: None} if path.suffix in dates else {}
    context = need_matplotlib().rc_context({"svg.hashsalt": "brrt"})
    with context, replacing(path) as unfinished:
        figure.savefig(unfinished, metadata=undated, **how)


def plot_world(world: World, ax: Any = None) -> Any:
    """Draw a world into axes, by default new ones; return them.

    The axes of a world in 3D have the projection "3d".

    Raises:
        BrrtError: matplotlib is missing, or the projection of the axes is not the world's.
    """
    need_matplotlib()
    if ax is None:
        ax = new_axes("3d" if world.dim == 3 else None)
    if (ax.name == "3d") != (world.dim == 3):
        raise BrrtError(
            f"the world is {world.dim}D; give axes made with subplot_kw={{'projection': '3d'}}"
            if world.dim == 3
            else "the world is 2D; give axes without a projection"
        )
    if world.dim == 2:
        _draw_2d(world, ax)
    else:
        _draw_3d(world, ax)
    return ax


def new_axes(projection: str | None = None) -> Any:
    """Return axes of a new figure that notebooks show."""
    import matplotlib.pyplot as plt  # noqa: PLC0415 - it opens windows

    return plt.subplots(subplot_kw={"projection": projection})[1]


def need_matplotlib() -> Any:
    """Import matplotlib.

    Raises:
        BrrtError: It is missing.
    """
    try:
        import matplotlib.figure  # noqa: PLC0415 - an extra, and slow to start
    except ImportError:
        raise BrrtError(
            "pictures need matplotlib, which is not installed; pip install 'brrt[plot]'"
        ) from None
    return matplotlib


def _draw_2d(world: World, ax: Any) -> None:
    from matplotlib import collections as artists  # noqa: PLC0415

    dark = rgb(PAPER_OBSTACLE)
    seam: dict[str, Any] = {"linewidths": _SEAM, "joinstyle": "miter"}
    (x0, y0), (x1, y1) = world.lower, world.upper
    if world.grid is not None:
        _draw_grid(world, world.grid, ax)
    if len(world.balls):
        sizes = 2 * world.balls[:, 2]
        ax.add_collection(
            artists.EllipseCollection(
                sizes, sizes, np.zeros(len(sizes)), units="xy", offsets=world.balls[:, :2],
                offset_transform=ax.transData, color=dark, **seam,
            )
        )  # fmt: skip
    corners = world.boxes[:, [0, 1, 2, 1, 2, 3, 0, 3]].reshape(-1, 4, 2)
    areas = [*corners, *(polygon for polygon in world.polygons if len(polygon) > 2)]
    if areas:
        ax.add_collection(artists.PolyCollection(areas, color=dark, **seam))
    segments = [polygon for polygon in world.polygons if len(polygon) == 2]
    if segments:
        ax.add_collection(
            artists.LineCollection(segments, color=dark, linewidths=1.2, capstyle="round")
        )
    _draw_ends(world, ax)
    ax.set(xlim=(x0, x1), ylim=(y1, y0) if world.y_down else (y0, y1), aspect="equal")
    ax.tick_params(color=rgb(OUTLINE), labelcolor=rgb(OUTLINE), labelsize=7, width=0.5, length=2.5)
    for spine in ax.spines.values():
        spine.set(color=rgb(OUTLINE), linewidth=0.6)


def _draw_ends(world: World, ax: Any) -> None:
    for point, colour, name in ((world.start, START, "start"), (world.goal, GOAL, "goal")):
        if point is not None:
            ax.plot(
                *point[:, None], ls="", marker="o", ms=7, color=rgb(colour), mec="white", mew=0.8,
                zorder=5, label=name,
            )  # fmt: skip


def _draw_grid(world: World, grid: Grid, ax: Any) -> None:
    """Draw the cells as an image; space that the grid does not cover is blocked."""
    from matplotlib.colors import ListedColormap  # noqa: PLC0415
    from matplotlib.patches import Rectangle  # noqa: PLC0415
    from matplotlib.transforms import Affine2D  # noqa: PLC0415

    if not grid.contains_box(world.lower, world.upper):
        (x, y), size = world.lower, world.upper - world.lower
        ax.add_patch(Rectangle((x, y), *size, color=rgb(PAPER_OBSTACLE), linewidth=0, zorder=-2))
    turned = Affine2D().rotate(grid.yaw).translate(*grid.origin)
    width, height = grid.size
    ax.imshow(
        grid.cells, cmap=ListedColormap([(1, 1, 1), rgb(PAPER_OBSTACLE)]), vmin=0, vmax=1,
        extent=(0, width, 0, height), origin="lower", interpolation="nearest",
        transform=turned + ax.transData, zorder=-1,
    )  # fmt: skip


def _draw_3d(world: World, ax: Any) -> None:
    from matplotlib.ticker import MaxNLocator  # noqa: PLC0415
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection  # noqa: PLC0415

    boxes, balls = _largest(world)
    faces = np.concatenate([_box_faces(boxes), _ball_faces(balls)])
    if len(faces):
        normals = np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0])
        normals += np.cross(faces[:, 2] - faces[:, 0], faces[:, 3] - faces[:, 0])
        lengths = np.maximum(np.linalg.norm(normals, axis=1), np.finfo(float).tiny)
        light = normals @ (_LIGHT / np.linalg.norm(_LIGHT)) / lengths
        shade = (0.62 + 0.38 * light)[:, None] * rgb(OBSTACLE_3D)
        colours = np.concatenate([shade, np.full((len(shade), 1), _ALPHA_3D)], axis=1)
        edges = np.where(np.arange(len(faces)) < 6 * len(boxes), 0.25, 0.0)
        ax.add_collection3d(
            Poly3DCollection(
                faces,
                facecolors=colours,
                edgecolors=rgb(PAPER_OBSTACLE),
                linewidths=edges,
                zorder=1,
            )
        )
    drawn, there = len(boxes) + len(balls), len(world.boxes) + len(world.balls)
    if drawn < there:
        text = f"the largest {drawn:,} of {there:,} obstacles"
        ax.text2D(0, 0.97, text, transform=ax.transAxes, size=7, color=rgb(OUTLINE))
    ax.computed_zorder = False
    _draw_ends(world, ax)
    limits = zip("xyz", world.lower, world.upper, strict=True)
    ax.set(**{f"{axis}lim": (low, high) for axis, low, high in limits})
    ax.set_box_aspect(world.upper - world.lower)
    ax.tick_params(labelsize=7, labelcolor=rgb(OUTLINE), color=rgb(OUTLINE))
    sizes = (world.upper - world.lower) / world.extent
    for axis, size in zip((ax.xaxis, ax.yaxis, ax.zaxis), sizes, strict=True):
        axis.set_major_locator(MaxNLocator(max(1, round(5 * size))))
        axis.set_pane_color((1, 1, 1, 0))
        axis.line.set(color=rgb(OUTLINE), linewidth=0.6)
        axis._axinfo["grid"].update(linewidth=0.25, color="0.85")  # noqa: SLF001 - no public API


def _largest(world: World) -> tuple[Floats, Floats]:
    """Return as many of the boxes and balls as can be drawn, those with the largest radii."""
    boxes, balls = world.boxes, world.balls
    radii = np.concatenate([np.linalg.norm(boxes[:, 3:] - boxes[:, :3], axis=1) / 2, balls[:, 3]])
    faces = np.repeat([6, _AROUND_ROUGH * _AROUND_ROUGH // 2], [len(boxes), len(balls)])
    if faces.sum() <= _MOST_FACES:
        return boxes, balls
    order = np.argsort(-radii, kind="stable")
    drawn = np.sort(order[np.cumsum(faces[order]) <= _MOST_FACES])
    return boxes[drawn[drawn < len(boxes)]], balls[drawn[drawn >= len(boxes)] - len(boxes)]


def _box_faces(boxes: Floats) -> Floats:
    """Return the faces of boxes, counter-clockwise from outside, shape (6 n, 4, 3)."""
    low, high = boxes[:, None, :3], boxes[:, None, 3:]
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    unit = np.zeros((6, 4, 3))
    for axis in range(3):
        across = [(axis + 1) % 3, (axis + 2) % 3]
        unit[2 * axis][:, across] = square[::-1]
        unit[2 * axis + 1][:, across] = square
        unit[2 * axis + 1][:, axis] = 1
    return np.asarray(low[:, None] + unit * (high - low)[:, None]).reshape(-1, 4, 3)


def _ball_faces(balls: Floats) -> Floats:
    """Return quadrilateral faces of spheres, fewer of each if there are many; shape (m, 4, 3)."""
    smooth = len(balls) * _AROUND * (_AROUND // 2) < _SMOOTH_FACES
    around = _AROUND if smooth else _AROUND_ROUGH
    up = around // 2
    a, b = np.meshgrid(
        np.linspace(0, 2 * np.pi, around + 1), np.linspace(-np.pi / 2, np.pi / 2, up + 1)
    )
    unit = np.stack([np.cos(b) * np.cos(a), np.cos(b) * np.sin(a), np.sin(b)], axis=-1)
    faces = np.stack([unit[:-1, :-1], unit[:-1, 1:], unit[1:, 1:], unit[1:, :-1]], axis=2)
    faces = faces.reshape(-1, 4, 3)
    placed = balls[:, None, None, :3] + balls[:, None, None, 3:] * faces
    return np.asarray(placed.reshape(-1, 4, 3))
