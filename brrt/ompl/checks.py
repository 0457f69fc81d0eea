"""The motions that a planner has checked: when each edge was made, and what was rejected."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Hashes = NDArray[np.uint64]

HEAD = 3
"""Numbers of a check before its configurations: time, iteration, whether the motion is free."""

_FACTOR, _SHIFT = np.uint64(0x9E3779B97F4A7C15), np.uint64(29)


def hash_rows(q: Floats) -> Hashes:
    """Return a hash of each configuration, shape (n,)."""
    found = np.full(len(q), len(q.T), np.uint64)
    for column in np.ascontiguousarray(q.T + 0.0).view(np.uint64):
        found = (found ^ column) * _FACTOR
        found ^= found >> _SHIFT
    return found


def find_last(keys: Hashes, wanted: Hashes) -> Ints:
    """Return the last row of `keys` that equals each wanted key, or -1, shape (n,)."""
    if not len(keys):
        return np.full(len(wanted), -1)
    order = np.argsort(keys, kind="stable")
    at = np.searchsorted(keys[order], wanted, side="right") - 1
    rows = order[at]
    return np.where((at >= 0) & (keys[rows] == wanted), rows, -1)


@dataclass(frozen=True, slots=True, eq=False)
class Checks:
    """Checks of motions, in order; the arrays have one row each.

    Attributes:
        t: When a check ended, in ns, shape (n,).
        iteration: The planner's iteration then, shape (n,).
        is_free: Whether the motion is free, shape (n,).
        q: The configurations to which the motions lead, shape (n, dof).
        begin: Hashes of those from which they lead, shape (n,).
        end: Hashes of `q`, shape (n,).
        origin: The configurations from which they lead, shape (n, dof).
    """

    t: Ints
    iteration: Ints
    is_free: NDArray[np.bool_]
    q: Floats
    begin: Hashes
    end: Hashes
    origin: Floats

    @classmethod
    def of(cls, noted: list[float], dof: int, origin_ns: int) -> "Checks":
        """Read checks from their numbers.

        Args:
            noted: Of each its time, iteration, whether it is free, and both configurations, one
                after the other.
            dof: Numbers in a configuration.
            origin_ns: When planning began.
        """
        rows = np.fromiter(noted, np.float64, len(noted)).reshape(-1, HEAD + 2 * dof)
        origin, q = rows[:, HEAD : HEAD + dof], rows[:, HEAD + dof :]
        t, iteration = rows[:, :2].T.astype(np.int64)
        return cls(
            t - origin_ns, iteration, rows[:, 2] > 0, q, hash_rows(origin), hash_rows(q), origin
        )

    def between(self, a: Hashes, b: Hashes) -> Ints:
        """Return the last check that found a motion free between configurations, either way.

        Args:
            a: Hashes of one end of each motion, shape (m,).
            b: Hashes of the other end, shape (m,).

        Returns:
            Rows, -1 where there is none, shape (m,). Where motions are not known, as where only
            configurations were checked, the first check of `b`.
        """
        free = np.flatnonzero(self.is_free)
        keys = self.begin[free] * _FACTOR + self.end[free]
        found = np.maximum(find_last(keys, a * _FACTOR + b), find_last(keys, b * _FACTOR + a))
        return np.where(found >= 0, free[found] if len(free) else -1, -1)

    def of_configurations(self, q: Hashes) -> Ints:
        """Return the first check that found each configuration free, or -1, shape (m,)."""
        free = np.flatnonzero(self.is_free)[::-1]
        found = find_last(self.end[free], q)
        return np.where(found >= 0, free[found] if len(free) else -1, -1)
