"""How runs look on white paper: colours, sizes of type, and figures of a column's width."""

from collections.abc import Mapping
from contextlib import AbstractContextManager
from typing import Any

import numpy as np

from brrt.views.colours import Colour
from brrt.views.matplotlib.draw_world import need_matplotlib, rgb

# The viewer's hues, darker: there, bright colours stand on a dark ground.
START = rgb((228, 108, 10))
GOAL = rgb((24, 150, 62))
RAW = rgb((216, 164, 0))
SMOOTHED = rgb((168, 110, 0))
REJECTED = rgb((178, 120, 124))
ROBOT = rgb((20, 22, 28))
QUIET = rgb((96, 103, 118))
"""Type and ticks that explain."""
HEAT = "viridis"
"""Map of colours from cheap to dear, even to the colour-blind eye and in grey."""
CELL_ALPHA = 0.75
"""Of cells in 3D, where one looks through them."""

_TREES: Mapping[int, tuple[str, Colour, Colour]] = {
    0: ("start", (38, 104, 214), (0, 158, 190)),
    1: ("goal", (206, 38, 46), (222, 92, 150)),
}
_OTHER: Colour = (124, 74, 190)
CURVES = tuple(
    rgb(colour)
    for colour in (
        (38, 104, 214), (206, 38, 46), (24, 150, 62), (228, 108, 10), (124, 74, 190),
        (0, 140, 168), (150, 90, 60), (96, 103, 118),
    )
)  # fmt: skip

COLUMN_IN, PAGE_IN = 3.3, 6.9
"""Widths, in inches, of one column and of both on the pages of most journals."""

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
    "figure.facecolor": "white",
    "axes.facecolor": "white",
    "pdf.fonttype": 42,  # type that can be searched, as publishers want it
}


def tree_style(number: int) -> tuple[str, tuple[float, ...], tuple[float, ...]]:
    """Return a tree's name, its colour, and that of its rewired edges."""
    name, colour, rewired = _TREES.get(number, (str(number), _OTHER, _OTHER))
    return name, rgb(colour), rgb(rewired)


def paper() -> AbstractContextManager[Any]:
    """Set sizes of type and lines while the body draws, whatever the user's own settings are."""
    mpl = need_matplotlib()
    defaults = {
        key: value for key, value in mpl.rcParamsDefault.items() if not key.startswith("backend")
    }
    context: AbstractContextManager[Any] = mpl.rc_context(defaults | _TYPE)
    return context


def clean(ax: Any) -> None:
    """Take away what a curve does not need: the frame above and at the right."""
    ax.spines[["top", "right"]].set_visible(False)
    ax.grid(visible=True, linewidth=0.3, color="0.88")
    ax.set_axisbelow(True)


def unit_of(seconds: float) -> tuple[float, str]:
    """Return the size and the name of the unit that suits a duration."""
    for size, name in ((1.0, "s"), (1e-3, "ms"), (1e-6, "µs")):
        if seconds >= size:
            return size, name
    return 1e-9, "ns"


def line_width(edges: int) -> float:
    """Return the width of a tree's edges, in points: thinner where there are many."""
    return float(np.clip(0.65 * (600 / max(edges, 1)) ** 0.3, 0.15, 0.65))
