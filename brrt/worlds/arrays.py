"""Array types, and numbers from files and users read into arrays."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrt.errors import BrrtError

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

GREATEST = 1e100
"""Largest absolute value of a coordinate: kernels square coordinates, which must not overflow."""

_MARGIN, _THIN = 0.05, 1e-6
"""Space around points, as a part of their longest range, and that as a part of the coordinates."""

LEAST = 1 / GREATEST
"""Least length but 0: the squares of lengths must not underflow either."""


def check_lengths(name: str, lengths: Floats) -> None:
    """Check that lengths which are not 0 have squares that do not underflow.

    Args:
        name: What they are, for messages ("world: sides of boxes").
        lengths: Any shape, none below 0.

    Raises:
        BrrtError: One is between 0 and `LEAST`.
    """
    small = (lengths > 0) & (lengths < LEAST)
    if small.any():
        least = lengths[small].min()
        raise BrrtError(f"{name} must be at least {LEAST:g}, not {least:g}; choose a smaller unit")


def read_numbers(name: str, values: Any, what: str, shape: tuple[int | None, ...]) -> Floats:
    """Convert numbers from JSON or Python to an array.

    Args:
        name: What the values are, for messages ("world: balls").
        values: The values.
        what: What they should be, for messages ("rows of 3 numbers").
        shape: The shape they must have; None for any length.

    Returns:
        A new array. An empty list counts as no rows.

    Raises:
        BrrtError: The values are no such numbers, not finite, or beyond `GREATEST`.
    """
    try:
        array = np.array(values, np.float64)
    except (TypeError, ValueError, OverflowError):
        raise BrrtError(f"{name} must be {what}{_wrong_row(values, shape[-1:])}") from None
    if array.size == 0 and len(shape) > 1 and shape[0] is None:
        return np.empty([n or 0 for n in shape])
    fits = array.ndim == len(shape) and all(
        wanted in (None, n) for n, wanted in zip(array.shape, shape, strict=True)
    )
    if not fits:
        raise BrrtError(f"{name} must be {what}")
    if not (np.abs(array) <= GREATEST).all():
        kind = "finite numbers" if shape else "a finite number"
        raise BrrtError(f"{name} must be {kind} up to {GREATEST:g}")
    return array


def _wrong_row(values: Any, width: tuple[int | None, ...]) -> str:
    """Name the first row of a list that is not as many numbers as it should be."""
    if not isinstance(values, list) or not values or not isinstance(values[0], list):
        return ""
    wanted = width[0] or len(values[0])
    for i, row in enumerate(values):
        numbers = isinstance(row, list) and all(isinstance(x, int | float) for x in row)
        if not numbers or len(row) != wanted:
            return f"; row {i} is not"
    return ""


def box_around(points: Floats) -> tuple[Floats, Floats]:
    """Return the corners of a box around points, shape (n, d), with space at its sides."""
    low, high = points.min(axis=0), points.max(axis=0)
    size = max(float((high - low).max()), _THIN * float(np.abs(points).max())) or 1.0
    # A side is no shorter than a tenth of the longest: views divide by it.
    more = np.maximum(_MARGIN * size, (_MARGIN * 2 * size - (high - low)) / 2)
    return low - more, high + more
