"""The world and what a run has made of it at an instant: trees or cells, paths, bodies."""

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrt.robots import Robot
from brrt.views.matplotlib import draw_world, style
from brrt.views.matplotlib.history import History, Record

Floats = NDArray[np.float64]

MOST_VECTORS = 3000
"""Lines or cells up to which a .svg or .pdf keeps each of them; more become an image in it."""

_LINES_IN_PATH = 64
_GHOSTS = 10
"""Places along a path at which the body is shown."""
_PARTS = 16
"""Pieces of a motion, where the place that is drawn need not move straight."""
_LAYERS = {"cells": 2.0, "rejects": 2.1, "tree": 2.2, "ghosts": 2.5, "trace": 2.7, "path": 3.0,
           "end": 5.0, "robot": 6.0}  # fmt: skip


class TreePanel:
    """Axes that show a run at any of its events; what never changes is drawn at once.

    Args:
        record: The run.
        ax: Axes of matplotlib, with projection "3d" for a world in 3D.
        rejects: How many of the newest rejected extensions are drawn, faintly.

    Attributes:
        history: The run, folded.
        moving: The artists that `show` changes, from back to front.

    Raises:
        BrrtError: The axes are of no use for this world, or the events do not make trees.
    """

    def __init__(self, record: Record, ax: Any, rejects: int = 0) -> None:
        self._record, self._ax, self._rejects = record, ax, rejects
        self.history = History(record)
        self._robot: Robot = self.history.robot
        self._flat = record.manifest.dim == 2
        self._draw_world()
        self.moving: list[Any] = []
        self._lines: dict[Any, Any] = {}
        if rejects:
            self._lines["rejects"] = self._collection(
                style.REJECTED, 0.3, "rejects", 0.55, "rejected"
            )
        if self.history.has_cells:
            self._cells = self._cell_marks()
        edges = self.history.nodes(self.history.last)
        for number in self.history.trees:
            name, colour, rewired = style.tree_style(number)
            width = style.line_width(edges)
            label = f"{name} tree"
            self._lines[number] = self._collection(colour, width, "tree", 1.0, label)
            self._lines[number, "rewired"] = self._collection(
                rewired, width, "tree", 1.0, "rewired"
            )
        self._trace = self._collection(style.ROBOT, 0.5, "trace", 0.6, "moves")
        self._ghosts = self._bodies([], style.SMOOTHED, "ghosts") if self._flat else None
        self._paths = {
            name: (self._line(width + 0.8, "white", None), self._line(width, colour, label))
            for name, width, colour, label in (
                ("raw", 1.0, style.RAW, "path"),
                ("short", 1.3, style.SMOOTHED, "smoothed"),
            )
        }
        self._here = self._line(0, style.ROBOT, "robot", marker="o", ms=4, mec="white", mew=0.6)
        self._here.set_zorder(_LAYERS["robot"])
        for artist in self.moving:
            artist.set_in_layout(False)  # it lies within the axes; to measure it takes seconds
        self.caption = ax.set_title("", loc="left", color=style.QUIET, pad=4)
        self.moving.append(self.caption)

    def show(self, seq: int) -> None:
        """Show the run as it stands after an event."""
        history = self.history
        if self._rejects:
            self._draw_lines(self._lines["rejects"], history.rejects(seq, self._rejects))
        for number in history.trees:
            edges = history.edges(number, seq)
            self._draw_lines(self._lines[number], edges.ends[~edges.rewired])
            self._draw_lines(self._lines[number, "rewired"], edges.ends[edges.rewired])
        if history.has_cells:
            self._show_cells(*history.cells(seq))
        trace = history.trace(seq)
        self._trace.set_segments(trace if history.has_cells else [])
        paths = history.paths(seq)
        best = paths.short or paths.raw
        # The moves of a robot that learns are its path, and go to and fro over the cells.
        raw = None if history.learns else paths.raw
        for name, found in (("raw", raw), ("short", paths.short)):
            for line in self._paths[name]:
                self._place(line, self._way(found[0]) if found else np.empty((0, 2)))
        if self._ghosts is not None:
            bodies = [] if best is None else list(self._robot.along(best[0], _GHOSTS))
            self._ghosts.set_verts([part for q in bodies for part in self._robot.outline(q)])
        on_way = trace and not np.array_equal(trace[-1][-1], self._end(self._record.manifest.goal))
        self._place(self._here, trace[-1][-1:] if on_way else np.empty((0, 2)))
        self.caption.set_text(self._text(seq, best[1] if best else None))

    @property
    def drawn_last(self) -> list[Any]:
        """Everything that moves, and what stands in front of it, from back to front."""
        return sorted([*self.moving, *self._marks], key=lambda artist: artist.get_zorder())

    def legend(self) -> list[Any]:
        """Return what is in sight and has a name, for a legend."""
        names = [*self._lines.values(), self._trace, *(pair[1] for pair in self._paths.values())]
        return [
            artist
            for artist in [*names, self._here, *self._marks]
            if not artist.get_label().startswith("_") and _holds_something(artist)
        ]

    def _draw_world(self) -> None:
        ax, manifest = self._ax, self._record.manifest
        world = replace(self._record.world, start=None, goal=None)
        draw_world.plot_world(world, ax)
        obstacles = len(world.balls) + len(world.boxes) + len(world.polygons)
        for artist in ax.collections:
            artist.set_rasterized(obstacles > MOST_VECTORS)
        self._marks = []
        for name, q, colour in (("start", manifest.start, style.START),
                                ("goal", manifest.goal, style.GOAL)):  # fmt: skip
            if self._flat:
                self._bodies([np.array(q)], colour, "end", 0.35)
            (mark,) = ax.plot(
                *self._end(q)[:, None], ls="", marker="o", ms=5, color=colour, mec="white",
                mew=0.7, zorder=_LAYERS["end"], label=name,
            )  # fmt: skip
            self._marks.append(mark)

    def _collection(
        self, colour: Any, width: float, layer: str, alpha: float, label: str = "_"
    ) -> Any:
        look: dict[str, Any] = {
            "colors": [colour], "linewidths": width, "alpha": alpha, "zorder": _LAYERS[layer],
            "capstyle": "round", "label": label,
        }  # fmt: skip
        if self._flat:
            from matplotlib.collections import LineCollection  # noqa: PLC0415

            lines = self._ax.add_collection(LineCollection([], **look), autolim=False)
        else:
            from mpl_toolkits.mplot3d.art3d import Line3DCollection  # noqa: PLC0415

            lines = self._ax.add_collection3d(Line3DCollection([], **look), autolim=False)
        self.moving.append(lines)
        return lines

    def _line(self, width: float, colour: Any, label: str | None, **more: Any) -> Any:
        nothing: list[list[float]] = [[]] * self._record.manifest.dim
        (line,) = self._ax.plot(
            *nothing, color=colour, lw=width, label=label or "_", zorder=_LAYERS["path"],
            solid_capstyle="round", solid_joinstyle="round", **more,
        )  # fmt: skip
        self.moving.append(line)
        return line

    def _bodies(self, poses: list[Floats], colour: Any, layer: str, filled: float = 0.12) -> Any:
        from matplotlib.collections import PolyCollection  # noqa: PLC0415

        parts = [part for q in poses for part in self._robot.outline(q)]
        bodies = PolyCollection(
            parts, facecolors=[(*colour, filled)], edgecolors=[(*colour, 0.9)], linewidths=0.5,
            zorder=_LAYERS[layer],
        )  # fmt: skip
        self._ax.add_collection(bodies, autolim=False)
        if layer == "ghosts":
            self.moving.append(bodies)
        return bodies

    def _cell_marks(self) -> Any:
        """Draw cells as squares of their size, in 3D as dots of about it."""
        _, values = self.history.cells(self.history.last)
        look: dict[str, Any] = {
            "cmap": style.HEAT, "clim": (0, values.max() or 1.0), "zorder": _LAYERS["cells"],
        }  # fmt: skip
        if self._flat:
            from matplotlib.collections import PolyCollection  # noqa: PLC0415

            marks = self._ax.add_collection(PolyCollection([], linewidths=0, **look), autolim=False)
        else:
            size = 90 * self._edge / self._record.world.extent
            marks = self._ax.scatter(
                [], [], [], c=[], s=size**2, marker="o", linewidths=0, alpha=style.CELL_ALPHA,
                depthshade=False, **look,
            )  # fmt: skip
        marks.set_rasterized(len(values) > MOST_VECTORS)
        self.moving.append(marks)
        return marks

    @property
    def _edge(self) -> float:
        return self.history.contract.epsilon or 1.0

    @property
    def heat(self) -> tuple[Any, str] | None:
        """The cells, and what their colours mean; None where there are none."""
        if not self.history.has_cells:
            return None
        learns = self.history.learns
        return self._cells, "heuristic cost-to-go" if learns else "cost from the start"

    def _draw_lines(self, lines: Any, ends: Floats) -> None:
        if self._flat:
            lines._paths = _compound(ends)  # noqa: SLF001 - `set_segments` makes a path of each
            lines.stale = True
        else:
            lines.set_segments(ends)
        lines.set_rasterized(len(ends) > MOST_VECTORS)

    def _show_cells(self, places: Floats, values: Floats) -> None:
        if self._flat:
            half = 0.5 * self._edge
            square = half * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
            self._cells.set_verts(places[:, None] + square)
        else:
            self._cells._offsets3d = tuple(places.T)  # noqa: SLF001 - there is no public way
        self._cells.set_array(values)

    def _way(self, path: Floats) -> Floats:
        """Return where a path goes; a body's place need not move straight between waypoints."""
        if len(path) > 1 and self._robot.outline(path[0]):
            parts = np.arange(_PARTS) / _PARTS
            legs = [self._robot.interpolate(*pair, parts) for pair in pairwise(path)]
            path = np.concatenate([*legs, path[-1:]])
        return self._robot.places(path)

    def _end(self, q: Any) -> Floats:
        place: Floats = self._robot.places(np.array([q], np.float64))[0]
        return place

    def _place(self, line: Any, places: Floats) -> None:
        if self._flat:
            line.set_data(*places.T[:2])
        else:
            line.set_data_3d(*(places.T if len(places) else ([], [], [])))

    def _text(self, seq: int, cost: float | None) -> str:
        """Say when it is and how far the run has come."""
        manifest = self._record.manifest
        history = self.history
        words = [manifest.scenario.planner, f"iteration {history.instant(seq).iteration:,}"]
        words.append(f"{history.nodes(seq):,} " + ("cells" if history.has_cells else "nodes"))
        if cost is not None:
            words.append(f"cost {cost:.4g}")
        return " · ".join(words)


def _compound(ends: Floats) -> list[Any]:
    """Return lines, shape (n, 2, 2), as few paths of many lines each: that is drawn much faster."""
    from matplotlib.path import Path as Strokes  # noqa: PLC0415

    codes = np.tile(np.array([Strokes.MOVETO, Strokes.LINETO], np.uint8), _LINES_IN_PATH)
    parts = [ends[i : i + _LINES_IN_PATH] for i in range(0, len(ends), _LINES_IN_PATH)]
    return [Strokes(part.reshape(-1, 2), codes[: 2 * len(part)]) for part in parts]


def _holds_something(artist: Any) -> bool:
    if hasattr(artist, "get_segments"):
        segments = getattr(artist, "_segments3d", None)
        return len(artist.get_paths() if segments is None else segments) > 0
    data = artist.get_data_3d() if hasattr(artist, "get_data_3d") else artist.get_data()
    return len(data[0]) > 0
