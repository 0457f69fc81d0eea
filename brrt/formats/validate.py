"""Whether the values of events are possible, for events of planners and of files."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrt.errors import BrrtError
from brrt.events import FIELDS, Events, Kind, Table
from brrt.worlds.arrays import GREATEST

_LONGEST = 1 << 60
"""The greatest time in ns, 36 years, and the greatest iteration."""

_CELLS = 27
"""Cells of a lattice that one event may introduce: the one it expands and its neighbours."""


def check_possible(events: Events, count: int) -> None:
    """Check that every value is possible; whether it is right is judged by `brrt.verify`.

    Args:
        events: The last batch.
        count: Events of the log so far, with these: there cannot be more nodes.

    Raises:
        BrrtError: A value is not.
    """
    for kind, table in events.tables.items():
        _check(kind, table, count)


def _check(kind: Kind, table: Table, count: int) -> None:
    _check_range(kind, "t", table, 0, _LONGEST)
    _check_range(kind, "iteration", table, 0, _LONGEST)
    for field in FIELDS[kind]:
        if field.choices is not None:
            # Enumerations count from 0 without gaps.
            _check_range(kind, field.name, table, 0, len(field.choices) - 1)
        elif field.type == "q[]":
            for at, rows in enumerate(table[field.name]):
                if not len(rows) or _beyond(rows, -GREATEST, GREATEST).any():
                    raise _error(kind, field.name, table[at])
        elif field.name == "part":
            _check_range(kind, field.name, table, 0, 1)
        elif field.type in ("q", "float64"):
            # An estimate is infinite if a cell has no free neighbour.
            most = np.inf if field.name == "h" else GREATEST
            _check_range(kind, field.name, table, -GREATEST, most)
        elif field.type == "int32":
            _check_range(kind, field.name, table, -1, _CELLS * count - 1)


def _check_range(kind: Kind, name: str, table: Table, least: float, most: float) -> None:
    values = table[name]
    # Both comparisons are false for nan; in the usual case no mask is needed.
    if len(values) and not (values.min() >= least and values.max() <= most):
        wrong = _beyond(values, least, most)
        raise _error(kind, name, table[int(wrong.argmax())])


def _beyond(values: NDArray[Any], least: float, most: float) -> NDArray[np.bool_]:
    """Return which events have a number out of range, or not a number, shape (n,)."""
    inside = (values >= least) & (values <= most)
    return np.asarray(~inside.reshape(len(values), -1).all(axis=1))


def _error(kind: Kind, name: str, event: np.void) -> BrrtError:
    value = " ".join(str(event[name]).split())[:60]
    choices = next((f.choices for f in FIELDS[kind] if f.name == name and f.choices), ())
    known = ", ".join(f"{choice.value} ({choice.label})" for choice in choices)
    possible = f"; possible are {known}" if known else ""
    return BrrtError(f"event {event['seq']:,}: {kind.label} has {name} = {value}{possible}")
