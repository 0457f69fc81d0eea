"""State spaces of OMPL: how a state becomes the numbers of a configuration."""

import math
from collections.abc import Callable, Iterator
from itertools import takewhile
from typing import Any

import numpy as np
from numpy.typing import NDArray
from ompl import base

from brrt.errors import BrrtError
from brrt.robots.opaque import MOST_NUMBERS

Floats = NDArray[np.float64]
Read = Callable[..., tuple[float, ...]]

_STRAIGHT = (base.RealVectorStateSpace, base.SO2StateSpace)
"""Spaces whose motions are straight, an angle turning the shorter way."""


class Space:
    """The space of a problem.

    The numbers of a configuration are those of the state in OMPL's order: subspaces one after the
    other, the values of R^n, x, y and yaw of SE(2), the angle of SO(2), x, y, z and a quaternion of
    SE(3).

    Args:
        information: An `ompl.base.SpaceInformation`.

    Attributes:
        dof: Numbers in a configuration.
        read: Returns the numbers of one or two states, one after the other.
        distance: Returns the distance of two states in the space's metric.
        is_real: Whether it is R^n, whose metric is Euclidean.
        is_straight: Whether its motions are straight.

    Raises:
        BrrtError: A state has no numbers, or too many.
    """

    def __init__(self, information: Any) -> None:
        space, state = information.getStateSpace(), information.allocState()
        value = space.getValueAddressAtIndex  # returns the value, or None behind the last one
        places = range(MOST_NUMBERS + 1)
        self.dof = sum(1 for _ in takewhile(lambda k: value(state, k) is not None, places))
        if not 0 < self.dof <= MOST_NUMBERS:
            count = f"more than {MOST_NUMBERS}" if self.dof else "no"
            raise BrrtError(f"states of the space {space.getName()} have {count} numbers")
        self.distance: Callable[[Any, Any], float] = information.distance
        self.is_real = type(space) is base.RealVectorStateSpace
        self._leaves = list(_leaves(space, 1.0))
        self.is_straight = all(type(leaf) in _STRAIGHT for leaf, _ in self._leaves)
        self.read: Read = _reader(value, self.dof, self.is_real)

    def spread(self, q: Floats, far: float, extent: float, *, wraps: bool) -> Floats:
        """Return how far each number may be from that of a configuration within a distance.

        Args:
            q: The configuration, shape (dof,).
            far: The distance, in the space's metric.
            extent: The longest distance of the space, for spaces that are not known.
            wraps: Whether who compares numbers knows that angles wrap.
        """
        limits: list[float] = []
        for leaf, weight in self._leaves:
            most = far / weight if weight > 0 else extent
            if type(leaf) is base.RealVectorStateSpace:
                limits += [most] * leaf.getDimension()
            elif type(leaf) is base.SO2StateSpace:
                crosses = abs(float(q[len(limits)])) + most >= math.pi and not wraps
                limits.append(2 * math.pi if crosses else min(most, math.pi))
            else:
                return np.full(self.dof, extent + 2 * math.pi)
        return np.array(limits)


def _leaves(space: Any, weight: float) -> Iterator[tuple[Any, float]]:
    """Yield the spaces that a compound one is made of, and their weights in its metric."""
    if type(space) in (base.CompoundStateSpace, base.SE2StateSpace):
        for i in range(space.getSubspaceCount()):
            yield from _leaves(space.getSubspace(i), weight * space.getSubspaceWeight(i))
    else:
        yield space, weight


def _reader(value: Callable[[Any, int], float], dof: int, is_real: bool) -> Read:
    """Return what reads states, which is called for each state: the usual case is short."""
    places = tuple(range(dof))
    if not is_real:
        return lambda *states: tuple([value(state, k) for state in states for k in places])
    if dof == 2:
        return _read_plane
    return lambda *states: tuple([state[k] for state in states for k in places])


def _read_plane(a: Any, b: Any = None) -> tuple[float, ...]:
    return (a[0], a[1]) if b is None else (a[0], a[1], b[0], b[1])
