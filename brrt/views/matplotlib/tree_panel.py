"""Axes with a run at an instant: the world, trees or cells, paths and bodies."""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrt.recording import Recording
from brrt.robots import Robot
from brrt.views.matplotlib import style
from brrt.views.matplotlib.draw_world import plot_world
from brrt.views.matplotlib.playback import Playback

Floats = NDArray[np.float64]

MOST_VECTORS = 3000
"""Lines or cells that are vectors in a .svg or .pdf; more become an image in it."""

_LINES_IN_PATH = 64
_GHOSTS = 10
"""Bodies along a path."""
_LAYERS = {"cells": 2.0, "rejects": 2.1, "links": 2.15, "tree": 2.2, "ghosts": 2.5,
           "trace": 2.7, "path": 3.0, "end": 5.0, "robot": 6.0}  # fmt: skip


class TreePanel:
    """Axes that show a run after any of its events; what never changes is drawn at once.

    Args:
        recording: The run.
        ax: Axes of matplotlib, with projection "3d" for a world in 3D.
        rejects: How many of the newest rejected extensions are drawn.

    Attributes:
        playback: The state of the run after any event.

    Raises:
        BrrtError: The projection of the axes is not the world's, or the events contradict each
            other.
    """

    def __init__(self, recording: Recording, ax: Any, rejects: int = 0) -> None:
        self._manifest, self._world = recording.manifest, recording.world
        self._ax, self._rejects = ax, rejects
        self.playback = Playback(recording)
        self._robot: Robot = self.playback.robot
        self._flat = self._manifest.dim == 2
        self._draw_static()
        self._changing: list[Any] = []
        self._lines: dict[Any, Any] = {}
        if rejects:
            self._lines["rejects"] = self._collection(
                style.REJECTED, 0.3, "rejects", 0.55, "rejected"
            )
        if self.playback.has_cells:
            self._cells = self._cell_artists()
        width = style.line_width(self.playback.nodes(self.playback.last))
        for number in self.playback.trees:
            name, colour, rewired = style.tree_style(number)
            self._lines[number, "links"] = self._collection(
                style.GRAPH, width, "links", 0.8, f"{name} graph"
            )
            self._lines[number] = self._collection(colour, width, "tree", 1.0, f"{name} tree")
            self._lines[number, "rewired"] = self._collection(
                rewired, width, "tree", 1.0, "rewired"
            )
        self._trace = self._collection(style.ROBOT, 0.5, "trace", 0.6, "moves")
        self._ghosts = self._bodies([], style.SMOOTHED, "ghosts") if self._flat else None
        self._skeletons = self._collection(style.SMOOTHED, 0.9, "ghosts", 0.45)
        self._paths = {
            name: (self._line(width + 0.8, "white", None), self._line(width, colour, label))
            for name, width, colour, label in (
                ("raw", 1.0, style.PATH, "path"),
                ("short", 1.3, style.SMOOTHED, "smoothed"),
            )
        }
        self._here = self._line(0, style.ROBOT, "robot", marker="o", ms=4, mec="white", mew=0.6)
        self._here.set_zorder(_LAYERS["robot"])
        for artist in self._changing:
            artist.set_in_layout(False)  # it lies within the axes; measuring it takes seconds
        self._caption = ax.set_title("", loc="left", color=style.QUIET, pad=4)
        self._changing.append(self._caption)

    def show(self, seq: int) -> None:
        """Show the run after an event."""
        playback = self.playback
        if self._rejects:
            self._draw_lines(self._lines["rejects"], playback.rejects(seq, self._rejects))
        for number in playback.trees:
            edges = playback.edges(number, seq)
            self._draw_lines(self._lines[number, "links"], playback.links(number, seq))
            self._draw_lines(self._lines[number], edges.ends[~edges.rewired])
            self._draw_lines(self._lines[number, "rewired"], edges.ends[edges.rewired])
        if playback.has_cells:
            self._show_cells(*playback.cells(seq))
        trace = playback.trace(seq)
        self._trace.set_segments(trace if playback.has_cells else [])
        paths = playback.paths(seq)
        best = paths.short or paths.raw
        # The path of a planner that learns is its trace, which is drawn already.
        raw = None if playback.learns else paths.raw
        for name, found in (("raw", raw), ("short", paths.short)):
            for line in self._paths[name]:
                self._place(line, self._robot.trail(found[0]) if found else np.empty((0, 2)))
        if self._ghosts is not None:
            bodies = [] if best is None else list(self._robot.along(best[0], _GHOSTS))
            self._ghosts.set_verts([part for q in bodies for part in self._robot.outline(q)])
        if best is not None:
            lines = self._robot.skeleton(self._robot.along(best[0], _GHOSTS))
            self._skeletons.set_segments(list(lines) if lines.shape[1] else [])
        else:
            self._skeletons.set_segments([])
        moving = trace and not np.array_equal(trace[-1][-1], self._end(self._manifest.goal))
        self._place(self._here, trace[-1][-1:] if moving else np.empty((0, 2)))
        self._caption.set_text(self._text(seq, best[1] if best else None))

    @property
    def drawn_last(self) -> list[Any]:
        """The artists that `show` changes and those in front of them, from back to front."""
        return sorted([*self._changing, *self._ends], key=lambda artist: artist.get_zorder())

    def legend(self) -> list[Any]:
        """Return the visible artists that have a name."""
        names = [*self._lines.values(), self._trace, *(pair[1] for pair in self._paths.values())]
        return [
            artist
            for artist in [*names, self._here, *self._ends]
            if not artist.get_label().startswith("_") and _is_visible(artist)
        ]

    def _draw_static(self) -> None:
        """Draw the world, start and goal."""
        ax, manifest, world = self._ax, self._manifest, self._world
        plot_world(replace(world, start=None, goal=None), ax)
        obstacles = len(world.balls) + len(world.boxes) + len(world.polygons)
        for artist in ax.collections:
            artist.set_rasterized(obstacles > MOST_VECTORS)
        self._ends = []
        for name, q, colour in (("start", manifest.start, style.START),
                                ("goal", manifest.goal, style.GOAL)):  # fmt: skip
            if self._flat:
                self._bodies([np.array(q)], colour, "end", 0.35)
            for line in self._robot.skeleton(np.array([q])):
                if len(line):
                    ax.plot(
                        *line.T,
                        color=colour,
                        lw=2,
                        marker=".",
                        ms=4,
                        zorder=_LAYERS["path"],
                        label="_",
                    )
            (dot,) = ax.plot(
                *self._end(q)[:, None], ls="", marker="o", ms=5, color=colour, mec="white",
                mew=0.7, zorder=_LAYERS["end"], label=name,
            )  # fmt: skip
            self._ends.append(dot)

    def _collection(
        self, colour: Any, width: float, layer: str, alpha: float, label: str = "_"
    ) -> Any:
        looks: dict[str, Any] = {
            "colors": [colour], "linewidths": width, "alpha": alpha, "zorder": _LAYERS[layer],
            "capstyle": "round", "label": label,
        }  # fmt: skip
        if self._flat:
            from matplotlib.collections import LineCollection  # noqa: PLC0415

            lines = self._ax.add_collection(LineCollection([], **looks), autolim=False)
        else:
            from mpl_toolkits.mplot3d.art3d import Line3DCollection  # noqa: PLC0415

            lines = self._ax.add_collection3d(Line3DCollection([], **looks), autolim=False)
        self._changing.append(lines)
        return lines

    def _line(self, width: float, colour: Any, label: str | None, **more: Any) -> Any:
        nothing: list[list[float]] = [[]] * self._manifest.dim
        (line,) = self._ax.plot(
            *nothing, color=colour, lw=width, label=label or "_", zorder=_LAYERS["path"],
            solid_capstyle="round", solid_joinstyle="round", **more,
        )  # fmt: skip
        self._changing.append(line)
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
            self._changing.append(bodies)
        return bodies

    def _cell_artists(self) -> Any:
        """Return cells as squares of their size, in 3D as dots of about that size."""
        _, values = self.playback.cells(self.playback.last)
        looks: dict[str, Any] = {
            "cmap": style.HEAT, "clim": (0, values.max() or 1.0), "zorder": _LAYERS["cells"],
        }  # fmt: skip
        if self._flat:
            from matplotlib.collections import PolyCollection  # noqa: PLC0415

            cells = self._ax.add_collection(
                PolyCollection([], linewidths=0, **looks), autolim=False
            )
        else:
            size = 90 * self._edge / self._world.extent
            cells = self._ax.scatter(
                [], [], [], c=[], s=size**2, marker="o", linewidths=0, alpha=style.CELL_ALPHA,
                depthshade=False, **looks,
            )  # fmt: skip
        cells.set_rasterized(len(values) > MOST_VECTORS)
        self._changing.append(cells)
        return cells

    @property
    def _edge(self) -> float:
        return self.playback.contract.cell or 1.0

    @property
    def heat(self) -> tuple[Any, str] | None:
        """The cells and what their colours mean; None if there are no cells."""
        if not self.playback.has_cells:
            return None
        learns = self.playback.learns
        return self._cells, "heuristic cost-to-go" if learns else "cost from the start"

    def _draw_lines(self, lines: Any, ends: Floats) -> None:
        if self._flat:
            lines._paths = _compound(ends)  # noqa: SLF001 - `set_segments` makes a path a line
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
            self._cells._offsets3d = tuple(places.T)  # noqa: SLF001 - no public API
        self._cells.set_array(values)

    def _end(self, q: Any) -> Floats:
        place: Floats = self._robot.places(np.array([q], np.float64))[0]
        return place

    def _place(self, line: Any, places: Floats) -> None:
        if self._flat:
            line.set_data(*places.T[:2])
        else:
            line.set_data_3d(*(places.T if len(places) else ([], [], [])))

    def _text(self, seq: int, cost: float | None) -> str:
        """Return the caption after an event."""
        playback = self.playback
        planner = style.literal(self._manifest.scenario.planner)
        words = [planner, f"iteration {playback.instant(seq).iteration:,}"]
        words.append(f"{playback.nodes(seq):,} " + ("cells" if playback.has_cells else "nodes"))
        if cost is not None:
            words.append(f"cost {cost:.4g}")
        return " · ".join(words)


def _compound(ends: Floats) -> list[Any]:
    """Return lines, shape (n, 2, 2), as paths of many lines each, which are drawn much faster."""
    from matplotlib.path import Path as Strokes  # noqa: PLC0415

    codes = np.tile(np.array([Strokes.MOVETO, Strokes.LINETO], np.uint8), _LINES_IN_PATH)
    parts = [ends[i : i + _LINES_IN_PATH] for i in range(0, len(ends), _LINES_IN_PATH)]
    return [Strokes(part.reshape(-1, 2), codes[: 2 * len(part)]) for part in parts]


def _is_visible(artist: Any) -> bool:
    if hasattr(artist, "get_segments"):
        segments = getattr(artist, "_segments3d", None)
        return len(artist.get_paths() if segments is None else segments) > 0
    data = artist.get_data_3d() if hasattr(artist, "get_data_3d") else artist.get_data()
    return len(data[0]) > 0
