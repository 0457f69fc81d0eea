"""Checks of what callers of the recorder pass: an error names the field and the value."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brrt.errors import BrrtError, unknown
from brrt.events import Named
from brrt.worlds.arrays import GREATEST

_WHOLE, _REAL = (int, np.integer), (float, int, np.floating, np.integer)

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def configuration(q: ArrayLike, dof: int) -> Sequence[float]:
    """Return a configuration as plain numbers, which are packed fast, shape (dof,).

    Raises:
        BrrtError: It is not `dof` finite numbers.
    """
    values: Any = q.tolist() if isinstance(q, np.ndarray) else q
    try:
        # Not a number is not less than anything.
        right = len(values) == dof and math.hypot(*values) < GREATEST
    except (TypeError, OverflowError):
        right = False
    if not right:
        raise BrrtError(f"q must be {dof} finite numbers, not {q!r:.60}")
    return values  # type: ignore[no-any-return]


def configurations(name: str, q: ArrayLike, dof: int) -> Floats:
    """Return configurations, shape (n, dof).

    Raises:
        BrrtError: They are not rows of `dof` finite numbers.
    """
    try:
        rows = np.array(q, np.float64)
    except (TypeError, ValueError):
        raise BrrtError(f"{name} must be rows of {dof} numbers, not {q!r:.60}") from None
    if rows.ndim != 2 or rows.shape[1] != dof:
        raise BrrtError(f"{name} must have the shape (n, {dof}), not {rows.shape}")
    if not (np.abs(rows) < GREATEST).all():
        raise BrrtError(f"{name} must be finite numbers")
    return rows


def cost_of(cost: Any) -> float:
    """Return a cost.

    Raises:
        BrrtError: It is not a finite number.
    """
    if cost.__class__ is float and -GREATEST < cost < GREATEST:  # the usual case
        return cost
    if isinstance(cost, _REAL):
        value = float(cost)
        if -GREATEST < value < GREATEST:
            return value
    raise BrrtError(f"cost must be a finite number, not {cost!r:.60}")


def costs_of(cost: ArrayLike, count: int) -> Floats:
    """Return costs, shape (count,).

    Raises:
        BrrtError: They are not finite numbers, one for all or one for each.
    """
    try:
        costs = np.broadcast_to(np.asarray(cost, np.float64), (count,))
    except (TypeError, ValueError):
        raise BrrtError(f"cost must be {count} numbers, not {cost!r:.60}") from None
    if not (np.abs(costs) < GREATEST).all():
        raise BrrtError("cost must be finite numbers")
    return costs


def fraction(name: str, value: Any) -> float:
    """Return a number from 0 to 1.

    Raises:
        BrrtError: It is not.
    """
    if isinstance(value, (*_REAL, np.bool_)) and 0 <= value <= 1:
        return float(value)
    raise BrrtError(f"{name} must be a number from 0 to 1, not {value!r:.60}")


def fractions(name: str, values: ArrayLike, count: int) -> Floats:
    """Return numbers from 0 to 1, shape (count,).

    Raises:
        BrrtError: They are not, one for all or one for each.
    """
    try:
        numbers = np.broadcast_to(np.asarray(values, np.float64), (count,))
    except (TypeError, ValueError):
        raise BrrtError(f"{name} must be {count} numbers, not {values!r:.60}") from None
    if not ((numbers >= 0) & (numbers <= 1)).all():
        raise BrrtError(f"{name} must be numbers from 0 to 1")
    return numbers


def whole(name: str, value: Any, low: int, high: int, what: str) -> int:
    """Return a whole number from `low` to below `high`.

    Raises:
        BrrtError: It is not; the message says that it must be `what`.
    """
    if isinstance(value, _WHOLE) and low <= value < high:
        return int(value)
    raise BrrtError(f"{name} must be {what}, not {value!r:.60}")


def wholes(name: str, values: ArrayLike, count: int, low: Any, high: Any, what: str) -> Ints:
    """Return whole numbers, each from `low` to below `high`, one for all or each; shape (count,).

    Raises:
        BrrtError: They are not; the message says that they must be `what`.
    """
    found = np.asarray(values)
    if found.dtype.kind in "iu" and found.shape in ((), (count,)):
        numbers = np.broadcast_to(found, (count,)).astype(np.int64)
        if ((low <= numbers) & (numbers < high)).all():
            return numbers
    raise BrrtError(f"{name} must be {what}, not {values!r:.60}")


def choice(name: str, choices: type[Named], value: Any) -> int:
    """Return a member of an enumeration, given itself, its name or its number.

    Raises:
        BrrtError: There is no such member.
    """
    if value.__class__ is choices:  # the usual case, and the fastest
        return value
    if isinstance(value, str):
        for each in choices:
            if value in (each.label, each.key):
                return each
    elif isinstance(value, _WHOLE) and value in set(choices):
        return int(value)
    raise unknown(name, str(value), [each.label for each in choices])


def chosen(name: str, choices: type[Named], values: Any, count: int) -> int | Ints:
    """Return members of an enumeration: one for all, or one for each event, shape (count,).

    Raises:
        BrrtError: One of them does not exist.
    """
    if np.ndim(values) == 0:
        return choice(name, choices, values)
    what = "numbers of " + ", ".join(f"{each.value} ({each.label})" for each in choices)
    return wholes(name, values, count, 0, len(choices), what)
