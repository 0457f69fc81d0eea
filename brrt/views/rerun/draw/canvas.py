"""What everything that is drawn into a recording shares: styles, rows in time, plots, the log."""

from collections.abc import Callable, Iterable
from functools import cache, lru_cache, partial
from typing import Any

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from brrt.events import Table
from brrt.scenario.manifest import Manifest
from brrt.views.colours import Colour
from brrt.views.rerun import layout
from brrt.views.rerun.arrow import line_strips, time_columns
from brrt.worlds.world import World

MOMENT = np.dtype([("seq", "<i8"), ("t", "<i8"), ("iteration", "<i8")])
"""When something happened."""

_ROW, _FEW = 1024, 1 << 16
"""Items in a row where there are many, and what comes before that."""


class Canvas:
    """A recording to draw into.

    Args:
        rec: The recording.
        manifest: The run's.
        world: The run's.
    """

    def __init__(self, rec: rr.RecordingStream, manifest: Manifest, world: World) -> None:
        self.world, self.dim, self.robot = world, manifest.dim, manifest.make_robot()
        flat = layout.is_flat(manifest)
        self.lines: Any = rr.LineStrips2D if flat else rr.LineStrips3D
        self.points: Any = rr.Points2D if flat else rr.Points3D
        self.boxes: Any = rr.Boxes2D if flat else rr.Boxes3D
        self._rec = rec
        self._styles: dict[str, list[Any]] = {}
        self._news: list[tuple[Any, str]] = []

    def places(self, values: Any) -> NDArray[np.float32]:
        """Where configurations, shape (n, dof), are drawn, shape (n, dim)."""
        return layout.places(values, self.robot)

    def style(
        self, entity: str, archetype: Any, colour: Colour, radius: float, layer: float
    ) -> None:
        """Set what all rows of an entity share; a negative radius is in points of the screen."""
        order = {"draw_order": layer} if self.dim == 2 else {}
        self._share(entity, archetype.from_fields, colors=colour, radii=radius, **order)

    def _share(self, entity: str, make: Callable[..., Any], **values: Any) -> None:
        """Log what rows share before the first one: most entities never get any."""
        self._styles.setdefault(entity, []).append(partial(make, **values))

    def still(self, entity: str, archetype: Any) -> None:
        """Log what holds at all times."""
        self._rec.log(entity, archetype, static=True)

    def row_style(
        self, archetype: Any, rows: int, radius: float, layer: float, colour: int | None = None
    ) -> Any:
        """Return a style for each of some rows, for entities that share theirs with many."""
        return _style_columns(archetype, rows, radius, layer if self.dim == 2 else None, colour)

    def plot_style(self, entity: str, name: str, colour: Colour) -> None:
        """Name and colour a plot."""
        name = name.replace("_", " ")
        self._share(entity, rr.SeriesLines, names=name, colors=colour, widths=1.5)

    def plot_dots(self, entity: str, name: str, colour: Colour) -> None:
        """Show the values of a plot as dots too."""
        self._share(entity, rr.SeriesPoints, colors=colour, marker_sizes=3, names=name)

    def plot(self, entity: str, rows: Table, values: Any) -> None:
        """Plot a value at each row's time."""
        self._send_columns(entity, rows, rr.Scalars.columns(scalars=values))

    def strips(self, places: NDArray[np.float32], lengths: Any) -> Any:
        """Return lines through places, one after the other; see `line_strips`."""
        return self.lines.columns(strips=line_strips(places, lengths))

    def send(self, entity: str, rows: Table, ends: NDArray[np.int64], columns: Any) -> None:
        """Send items in rows; each row has the time of its last event."""
        self.send_rows(entity, rows[ends - 1], np.diff(ends, prepend=0), columns)

    def send_rows(
        self,
        entity: str,
        moments: Table,
        counts: NDArray[Any],
        columns: Any,
        style: Any = (),
    ) -> None:
        """Send so many items at each of some moments, and a style in each row if there is one."""
        self._send_columns(entity, moments, [*columns.partition(counts), *style])

    def put_away(self, entity: str, event: Any, place: NDArray[np.float32]) -> None:
        """From an event on, shrink an entity that grows to a place where a mark covers it.

        What is shown up to the cursor stays: neither Clear nor an empty row takes a row away. But
        there is one transform at each instant, so that it also comes back on the way back.
        """
        where = np.zeros((1, 3), np.float32)
        where[0, : self.dim] = place
        columns = rr.Transform3D.columns(translation=where, scale=np.full((1, 3), 1e-6, np.float32))
        self._send_columns(entity, moments([event]), columns)

    def tell(self, event: Any, text: str) -> None:
        """Say something in the log at the time of an event."""
        self._news.append((event, text))

    def tell_news(self) -> None:
        """Write what has been said to the log, in order."""
        if self._news:
            self._news.sort(key=lambda item: int(item[0]["seq"]))
            texts = rr.TextLog.columns(text=[text for _, text in self._news])
            self._send_columns("/log", moments(event for event, _ in self._news), texts)
            self._news.clear()

    def _send_columns(self, entity: str, rows: Table, columns: Any) -> None:
        for style in self._styles.pop(entity, ()):
            self.still(entity, style())
        self._rec.send_columns(entity, time_columns(rows), columns)


@lru_cache(maxsize=256)
def _style_columns(
    archetype: Any, rows: int, radius: float, layer: float | None, colour: int | None
) -> Any:
    """Return what many entities share; making it takes half a millisecond."""
    given: dict[str, Any] = {"radii": np.full(rows, radius, np.float32)}
    if colour is not None:
        given["colors"] = np.full(rows, colour, np.uint32)
    if layer is not None:
        given["draw_order"] = np.full(rows, layer, np.float32)
    return archetype.columns(**given)


def growing_rows(first: int, count: int) -> NDArray[np.int64]:
    """Cut items into rows of about 1 % of what there is, from 1 item up to `_ROW`.

    A viewer takes time for each row, and shows a row at once: so the first edges of a tree appear
    one by one, and the many that follow in rows.

    Args:
        first: Items before these.
        count: Items to cut, at least 1.

    Returns:
        The end of each row, exclusive, counted from `first`; the last is `count`.
    """
    few, end = _first_rows(), first + count
    begin = few.searchsorted(first, "right")
    many = np.arange(max(_FEW, (first // _ROW + 1) * _ROW), end, _ROW)
    return np.concatenate([few[begin : few.searchsorted(end)], many, [end]]) - first


@cache
def _first_rows() -> NDArray[np.int64]:
    """Where the rows of the first items begin."""
    row = (64 * np.log2(np.arange(1.0, _FEW + 1))).astype(np.int64)
    return np.flatnonzero(np.diff(row)) + 1


def moments(events: Iterable[Any]) -> Table:
    """Gather the times of events of several kinds."""
    return np.array([(e["seq"], e["t"], e["iteration"]) for e in events], MOMENT)


def merged(tables: Iterable[Table], *fields: str) -> Table:
    """Bring the times and some fields of tables into one, in the order of `seq`."""
    tables = list(tables)
    types = next(table.dtype for table in tables)
    dtype = np.dtype([(name, types[name]) for name in ("seq", "t", "iteration", *fields)])
    parts = []
    for table in tables:
        part = np.empty(len(table), dtype)
        for name in dtype.names or ():
            part[name] = table[name]
        parts.append(part)
    joined = np.concatenate(parts)
    return joined.take(np.argsort(joined["seq"], kind="stable"))
