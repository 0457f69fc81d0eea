"""Events as Arrow columns, the way Rerun takes them; `rrd_reader` undoes that."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pyarrow  # noqa: ICN001 - it gets that name below
import rerun as rr
from numpy.typing import NDArray

from brrt.events import Field, Table

pa: Any = pyarrow  # mypy knows none of its names


def time_columns(rows: Table) -> list[rr.TimeColumn]:
    """Return the timelines of events, exact to the nanosecond."""
    return [
        rr.TimeColumn("iteration", sequence=np.ascontiguousarray(rows["iteration"])),
        rr.TimeColumn("event", sequence=np.ascontiguousarray(rows["seq"])),
        rr.TimeColumn("t", duration=rows["t"].astype("m8[ns]")),
    ]


def to_arrow(field: Field, values: NDArray[Any]) -> Any:
    """Return a field of any type as an Arrow array with one value a row."""
    if field.type == "q[]":
        flat = [np.ravel(row) for row in values]
        offsets = np.cumsum([0, *map(len, flat)], dtype=np.int32)
        return pa.ListArray.from_arrays(offsets, pa.array(np.concatenate(flat), pa.float64()))
    values = np.ascontiguousarray(values)  # pyarrow copies what has gaps value by value
    if field.type == "q":
        return pa.FixedSizeListArray.from_arrays(pa.array(values.reshape(-1)), values.shape[1])
    return pa.array(values)


def line_strips(places: NDArray[np.float32], lengths: int | Sequence[int]) -> Any:
    """Return line strips as Arrow holds them; Rerun's own conversion takes ten times longer.

    Args:
        places: Their points, one after the other, shape (n, 2) or (n, 3).
        lengths: Points of each strip; one number if all are equal.
    """
    if isinstance(lengths, int):
        offsets = np.arange(0, len(places) + 1, lengths, dtype=np.int32)
    else:
        offsets = np.cumsum([0, *lengths], dtype=np.int32)
    flat = places.shape[1] == 2
    batch: Any = rr.components.LineStrip2DBatch if flat else rr.components.LineStrip3DBatch
    arrow = batch._ARROW_DATATYPE  # noqa: SLF001 - only this very type is taken as it is
    points = pa.FixedSizeListArray.from_arrays(places.reshape(-1), type=arrow.value_type)
    return pa.ListArray.from_arrays(offsets, points, type=arrow)
