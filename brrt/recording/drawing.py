"""Events as pictures in Rerun: trees as they grow, samples, rejections, paths, plots, a log.

All of it is float32, and thinned out where there is more than an eye or a viewer can take: the
exact events stand beside it.
"""

from collections.abc import Iterable
from typing import Any

import numpy as np
import pyarrow as pa
import rerun as rr
from numpy.typing import NDArray

from brrt.events import Events, Kind, Phase, Reason, Source, Stage, Status, Table
from brrt.recording import scene
from brrt.scenario import Manifest
from brrt.worlds.world import World

Indices = NDArray[np.int64]
Points = NDArray[np.float32]

_KEPT_NODES = 1 << 22
"""Nodes of a tree whose positions are kept in memory (12 bytes each in 3D) to draw from."""

_DRAWN_IN_FULL = 50_000
"""Nodes of a tree up to which every edge is drawn."""

_CELLS = 1 << 16
"""Cells of the grid that thins out what comes after: each then takes a single edge."""

_FADING_ROW = 16
"""Samples or rejections in a row; they appear and vanish by rows."""

_LONGEST_SHOWN = 1000
"""Waypoints up to which a path is drawn anew after each accepted shortcut."""

_MOMENT = np.dtype([("seq", "<i8"), ("t", "<i8"), ("iteration", "<i8")])


def time_columns(rows: Table) -> list[Any]:
    """Return the three timelines of events, from the columns that every event has."""
    return [
        rr.TimeColumn("iteration", sequence=np.ascontiguousarray(rows["iteration"])),
        rr.TimeColumn("event", sequence=np.ascontiguousarray(rows["seq"])),
        rr.TimeColumn("t", duration=rows["t"].astype("m8[ns]")),
    ]


def growing_rows(first: int, count: int) -> Indices:
    """Cut items into rows of about 1 % of what there is, from 1 item up to 256.

    A viewer takes time for each row, and shows a row at once: so the first edges of a tree appear
    one by one, and the many that follow in rows.

    Args:
        first: Items before these.
        count: Items to cut, at least 1.

    Returns:
        The end of each row, exclusive, counted from `first`; the last is `count`.
    """
    number = np.arange(first, first + count)
    row = np.where(number < 1 << 14, 64 * np.log2(number + 1.0), number / 256).astype(np.int64)
    return np.append(np.flatnonzero(np.diff(row)) + 1, count)


def even_rows(count: int) -> Indices:
    """Cut items into rows of one size, the last one apart."""
    return np.append(np.arange(_FADING_ROW, count, _FADING_ROW), count)


class Drawing:
    """Draws batches of events into a recording.

    Args:
        rec: A `rerun.RecordingStream`.
        manifest: The run's.
        world: The run's.
    """

    def __init__(self, rec: Any, manifest: Manifest, world: World) -> None:  # noqa: ANN401
        self._rec, self._world, self._dim = rec, world, manifest.dim
        self._trees: dict[int, _Tree] = {}
        self._edges = 0
        self._rejects = dict.fromkeys(Reason, 0)
        self._path: NDArray[np.float64] | None = None
        self._cost = np.inf
        flat = scene.is_flat(manifest)
        self._lines: Any = rr.LineStrips2D if flat else rr.LineStrips3D
        self._points: Any = rr.Points2D if flat else rr.Points3D
        scene.log_scene(rec, manifest, world)
        self._log_styles()

    def write(self, events: Events) -> None:
        """Draw a batch."""
        news = [*self._draw_edges(events[Kind.EDGE]), *self._draw_paths(events)]
        self._draw_rejects(events)
        self._draw_samples(events[Kind.SAMPLE])
        news += [(event, _phase_text(event)) for event in events[Kind.PHASE]]
        if news:
            news.sort(key=lambda item: int(item[0]["seq"]))
            columns = rr.TextLog.columns(
                text=[text for _, text in news], level=["INFO"] * len(news)
            )
            self._rec.send_columns("/log", time_columns(_moments(e for e, _ in news)), columns)

    def _log_styles(self) -> None:
        for stage, (name, colour, radius) in scene.PATHS.items():
            self._style(f"/world/path/{name}", self._lines, colour, -radius, 40.0 + stage)
        for source, colour in scene.SAMPLES.items():
            self._style(f"/world/samples/{_label(source)}", self._points, colour, -2, 30.0)
        for reason, colour in scene.REJECTS.items():
            self._style(f"/world/rejected/{_label(reason)}", self._lines, colour, -0.5, 10.0)
            self._plot(f"/series/rejected/{_label(reason)}", _label(reason), colour)
        cost = scene.PATHS[Stage.SMOOTHED][1]
        self._plot("/series/cost", "cost", cost)
        self._rec.log(
            "/series/cost", rr.SeriesPoints(colors=cost, marker_sizes=3, names="cost"), static=True
        )

    def _style(
        self,
        entity: str,
        archetype: Any,  # noqa: ANN401
        colour: scene.Colour,
        radius: float,
        order: float,
    ) -> None:
        """Log what all rows of an entity share. Negative radii are points of the screen."""
        layer = {"draw_order": order} if self._dim == 2 else {}  # noqa: PLR2004
        style = archetype.from_fields(colors=colour, radii=radius, **layer)
        self._rec.log(entity, style, static=True)

    def _plot(self, entity: str, name: str, colour: scene.Colour) -> None:
        self._rec.log(entity, rr.SeriesLines(names=name, colors=colour, widths=1.5), static=True)

    def _send(self, entity: str, rows: Table, ends: Indices, columns: Any) -> None:  # noqa: ANN401
        """Send items in rows; each row has the time of its last event."""
        parts = columns.partition(np.diff(ends, prepend=0))
        self._rec.send_columns(entity, time_columns(rows[ends - 1]), parts)

    def _strips(self, places: Points, lengths: int | Iterable[int]) -> Any:  # noqa: ANN401
        """Return line strips as Arrow wants them; Rerun's own conversion takes ten times longer.

        Args:
            places: Their points, one after the other, shape (n, dim).
            lengths: Points in each strip; one number if all are equal.
        """
        if isinstance(lengths, int):
            offsets = np.arange(0, len(places) + 1, lengths, dtype=np.int32)
        else:
            offsets = np.cumsum([0, *lengths], dtype=np.int32)
        flat = rr.components.LineStrip2DBatch if self._dim == 2 else rr.components.LineStrip3DBatch  # noqa: PLR2004
        kind = flat._ARROW_DATATYPE  # noqa: SLF001 - only this very type is taken as it is
        points = pa.FixedSizeListArray.from_arrays(places.reshape(-1), type=kind.value_type)
        return self._lines.columns(strips=pa.ListArray.from_arrays(offsets, points, type=kind))

    def _draw_edges(self, table: Table) -> list[tuple[Any, str]]:
        news: list[tuple[Any, str]] = []
        for number in np.unique(table["tree"]).tolist():
            rows = table[table["tree"] == number]
            entity, name = scene.tree_entity(number), scene.tree_entity(number).rsplit("/")[-1]
            if number not in self._trees:
                self._trees[number] = _Tree(self._world)
                colour = scene.tree_colour(number)
                self._style(entity, self._lines, colour, -0.75, 20.0)
                self._plot(f"/series/nodes/{name}", f"{name} tree", colour)
            tree = self._trees[number]
            ends = growing_rows(tree.nodes, len(rows))
            self._rec.send_columns(
                f"/series/nodes/{name}",
                time_columns(rows[ends - 1]),
                rr.Scalars.columns(scalars=tree.nodes + ends.astype(np.float64)),
            )
            was_thin, before = tree.thinned, tree.drawn
            strips, drawn = tree.join(rows)
            if len(drawn):
                ends = growing_rows(before, len(drawn))
                self._send(
                    entity, rows[drawn], ends, self._strips(strips.reshape(-1, self._dim), 2)
                )
            if tree.thinned and not was_thin:
                text = f"{name} tree has {_DRAWN_IN_FULL:,} nodes: now only edges into empty space are drawn"
                news.append((rows[-1], text))
        return news

    def _draw_samples(self, table: Table) -> None:
        for source in scene.SAMPLES:
            rows = table[table["source"] == source]
            if len(rows):
                columns = self._points.columns(positions=_places(rows["q"], self._dim))
                self._send(f"/world/samples/{_label(source)}", rows, even_rows(len(rows)), columns)

    def _draw_rejects(self, events: Events) -> None:
        table, edges = events[Kind.REJECT], events[Kind.EDGE]
        before = self._edges + sum(self._rejects.values())
        for reason in scene.REJECTS:
            rows = table[table["reason"] == reason]
            if not len(rows):
                continue
            strips = np.empty((len(rows), 2, self._dim), np.float32)
            for number, tree in self._trees.items():
                mine = rows["tree"] == number
                strips[mine, 0] = tree.places(rows["node"][mine])
            strips[:, 1] = _places(rows["q"], self._dim)
            columns = self._strips(strips.reshape(-1, self._dim), 2)
            self._send(f"/world/rejected/{_label(reason)}", rows, even_rows(len(rows)), columns)

            ends = growing_rows(self._rejects[reason], len(rows))
            at = rows["seq"][ends - 1]
            tried = before + sum(np.searchsorted(t["seq"], at, "right") for t in (table, edges))
            share = 100 * (self._rejects[reason] + ends) / tried
            self._rec.send_columns(
                f"/series/rejected/{_label(reason)}",
                time_columns(rows[ends - 1]),
                rr.Scalars.columns(scalars=share),
            )
            self._rejects[reason] += len(rows)
        self._edges += len(edges)

    def _draw_paths(self, events: Events) -> list[tuple[Any, str]]:
        """Draw the paths, and each one between them as shortcuts are accepted."""
        shortcuts = events[Kind.SHORTCUT]
        changes = [(event, None) for event in shortcuts[shortcuts["accepted"]]]
        changes += [(event, Stage(int(event["stage"]))) for event in events[Kind.PATH]]
        changes.sort(key=lambda change: int(change[0]["seq"]))
        drawn: dict[Stage, list[tuple[Any, Points]]] = {}
        news = []
        for event, stage in changes:
            if stage is not None:
                news.append((event, self._path_text(event, stage)))
                self._path = event["waypoints"]
            elif self._path is not None:
                self._path = np.delete(self._path, slice(event["i"] + 1, event["j"]), axis=0)
            if self._path is not None and (stage is not None or len(self._path) <= _LONGEST_SHOWN):
                place = _places(self._path, self._dim)
                drawn.setdefault(Stage.SMOOTHED if stage is None else stage, []).append((event, place))
        for stage, items in drawn.items():
            columns = self._strips(
                np.concatenate([p for _, p in items]), [len(p) for _, p in items]
            )
            when = time_columns(_moments(e for e, _ in items))
            self._rec.send_columns(f"/world/path/{scene.PATHS[stage][0]}", when, columns)
        if changes:
            costs = rr.Scalars.columns(scalars=[float(event["cost"]) for event, _ in changes])
            self._rec.send_columns(
                "/series/cost", time_columns(_moments(e for e, _ in changes)), costs
            )
        return news

    def _path_text(self, event: Any, stage: Stage) -> str:  # noqa: ANN401
        cost, waypoints = float(event["cost"]), len(event["waypoints"])
        text = f"{scene.PATHS[stage][0]} path: cost {cost:.6g}, {waypoints} waypoints"
        if stage is Stage.SMOOTHED and 0 < self._cost < np.inf:
            text += f", {100 * (1 - cost / self._cost):.1f} % shorter"
        self._cost = cost
        return text


class _Tree:
    """Where the nodes of a tree are, and which of its edges are drawn."""

    def __init__(self, world: World) -> None:
        self.nodes, self.drawn, self.thinned = 0, 0, False
        self._places = np.full((1024, world.dim), np.nan, np.float32)
        side = int(_CELLS ** (1 / world.dim))
        self._lower, self._scale = world.lower, side / (world.upper - world.lower)
        self._shape = (side,) * world.dim
        self._taken = np.zeros(side**world.dim, np.bool_)

    def join(self, rows: Table) -> tuple[Points, Indices]:
        """Take in edges; return the lines to draw, shape (n, 2, dim), and which rows they are."""
        places = _places(rows["q"], self._places.shape[1])
        self._keep(rows["node"], places)
        wanted = rows["parent"] >= 0
        cells = self._cells_of(rows["q"])
        late = np.arange(self.nodes, self.nodes + len(rows)) >= _DRAWN_IN_FULL
        if late.any():
            self.thinned = True
            first_of_cell = np.zeros(len(rows), np.bool_)
            first_of_cell[np.unique(cells, return_index=True)[1]] = True
            wanted &= ~late | (first_of_cell & ~self._taken[cells])
        self._taken[cells] = True
        which = np.flatnonzero(wanted)
        self.nodes, self.drawn = self.nodes + len(rows), self.drawn + len(which)
        return np.stack([self.places(rows["parent"][which]), places[which]], axis=1), which

    def places(self, nodes: NDArray[np.int32]) -> Points:
        """Where nodes are, shape (n, dim); NaN, which is not drawn, where it was not kept."""
        found = self._places[np.clip(nodes, 0, len(self._places) - 1)]
        found[(nodes < 0) | (nodes >= len(self._places))] = np.nan
        return found

    def _keep(self, nodes: NDArray[np.int32], places: Points) -> None:
        kept = (nodes >= 0) & (nodes < _KEPT_NODES)
        nodes, places = nodes[kept], places[kept]
        need = int(nodes.max(initial=-1)) + 1
        if need > len(self._places):
            grown = np.full((max(need, 2 * len(self._places)), places.shape[1]), np.nan, np.float32)
            grown[: len(self._places)] = self._places
            self._places = grown
        self._places[nodes] = places

    def _cells_of(self, q: NDArray[np.float64]) -> Indices:
        dim = len(self._shape)
        cells = ((q[:, :dim] - self._lower) * self._scale).astype(np.int64)
        return np.ravel_multi_index(tuple(cells.T), self._shape, mode="clip")


def _places(values: Any, dim: int) -> Points:  # noqa: ANN401 - anything with numbers
    """Positions of configurations, shape (n, dim): a robot's first coordinates are its place."""
    return np.ascontiguousarray(np.asarray(values)[..., :dim], np.float32)


def _moments(events: Iterable[Any]) -> Table:
    """Gather the times of events of several kinds."""
    return np.array([(e["seq"], e["t"], e["iteration"]) for e in events], _MOMENT)


def _phase_text(event: Any) -> str:  # noqa: ANN401
    phase, status = Phase(int(event["name"])), Status(int(event["status"]))
    if status is Status.BEGIN:
        return f"{_label(phase)} begins"
    return f"{_label(phase)} ends: {_label(status).replace('_', ' ')}"


def _label(choice: Phase | Status | Source | Reason) -> str:
    return choice.name.lower()
