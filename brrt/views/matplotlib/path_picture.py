"""A path that was judged, drawn into its world: where it is free, and where it hits what."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrt.verification.path_check import PathCheck
from brrt.views.colours import PAPER_HIT, rgb
from brrt.views.matplotlib import style
from brrt.views.matplotlib.draw_world import need_matplotlib, plot_world, save_figure

Floats = NDArray[np.float64]

_DPI, _LEAST, _HIGHEST = 200, 0.3, 2.2
_BODIES, _PARTS, _MOST_HITS = 12, 16, 200
"""Bodies along the path; pieces of a motion, which may be a curve; hits that are marked."""


def save_path(check: PathCheck, path: Path) -> None:
    """Draw a path into a .png, .svg or .pdf file; it appears once it is complete.

    Raises:
        BrrtError: matplotlib is missing, or the file cannot be written.
    """
    mpl = need_matplotlib()
    size, width = check.world.upper - check.world.lower, style.PAGE_IN * 0.7
    shape = np.clip(size[1] / size[0], _LEAST, _HIGHEST) if len(size) == 2 else 0.85
    with style.paper():
        figure = mpl.figure.Figure(
            figsize=(width, width * float(shape) + 0.5), dpi=_DPI, layout="constrained"
        )
        draw_path(check, figure.add_subplot(projection=None if len(size) == 2 else "3d"))
        figure.legend(loc="outside lower center", ncols=4)
        save_figure(figure, path, dpi=_DPI)


def draw_path(check: PathCheck, ax: Any) -> None:
    """Draw a path and its world into axes, with projection "3d" for a world in 3D."""
    plot_world(replace(check.world, start=None, goal=None), ax)
    hit = {each.motion for each in check.hits}
    places = [_places(check, i) for i in range(len(check.lengths))]
    for colour, name, wanted in (
        (style.PATH, "free", False),
        (rgb(PAPER_HIT), "not free", True),
    ):
        some = [each for i, each in enumerate(places) if (i in hit) == wanted]
        if some:
            gap = np.full((1, check.world.dim), np.nan)
            line = np.concatenate([part for each in some for part in (each, gap)])
            ax.plot(*line.T, color=colour, lw=1.4, zorder=3, label=name)
    marks = check.robot.places(
        np.array([each.q for each in check.hits[:_MOST_HITS]] or check.q[:0])
    )
    _mark(ax, marks, "hits here", rgb(PAPER_HIT), "x", 6)
    _mark(ax, check.robot.places(check.q[:1]), "begin", style.START, "o", 5)
    _mark(ax, check.robot.places(check.q[-1:]), "end", style.GOAL, "o", 5)
    if check.world.dim == 2:
        _draw_bodies(check, ax)
        digits = "holds" if check.holds else "does not hold"
        ax.set_title(
            f"the path {digits} · length {check.length:.5g}", loc="left", color=style.QUIET
        )


def _places(check: PathCheck, motion: int) -> Floats:
    """Return places along a motion, shape (k, d); that of a body may follow a curve."""
    curved = bool(len(check.robot.outline(check.q[0])))
    parts = np.linspace(0, 1, _PARTS + 1 if curved else 2)
    a, b = check.q[motion], check.q[min(motion + 1, len(check.q) - 1)]
    return check.robot.places(check.robot.interpolate(a, b, parts))


def _mark(ax: Any, places: Floats, name: str, colour: Any, marker: str, size: float) -> None:
    if len(places):
        ax.plot(
            *places.T, ls="", marker=marker, ms=size, color=colour, zorder=5, label=name,
            mec=colour if marker == "x" else "white", mew=1.4 if marker == "x" else 0.7,
        )  # fmt: skip


def _draw_bodies(check: PathCheck, ax: Any) -> None:
    """Draw the body along the path and where it hits."""
    from matplotlib.collections import PolyCollection  # noqa: PLC0415

    along = [*check.q[:1], *check.robot.along(check.q, _BODIES), *check.q[-1:]]
    hits = [np.array(hit.q) for hit in check.hits[:_MOST_HITS]]
    for poses, colour in ((along, style.SMOOTHED), (hits, rgb(PAPER_HIT))):
        parts = [part for q in poses for part in check.robot.outline(q)]
        if parts:
            bodies = PolyCollection(
                parts, facecolors=[(*colour, 0.12)], edgecolors=[(*colour, 0.9)], linewidths=0.5,
                zorder=2.5,
            )  # fmt: skip
            ax.add_collection(bodies, autolim=False)
