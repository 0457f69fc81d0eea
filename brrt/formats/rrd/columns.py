"""Events as Arrow columns, both ways: as Rerun takes them, and out of the chunks that it reads."""

from typing import Any, NamedTuple

import numpy as np
import pyarrow  # noqa: ICN001 - it gets that name below
import rerun as rr
from numpy.typing import NDArray

from brrt.errors import BrrtError
from brrt.events import FIELDS, Field, Kind, Table, table_dtype

pa: Any = pyarrow  # mypy knows none of its names

EVENTS, OURS = "/ev/", "/brrt/"
MANIFEST, WORLD, END = "/brrt/manifest", "/brrt/world", "/brrt/end"
"""Entities: the events of each kind are below `EVENTS`, named texts below `OURS`."""

_TIMELINES = {"iteration": "iteration", "event": "seq", "t": "t"}
"""The timelines, and the column of a table that each holds."""


class Column(NamedTuple):
    """A column of times or of components, as `send_columns` takes either.

    Rerun's own classes check all values again, which takes longer than sending them.

    Attributes:
        name: The timeline, or the component's descriptor.
        values: An Arrow array with one value a row; of components, one list a row.
    """

    name: Any
    values: Any

    def timeline_name(self) -> str:
        """Return the timeline."""
        return str(self.name)

    def component_descriptor(self) -> Any:
        """Return the component's descriptor."""
        return self.name

    def as_arrow_array(self) -> Any:
        """Return the values."""
        return self.values


def archetype(entity: str) -> str:
    """Return the archetype of an entity: `brrt.edge` for `/ev/edge`."""
    return f"brrt.{entity.rsplit('/', 1)[-1]}"


def _component(kind: Kind, field: Field) -> str:
    return f"brrt.{kind.label}:{field.name}"


def time_columns(rows: Table) -> list[Column]:
    """Return the timelines of events, exact to the nanosecond."""
    columns = {name: np.ascontiguousarray(rows[column]) for name, column in _TIMELINES.items()}
    columns["t"] = columns["t"].view("m8[ns]")
    return [Column(name, pa.array(values)) for name, values in columns.items()]


def event_columns(kind: Kind, table: Table) -> list[Column]:
    """Return the fields of events of a kind, one component each."""
    offsets, columns = pa.array(np.arange(len(table) + 1, dtype=np.int32)), []
    for field in FIELDS[kind]:
        values = to_arrow(field, table[field.name])
        if field.type != "q[]":  # whose values are lists already, one a row
            values = pa.ListArray.from_arrays(offsets, values)
        name = rr.ComponentDescriptor(_component(kind, field), archetype=f"brrt.{kind.label}")
        columns.append(Column(name, values))
    return columns


def table_of(kind: Kind, dof: int, batch: Any) -> Table:
    """Return the events in a record batch of Rerun's.

    Raises:
        BrrtError: A time or a value is missing, or a column is of another type.
        KeyError: A column is missing.
    """
    table = np.empty(batch.num_rows, table_dtype(kind, dof))
    for timeline, name in _TIMELINES.items():
        times = batch.column(timeline)
        if times.null_count:
            raise BrrtError(f"{kind.label} has an event without {name}")
        table[name] = times.cast("int64").to_numpy()
    for field in FIELDS[kind]:
        table[field.name] = from_arrow(field, batch.column(_component(kind, field)), dof)
    return table


def to_arrow(field: Field, values: NDArray[Any]) -> Any:
    """Return a field of any type as an Arrow array with one value a row."""
    if field.type == "q[]":
        flat = [np.ravel(row) for row in values]
        offsets = np.cumsum([0, *map(len, flat)], dtype=np.int32)
        return pa.ListArray.from_arrays(offsets, pa.array(np.concatenate(flat), pa.float64()))
    values = np.ascontiguousarray(values)  # pyarrow copies values with gaps one by one
    if field.type == "q":
        return pa.FixedSizeListArray.from_arrays(pa.array(values.reshape(-1)), values.shape[1])
    return pa.array(values)


def from_arrow(field: Field, column: Any, dof: int) -> NDArray[Any]:
    """Undo `to_arrow`, and the list around each value that Rerun requires.

    Raises:
        BrrtError: There is not one value a row, or it is of another type.
    """
    flat, rows = column.flatten(), len(column)
    if field.type == "q":
        if flat.type.list_size != dof:
            raise BrrtError(f"{field.name} has {flat.type.list_size} numbers instead of {dof}")
        values, wanted = flat.flatten(), rows * dof
    else:
        values, wanted = flat, len(flat) if field.type == "q[]" else rows
    kind = pa.float64() if field.type in ("q", "q[]") else pa.from_numpy_dtype(field.type)
    if values.type != kind or values.null_count or len(values) != wanted:
        raise BrrtError(f"{field.name} has {len(values)} values of {values.type} in {rows} rows")
    numbers = np.asarray(values.to_numpy(zero_copy_only=False))
    if field.type == "q":
        return numbers.reshape(-1, dof)
    if field.type != "q[]":
        return numbers
    parts = np.empty(rows, object)
    ends = np.cumsum(np.asarray(column.value_lengths()))
    for i, part in enumerate(np.split(numbers, ends[:-1])):
        parts[i] = part.reshape(-1, dof)
    return parts
