"""Counts, durations and configurations as text."""

from collections.abc import Iterable


def counted(number: int, one: str, several: str | None = None) -> str:
    """Write a number of things: `1 node`, `1,200 nodes`."""
    return f"{number:,} {one if number == 1 else several or one + 's'}"


def seconds(value: float) -> str:
    """Write a duration in the unit that suits it: `20 ms`."""
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("us", 1e-6)):
        if value >= size:
            return f"{value / size:.3g} {unit}"
    return f"{value * 1e9:.0f} ns"


def vector(values: Iterable[float], digits: int = 6) -> str:
    """Write a configuration or a point: `(1.5, 2)`."""
    return "(" + ", ".join(f"{x:.{digits}g}" for x in values) + ")"
