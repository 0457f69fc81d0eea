"""Events as pictures in Rerun: trees as they grow, samples, rejections, paths, plots, a log.

All of it is float32, and thinned out where there is more than an eye or a viewer can take: the
exact events stand beside it.
"""

from collections.abc import Iterable
from typing import Any

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from brrt.events import Events, Kind, Phase, Reason, Source, Stage, Status, Table
from brrt.recording import scene
from brrt.recording.columns import line_strips, time_columns
from brrt.recording.tree_sketch import DRAWN_IN_FULL, TreeSketch
from brrt.scenario import Manifest
from brrt.worlds.world import World

_FADING_IN_FULL, _FADING_STRIDE = 10_000, 16
"""Samples of a source, or rejections for a reason, that are all drawn; then one of so many."""

_FADING_ROW = 16
"""Samples or rejections in a row; they appear and vanish by rows."""

_LONGEST_SHOWN = 1000
"""Waypoints up to which a path is drawn anew after each accepted shortcut."""

_MOMENT = np.dtype([("seq", "<i8"), ("t", "<i8"), ("iteration", "<i8")])


def growing_rows(first: int, count: int) -> NDArray[np.int64]:
    """Cut items into rows of about 1 % of what there is, from 1 item up to 1024.

    A viewer takes time for each row, and shows a row at once: so the first edges of a tree appear
    one by one, and the many that follow in rows.

    Args:
        first: Items before these.
        count: Items to cut, at least 1.

    Returns:
        The end of each row, exclusive, counted from `first`; the last is `count`.
    """
    number = np.arange(first, first + count)
    row = np.where(number < 1 << 16, 64 * np.log2(number + 1.0), number / 1024).astype(np.int64)
    return np.append(np.flatnonzero(np.diff(row)) + 1, count)


class Drawing:
    """Draws batches of events into a recording.

    Args:
        rec: The recording.
        manifest: The run's.
        world: The run's.
    """

    def __init__(self, rec: rr.RecordingStream, manifest: Manifest, world: World) -> None:
        self._rec, self._world, self._dim = rec, world, manifest.dim
        self._robot = manifest.make_robot()
        flat = scene.is_flat(manifest)
        self._lines: Any = rr.LineStrips2D if flat else rr.LineStrips3D
        self._points: Any = rr.Points2D if flat else rr.Points3D
        self._trees: dict[int, TreeSketch] = {}
        self._edges, self._rejects = 0, dict.fromkeys(Reason, 0)
        self._faded: dict[str, int] = {}
        self._path: NDArray[np.float64] | None = None
        self._raw_cost = np.inf
        self._news: list[tuple[Any, str]] = []
        scene.log_scene(rec, manifest, world)
        self._log_styles()

    def write(self, events: Events) -> None:
        """Draw a batch."""
        self._draw_edges(events[Kind.EDGE])
        self._draw_rejects(events[Kind.REJECT], events[Kind.EDGE])
        self._draw_samples(events[Kind.SAMPLE])
        self._draw_paths(events[Kind.PATH], events[Kind.SHORTCUT])
        self._news += [(event, _phase_text(event)) for event in events[Kind.PHASE]]
        self._tell_news()

    def _log_styles(self) -> None:
        for stage in Stage:
            name, colour, radius = scene.path_style(stage)
            self._style(f"/world/path/{name}", self._lines, colour, -radius, 40.0 + stage)
        for source in Source:
            colour = scene.SAMPLES.get(source, scene.OTHER)
            self._style(f"/world/samples/{_label(source)}", self._points, colour, -2, 30.0)
        for reason in Reason:
            colour = scene.REJECTS.get(reason, scene.OTHER)
            self._style(f"/world/rejected/{_label(reason)}", self._lines, colour, -0.5, 10.0)
            self._plot_style(f"/series/rejected/{_label(reason)}", _label(reason), colour)
        gold = scene.path_style(Stage.SMOOTHED)[1]
        self._plot_style("/series/cost", "cost", gold)
        dots = rr.SeriesPoints(colors=gold, marker_sizes=3, names="cost")
        self._rec.log("/series/cost", dots, static=True)

    def _style(
        self, entity: str, archetype: Any, colour: scene.Colour, radius: float, layer: float
    ) -> None:
        """Log what all rows of an entity share; a negative radius is in points of the screen."""
        order = {"draw_order": layer} if self._dim == 2 else {}
        style = archetype.from_fields(colors=colour, radii=radius, **order)
        self._rec.log(entity, style, static=True)

    def _plot_style(self, entity: str, name: str, colour: scene.Colour) -> None:
        line = rr.SeriesLines(names=name.replace("_", " "), colors=colour, widths=1.5)
        self._rec.log(entity, line, static=True)

    def _send(self, entity: str, rows: Table, ends: NDArray[np.int64], columns: Any) -> None:
        """Send items in rows; each row has the time of its last event."""
        parts = columns.partition(np.diff(ends, prepend=0))
        self._rec.send_columns(entity, time_columns(rows[ends - 1]), parts)

    def _plot(self, entity: str, rows: Table, values: Any) -> None:
        self._rec.send_columns(entity, time_columns(rows), rr.Scalars.columns(scalars=values))

    def _draw_edges(self, table: Table) -> None:
        for number in np.unique(table["tree"]).tolist():
            name, colour = scene.tree_style(number)
            if number not in self._trees:
                self._trees[number] = TreeSketch(self._world, self._robot)
                self._style(f"/world/tree/{name}", self._lines, colour, -0.75, 20.0)
                self._plot_style(f"/series/nodes/{name}", f"{name} tree", colour)
            tree, mine = self._trees[number], table["tree"] == number
            rows = table if mine.all() else table[mine]
            ends = growing_rows(tree.nodes, len(rows))
            self._plot(f"/series/nodes/{name}", rows[ends - 1], tree.nodes + ends)
            if tree.nodes <= DRAWN_IN_FULL < tree.nodes + len(rows):
                limit = f"beyond {DRAWN_IN_FULL:,} nodes only edges to new places are drawn"
                self._news.append((rows[-1], f"{name} tree: {limit}"))
            before = tree.drawn
            strips, drawn = tree.join(rows)
            if len(drawn):
                lines = self._lines.columns(strips=line_strips(strips, 2))
                ends = growing_rows(before, len(drawn))
                self._send(f"/world/tree/{name}", rows[drawn], ends, lines)

    def _draw_samples(self, table: Table) -> None:
        for source in Source:
            which = np.flatnonzero(table["source"] == source)
            rows = self._fading(table, which, f"{_label(source)} samples")
            if len(rows):
                points = self._points.columns(positions=scene.places(rows["q"], self._robot))
                self._send(f"/world/samples/{_label(source)}", rows, _even_rows(len(rows)), points)

    def _draw_rejects(self, table: Table, edges: Table) -> None:
        before = self._edges + sum(self._rejects.values())
        for reason in Reason:
            which = np.flatnonzero(table["reason"] == reason)
            if len(which):
                self._plot_rejects(reason, before, table, which, edges)
            rows = self._fading(table, which, f"{_label(reason)} rejections")
            if len(rows):
                lines = self._lines.columns(strips=line_strips(self._attempts(rows), 2))
                self._send(f"/world/rejected/{_label(reason)}", rows, _even_rows(len(rows)), lines)
        self._edges += len(edges)

    def _attempts(self, rejects: Table) -> NDArray[np.float32]:
        """Return where each extension left from and wanted to go, shape (2 n, dim)."""
        ends = np.full((len(rejects), 2, self._dim), np.nan, np.float32)
        for number, tree in self._trees.items():
            mine = rejects["tree"] == number
            ends[mine, 0] = tree.places(rejects["node"][mine])
        ends[:, 1] = scene.places(rejects["q"], self._robot)
        return ends.reshape(-1, self._dim)

    def _plot_rejects(
        self, reason: Reason, before: int, table: Table, which: NDArray[np.int64], edges: Table
    ) -> None:
        """Plot which part of all extensions so far was rejected for a reason."""
        have = self._rejects[reason]
        ends = growing_rows(have, len(which))
        rows = table[which[ends - 1]]
        tried = before + sum(
            np.searchsorted(t["seq"], rows["seq"], "right") for t in (table, edges)
        )
        self._plot(f"/series/rejected/{_label(reason)}", rows, 100 * (have + ends) / tried)
        self._rejects[reason] = have + len(which)

    def _fading(self, table: Table, which: NDArray[np.int64], what: str) -> Table:
        """Return the rows `which` of a table, thinned out if there have been many."""
        first = self._faded.get(what, 0)
        self._faded[what] = first + len(which)
        if first <= _FADING_IN_FULL < first + len(which):
            text = f"{what}: beyond {_FADING_IN_FULL:,} one in {_FADING_STRIDE} is drawn"
            self._news.append((table[which[-1]], text))
        number = np.arange(first, first + len(which))
        shown = (number < _FADING_IN_FULL) | (number % _FADING_STRIDE == 0)
        rows: Table = table[which[shown]]
        return rows

    def _draw_paths(self, paths: Table, shortcuts: Table) -> None:
        """Draw each path, and those between them as shortcuts are accepted."""
        changes: list[tuple[Any, Stage | None]]
        changes = [(event, Stage(int(event["stage"]))) for event in paths]
        changes += [(event, None) for event in shortcuts[shortcuts["accepted"]]]
        changes.sort(key=lambda change: int(change[0]["seq"]))
        drawn: dict[Stage, list[tuple[Any, NDArray[np.float32]]]] = {}
        for event, stage in changes:
            if stage is not None:
                self._path = event["waypoints"]
                self._news.append((event, self._path_text(event, stage)))
            elif self._path is not None:
                self._path = np.delete(self._path, slice(event["i"] + 1, event["j"]), axis=0)
            if self._path is not None and (stage is not None or len(self._path) <= _LONGEST_SHOWN):
                shown = Stage.SMOOTHED if stage is None else stage
                drawn.setdefault(shown, []).append((event, scene.places(self._path, self._robot)))
        for stage, items in drawn.items():
            places = [place for _, place in items]
            strips = line_strips(np.concatenate(places), [len(place) for place in places])
            rows = _moments(event for event, _ in items)
            entity = f"/world/path/{scene.path_style(stage)[0]}"
            self._rec.send_columns(entity, time_columns(rows), self._lines.columns(strips=strips))
        if changes:
            costs = [float(event["cost"]) for event, _ in changes]
            self._plot("/series/cost", _moments(event for event, _ in changes), costs)

    def _path_text(self, event: Any, stage: Stage) -> str:
        cost, waypoints = float(event["cost"]), len(event["waypoints"])
        text = f"{_label(stage)} path: cost {cost:.6g}, {waypoints} waypoints"
        if stage is Stage.RAW:
            self._raw_cost = cost
        elif 0 < self._raw_cost < np.inf:
            text += f", {100 * (1 - cost / self._raw_cost):.1f} % shorter"
        return text

    def _tell_news(self) -> None:
        if self._news:
            self._news.sort(key=lambda item: int(item[0]["seq"]))
            texts = rr.TextLog.columns(text=[text for _, text in self._news])
            rows = _moments(event for event, _ in self._news)
            self._rec.send_columns("/log", time_columns(rows), texts)
            self._news.clear()


def _even_rows(count: int) -> NDArray[np.int64]:
    return np.append(np.arange(_FADING_ROW, count, _FADING_ROW), count)


def _moments(events: Iterable[Any]) -> Table:
    """Gather the times of events of several kinds."""
    return np.array([(e["seq"], e["t"], e["iteration"]) for e in events], _MOMENT)


def _phase_text(event: Any) -> str:
    phase, status = Phase(int(event["name"])), Status(int(event["status"]))
    if status is Status.BEGIN:
        return f"{_label(phase)} begins"
    return f"{_label(phase)} ends: {_label(status).replace('_', ' ')}"


def _label(choice: Phase | Status | Source | Reason | Stage) -> str:
    return choice.name.lower()
