"""The buffer of events that kernels write to, and one function `emit_<kind>` for each kind.

The functions are generated from `event_columns.LAYOUT` when this module is imported, so a new kind
needs no code here but its line at the end.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brrt.event_columns import (
    ASKED,
    CONFIGURATIONS,
    COUNT,
    FIRST_SEQ,
    INTEGERS,
    LAST_T,
    LAYOUT,
    ORIGIN,
    POINTS,
    REALS,
    TICK,
    UNTIL_SEQ,
    UNTIL_T,
    WIDTH,
)
from brrt.events import Kind, Phase
from brrt.kernels.clock import now_ns
from brrt.kernels.jit import inline_helper

Floats = NDArray[np.float64]

_ASKED_PER_READING = 16
"""Calls of `paused` for each reading of the clock, on a logical clock."""


class Buffer(NamedTuple):
    """Columns of events; `LAYOUT` says where they hold the fields of a kind.

    Attributes:
        state: Number of events, seq of the first, time of the last, the clock's origin, ns between
            two events of a logical clock (0: a real clock), rows of `points` in use, the time and
            the seq at which a kernel is to return, and calls of `paused`; shape (9,), int64.
        kind: Shape (n,), uint8.
        t: Time in ns since the origin, shape (n,), int64.
        iteration: Shape (n,), int64.
        integers: Integer fields, shape (n, most that a kind has), int32.
        reals: Float fields, shape (n, most that a kind has).
        q: Configurations, side by side, shape (n, most that a kind has times dof).
        points: Waypoints of all paths, shape (n, dof).
    """

    state: NDArray[np.int64]
    kind: NDArray[np.uint8]
    t: NDArray[np.int64]
    iteration: NDArray[np.int64]
    integers: NDArray[np.int32]
    reals: Floats
    q: Floats
    points: Floats


def empty_buffer(dof: int, capacity: int) -> Buffer:
    """Return a buffer for so many events."""
    return Buffer(
        state=np.zeros(9, np.int64),
        kind=np.empty(capacity, np.uint8),
        t=np.empty(capacity, np.int64),
        iteration=np.empty(capacity, np.int64),
        integers=np.empty((capacity, WIDTH[INTEGERS]), np.int32),
        reals=np.empty((capacity, WIDTH[REALS])),
        q=np.empty((capacity, WIDTH[CONFIGURATIONS] * dof)),
        points=np.empty((capacity, dof)),
    )


@inline_helper
def room(buffer: Buffer) -> int:
    """Number of events that still fit."""
    return len(buffer.kind) - int(buffer.state[COUNT])


@inline_helper
def paused(buffer: Buffer) -> bool:
    """Whether a kernel is to return, so that its caller can look at the budget and at signals.

    The time of the last event serves as the clock, which costs nothing. That of a logical clock
    says nothing, so the clock is read then, in one of several calls.
    """
    state = buffer.state
    if state[FIRST_SEQ] + state[COUNT] >= state[UNTIL_SEQ]:
        return True
    if state[TICK] == 0:
        return bool(state[LAST_T] >= state[UNTIL_T])
    state[ASKED] += 1
    if state[ASKED] % _ASKED_PER_READING > 0:
        return False
    return bool(now_ns() - state[ORIGIN] >= state[UNTIL_T])


@inline_helper
def point_room(buffer: Buffer) -> int:
    """Number of waypoints that still fit."""
    return len(buffer.points) - int(buffer.state[POINTS])


@inline_helper
def take_points(buffer: Buffer, n: int) -> int:
    """Reserve n rows of `points`, for which there must be room, and return the first."""
    first = int(buffer.state[POINTS])
    buffer.state[POINTS] += n
    return first


@inline_helper
def _append(buffer: Buffer, kind: int, iteration: int) -> int:
    """Append an event without its fields and return its row."""
    state = buffer.state
    n = int(state[COUNT])
    if state[TICK] > 0:
        t = (state[FIRST_SEQ] + n) * state[TICK]
    else:
        t = max(now_ns() - state[ORIGIN], state[LAST_T] + 1)
    buffer.kind[n], buffer.t[n], buffer.iteration[n] = kind, t, iteration
    state[LAST_T] = t
    state[COUNT] = n + 1
    return n


@inline_helper
def _put_q(buffer: Buffer, n: int, at: int, Q: Floats, row: int) -> None:
    """Copy a configuration into an event."""
    for k in range(Q.shape[1]):
        buffer.q[n, at * Q.shape[1] + k] = Q[row, k]


def _emitter(kind: Kind) -> Any:
    """Generate the function that appends an event of a kind.

    Its arguments are the buffer, which must have room, the iteration, and the fields in the order
    of `events.FIELDS`: for a configuration an array and a row, for waypoints their first row in
    `Buffer.points` and the number of rows.
    """
    arguments, lines = ["buffer", "iteration"], [f"n = _append(buffer, {int(kind)}, iteration)"]
    for field, column, at in LAYOUT[kind]:
        name = field.name
        if field.type == "q":
            arguments += [name, f"{name}_row"]
            lines.append(f"_put_q(buffer, n, {at}, {name}, {name}_row)")
        elif field.type == "q[]":
            arguments += [f"{name}_first", f"{name}_count"]
            lines.append(f"buffer.{column}[n, {at}] = {name}_first")
            lines.append(f"buffer.{column}[n, {at + 1}] = {name}_count")
        else:
            arguments.append(name)
            lines.append(f"buffer.{column}[n, {at}] = {name}")
    function = f"emit_{kind.key}"
    source = f"def {function}({', '.join(arguments)}):\n    " + "\n    ".join(lines)
    # Numba files its cache under the name of the source file.
    made: dict[str, Any] = {}
    exec(compile(source, __file__, "exec"), globals(), made)  # noqa: S102 - of our own declaration
    return inline_helper(made[function])


emit_phase: Callable[[Buffer, int, int, int], None] = _emitter(Kind.PHASE)
emit_sample: Callable[[Buffer, int, int, int, Floats, int], None] = _emitter(Kind.SAMPLE)
emit_reject: Callable[[Buffer, int, int, int, int, Floats, int], None] = _emitter(Kind.REJECT)
emit_edge: Callable[[Buffer, int, int, int, int, float, Floats, int], None] = _emitter(Kind.EDGE)
emit_path: Callable[[Buffer, int, int, float, int, int], None] = _emitter(Kind.PATH)
emit_shortcut: Callable[[Buffer, int, int, int, bool, float], None] = _emitter(Kind.SHORTCUT)
emit_rewire: Callable[[Buffer, int, int, int, int, float], None] = _emitter(Kind.REWIRE)
emit_connect: Callable[[Buffer, int, int, int, float], None] = _emitter(Kind.CONNECT)
emit_expand: Callable[[Buffer, int, int, int, float, Floats, int], None] = _emitter(Kind.EXPAND)
emit_heuristic: Callable[[Buffer, int, int, float, Floats, int], None] = _emitter(Kind.HEURISTIC)
emit_move: Callable[[Buffer, int, int, int, int, float, Floats, int], None] = _emitter(Kind.MOVE)
emit_vertex: Callable[[Buffer, int, int, int, Floats, int], None] = _emitter(Kind.VERTEX)
emit_link: Callable[[Buffer, int, int, int, int, float], None] = _emitter(Kind.LINK)
emit_cut: Callable[[Buffer, int, int, int, int], None] = _emitter(Kind.CUT)
emit_remove: Callable[[Buffer, int, int, int], None] = _emitter(Kind.REMOVE)
emit_check: Callable[[Buffer, int, int, int, int, float, Floats, int], None] = _emitter(Kind.CHECK)

_PLAN = int(Phase.PLAN)


@inline_helper
def emit_plan_end(buffer: Buffer, iteration: int, status: int) -> None:
    """Append the end of planning with its `Status`."""
    emit_phase(buffer, iteration, _PLAN, status)
