"""What all parts of a drawing share: styles of entities, rows in time, plots and the text log."""

from collections.abc import Callable, Iterable, Sequence
from functools import cache, lru_cache, partial
from typing import Any

import numpy as np
import pyarrow  # noqa: ICN001 - it gets that name below
import rerun as rr
from numpy.typing import NDArray

from brrt.events import Table
from brrt.formats.rrd.columns import time_columns
from brrt.scenario.manifest import Manifest
from brrt.views.colours import Colour
from brrt.views.rerun.frame import Frame

pa: Any = pyarrow  # mypy knows none of its names

TIMES = np.dtype([("seq", "<i8"), ("t", "<i8"), ("iteration", "<i8")])
"""The columns that every event has."""

_ROW, _MANY = 1024, 1 << 16
"""Items in a row where there are many, and the number of items from which on there are."""


class Canvas:
    """A Rerun recording stream to draw a run into.

    Attributes:
        frame: How coordinates are drawn.
        world: The world as it is drawn.
        dim: Its dimensions.
        robot: The run's.
    """

    def __init__(self, rec: rr.RecordingStream, manifest: Manifest, frame: Frame) -> None:
        self.frame, self.world = frame, frame.drawn
        self.dim, self.robot = manifest.dim, manifest.make_robot()
        flat, parts = self.dim == 2, rr.components
        self._strips: Any = parts.LineStrip2DBatch if flat else parts.LineStrip3DBatch
        self.lines: Any = rr.LineStrips2D if flat else rr.LineStrips3D
        self.points: Any = rr.Points2D if flat else rr.Points3D
        self.boxes: Any = rr.Boxes2D if flat else rr.Boxes3D
        self._rec = rec
        self._styles: dict[str, list[Any]] = {}
        self._texts: list[tuple[Any, str]] = []

    def places(self, values: Any) -> NDArray[np.float32]:
        """Return where configurations, shape (n, dof), are drawn, shape (n, dim)."""
        return self.frame.places(values, self.robot)

    def trail(self, path: NDArray[np.float64]) -> NDArray[np.float32]:
        """Return where a path, shape (m, dof), is drawn, shape (k, dim); see `Robot.trail`."""
        return np.ascontiguousarray(self.frame.points(self.robot.trail(path)), np.float32)

    def style(
        self, entity: str, archetype: Any, colour: Colour, radius: float, layer: float
    ) -> None:
        """Set the style of all rows of an entity; a negative radius is in points of the screen."""
        order = {"draw_order": layer} if self.dim == 2 else {}
        self._share(entity, archetype.from_fields, colors=colour, radii=radius, **order)

    def _share(self, entity: str, make: Callable[..., Any], **values: Any) -> None:
        """Log static values of an entity before its first row: most entities never get one."""
        self._styles.setdefault(entity, []).append(partial(make, **values))

    def row_style(
        self, archetype: Any, rows: int, radius: float, layer: float, colour: int | None = None
    ) -> Any:
        """Return columns that set the style in each of some rows, for entities of many pages."""
        return _style_columns(archetype, rows, radius, layer if self.dim == 2 else None, colour)

    def plot_style(self, entity: str, name: str, colour: Colour, *, dots: bool = False) -> None:
        """Name and colour a plot; `dots` marks its values."""
        name = name.replace("_", " ")
        self._share(entity, rr.SeriesLines, names=name, colors=colour, widths=1.5)
        if dots:
            self._share(entity, rr.SeriesPoints, colors=colour, marker_sizes=3, names=name)

    def plot(self, entity: str, rows: Table, values: Any) -> None:
        """Plot a value at each row's time."""
        self._send_columns(entity, rows, rr.Scalars.columns(scalars=values))

    def strips(self, points: NDArray[np.float32], lengths: int | Sequence[int]) -> Any:
        """Return columns of lines through points; Rerun's own conversion takes ten times longer.

        Args:
            points: Points of the lines, one line after another, shape (n, dim).
            lengths: Points of each line; one number if all are equal.
        """
        if isinstance(lengths, int):
            offsets = np.arange(0, len(points) + 1, lengths, dtype=np.int32)
        else:
            offsets = np.cumsum([0, *lengths], dtype=np.int32)
        arrow = self._strips._ARROW_DATATYPE  # noqa: SLF001 - only this type is not converted
        flat = pa.FixedSizeListArray.from_arrays(points.reshape(-1), type=arrow.value_type)
        return self.lines.columns(strips=pa.ListArray.from_arrays(offsets, flat, type=arrow))

    def segments(self, begins: NDArray[np.float32], ends: NDArray[np.float32]) -> Any:
        """Return columns of straight lines between places, shape (n, dim) each."""
        return self.strips(np.stack([begins, ends], axis=1).reshape(-1, self.dim), 2)

    def send(self, entity: str, rows: Table, ends: NDArray[np.int64], columns: Any) -> None:
        """Send items in rows that end at `ends`; each row has the time of its last event."""
        self.send_rows(entity, rows[ends - 1], np.diff(ends, prepend=0), columns)

    def send_rows(
        self, entity: str, times: Table, counts: NDArray[Any], columns: Any, style: Any = ()
    ) -> None:
        """Send `counts` items at each of the times, with the columns of a style in each row."""
        self._send_columns(entity, times, [*columns.partition(counts), *style])

    def hide_from(self, event: Any, entity: str, place: NDArray[np.float32]) -> None:
        """From an event on, shrink an entity to a place where a marker covers it.

        A view shows all rows up to the cursor: neither Clear nor an empty row takes one away. But
        one transform holds at each instant, so the entity is back when the cursor goes back.
        """
        where = np.zeros((1, 3), np.float32)
        where[0, : self.dim] = place
        columns = rr.Transform3D.columns(translation=where, scale=np.full((1, 3), 1e-6, np.float32))
        self._send_columns(entity, times_of([event]), columns)

    def add_text(self, event: Any, text: str) -> None:
        """Add a line to the text log at the time of an event."""
        self._texts.append((event, text))

    def send_texts(self) -> None:
        """Send the added lines, in the order of their events."""
        if self._texts:
            self._texts.sort(key=lambda item: int(item[0]["seq"]))
            columns = rr.TextLog.columns(text=[text for _, text in self._texts])
            self._send_columns("/log", times_of(event for event, _ in self._texts), columns)
            self._texts.clear()

    def _send_columns(self, entity: str, rows: Table, columns: Any) -> None:
        for style in self._styles.pop(entity, ()):
            self._rec.log(entity, style(), static=True)
        self._rec.send_columns(entity, time_columns(rows), columns)


@lru_cache(maxsize=256)
def _style_columns(
    archetype: Any, rows: int, radius: float, layer: float | None, colour: int | None
) -> Any:
    """Return a style as columns; cached, since making it takes half a millisecond."""
    values: dict[str, Any] = {"radii": np.full(rows, radius, np.float32)}
    if colour is not None:
        values["colors"] = np.full(rows, colour, np.uint32)
    if layer is not None:
        values["draw_order"] = np.full(rows, layer, np.float32)
    return archetype.columns(**values)


def growing_rows(first: int, count: int) -> NDArray[np.int64]:
    """Cut items into rows that have about 1 % of the items so far, from 1 item up to `_ROW`.

    A viewer takes time for each row and shows a row at once: so the first edges of a tree appear
    one by one, and the many later ones in rows.

    Args:
        first: Items before these.
        count: Items to cut, at least 1.

    Returns:
        The end of each row, exclusive, counted from `first`; the last is `count`.
    """
    few, end = _first_rows(), first + count
    begin = few.searchsorted(first, "right")
    many = np.arange(max(_MANY, (first // _ROW + 1) * _ROW), end, _ROW)
    return np.concatenate([few[begin : few.searchsorted(end)], many, [end]]) - first


@cache
def _first_rows() -> NDArray[np.int64]:
    """Return where the rows of the first `_MANY` items begin."""
    row = (64 * np.log2(np.arange(1.0, _MANY + 1))).astype(np.int64)
    return np.flatnonzero(np.diff(row)) + 1


def times_of(events: Iterable[Any]) -> Table:
    """Return the times of events of any kinds as one table."""
    return np.array([(e["seq"], e["t"], e["iteration"]) for e in events], TIMES)


def merged(tables: Iterable[Table], *fields: str) -> Table:
    """Return the times and some fields of tables as one table, in the order of `seq`."""
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
