"""Events in the making, and the order that they can have."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brrt.event_columns import CONFIGURATIONS, INTEGERS, REALS, WIDTH, EventColumns
from brrt.events import Kind
from brrt.ompl.checks import Checks

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

FIRST, LATE, LAST = -1, 1 << 40, 1 << 41
"""Ranks of events of the same moment: cuts; links and rejections; removals. Those of nodes that
join or get another parent are their depths."""


@dataclass(frozen=True, slots=True)
class Moment:
    """When the planner's data were read.

    Attributes:
        t: Time in ns since the run began.
        iteration: The planner's iteration.
    """

    t: int
    iteration: int


def rise(values: Ints, above: Ints) -> Ints:
    """Return the greatest value of each row and of those above it, shape (n,).

    Args:
        values: A value of each row, shape (n,).
        above: The row above each row, itself at the top, shape (n,).
    """
    while True:
        values, further = np.maximum(values, values[above]), above[above]
        if (further == above).all():
            return np.asarray(values)
        above = further


def depths(above: Ints) -> Ints:
    """Return how many rows are above each row, shape (n,); see `rise`."""
    depth = (above != np.arange(len(above))).astype(np.int64)
    while True:
        depth, further = depth + depth[above], above[above]
        if (further == above).all():
            return np.asarray(depth)
        above = further


class Batch:
    """Events in the making."""

    def __init__(self, dof: int) -> None:
        self._dof, self._parts = dof, list[tuple[NDArray[np.generic], ...]]()

    def add(
        self, kind: Kind | Ints, t: Ints, iteration: Ints, rank: Ints | int, *integers: Ints | int,
        real: Floats | float = 0.0, q: Floats | None = None,
    ) -> None:  # fmt: skip
        """Add events; the integers in the order of `brrt.events.FIELDS`."""
        n = len(t)
        whole, reals = np.zeros((n, WIDTH[INTEGERS]), np.int32), np.zeros((n, WIDTH[REALS]))
        for column, values in enumerate(integers):
            whole[:, column] = values
        reals[:, 0] = real
        rows = np.zeros((n, WIDTH[CONFIGURATIONS] * self._dof)) if q is None else q
        kinds = np.broadcast_to(np.asarray(kind, np.uint8), n)
        self._parts.append((t, iteration, np.broadcast_to(rank, n), kinds, whole, reals, rows))

    def columns(self, last: Moment) -> EventColumns:
        """Return the events in order, none before the last moment."""
        t, iteration, rank, kind, whole, reals, q = (
            np.concatenate(parts) for parts in zip(*self._parts, strict=True)
        )
        order = np.lexsort((rank, t))
        steps = np.arange(len(order))
        t = np.maximum.accumulate(np.maximum(t[order] - steps, last.t + 1)) + steps
        iteration = np.maximum.accumulate(np.maximum(iteration[order], last.iteration))
        return EventColumns(
            0, self._dof, kind[order], t, iteration, whole[order], reals[order], q[order],
            np.empty((0, self._dof)),
        )  # fmt: skip


def occurrences(keys: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """Return how many earlier rows have the same key, shape (n,)."""
    order = np.argsort(keys, kind="stable")
    ordered, steps = keys[order], np.arange(len(keys))
    begins = np.append(True, ordered[1:] != ordered[:-1])[: len(keys)]
    count = np.empty(len(keys), np.uint64)
    count[order] = steps - np.maximum.accumulate(np.where(begins, steps, 0))
    return count


def iterations_at(t: Ints, checks: Checks, now: Moment) -> Ints:
    """Return the iteration of each time since the last graph was read, shape (n,)."""
    times, counts = np.append(checks.t, now.t), np.append(checks.iteration, now.iteration)
    return np.asarray(counts[np.minimum(np.searchsorted(times, t), len(checks.t))])
