"""Counts, durations and configurations as text."""

from collections.abc import Iterable, Sequence

from brrt.digits import join_numbers, tell_apart


def counted(number: int, one: str, several: str | None = None) -> str:
    """Write a number of things: `1 node`, `1,200 nodes`."""
    return f"{number:,} {one if number == 1 else several or one + 's'}"


def seconds(value: float) -> str:
    """Write a duration in the unit that suits it: `20 ms`."""
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("us", 1e-6)):
        if value >= size:
            return f"{value / size:.3g} {unit}"
    return f"{value * 1e9:.0f} ns"


def vector(values: Iterable[float], digits: int | Sequence[int] = 12) -> str:
    """Write a configuration or a point: `(1.5, 2)`; see `brrt.digits.digits_within`."""
    return f"({join_numbers(values, digits)})"


def vectors(*each: Iterable[float]) -> list[str]:
    """Write configurations or points in digits that tell their coordinates apart."""
    columns = [tell_apart(*values) for values in zip(*each, strict=True)]
    return [f"({', '.join(row)})" for row in zip(*columns, strict=True)]
