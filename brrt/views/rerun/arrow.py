"""Events as Arrow columns for Rerun; `brrt.formats.rrd` reads them back."""

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
import pyarrow  # noqa: ICN001 - it gets that name below
import rerun as rr
from numpy.typing import NDArray

from brrt.events import Field, Table

pa: Any = pyarrow  # mypy knows none of its names


class Column(NamedTuple):
    """A column of times or components, as `send_columns` takes either.

    It replaces Rerun's own classes, whose checks take longer than sending the data.

    Attributes:
        name: The timeline, or the component's descriptor.
        values: An Arrow array: one value a row for times, one list a row for components.
    """

    name: Any
    values: Any

    def timeline_name(self) -> str:
        """Return the name of the timeline."""
        return str(self.name)

    def component_descriptor(self) -> Any:
        """Return the descriptor of the component."""
        return self.name

    def as_arrow_array(self) -> Any:
        """Return the values."""
        return self.values


def time_columns(rows: Table) -> list[Column]:
    """Return the timelines of events, exact to the nanosecond."""
    iteration, seq, t = (np.ascontiguousarray(rows[name]) for name in ("iteration", "seq", "t"))
    return [
        Column("iteration", pa.array(iteration)),
        Column("event", pa.array(seq)),
        Column("t", pa.array(t.view("m8[ns]"))),
    ]


def event_columns(archetype: str, fields: Iterable[Field], table: Table) -> list[Column]:
    """Return the fields of events as columns, one component each."""
    offsets, columns = pa.array(np.arange(len(table) + 1, dtype=np.int32)), []
    for field in fields:
        values = to_arrow(field, table[field.name])
        if field.type != "q[]":  # that array holds a list a row already
            values = pa.ListArray.from_arrays(offsets, values)
        name = rr.ComponentDescriptor(f"{archetype}:{field.name}", archetype=archetype)
        columns.append(Column(name, values))
    return columns


def to_arrow(field: Field, values: NDArray[Any]) -> Any:
    """Return a field of any type as an Arrow array with one value a row."""
    if field.type == "q[]":
        flat = [np.ravel(row) for row in values]
        offsets = np.cumsum([0, *map(len, flat)], dtype=np.int32)
        return pa.ListArray.from_arrays(offsets, pa.array(np.concatenate(flat), pa.float64()))
    values = np.ascontiguousarray(values)  # pyarrow copies arrays with gaps value by value
    if field.type == "q":
        return pa.FixedSizeListArray.from_arrays(pa.array(values.reshape(-1)), values.shape[1])
    return pa.array(values)


def line_strips(places: NDArray[np.float32], lengths: int | Sequence[int]) -> Any:
    """Return line strips as an Arrow array; Rerun's own conversion takes ten times longer.

    Args:
        places: Their points, one after another, shape (n, 2) or (n, 3).
        lengths: Points of each strip; one number if all are equal.
    """
    if isinstance(lengths, int):
        offsets = np.arange(0, len(places) + 1, lengths, dtype=np.int32)
    else:
        offsets = np.cumsum([0, *lengths], dtype=np.int32)
    flat = places.shape[1] == 2
    batch: Any = rr.components.LineStrip2DBatch if flat else rr.components.LineStrip3DBatch
    arrow = batch._ARROW_DATATYPE  # noqa: SLF001 - only this exact type is not converted
    points = pa.FixedSizeListArray.from_arrays(places.reshape(-1), type=arrow.value_type)
    return pa.ListArray.from_arrays(offsets, points, type=arrow)
