"""Angles that wrap, in kernels; `brrt.robots.angles` has the same for numpy arrays."""

import math

from brrt.kernels.jit import inline_helper

_TURN, _HALF_TURN = 2 * math.pi, math.pi
_LARGEST = math.nextafter(math.pi, 0)


@inline_helper
def angle_difference(a: float, b: float) -> float:
    """Angle from a to b the short way round; both in [-pi, pi]."""
    difference = b - a
    if difference > _HALF_TURN:
        difference -= _TURN
    elif difference < -_HALF_TURN:
        difference += _TURN
    return difference


@inline_helper
def angle_distance(a: float, b: float) -> float:
    """Size of the angle between a and b, both in [-pi, pi].

    Rounded so that `angle_distance_to_range` never exceeds it: a search by boxes misses no nearest
    neighbour.
    """
    difference = abs(b - a)
    return max(0.0, min(difference, _TURN - difference))


@inline_helper
def angle_distance_to_range(low: float, high: float, a: float) -> float:
    """Least size of the angle between a and any angle in [low, high]."""
    if low <= a <= high:
        return 0.0
    if a < low:
        return max(0.0, min(low - a, _TURN - (high - a)))
    return max(0.0, min(a - high, _TURN - (a - low)))


@inline_helper
def interpolate_angle(a: float, b: float, part: float) -> float:
    """Angle in [-pi, pi) at a part (0 to 1) of the short way from a to b."""
    angle = a + angle_difference(a, b) * part
    if angle >= _HALF_TURN:
        angle -= _TURN
    elif angle < -_HALF_TURN:
        angle += _TURN
    return min(max(angle, -_HALF_TURN), _LARGEST)
