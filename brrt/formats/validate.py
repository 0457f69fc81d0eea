"""What an event can say: told of what a planner emits, and of what a file is read to hold."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrt.errors import BrrtError
from brrt.events import FIELDS, Events, Kind, Table
from brrt.worlds.arrays import GREATEST

_LONGEST = 1 << 60
"""Nanoseconds of a run, 36 years, and iterations."""

_SEEN = 27
"""Cells of a lattice that an event may be the first to show: the one it expands, and all around."""


def check_possible(events: Events, count: int) -> None:
    """See that every value is one that a planner can mean; whether it is right is for the checks.

    Args:
        events: The newest.
        count: Events of the log so far, these included: there are no more nodes.

    Raises:
        BrrtError: One is not.
    """
    for kind, table in events.tables.items():
        _check(kind, table, count)


def _check(kind: Kind, table: Table, count: int) -> None:
    _hold(kind, "t", table, 0, _LONGEST)
    _hold(kind, "iteration", table, 0, _LONGEST)
    for field in FIELDS[kind]:
        if field.choices is not None:
            # Enumerations count from 0 without a gap.
            _hold(kind, field.name, table, 0, len(field.choices) - 1)
        elif field.type == "q[]":
            for at, rows in enumerate(table[field.name]):
                if not len(rows) or _beyond(rows, -GREATEST, GREATEST).any():
                    raise _impossible(kind, field.name, table[at])
        elif field.type in ("q", "float64"):
            # An estimate is infinite where there is no way out.
            most = np.inf if field.name == "h" else GREATEST
            _hold(kind, field.name, table, -GREATEST, most)
        elif field.type == "int32":
            _hold(kind, field.name, table, -1, _SEEN * count - 1)


def _hold(kind: Kind, name: str, table: Table, least: float, most: float) -> None:
    values = table[name]
    # Two passes without a mask in the usual case; they are false of what is not a number, too.
    if len(values) and not (values.min() >= least and values.max() <= most):
        wrong = _beyond(values, least, most)
        raise _impossible(kind, name, table[int(wrong.argmax())])


def _beyond(values: NDArray[Any], least: float, most: float) -> NDArray[np.bool_]:
    """Return which of n events have a number that is out of range or none, shape (n,)."""
    inside = (values >= least) & (values <= most)
    return np.asarray(~inside.reshape(len(values), -1).all(axis=1))


def _impossible(kind: Kind, name: str, event: np.void) -> BrrtError:
    value = " ".join(str(event[name]).split())[:60]
    choices = next((f.choices for f in FIELDS[kind] if f.name == name and f.choices), ())
    there = f"; there is {', '.join(f'{c.value} ({c.label})' for c in choices)}" if choices else ""
    return BrrtError(f"event {event['seq']:,}: {kind.label} has {name} = {value}{there}")
