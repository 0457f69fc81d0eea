"""How figures look on white paper: colours, sizes of type, and widths of a column and a page."""

from contextlib import AbstractContextManager
from typing import Any

import numpy as np

from brrt.text import readable, visible
from brrt.views import colours
from brrt.views.colours import rgb
from brrt.views.matplotlib.draw_world import need_matplotlib

START, GOAL = rgb(colours.PAPER_START), rgb(colours.PAPER_GOAL)
PATH, SMOOTHED = rgb(colours.PAPER_PATH), rgb(colours.PAPER_SMOOTHED)
REJECTED, ROBOT = rgb(colours.PAPER_REJECTED), rgb(colours.PAPER_ROBOT)
GRAPH = rgb(colours.PAPER_GRAPH)
QUIET = rgb(colours.OUTLINE)
"""Captions and notes."""
CURVES = tuple(map(rgb, colours.PAPER_CURVES))
HEAT = "viridis"
"""Colour map from low to high, even to colour-blind eyes and in grey."""
CELL_ALPHA = 0.75
"""Of cells in 3D, which one sees through."""

COLUMN_IN, PAGE_IN = 3.3, 6.9
"""Widths, in inches, of a column and of a page of two columns in most journals."""

_TYPE = {
    "font.size": 7.5,
    "axes.labelsize": 7.5,
    "axes.titlesize": 7,
    "legend.fontsize": 7,
    "xtick.labelsize": 7,
    "ytick.labelsize": 7,
    "axes.linewidth": 0.6,
    "xtick.major.width": 0.5,
    "ytick.major.width": 0.5,
    "xtick.major.size": 2.5,
    "ytick.major.size": 2.5,
    "legend.frameon": False,
    "legend.handlelength": 1.2,
    "legend.columnspacing": 1.0,
    "legend.handletextpad": 0.4,
    "legend.labelspacing": 0.3,
    "axes.formatter.use_mathtext": True,
    "axes.formatter.limits": (-4, 6),
    "axes.formatter.offset_threshold": 3,  # labels of maps far from the origin would overlap
    "figure.facecolor": "white",
    "axes.facecolor": "white",
    "pdf.fonttype": 42,  # searchable type, which publishers require
}


def tree_style(number: int) -> tuple[str, tuple[float, ...], tuple[float, ...]]:
    """Return a tree's name, its colour, and that of its rewired edges."""
    other = (str(number), colours.PAPER_OTHER, colours.PAPER_OTHER)
    name, colour, rewired = colours.PAPER_TREES.get(number, other)
    return name, rgb(colour), rgb(rewired)


def paper() -> AbstractContextManager[Any]:
    """Set sizes of type and lines in the body, independent of the user's settings."""
    mpl = need_matplotlib()
    defaults = {
        key: value for key, value in mpl.rcParamsDefault.items() if not key.startswith("backend")
    }
    context: AbstractContextManager[Any] = mpl.rc_context(defaults | _TYPE)
    return context


def clean(ax: Any) -> None:
    """Remove the frame above and at the right of axes, and draw a grid."""
    ax.spines[["top", "right"]].set_visible(False)
    ax.grid(visible=True, linewidth=0.3, color="0.88")
    ax.set_axisbelow(True)


def unit_of(seconds: float) -> tuple[float, str]:
    """Return the size and the name of the unit that suits a duration."""
    for size, name in ((1.0, "s"), (1e-3, "ms"), (1e-6, "µs")):
        if seconds >= size:
            return size, name
    return 1e-9, "ns"


def literal(name: str) -> str:
    """Return a name as a text of matplotlib that shows it as it is, without formulas."""
    return visible(readable(name), one_line=True).replace("$", r"\$")


def line_width(edges: int) -> float:
    """Return the width of a tree's edges, in points: thinner where there are many."""
    return float(np.clip(0.65 * (600 / max(edges, 1)) ** 0.3, 0.15, 0.65))
