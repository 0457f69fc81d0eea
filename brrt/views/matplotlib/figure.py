"""Figures of runs: panels side by side, in the width of a column or of a page."""

from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from brrt.errors import BrrtError, unknown
from brrt.events import Kind
from brrt.recording import Recording, check_limits
from brrt.views.matplotlib import style
from brrt.views.matplotlib.curves import Against, draw_cost, draw_time
from brrt.views.matplotlib.draw_world import need_matplotlib, new_axes, plot_world, save_figure
from brrt.views.matplotlib.history import Record
from brrt.views.matplotlib.tree import TreePanel
from brrt.worlds.world import World

PANELS = ("tree", "cost", "time")
_CURVE_HEIGHT, _SCALE_HEIGHT, _LEGEND_HEIGHT = 2.4, 0.65, 0.35
_LEGEND_COLUMNS, _LEGEND_LINE = 4, 0.8
_LOWEST, _HIGHEST = 0.3, 2.2
"""Shapes that a map may have, height by width, before it is drawn with empty margins."""


@dataclass(frozen=True, slots=True)
class Look:
    """How a figure is drawn.

    Attributes:
        width: Its width in inches; by default a column's for one panel and a page's for more.
        dpi: Dots per inch, also of what is an image in a .svg or .pdf.
        rejects: How many of the newest rejected extensions are drawn.
        against: Abscissa of costs; see `draw_cost`.
        azimuth: Where the camera of a 3D world stands, in degrees around the vertical.
        elevation: How high it stands, in degrees.
    """

    width: float | None = None
    dpi: int = 300
    rejects: int = 0
    against: Against | None = None
    azimuth: float = -62.0
    elevation: float = 28.0


def save_plot(
    records: Sequence[Record], path: Path, panels: Sequence[str] = (), look: Look | None = None
) -> None:
    """Draw runs into a .png, .svg or .pdf file; equal runs give equal files.

    Args:
        records: The runs; several are for costs alone.
        path: The file; it appears under its name when it is whole.
        panels: Some of `PANELS`; by default the tree, with the cost where the planner improves,
            and of several runs the cost.
        look: How.

    Raises:
        BrrtError: matplotlib is missing, a panel has nothing to show, or the file cannot be
            written.
    """
    mpl, look = need_matplotlib(), look or Look()
    if not panels:
        single = ("tree", "cost") if records[0].improves else ("tree",)
        panels = single if len(records) == 1 else ("cost",)
    if len(records) > 1 and set(panels) != {"cost"}:
        raise BrrtError("several runs share a picture of their costs alone; give --what cost")
    with style.paper():
        width = look.width or (style.COLUMN_IN if len(panels) == 1 else style.PAGE_IN)
        shares = _shares(panels)
        heights = [_height(records[0], p, width * s) for p, s in zip(panels, shares, strict=True)]
        figure = mpl.figure.Figure(
            figsize=(width, max(heights)), dpi=look.dpi, layout="constrained"
        )
        parts = np.atleast_1d(figure.subfigures(1, len(panels), width_ratios=shares))
        for panel, part in zip(panels, parts, strict=True):
            if panel == "tree":
                _add_tree(part, records[0], look)
            elif panel == "cost":
                draw_cost(part.add_subplot(), records, look.against)
            else:
                draw_time(part.subplots(3, 1, sharex=True), records[0])
        save_figure(figure, path, dpi=look.dpi)


def plot(
    run: Recording | World,
    ax: Any = None,
    *,
    what: str = "tree",
    rejects: int = 0,
    **until: int | None,
) -> Any:
    """Draw a run or a world by matplotlib into axes, new ones by default; return the axes.

    Args:
        run: The run, or a world.
        ax: Axes of matplotlib, with projection "3d" for the tree in a world in 3D.
        what: "tree", or "cost" for the cost of the best path.
        rejects: How many of the newest rejected extensions are drawn.
        until: The instant, as `Events.until` takes it; the end by default.

    Raises:
        BrrtError: matplotlib is missing, the axes do not fit, or there is no path.
    """
    if isinstance(run, World):
        return plot_world(run, ax)
    need_matplotlib()
    check_limits(until, "ax", "what", "rejects")
    events = run.events().until(**until)
    record = Record(run.manifest.scenario.planner, run.manifest, run.world, events)
    if what not in PANELS[:2]:
        raise unknown("panel", what, PANELS[:2])
    with style.paper() if ax is None else nullcontext():
        deep = what == "tree" and record.manifest.dim == 3
        ax = new_axes("3d" if deep else None) if ax is None else ax
        if what == "cost":
            return draw_cost(ax, [record])
        panel = TreePanel(record, ax, rejects)
        panel.show(panel.history.last)
    return ax


def tree_panel(part: Any, record: Record, look: Look) -> TreePanel:
    """Put axes into a figure, or a part of one, and the run at no instant yet into these."""
    flat = record.manifest.dim == 2
    ax = part.add_subplot(projection=None if flat else "3d")
    if not flat:
        ax.view_init(elev=look.elevation, azim=look.azimuth)
    return TreePanel(record, ax, look.rejects)


def height_of_tree(record: Record, width: float) -> float:
    """Return the height, in inches, that suits the world, its legend and scale in a width."""
    below = _LEGEND_HEIGHT + _SCALE_HEIGHT * bool(record.events.counts.get(Kind.EXPAND))
    if record.manifest.dim == 3:
        return 0.85 * width + below
    size = record.world.upper - record.world.lower
    map_height = (width - 0.35) * float(np.clip(size[1] / size[0], _LOWEST, _HIGHEST))
    return map_height + 0.4 + below


def _add_tree(part: Any, record: Record, look: Look) -> None:
    panel = tree_panel(part, record, look)
    panel.show(panel.history.last)
    explain(part, panel, panel.legend())


def explain(part: Any, panel: TreePanel, marks: Sequence[Any]) -> None:
    """Say below a tree what is what.

    Args:
        part: The figure.
        panel: The tree in it.
        marks: What has a name, see `TreePanel.legend`.
    """
    rows = -(-len(marks) // _LEGEND_COLUMNS)
    columns = -(-len(marks) // rows)
    legend = part.legend(
        handles=marks, loc="outside lower center", ncols=columns, borderaxespad=0.2
    )
    for line in legend.get_lines():
        if line.get_linewidth() > 0:
            line.set(linewidth=max(line.get_linewidth(), _LEGEND_LINE), alpha=1.0)
    if panel.heat is not None:
        cells, meaning = panel.heat
        below = {"location": "bottom", "shrink": 0.8, "pad": 0.03, "aspect": 40}
        part.colorbar(cells, ax=part.axes[0], label=meaning, **below)


def _shares(panels: Sequence[str]) -> list[float]:
    weights = [1.15 if panel == "tree" else 1.0 for panel in panels]
    return [weight / sum(weights) for weight in weights]


def _height(record: Record, panel: str, width: float) -> float:
    if panel == "tree":
        return height_of_tree(record, width)
    return _CURVE_HEIGHT * (1.35 if panel == "time" else 1.0)
