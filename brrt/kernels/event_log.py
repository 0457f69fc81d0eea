"""The log that a run writes to: it numbers and times events and returns them in batches."""

import math
import time
from collections.abc import Mapping
from typing import Any

import numpy as np

from brrt.errors import BrrtError, unknown
from brrt.event_columns import (
    COUNT,
    FIRST_SEQ,
    LAST_T,
    LAYOUT,
    ORIGIN,
    POINTS,
    TICK,
    UNTIL_SEQ,
    UNTIL_T,
    EventColumns,
)
from brrt.events import FIELDS, LATEST_NS, Events, Kind
from brrt.kernels.arrays import enlarged
from brrt.kernels.clock import COMPILED_CLOCK
from brrt.kernels.emit import Buffer, empty_buffer

_MAX_DELAY_S = 0.25
"""Age at which events are drained although the batch has room: a live view shows them then."""

_SLICE_S = 0.05
"""Time after which a kernel returns."""

_EVENTS_PER_CALL = 1 << 40 if COMPILED_CLOCK else 1024
"""Events after which it returns in any case."""

_PER_EVENT = tuple(name for name in Buffer._fields if name not in ("state", "points"))


class EventLog:
    """The log that a run writes to: it numbers and times events and returns them in batches.

    Kernels write to `buffer` by the functions of `brrt.kernels.emit`; Python code, and planners
    outside brrt, call the method `emit`.

    Args:
        dof: Numbers in a configuration.
        capacity: Greatest number of events in a batch.
        logical_clock: Time events 1 us apart instead of reading the clock, so that two runs with
            the same seed give the same bytes.
    """

    def __init__(self, dof: int, capacity: int = 16384, *, logical_clock: bool = False) -> None:
        self.dof = dof
        self.buffer = empty_buffer(dof, capacity)
        self.buffer.state[LAST_T] = -1
        self.buffer.state[[UNTIL_SEQ, UNTIL_T]] = np.iinfo(np.int64).max
        self.buffer.state[TICK] = 1000 if logical_clock else 0
        # A clock that was never set may be before 1970 or far in the future; files allow neither.
        self.epoch_ns = 0 if logical_clock else min(max(time.time_ns(), 0), LATEST_NS)
        self._drained = time.monotonic()
        self._set_origin(time.perf_counter_ns())

    def __len__(self) -> int:
        return int(self.buffer.state[COUNT])

    @property
    def room(self) -> int:
        """Number of events that fit before the next `drain`."""
        return len(self.buffer.kind) - len(self)

    @property
    def overdue(self) -> bool:
        """Whether the events should be drained although the batch has room."""
        return len(self) > 0 and time.monotonic() - self._drained > _MAX_DELAY_S

    def reserve(self, events: int, points: int = 0) -> None:
        """Enlarge a batch to hold what a planner emits without a `drain` in between.

        Args:
            events: Number of events.
            points: Number of waypoints of their paths.
        """
        old, used = self.buffer, len(self.buffer.kind)
        if events > used:
            rows = {name: enlarged(getattr(old, name), used, events) for name in _PER_EVENT}
            self.buffer = old._replace(**rows)
        if points > len(old.points):
            larger = enlarged(old.points, len(old.points), points)
            self.buffer = self.buffer._replace(points=larger)

    def resume(self, t: int) -> None:
        """Continue the time of a log whose last event has the time `t`, in ns."""
        self._set_origin(time.perf_counter_ns() - t)
        self.buffer.state[LAST_T] = t

    def _set_origin(self, origin: int) -> None:
        self._origin = origin
        self.buffer.state[ORIGIN] = origin if COMPILED_CLOCK else 0

    @property
    def elapsed_s(self) -> float:
        """Seconds since the run began."""
        return (time.perf_counter_ns() - self._origin) / 1e9

    def emit(self, kind: Kind, iteration: int, **fields: Any) -> None:
        """Append an event, for which there must be `room`.

        Args:
            kind: What happened.
            iteration: The planner's count.
            fields: Every field that `events.FIELDS` declares for the kind.

        Raises:
            BrrtError: A field is missing, unknown or of the wrong type, or the batch is full.
        """
        row, state = len(self), self.buffer.state
        if row == 0 and state[FIRST_SEQ] == 0:
            # The time before the first event, such as for opening files, is not part of the run.
            self._set_origin(time.perf_counter_ns())
        self.tick()
        try:
            self._put(kind, row, fields)
        except (KeyError, TypeError, ValueError, OverflowError, IndexError) as error:
            raise _invalid(kind, fields, self.dof, self.room, error) from None
        buffer = self.buffer
        buffer.kind[row], buffer.iteration[row] = kind, iteration
        buffer.t[row] = state[LAST_T] = self._time(row)
        state[COUNT] = row + 1

    def _put(self, kind: Kind, row: int, fields: Mapping[str, Any]) -> None:
        if len(fields) != len(LAYOUT[kind]):
            raise KeyError
        for field, column, at in LAYOUT[kind]:
            value: Any = fields[field.name]
            if field.type == "q[]":
                value = self._put_points(value)  # this may replace the buffer by a larger one
                getattr(self.buffer, column)[row, at : at + 2] = value
            elif field.type == "q":
                if len(value) != self.dof:  # numpy would copy a single number to all places
                    raise ValueError
                self.buffer.q[row, at * self.dof : (at + 1) * self.dof] = value
            else:
                getattr(self.buffer, column)[row, at] = value

    def _put_points(self, points: Any) -> tuple[int, int]:
        """Store a path's waypoints; return their first row and their number."""
        rows = np.array(points, np.float64).reshape(len(points), self.dof)
        first = int(self.buffer.state[POINTS])
        if first + len(rows) > len(self.buffer.points):
            self.reserve(0, 2 * (first + len(rows)))
        self.buffer.points[first : first + len(rows)] = rows
        self.buffer.state[POINTS] += len(rows)
        return first, len(rows)

    def _time(self, row: int) -> int:
        state = self.buffer.state
        if state[TICK]:
            return int((state[FIRST_SEQ] + row) * state[TICK])
        return max(time.perf_counter_ns() - self._origin, int(state[LAST_T]) + 1)

    @property
    def count(self) -> int:
        """Number of events since the run began."""
        return int(self.buffer.state[FIRST_SEQ]) + len(self)

    def allow(self, seconds: float = math.inf, events: int | None = None) -> None:
        """Let the next kernel run until its caller should look at the budget and at signals.

        Args:
            seconds: Time that is left; without any, the kernel only emits what it has found.
            events: Events that the log may have in all; None for no limit.
        """
        state, most = self.buffer.state, self.count + _EVENTS_PER_CALL
        slice_ns = int(min(seconds, _SLICE_S) * 1e9)
        state[UNTIL_T] = time.perf_counter_ns() - self._origin + slice_ns
        state[UNTIL_SEQ] = most if events is None else min(most, events)
        if seconds <= 0:
            state[UNTIL_SEQ] = 0
        self.tick()

    def tick(self) -> None:
        """Write the time to the buffer, for kernels that cannot read the clock themselves."""
        state = self.buffer.state
        if not COMPILED_CLOCK and state[TICK] == 0:
            state[LAST_T] = max(int(state[LAST_T]), time.perf_counter_ns() - self._origin)

    def drain(self) -> Events:
        """Return the events so far and empty the buffer."""
        self._drained = time.monotonic()
        old, n = self.buffer, len(self)
        first, points = int(old.state[FIRST_SEQ]), int(old.state[POINTS])
        rows = {name: getattr(old, name)[:n].copy() for name in _PER_EVENT}
        old.state[FIRST_SEQ] += n
        old.state[COUNT] = old.state[POINTS] = 0
        columns = EventColumns(first, self.dof, points=old.points[:points].copy(), **rows)
        return columns.events()


def _invalid(
    kind: Kind, fields: Mapping[str, Any], dof: int, room: int, error: Exception
) -> BrrtError:
    """Return the error that names the wrong field of an event and what it should be."""
    types = {field.name: field.type for field in FIELDS[kind]}
    if room <= 0:
        return BrrtError("the batch is full; yield log.drain() while there is room")
    for name in fields:
        if name not in types:
            return unknown(f"field of a {kind.label} event", name, types)
    shapes = {"q": f"{dof} numbers", "q[]": f"rows of {dof} numbers"}
    for name, kind_of in types.items():
        if name not in fields:
            return BrrtError(f"a {kind.label} event needs the field {name!r} ({kind_of})")
    for name, kind_of in types.items():
        if not _fits(fields[name], kind_of, dof):
            value = " ".join(repr(fields[name]).split())
            wanted = shapes.get(kind_of, kind_of)
            return BrrtError(f"{name} of a {kind.label} event must be {wanted}, not {value:.60}")
    return BrrtError(f"a {kind.label} event cannot be recorded: {error}")


def _fits(value: Any, kind_of: str, dof: int) -> bool:
    """Whether a value can be stored in a field of that type."""
    try:
        if kind_of == "q":
            return np.array(value, np.float64).shape == (dof,)
        if kind_of == "q[]":
            return np.array(value, np.float64).shape == (len(value), dof)
        np.empty(1, np.float64 if kind_of.startswith("float") else np.int32)[0] = value
    except (TypeError, ValueError, OverflowError):
        return False
    return True
