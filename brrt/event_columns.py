"""Events in the order in which they happen, with place for the fields of any kind.

Planners write events of all kinds into the same columns: compiled ones by `brrt.kernels.emit`,
others by `brrt.recorder`. `LAYOUT` says where each field is; the tables of the kinds are made when
they are needed, usually on the thread that writes them.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brrt.events import FIELDS, Events, Field, Instant, Kind, LazyTables, Table, table_dtype

Floats = NDArray[np.float64]

INTEGERS, REALS, CONFIGURATIONS = "integers", "reals", "q"
"""The columns that hold fields."""

_COLUMNS = {
    **dict.fromkeys(("bool", "int8", "uint8", "int16", "uint16", "int32", "q[]"), INTEGERS),
    **dict.fromkeys(("float32", "float64"), REALS),
    "q": CONFIGURATIONS,
}
"""The column for each type of field; integers have 32 bits."""


COUNT, FIRST_SEQ, LAST_T, ORIGIN, TICK, POINTS, UNTIL_T, UNTIL_SEQ, ASKED = range(9)
"""Places in the `state` of a buffer that kernels write to."""


class Place(NamedTuple):
    """Where a field is.

    Attributes:
        field: The field.
        column: Name of the column.
        at: Index in the column's row, of a number or of a configuration. Waypoints take two
            integers: their first row among all waypoints, and the number of rows.
    """

    field: Field
    column: str
    at: int

    @property
    def end(self) -> int:
        """Index after the field."""
        return self.at + (2 if self.field.type == "q[]" else 1)


def layout_of(kind: Kind, fields: tuple[Field, ...]) -> tuple[Place, ...]:
    """Give each field of a kind its own place.

    Raises:
        TypeError: No column can hold a field of that type.
    """
    places: list[Place] = []
    for field in fields:
        column = _COLUMNS.get(field.type)
        if column is None:
            raise TypeError(
                f"field {field.name!r} of kind {kind.name} has the type {field.type!r}; "
                f"brrt.event_columns can hold {', '.join(_COLUMNS)}"
            )
        taken = [place.end for place in places if place.column == column]
        places.append(Place(field, column, max(taken, default=0)))
    return tuple(places)


LAYOUT: Mapping[Kind, tuple[Place, ...]] = {kind: layout_of(kind, FIELDS[kind]) for kind in Kind}

WIDTH: Mapping[str, int] = {
    column: max(p.end for places in LAYOUT.values() for p in places if p.column == column)
    for column in (INTEGERS, REALS, CONFIGURATIONS)
}
"""For each column the most numbers, or configurations, that an event of any kind has."""


@dataclass(frozen=True, slots=True, eq=False)
class EventColumns:
    """Successive events, which do not change any more.

    Attributes:
        first: Number of the first event.
        dof: Numbers in a configuration.
        kind: Shape (n,), uint8.
        t: Time in ns since the run began, shape (n,), int64.
        iteration: Shape (n,), int64.
        integers: Integer fields, shape (n, WIDTH[INTEGERS]), int32.
        reals: Float fields, shape (n, WIDTH[REALS]).
        q: Configurations, side by side, shape (n, WIDTH[CONFIGURATIONS] * dof).
        points: Waypoints of all paths, shape (m, dof).
    """

    first: int
    dof: int
    kind: NDArray[np.uint8]
    t: NDArray[np.int64]
    iteration: NDArray[np.int64]
    integers: NDArray[np.int32]
    reals: Floats
    q: Floats
    points: Floats

    def events(self) -> Events:
        """Return them as a batch."""
        counts = np.bincount(self.kind, minlength=len(Kind))
        present = {Kind(int(code)): int(counts[code]) for code in np.flatnonzero(counts)}
        last = Instant(0, 0)
        if len(self.kind):
            last = Instant(int(self.t[-1]), int(self.iteration[-1]))
        return Events(self.dof, LazyTables(present, last, self._table))

    def _table(self, kind: Kind) -> Table:
        """Gather the events of a kind, with their fields by name."""
        dof, rows = self.dof, np.flatnonzero(self.kind == kind)
        table = np.empty(len(rows), table_dtype(kind, dof))
        table["seq"] = rows + self.first
        table["t"] = self.t[rows]
        table["iteration"] = self.iteration[rows]
        for field, column, at in LAYOUT[kind]:
            if field.type == "q[]":
                places = self.integers[rows, at : at + 2].tolist()
                for i, (begin, n) in enumerate(places):
                    table[field.name][i] = self.points[begin : begin + n]
            elif field.type == "q":
                table[field.name] = self.q[rows, at * dof : (at + 1) * dof]
            else:
                table[field.name] = getattr(self, column)[rows, at]
        return table
