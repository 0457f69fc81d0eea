"""Rows of events in the order in which they happen, as one `struct.pack_into` writes them."""

from __future__ import annotations

import struct
from collections.abc import Mapping
from functools import cache

import numpy as np
from numpy.typing import NDArray

from brrt.events import FIELDS, Events, Instant, Kind, LazyTables, Table, table_dtype

Floats = NDArray[np.float64]

_INTEGERS = 3
"""Whole numbers in a row; waypoints take two of them, their first row and their number."""


@cache
def row_dtype(dof: int) -> np.dtype[np.void]:
    """Return the layout of a row, with place for the fields of any kind."""
    return np.dtype(
        [
            ("t", "<i8"), ("iteration", "<i8"), ("real", "<f8"), ("q", "<f8", (dof,)),
            ("integers", "<i4", (_INTEGERS,)), ("kind", "u1"), ("rest", "V3"),
        ]
    )  # fmt: skip


def row_struct(dof: int) -> struct.Struct:
    """Return what packs a row: time, iteration, float, configuration, integers, kind."""
    return struct.Struct(f"<qqd{dof}d{_INTEGERS}iB3x")


def _places(kind: Kind) -> tuple[dict[str, int], str | None, str | None]:
    """Return which integer holds each field of a kind, and its float and its configuration."""
    integers: dict[str, int] = {}
    end = 0
    reals: list[str | None] = []
    configurations: list[str | None] = []
    for field in FIELDS[kind]:
        if field.type == "q":
            configurations.append(field.name)
        elif field.type == "float64":
            reals.append(field.name)
        else:
            integers[field.name], end = end, end + (2 if field.type == "q[]" else 1)
    if end > _INTEGERS or len(reals) > 1 or len(configurations) > 1:
        raise TypeError(f"kind {kind.name} has more fields than a row of brrt.recorder holds")
    return integers, [*reals, None][0], [*configurations, None][0]


PLACES: Mapping[Kind, tuple[dict[str, int], str | None, str | None]] = {k: _places(k) for k in Kind}


def events_of(rows: Table, points: Floats, first: int, dof: int) -> Events:
    """Return rows as a batch, whose tables are built by the thread that writes them.

    Args:
        rows: The rows, shape (n,); they must not change any more.
        points: Waypoints of their paths, shape (m, dof).
        first: Number of the first event.
        dof: Numbers in a configuration.
    """

    def table(kind: Kind) -> Table:
        chosen = np.flatnonzero(rows["kind"] == kind)
        some, found = rows[chosen], np.empty(len(chosen), table_dtype(kind, dof))
        integers, real, q = PLACES[kind]
        found["seq"], found["t"], found["iteration"] = chosen + first, some["t"], some["iteration"]
        for name, at in integers.items():
            if found.dtype[name].hasobject:
                for i, (begin, count) in enumerate(some["integers"][:, at : at + 2].tolist()):
                    found[name][i] = points[begin : begin + count]
            else:
                found[name] = some["integers"][:, at]
        if real is not None:
            found[real] = some["real"]
        if q is not None:
            found[q] = some["q"]
        return found

    counts = np.bincount(rows["kind"], minlength=len(Kind))
    present = {Kind(code): int(counts[code]) for code in np.flatnonzero(counts).tolist()}
    last = Instant(int(rows["t"][-1]), int(rows["iteration"][-1]))
    return Events(dof, LazyTables(present, last, table))
