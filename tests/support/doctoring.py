"""Logs that are doctored at random, one event at a time: for the tests and benchmarks/doctor.py."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from brrt import Events, Kind
from brrt.events import FIELDS, Field

OFF = 1e-3
"""Part by which a number is off."""

Doctor = Callable[[Events, Kind, int, np.random.Generator], Events | None]
"""Changes the event of this kind and row; None where there is nothing to change."""


def field_doctor(field: Field) -> Doctor:
    """Change a field of an event to something else that it may say."""

    def doctor(log: Events, kind: Kind, row: int, rng: np.random.Generator) -> Events | None:
        table = log[kind].copy()
        old = table[field.name][row]
        new = other_value(log, field, kind, old, rng)
        if new is None:
            return None
        table[field.name][row] = new
        return Events(log.dof, {**log.tables, kind: table})

    return doctor


def other_value(log: Events, field: Field, kind: Kind, old: Any, rng: np.random.Generator) -> Any:
    """Return what a field might say as well, or None."""
    if field.choices is not None:
        return rng.choice([int(choice) for choice in field.choices if choice != old])
    if field.type == "bool":
        return not old
    if field.name == "tree":
        return 1 - old if Kind.CONNECT in log.tables or kind is Kind.SAMPLE else None
    if field.type == "float64":
        return old * (1 + rng.choice([-OFF, OFF])) if old else OFF
    if field.type.startswith("q"):
        q = np.array(old, np.float64)
        if not q.size:
            return None
        at = tuple(rng.integers(0, n) for n in q.shape)
        q[at] += rng.choice([-OFF, OFF]) * max(abs(q[at]), 1.0)
        return q
    known = np.setdiff1d(log[kind][field.name], [old])
    return rng.choice(known) if len(known) else None


def other_iteration(log: Events, kind: Kind, row: int, rng: np.random.Generator) -> Events | None:
    """Say that an event belongs to the iteration before or after."""
    table = log[kind].copy()
    table["iteration"][row] = max(0, table["iteration"][row] + rng.choice([-1, 1]))
    if table["iteration"][row] == log[kind]["iteration"][row]:
        return None
    return Events(log.dof, {**log.tables, kind: table})


def dropped(log: Events, kind: Kind, row: int, rng: np.random.Generator) -> Events:
    """Leave an event out; the others close up."""
    gone = log[kind]["seq"][row]
    tables = {k: t[t["seq"] != gone].copy() for k, t in log.tables.items()}
    for table in tables.values():
        table["seq"][table["seq"] > gone] -= 1
    return Events(log.dof, {k: t for k, t in tables.items() if len(t)})


def doubled(log: Events, kind: Kind, row: int, rng: np.random.Generator) -> Events:
    """Tell of an event twice, one right after the other; what follows is a nanosecond later."""
    seq = log[kind]["seq"][row]
    tables = {k: t.copy() for k, t in log.tables.items()}
    for table in tables.values():
        later = table["seq"] > seq
        table["seq"][later] += 1
        table["t"][later] += 1
    again = tables[kind][row : row + 1].copy()
    again["seq"] += 1
    again["t"] += 1
    tables[kind] = np.insert(tables[kind], row + 1, again)
    return Events(log.dof, tables)


def swapped(
    log: Events,
    kind: Kind,
    row: int,
    rng: np.random.Generator,
) -> Events | None:
    """Tell of an event after the next one; each keeps its iteration, times and numbers rise."""
    first = log[kind]["seq"][row]
    tables = {k: t.copy() for k, t in log.tables.items()}
    pair = [
        (k, int(at[0]))
        for seq in (first, first + 1)
        for k, t in tables.items()
        if len(at := np.flatnonzero(t["seq"] == seq))
    ]
    if len(pair) < 2:
        return None
    (a, i), (b, j) = pair
    for name in ("seq", "t"):
        one, two = int(tables[a][name][i]), int(tables[b][name][j])
        tables[a][name][i], tables[b][name][j] = two, one
    if a == b:
        tables[a] = tables[a][np.argsort(tables[a]["seq"])]
    return Events(log.dof, tables)


WAYS: dict[str, Doctor] = {
    "dropped": dropped, "doubled": doubled, "swapped": swapped, "iteration": other_iteration,
}  # fmt: skip


def doctors(log: Events) -> Iterator[tuple[Kind, str, Doctor]]:
    """Yield the ways in which a log can be doctored."""
    for kind in log.tables:
        for field in FIELDS[kind]:
            yield kind, field.name, field_doctor(field)
        for name, doctor in WAYS.items():
            yield kind, name, doctor
