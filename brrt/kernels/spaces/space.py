"""Configuration space as kernels see it: a robot among obstacles, under one set of names.

A robot's file defines a NamedTuple of arrays with the static kernels `measure`, `length`,
`box_measure`, `interpolate` and `segment_free`; the functions of the same names here resolve to
them when a planner is compiled, so a planner knows no robot and a robot no planner.
"""

from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np
from numba import types
from numba.extending import overload
from numpy.typing import NDArray

from brrt.kernels.jit import INLINED, inline_helper
from brrt.kernels.random import Random, uniform

Floats = NDArray[np.float64]
F = TypeVar("F", bound=Callable[..., Any])


def by_robot(function: F, default: Any = None) -> F:
    """Let kernels that call `function` get the kernel of that name from the space's class.

    Args:
        function: What kernels call.
        default: What they get where a robot has none of its own.
    """

    @overload(function, strict=False, jit_options=INLINED)  # type: ignore[arg-type]
    def resolve(space: Any, *rest: Any) -> Any:  # noqa: ARG001 - numba's types are untyped
        if isinstance(space, types.BaseNamedTuple):
            robot = space.instance_class  # type: ignore[attr-defined]
            return getattr(robot, function.__name__, default).py_func
        return None

    return function


@by_robot
def measure(space: Any, A: Floats, i: int, B: Floats, j: int) -> float:
    """Return a number that grows with the distance of A[i] and B[j] and is cheap to compare."""
    return float(space.measure(space, A, i, B, j))


@by_robot
def length(space: Any, measured: float) -> float:
    """Return the distance that a `measure` stands for."""
    return float(space.length(space, measured))


@by_robot
def box_measure(space: Any, boxes: Floats, b: int, Q: Floats, i: int) -> float:
    """Return a lower bound of `measure` from Q[i] to anything in boxes[b]: least, then greatest."""
    return float(space.box_measure(space, boxes, b, Q, i))


@by_robot
def interpolate(
    space: Any,
    A: Floats,
    i: int,
    B: Floats,
    j: int,
    part: float,
    out: Floats,
    row: int,
) -> None:
    """Write the configuration at a part (0 to 1) of the way from A[i] to B[j] into out[row]."""
    space.interpolate(space, A, i, B, j, part, out, row)


@by_robot
def segment_free(space: Any, A: Floats, i: int, B: Floats, j: int) -> bool:
    """Whether the motion from A[i] to B[j] is free of collisions, ends included."""
    return bool(space.segment_free(space, A, i, B, j))


@inline_helper
def distance(space: Any, A: Floats, i: int, B: Floats, j: int) -> float:
    """Distance of A[i] and B[j] in the robot's metric."""
    return length(space, measure(space, A, i, B, j))


@inline_helper
def sample_uniform(space: Any, rng: Random, out: Floats, row: int) -> None:
    """Draw a configuration evenly from the bounds into out[row]."""
    for k in range(len(space.lower)):
        low, high = space.lower[k], space.upper[k]
        out[row, k] = min(low + (high - low) * uniform(rng), high)


@inline_helper
def steer(
    space: Any,
    A: Floats,
    i: int,
    B: Floats,
    j: int,
    step: float,
    out: Floats,
    row: int,
) -> float:
    """Move from A[i] towards B[j] by at most `step`, into out[row]; return how far.

    That is 0 where the step is lost in rounding; a tree that did not see it would grow on the spot.
    """
    far = distance(space, A, i, B, j)
    if far <= step:
        for k in range(len(space.lower)):
            out[row, k] = B[j, k]
        return far
    interpolate(space, A, i, B, j, step / far, out, row)
    for k in range(len(space.lower)):
        if out[row, k] != A[i, k]:
            return step
    return 0.0


_INFORMED_DRAWS = 1000
"""Draws after which a sample is taken as it is; a planner finds out that it is of no use."""


@inline_helper
def _sample_by_rejection(
    space: Any, rng: Random, ends: Floats, start: int, goal: int, best: float, out: Floats, row: int
) -> None:
    """Draw from the bounds until the way over the sample may be shorter than the best."""
    for _ in range(_INFORMED_DRAWS):
        sample_uniform(space, rng, out, row)
        there = distance(space, ends, start, out, row)
        if there + distance(space, out, row, ends, goal) < best:
            return


def sample_informed(
    space: Any, rng: Random, ends: Floats, start: int, goal: int, best: float, out: Floats, row: int
) -> None:
    """Draw evenly from the configurations over which a path may cost less than the best.

    Gammell, Srinivasa and Barfoot 2014; a robot may have a way of its own to draw from that set.

    Args:
        space: Configuration space.
        rng: Random draws.
        ends: Where start and goal stand, shape (n, dof).
        start: Row of the start.
        goal: Row of the goal.
        best: Cost of the best path.
        out: Where the sample is written, shape (m, dof).
        row: Its row.
    """
    own = getattr(space, "sample_informed", _sample_by_rejection)
    own(space, rng, ends, start, goal, best, out, row)


by_robot(sample_informed, _sample_by_rejection)
