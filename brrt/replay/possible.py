"""What an event can say: told of what a planner emits, and of what a file is read to hold."""

from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from brrt.errors import BrrtError
from brrt.events import FIELDS, EnumClass, Events, Kind, Table
from brrt.worlds.convex import GREATEST

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
    _hold(kind, "t", table, (table["t"] < 0) | (table["t"] > _LONGEST))
    _hold(kind, "iteration", table, (table["iteration"] < 0) | (table["iteration"] > _LONGEST))
    for field in FIELDS[kind]:
        values = table[field.name]
        if field.choices is not None:
            wrong = ~np.isin(values, list(field.choices))
        elif field.type == "q[]":
            wrong = np.array([not (len(rows) and _finite(rows).all()) for rows in values], np.bool_)
        elif field.type == "q":
            wrong = np.asarray(~_finite(values).all(axis=1))
        elif field.type == "float64":
            wrong = ~_finite(values)
            if field.name == "h":  # where there is no way out
                wrong &= values != np.inf
        elif field.type == "int32":
            wrong = (values < -1) | (values >= _SEEN * count)
        else:
            continue
        _hold(kind, field.name, table, wrong, field.choices)


def _finite(values: NDArray[np.float64]) -> NDArray[np.bool_]:
    return np.asarray(np.abs(values) <= GREATEST)


def _hold(
    kind: Kind,
    name: str,
    table: Table,
    wrong: NDArray[np.bool_],
    choices: EnumClass | None = None,
) -> None:
    if wrong.any():
        event = table[int(wrong.argmax())]
        value = " ".join(str(event[name]).split())[:60]
        there = "" if choices is None else f"; there is {', '.join(map(told, choices))}"
        raise BrrtError(f"event {event['seq']:,}: {kind.label} has {name} = {value}{there}")


def told(choice: IntEnum) -> str:
    """Return a choice as number and name."""
    return f"{choice.value} ({choice.name.lower().replace('_', ' ')})"
