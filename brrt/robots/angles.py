"""Angles that wrap, as numpy arrays; `brrt.kernels.spaces.angles` has the same for kernels."""

import math

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

_TURN = 2 * math.pi
_LARGEST = math.nextafter(math.pi, 0)


def angle_differences(a: Floats, b: Floats) -> Floats:
    """Angles from a to b the short way round; all in [-pi, pi]."""
    difference = np.asarray(b) - np.asarray(a)
    below = np.where(difference < -np.pi, difference + _TURN, difference)
    return np.where(difference > np.pi, difference - _TURN, below)


def angle_distances(a: Floats, b: Floats) -> Floats:
    """Sizes of the angles between a and b, all in [-pi, pi]."""
    difference = np.abs(np.asarray(b) - np.asarray(a))
    return np.maximum(0.0, np.minimum(difference, _TURN - difference))


def wrap_angles(a: Floats) -> Floats:
    """Bring angles of any size into [-pi, pi); angles in that range keep their bits."""
    a = np.asarray(a, dtype=np.float64)
    wrapped = np.clip(a - _TURN * np.floor((a + np.pi) / _TURN), -np.pi, _LARGEST)
    return np.where((a >= -np.pi) & (a < np.pi), a, wrapped)


def rotation(angle: float) -> Floats:
    """Matrix M for which `points @ M` are points, shape (n, 2), rotated by `angle`."""
    cos, sin = math.cos(angle), math.sin(angle)
    return np.array([[cos, sin], [-sin, cos]])
