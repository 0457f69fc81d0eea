"""Configuration space as kernels see it: the functions that a planner calls for any robot.

A file in `brrt.kernels.spaces` defines a NamedTuple of arrays with the static kernels `measure`,
`length`, `box_measure`, `interpolate` and `segment_free`. When a planner is compiled, the functions
of the same names here resolve to them, so planners and robots do not depend on each other.
"""

from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np
from numba import types
from numba.extending import overload
from numpy.typing import NDArray

from brrt.kernels.jit import INLINE_HELPER, inline_helper
from brrt.kernels.random import Random, uniform

Floats = NDArray[np.float64]
F = TypeVar("F", bound=Callable[..., Any])


def by_space(function: F, default: Any = None) -> F:
    """Resolve calls of `function` in kernels to the kernel of that name in the space's class.

    Args:
        function: The function that kernels call.
        default: The kernel for spaces that have none of that name.
    """

    @overload(function, strict=False, jit_options=INLINE_HELPER)  # type: ignore[arg-type]
    def resolve(space: Any, *rest: Any) -> Any:  # noqa: ARG001 - numba's types are untyped
        if isinstance(space, types.BaseNamedTuple):
            kernels = space.instance_class  # type: ignore[attr-defined]
            return getattr(kernels, function.__name__, default).py_func
        return None

    return function


@by_space
def measure(space: Any, A: Floats, i: int, B: Floats, j: int) -> float:
    """Return a number that increases with the distance of A[i] and B[j] and is cheaper."""
    return float(space.measure(space, A, i, B, j))


@by_space
def length(space: Any, measured: float) -> float:
    """Return the distance that belongs to a `measure`."""
    return float(space.length(space, measured))


@by_space
def box_measure(space: Any, boxes: Floats, b: int, Q: Floats, i: int) -> float:
    """Return a lower bound of `measure` from Q[i] to boxes[b]: least, then greatest corner."""
    return float(space.box_measure(space, boxes, b, Q, i))


@by_space
def interpolate(
    space: Any, A: Floats, i: int, B: Floats, j: int, part: float, out: Floats, row: int
) -> None:
    """Write the configuration at a part (0 to 1) of the motion from A[i] to B[j] to out[row]."""
    space.interpolate(space, A, i, B, j, part, out, row)


@by_space
def segment_free(space: Any, A: Floats, i: int, B: Floats, j: int) -> bool:
    """Whether the motion from A[i] to B[j] is free of collisions, ends included."""
    return bool(space.segment_free(space, A, i, B, j))


@inline_helper
def distance(space: Any, A: Floats, i: int, B: Floats, j: int) -> float:
    """Distance of A[i] and B[j] in the robot's metric."""
    return length(space, measure(space, A, i, B, j))


@inline_helper
def interpolate_coordinate(
    space: Any, A: Floats, i: int, B: Floats, j: int, k: int, part: float
) -> float:
    """Coordinate k at a part (0 to 1) of the straight line from A[i] to B[j], within the bounds."""
    q = A[i, k] + (B[j, k] - A[i, k]) * part
    return float(min(max(q, space.lower[k]), space.upper[k]))


@inline_helper
def sample_uniform(space: Any, rng: Random, out: Floats, row: int) -> None:
    """Draw a configuration uniformly from the bounds and write it to out[row]."""
    for k in range(len(space.lower)):
        low, high = space.lower[k], space.upper[k]
        out[row, k] = min(low + (high - low) * uniform(rng), high)


@inline_helper
def steer(
    space: Any, A: Floats, i: int, B: Floats, j: int, step: float, out: Floats, row: int
) -> float:
    """Write the configuration at most `step` from A[i] towards B[j] to out[row].

    Returns:
        Its distance from A[i]; 0 if rounding makes the two equal: no tree adds a node twice.
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
"""Draws after which the last one is used, although no shorter path leads over it."""


@inline_helper
def _sample_by_rejection(
    space: Any, rng: Random, ends: Floats, start: int, goal: int, best: float, out: Floats, row: int
) -> None:
    """Draw from the bounds until a path over the sample may be shorter than the best."""
    for _ in range(_INFORMED_DRAWS):
        sample_uniform(space, rng, out, row)
        there = distance(space, ends, start, out, row)
        if there + distance(space, out, row, ends, goal) < best:
            return


def sample_informed(
    space: Any, rng: Random, ends: Floats, start: int, goal: int, best: float, out: Floats, row: int
) -> None:
    """Draw uniformly from the configurations over which a path may cost less than the best.

    Gammell, Srinivasa and Barfoot 2014; a space may draw from that set without rejection.

    Args:
        space: Configuration space.
        rng: Random draws.
        ends: Configurations, shape (n, dof).
        start: Row of the start in `ends`.
        goal: Row of the goal in `ends`.
        best: Cost of the best path.
        out: Array that the sample is written to, shape (m, dof).
        row: Row of the sample in `out`.
    """
    own = getattr(space, "sample_informed", _sample_by_rejection)
    own(space, rng, ends, start, goal, best, out, row)


by_space(sample_informed, _sample_by_rejection)
