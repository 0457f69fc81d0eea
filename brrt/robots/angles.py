"""Angles that wrap: the short way round, as kernels and as numpy see it."""

import math

import numpy as np
from numpy.typing import NDArray

from brrt.kernels.jit import inline_helper

Floats = NDArray[np.float64]

TURN, HALF_TURN = 2 * math.pi, math.pi
_LAST = math.nextafter(math.pi, 0)


@inline_helper
def turn_between(a: float, b: float) -> float:
    """Angle from a to b the short way round; both in [-pi, pi]."""
    step = b - a
    if step > HALF_TURN:
        step -= TURN
    elif step < -HALF_TURN:
        step += TURN
    return step


@inline_helper
def angle_apart(a: float, b: float) -> float:
    """Return the size of the angle between a and b, both in [-pi, pi].

    Rounded so that `angle_to_range` never exceeds it: a nearest neighbour is never overlooked.
    """
    step = abs(b - a)
    return max(0.0, min(step, TURN - step))


@inline_helper
def angle_to_range(low: float, high: float, a: float) -> float:
    """Least size of the angle between a and anything in [low, high]."""
    if low <= a <= high:
        return 0.0
    if a < low:
        return max(0.0, min(low - a, TURN - (high - a)))
    return max(0.0, min(a - high, TURN - (a - low)))


@inline_helper
def wrapped(a: float) -> float:
    """Return an angle less than a turn out of range as one in [-pi, pi)."""
    if a >= HALF_TURN:
        a -= TURN
    elif a < -HALF_TURN:
        a += TURN
    return min(max(a, -HALF_TURN), _LAST)


def turns_between(a: Floats, b: Floats) -> Floats:
    """`turn_between` of arrays."""
    step = np.asarray(b) - np.asarray(a)
    return np.where(step > np.pi, step - TURN, np.where(step < -np.pi, step + TURN, step))


def angles_apart(a: Floats, b: Floats) -> Floats:
    """`angle_apart` of arrays."""
    step = np.abs(np.asarray(b) - np.asarray(a))
    return np.maximum(0.0, np.minimum(step, TURN - step))


def all_wrapped(a: Floats) -> Floats:
    """Bring angles of any size to [-pi, pi); those that are in range stay as they are."""
    a = np.asarray(a, dtype=np.float64)
    moved = np.clip(a - TURN * np.floor((a + np.pi) / TURN), -np.pi, _LAST)
    return np.where((a >= -np.pi) & (a < np.pi), a, moved)


def rotation(angle: float) -> Floats:
    """Return the matrix M for which `points @ M` are points, shape (n, 2), turned by `angle`."""
    cos, sin = math.cos(angle), math.sin(angle)
    return np.array([[cos, sin], [-sin, cos]])
