"""Numbers as text for people, with as many digits as tell them apart."""

from collections.abc import Iterable, Sequence
from decimal import ROUND_CEILING, ROUND_FLOOR, Context
from math import floor, log10

DIGITS = 6
"""Significant digits of a number, unless it takes more."""

_ALL = 17
"""Significant digits at which all numbers of 64 bits differ."""


def digits_within(
    lower: Iterable[float], upper: Iterable[float], digits: int = DIGITS
) -> tuple[int, ...]:
    """Return how many significant digits coordinates need that lie between bounds.

    Far from 0 the first digits are the same everywhere: they are not counted.

    Args:
        lower: Least value of each coordinate.
        upper: Greatest value of each coordinate.
        digits: Digits that differ between the bounds.
    """
    return tuple(_needed(*ends, digits) for ends in zip(lower, upper, strict=True))


def _needed(low: float, high: float, digits: int) -> int:
    far, side = max(abs(low), abs(high)), high - low
    same = floor(log10(far / side)) if far > side > 0 else 0
    return min(digits + same, _ALL)


def join_numbers(
    values: Iterable[float], digits: int | Sequence[int] = DIGITS, separator: str = ", "
) -> str:
    """Write numbers, each in so many significant digits at most."""
    numbers = list(values)
    each = [digits] * len(numbers) if isinstance(digits, int) else digits
    return separator.join(f"{x:.{n}g}" for x, n in zip(numbers, each, strict=True))


def tell_apart(*values: float, digits: int = DIGITS) -> tuple[str, ...]:
    """Write numbers in as few digits, but not fewer than `digits`, as all that differ look so."""
    for n in range(digits, _ALL):
        texts = tuple(f"{x:.{n}g}" for x in values)
        if len(set(texts)) == len(set(values)):
            return texts
    return tuple(f"{x:.{_ALL}g}" for x in values)


def at_least(limit: float, digits: int = DIGITS) -> str:
    """Write a lower limit so that the number which is written keeps it: rounded up if need be."""
    text = f"{limit:.{digits}g}"
    return text if float(text) >= limit else _rounded(limit, digits, ROUND_CEILING)


def at_most(limit: float, digits: int = DIGITS) -> str:
    """Write an upper limit so that the number which is written keeps it."""
    text = f"{limit:.{digits}g}"
    return text if float(text) <= limit else _rounded(limit, digits, ROUND_FLOOR)


def _rounded(value: float, digits: int, rounding: str) -> str:
    number = Context(prec=digits, rounding=rounding).create_decimal_from_float(value)
    return f"{float(number):.{digits}g}"


def against_limits(
    value: float, low: float, high: float, digits: int = DIGITS
) -> tuple[str, str, str]:
    """Write a number and its limits, which may be infinite.

    Args:
        value: The number.
        low: The least number that is allowed.
        high: The greatest.
        digits: Significant digits that are written at least.

    Returns:
        Texts of value, low and high: read as numbers, the value breaks the limits as it does
        itself, and the limits keep them.
    """
    for n in range(digits, _ALL):
        text = f"{value:.{n}g}"
        if (float(text) < low) == (value < low) and (float(text) > high) == (value > high):
            return text, at_least(low, n), at_most(high, n)
    return f"{value:.{_ALL}g}", at_least(low, _ALL), at_most(high, _ALL)
