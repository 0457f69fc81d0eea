"""State spaces of OMPL: how a state becomes the numbers of a configuration."""

from collections.abc import Callable, Iterator
from itertools import takewhile
from typing import Any

from ompl import base

from brrt.errors import BrrtError
from brrt.robots.opaque import MOST_NUMBERS

Read = Callable[..., tuple[float, ...]]

_STRAIGHT = (base.RealVectorStateSpace, base.SO2StateSpace, base.SE2StateSpace)
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
        self.is_straight = all(type(leaf) in _STRAIGHT for leaf in _leaves(space))
        self.read: Read = _reader(value, self.dof, self.is_real)


def _leaves(space: Any) -> Iterator[Any]:
    """Yield the spaces that a compound one is made of."""
    if type(space) is base.CompoundStateSpace:
        for i in range(space.getSubspaceCount()):
            yield from _leaves(space.getSubspace(i))
    else:
        yield space


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
