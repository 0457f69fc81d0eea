"""Figures of runs: panels side by side, in the width of a column or of a page."""

from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from brrt.errors import BrrtError, unknown
from brrt.events import Kind, Stage
from brrt.recording import Recording, check_limits
from brrt.views.matplotlib import style
from brrt.views.matplotlib.curves import Against, draw_cost, draw_time
from brrt.views.matplotlib.draw_world import need_matplotlib, new_axes, plot_world, save_figure
from brrt.views.matplotlib.tree_panel import TreePanel
from brrt.worlds.world import World

PANELS = ("tree", "cost", "time")
_CURVE_HEIGHT, _SCALE_HEIGHT, _LEGEND_HEIGHT = 2.4, 0.65, 0.35
"""In inches, as all heights and widths here."""
_LEGEND_COLUMNS, _LEGEND_LINE = 4, 0.8
_LOWEST, _HIGHEST = 0.3, 2.2
"""Least and greatest height of a map in widths; maps beyond have empty margins."""


@dataclass(frozen=True, slots=True)
class FigureOptions:
    """How a figure is drawn.

    Attributes:
        width: Width in inches; by default a column's for one panel and a page's for more.
        dpi: Dots per inch, also of images in a .svg or .pdf.
        rejects: How many of the newest rejected extensions are drawn.
        against: Abscissa of costs; see `draw_cost`.
        azimuth: Camera of a 3D world, in degrees around the vertical.
        elevation: Camera of a 3D world, in degrees above the horizon.
    """

    width: float | None = None
    dpi: int = 300
    rejects: int = 0
    against: Against | None = None
    azimuth: float = -62.0
    elevation: float = 28.0


def save_plot(
    recordings: Sequence[Recording],
    path: Path,
    panels: Sequence[str] = (),
    options: FigureOptions | None = None,
    names: Sequence[str] = (),
) -> None:
    """Draw runs into a .png, .svg or .pdf file; equal runs give equal files.

    Args:
        recordings: The runs; several share the panel of costs only.
        path: The file; it appears once it is complete.
        panels: Some of `PANELS`; by default the tree, with the cost where the planner improves its
            path, and of several runs the cost.
        options: How it is drawn.
        names: Names of the runs in legends and messages; by default those of the recordings.

    Raises:
        BrrtError: matplotlib is missing, a panel has nothing to show, or the file cannot be
            written.
    """
    mpl, options = need_matplotlib(), options or FigureOptions()
    runs = [recording.until() for recording in recordings]
    names = names or [run.name for run in runs]
    if not panels:
        improved = (runs[0].events()[Kind.PATH]["stage"] == Stage.IMPROVED).any()
        panels = ("cost",) if len(runs) > 1 else ("tree", "cost") if improved else ("tree",)
    if len(runs) > 1 and set(panels) != {"cost"}:
        raise BrrtError("several runs share a figure of their costs only; give --what cost")
    with style.paper():
        width = options.width or (style.COLUMN_IN if len(panels) == 1 else style.PAGE_IN)
        weights = np.array([1.15 if panel == "tree" else 1.0 for panel in panels])
        shares = weights / weights.sum()
        heights = [_height(runs[0], p, width * s) for p, s in zip(panels, shares, strict=True)]
        figure = mpl.figure.Figure(
            figsize=(width, max(heights)), dpi=options.dpi, layout="constrained"
        )
        parts = np.atleast_1d(figure.subfigures(1, len(panels), width_ratios=shares))
        for panel, part in zip(panels, parts, strict=True):
            if panel == "tree":
                tree = tree_panel(part, runs[0], options)
                tree.show(tree.playback.last)
                add_legend(part, tree, tree.legend())
            elif panel == "cost":
                draw_cost(part.add_subplot(), runs, names, options.against)
            else:
                draw_time(part.subplots(3, 1, sharex=True), runs[0], names[0])
        save_figure(figure, path, dpi=options.dpi)


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
        ax: Axes of matplotlib, with projection "3d" for a tree or a world in 3D.
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
    if what not in PANELS[:2]:
        raise unknown("panel", what, PANELS[:2])
    run = run.until(**until)
    with style.paper() if ax is None else nullcontext():
        deep = what == "tree" and run.manifest.dim == 3
        ax = new_axes("3d" if deep else None) if ax is None else ax
        if what == "cost":
            return draw_cost(ax, [run], [run.manifest.scenario.planner])
        panel = TreePanel(run, ax, rejects)
        panel.show(panel.playback.last)
    return ax


def tree_panel(part: Any, recording: Recording, options: FigureOptions) -> TreePanel:
    """Add axes for a run to a figure, or a part of one; `TreePanel.show` draws an instant."""
    flat = recording.manifest.dim == 2
    ax = part.add_subplot(projection=None if flat else "3d")
    if not flat:
        ax.view_init(elev=options.elevation, azim=options.azimuth)
    return TreePanel(recording, ax, options.rejects)


def height_of_tree(recording: Recording, width: float) -> float:
    """Return the height for a world, its legend and its colour scale in a width."""
    below = _LEGEND_HEIGHT + _SCALE_HEIGHT * (len(recording.events()[Kind.EXPAND]) > 0)
    if recording.manifest.dim == 3:
        return 0.85 * width + below
    size = recording.world.upper - recording.world.lower
    map_height = (width - 0.35) * float(np.clip(size[1] / size[0], _LOWEST, _HIGHEST))
    return map_height + 0.4 + below


def add_legend(part: Any, panel: TreePanel, artists: Sequence[Any]) -> None:
    """Add a legend of artists, and a colour scale for cells, below a tree in a figure."""
    rows = -(-len(artists) // _LEGEND_COLUMNS)
    columns = -(-len(artists) // rows)
    legend = part.legend(
        handles=artists, loc="outside lower center", ncols=columns, borderaxespad=0.2
    )
    for line in legend.get_lines():
        if line.get_linewidth() > 0:
            line.set(linewidth=max(line.get_linewidth(), _LEGEND_LINE), alpha=1.0)
    if panel.heat is not None:
        cells, meaning = panel.heat
        below = {"location": "bottom", "shrink": 0.8, "pad": 0.03, "aspect": 40}
        part.colorbar(cells, ax=part.axes[0], label=meaning, **below)


def _height(recording: Recording, panel: str, width: float) -> float:
    if panel == "tree":
        return height_of_tree(recording, width)
    return _CURVE_HEIGHT * (1.35 if panel == "time" else 1.0)
