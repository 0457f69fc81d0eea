"""Numbers as text: as many digits as tell them apart, and limits that are kept."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from brrt.digits import (
    against_limits,
    at_least,
    at_most,
    digits_within,
    join_numbers,
    tell_apart,
)

NUMBERS = st.floats(-1e100, 1e100)


@given(NUMBERS, NUMBERS, st.integers(1, 17))
def test_limits_are_kept_by_what_is_written(value: float, limit: float, digits: int) -> None:
    """A limit that is read back allows nothing more, and the value still breaks it."""
    assert float(at_least(limit, digits)) >= limit >= float(at_most(limit, digits))
    low, high = sorted((value, limit))
    for number in (value, limit, math.nextafter(high, math.inf), math.nextafter(low, -math.inf)):
        text, least, most = against_limits(number, low, high, digits)
        assert low <= float(least)
        assert float(most) <= high
        assert (float(text) < low, float(text) > high) == (number < low, number > high)


@given(st.lists(NUMBERS, min_size=1, max_size=5))
def test_different_numbers_look_different(values: list[float]) -> None:
    """Two numbers have the same text only if they are equal."""
    assert len(set(tell_apart(*values))) == len(set(values))


@pytest.mark.parametrize(
    ("lower", "upper", "point", "text"),
    [
        ([0, 0], [100, 100], [12.3456789, 99.99999], "12.3457, 100"),
        ([388096.25, 3948996.5], [388116.25, 3949016.5], [388105.25, 3949000.5],
         "388105.25, 3949000.5"),
        ([139.76, -35.68], [139.77, -35.67], [139.763426, -35.6786133], "139.763426, -35.6786133"),
        ([-5, 1e9], [5, 1e9 + 1], [-1 / 3, 1e9 + 1 / 3], "-0.333333, 1000000000.33333"),
        ([0, 1], [0, 1 + 1e-15], [0, 1], "0, 1"),
        ([2e-9, 0], [3e-9, 1], [2.123456789e-9, 0.5], "2.12346e-09, 0.5"),
    ],
)  # fmt: skip
def test_places_are_told_apart(
    lower: list[float], upper: list[float], point: list[float], text: str
) -> None:
    """Digits that are the same everywhere do not count."""
    assert join_numbers(point, digits_within(lower, upper)) == text
