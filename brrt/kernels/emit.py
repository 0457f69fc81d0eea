"""How kernels and Python code say what happens: a buffer of events, drained batch by batch."""

import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brrt.errors import BrrtError, unknown
from brrt.events import (
    FIELDS,
    LATEST_NS,
    Events,
    Instant,
    Kind,
    LazyTables,
    Phase,
    Table,
    table_dtype,
)
from brrt.kernels.clock import COMPILED_CLOCK, now_ns
from brrt.kernels.jit import inline_helper

INTS = 3
"""Integer fields that a kind may have; `emit` takes this many."""

_PHASE, _PLAN = int(Kind.PHASE), int(Phase.PLAN)

_COUNT, _FIRST_SEQ, _LAST_T, _ORIGIN, _TICK, _POINTS = range(6)


class Buffer(NamedTuple):
    """Columns that a kernel writes; which field stands where follows from `events.FIELDS`.

    Attributes:
        state: Events held, seq of the first, time of the last, the clock's origin, the ns between
            two events of a logical clock (0: a real clock), and rows of `points` in use; shape
            (6,), int64.
        kind: Shape (n,), uint8.
        t: Time in ns since the origin, shape (n,), int64.
        iteration: Shape (n,), int64.
        ints: A kind's integer fields in their order, shape (n, 3), int32.
        real: A kind's float field, shape (n,).
        q: Configurations, shape (n, dof).
        points: Waypoints of all paths, shape (n, dof); a path's event holds in `ints`, behind its
            own fields, its first row and how many it has.
    """

    state: NDArray[np.int64]
    kind: NDArray[np.uint8]
    t: NDArray[np.int64]
    iteration: NDArray[np.int64]
    ints: NDArray[np.int32]
    real: NDArray[np.float64]
    q: NDArray[np.float64]
    points: NDArray[np.float64]


@inline_helper
def room(buffer: Buffer) -> int:
    """Events that still fit."""
    return len(buffer.kind) - int(buffer.state[_COUNT])


@inline_helper
def emit(
    buffer: Buffer,
    kind: int,
    iteration: int,
    i0: int,
    i1: int,
    i2: int,
    real: float,
    q: NDArray[np.float64],
    row: int,
) -> None:
    """Append an event; the caller saw to it that there is room.

    Args:
        buffer: Where to.
        kind: A `Kind`.
        iteration: The planner's count.
        i0: The kind's first integer field.
        i1: Its second, or anything.
        i2: Its third, or anything.
        real: Its float field, or anything.
        q: Configurations, shape (n, dof).
        row: Which of them is the event's, or any.
    """
    state = buffer.state
    n = state[_COUNT]
    last = state[_LAST_T]
    if state[_TICK] > 0:
        t = (state[_FIRST_SEQ] + n) * state[_TICK]
    else:
        t = max(now_ns() - state[_ORIGIN], last + 1)
    buffer.kind[n] = kind
    buffer.t[n] = t
    buffer.iteration[n] = iteration
    buffer.ints[n, 0] = i0
    buffer.ints[n, 1] = i1
    buffer.ints[n, 2] = i2
    buffer.real[n] = real
    for k in range(q.shape[1]):
        buffer.q[n, k] = q[row, k]
    state[_LAST_T] = t
    state[_COUNT] = n + 1


@inline_helper
def point_room(buffer: Buffer) -> int:
    """Waypoints that still fit."""
    return len(buffer.points) - int(buffer.state[_POINTS])


@inline_helper
def take_points(buffer: Buffer, n: int) -> int:
    """Reserve n rows of `points`, which the caller saw to be there; return the first."""
    first = int(buffer.state[_POINTS])
    buffer.state[_POINTS] += n
    return first


@inline_helper
def emit_end(buffer: Buffer, iteration: int, status: int) -> None:
    """Say how planning has ended, a `Status`; the caller saw to it that there is room."""
    emit(buffer, _PHASE, iteration, _PLAN, status, 0, 0.0, buffer.q, 0)


def _slots(kind: Kind) -> list[tuple[str, str, int]]:
    """For each field of a kind: its name, the column that holds it, and its place therein."""
    places, ints = [], 0
    for field in FIELDS[kind]:
        if field.type == "q[]":
            places.append((field.name, "points", ints))
            ints += 2
        elif field.type == "q":
            places.append((field.name, "q", 0))
        elif field.type.startswith("float"):
            places.append((field.name, "real", 0))
        else:
            places.append((field.name, "ints", ints))
            ints += 1
    return places


_PATIENCE_S = 0.25
"""So long events may wait for their batch to fill: who records them waits as well."""

_SLOTS: Mapping[Kind, list[tuple[str, str, int]]] = {kind: _slots(kind) for kind in Kind}


def _unfit(
    kind: Kind, fields: Mapping[str, Any], dof: int, room: int, error: Exception
) -> BrrtError:
    """Say which field of an event is wrong, and what it should be."""
    expected = {field.name: field.type for field in FIELDS[kind]}
    if room <= 0:
        return BrrtError("the batch is full; yield log.drain() while there is room")
    for name in fields:
        if name not in expected:
            return unknown(f"field of a {kind.label} event", name, expected)
    for name, what in expected.items():
        if name not in fields:
            return BrrtError(f"a {kind.label} event needs the field {name!r} ({what})")
    shapes = {"q": f"{dof} numbers", "q[]": f"rows of {dof} numbers"}
    for name, what in expected.items():
        if not _fits(fields[name], what, dof):
            text = " ".join(repr(fields[name]).split())
            return BrrtError(
                f"{name} of a {kind.label} event must be {shapes.get(what, what)}, not {text:.60}"
            )
    return BrrtError(f"a {kind.label} event cannot be recorded: {error}")


def _fits(value: Any, what: str, dof: int) -> bool:
    """Whether a value can be put into a field of that type."""
    try:
        if what == "q":
            return np.array(value, np.float64).shape == (dof,)
        if what == "q[]":
            return np.array(value, np.float64).shape == (len(value), dof)
        np.empty(1, np.float64 if what.startswith("float") else np.int32)[0] = value
    except (TypeError, ValueError, OverflowError):
        return False
    return True


class EventLog:
    """The log that a run writes to: numbers and times every event, and hands them out in batches.

    Kernels write to `buffer` through the compiled `emit`; Python code, and planners from outside,
    call the method `emit`.

    Args:
        dof: Numbers in a configuration.
        capacity: Events that a batch holds at most.
        logical_clock: Number events 1 us apart instead of asking the clock, so that two runs
            with one seed give the same bytes.
    """

    def __init__(self, dof: int, capacity: int = 16384, *, logical_clock: bool = False) -> None:
        self.dof = dof
        self.buffer = Buffer(
            state=np.zeros(6, np.int64),
            kind=np.empty(capacity, np.uint8),
            t=np.empty(capacity, np.int64),
            iteration=np.empty(capacity, np.int64),
            ints=np.empty((capacity, INTS), np.int32),
            real=np.empty(capacity, np.float64),
            q=np.empty((capacity, dof), np.float64),
            points=np.empty((capacity, dof), np.float64),
        )
        self.buffer.state[_LAST_T] = -1
        self.buffer.state[_TICK] = 1000 if logical_clock else 0
        # A clock that was never set may stand before 1970, or in another age: files hold neither.
        self.epoch_ns = 0 if logical_clock else min(max(time.time_ns(), 0), LATEST_NS)
        self._origin = time.perf_counter_ns()
        self._drained = time.monotonic()
        self.buffer.state[_ORIGIN] = self._origin if COMPILED_CLOCK else 0

    def __len__(self) -> int:
        return int(self.buffer.state[_COUNT])

    @property
    def room(self) -> int:
        """Events that fit before the next `drain`."""
        return len(self.buffer.kind) - len(self)

    @property
    def overdue(self) -> bool:
        """Whether events have waited long enough for a `drain`, though there is room for more."""
        return len(self) > 0 and time.monotonic() - self._drained > _PATIENCE_S

    def reserve(self, events: int, points: int = 0) -> None:
        """Make a batch large enough for what a planner emits in one go.

        Args:
            events: Events.
            points: Waypoints of their paths.
        """
        b = self.buffer
        if events > len(b.kind):
            kind, t, iteration = (_longer(c, events) for c in (b.kind, b.t, b.iteration))
            ints, real, q = (_longer(c, events) for c in (b.ints, b.real, b.q))
            self.buffer = b = Buffer(b.state, kind, t, iteration, ints, real, q, b.points)
        if points > len(b.points):
            self.buffer = b._replace(points=_longer(b.points, points))

    def _begin(self) -> None:
        """Let time count from now: what came before, such as opening files, is not the run's."""
        self._origin = time.perf_counter_ns()
        self.buffer.state[_ORIGIN] = self._origin if COMPILED_CLOCK else 0

    def resume(self, t: int) -> None:
        """Let time go on from that of the last event, `t` in ns, as if none had passed since."""
        self._origin = time.perf_counter_ns() - t
        self.buffer.state[_ORIGIN] = self._origin if COMPILED_CLOCK else 0
        self.buffer.state[_LAST_T] = t

    @property
    def elapsed_s(self) -> float:
        """Seconds since the log was opened."""
        return (time.perf_counter_ns() - self._origin) / 1e9

    def emit(self, kind: Kind, iteration: int, **fields: Any) -> None:
        """Append an event; the caller saw to it that there is `room`.

        Args:
            kind: What happened.
            iteration: The planner's count.
            fields: Every field that `events.FIELDS` declares for the kind.

        Raises:
            BrrtError: A field is missing, not known or of no use, or the batch is full.
        """
        row = len(self)
        if row == 0 and self.buffer.state[_FIRST_SEQ] == 0:
            self._begin()
        self.tick()
        try:
            self._put(kind, row, fields)
        except (KeyError, TypeError, ValueError, OverflowError, IndexError) as error:
            raise _unfit(kind, fields, self.dof, self.room, error) from None
        buffer = self.buffer
        buffer.kind[row], buffer.iteration[row] = kind, iteration
        buffer.t[row] = buffer.state[_LAST_T] = self._time(row)
        buffer.state[_COUNT] = row + 1

    def _put(self, kind: Kind, row: int, fields: Mapping[str, Any]) -> None:
        buffer, slots, ints = self.buffer, _SLOTS[kind], 0
        if len(fields) != len(slots):
            raise KeyError
        for name, column, _ in slots:
            value = fields[name]
            if column == "points":
                place = self._keep_points(value)
                buffer = self.buffer  # it may have been replaced by a larger one
                buffer.ints[row, ints : ints + 2] = place
                ints += 2
            elif column == "q":
                if len(value) != self.dof:  # numpy would spread a single number over all
                    raise ValueError
                buffer.q[row] = value
            elif column == "real":
                buffer.real[row] = value
            else:
                buffer.ints[row, ints] = value
                ints += 1

    def _keep_points(self, points: Any) -> tuple[int, int]:
        """Store a path's waypoints; return their first row and how many there are."""
        rows = np.array(points, np.float64).reshape(len(points), self.dof)
        first = int(self.buffer.state[_POINTS])
        if first + len(rows) > len(self.buffer.points):
            self.reserve(0, 2 * (first + len(rows)))
        self.buffer.points[first : first + len(rows)] = rows
        self.buffer.state[_POINTS] += len(rows)
        return first, len(rows)

    def _time(self, row: int) -> int:
        state = self.buffer.state
        if state[_TICK]:
            return int((state[_FIRST_SEQ] + row) * state[_TICK])
        return max(time.perf_counter_ns() - self._origin, int(state[_LAST_T]) + 1)

    def tick(self) -> None:
        """Tell kernels the time where they cannot read the clock themselves."""
        state = self.buffer.state
        if not COMPILED_CLOCK and state[_TICK] == 0:
            state[_LAST_T] = max(int(state[_LAST_T]), time.perf_counter_ns() - self._origin)

    def drain(self) -> Events:
        """Hand out the events held so far, and begin anew."""
        self._drained = time.monotonic()
        n = len(self)
        first = int(self.buffer.state[_FIRST_SEQ])
        b = self.buffer
        columns = Buffer(
            b.state, b.kind[:n].copy(), b.t[:n].copy(), b.iteration[:n].copy(),
            b.ints[:n].copy(), b.real[:n].copy(), b.q[:n].copy(),
            b.points[: b.state[_POINTS]].copy(),
        )  # fmt: skip
        held = _Held(first, self.dof, columns)
        self.buffer.state[_FIRST_SEQ] += n
        self.buffer.state[_COUNT] = self.buffer.state[_POINTS] = 0
        counts = np.bincount(columns.kind, minlength=len(Kind))
        present = {Kind(int(code)): int(counts[code]) for code in np.flatnonzero(counts)}
        last = Instant(int(columns.t[-1]), int(columns.iteration[-1])) if n else Instant(0, 0)
        return Events(self.dof, LazyTables(present, last, held.table))


def _longer(column: NDArray[Any], n: int) -> NDArray[Any]:
    longer = np.empty((n, *column.shape[1:]), column.dtype)
    longer[: len(column)] = column
    return longer


@dataclass(frozen=True, slots=True, eq=False)
class _Held:
    """A batch out of the kernels' way."""

    first: int
    dof: int
    columns: Buffer

    def table(self, kind: Kind) -> Table:
        """Gather the events of a kind, its fields under their names."""
        columns = self.columns
        rows = np.flatnonzero(columns.kind == kind)
        table = np.empty(len(rows), table_dtype(kind, self.dof))
        table["seq"] = rows + self.first
        table["t"] = columns.t[rows]
        table["iteration"] = columns.iteration[rows]
        for name, column, place in _SLOTS[kind]:
            if column == "points":
                for i, (begin, n) in enumerate(columns.ints[rows, place : place + 2].tolist()):
                    table[name][i] = columns.points[begin : begin + n]
            elif column == "ints":
                table[name] = columns.ints[rows, place]
            elif column == "real":
                table[name] = columns.real[rows]
            else:
                table[name] = columns.q[rows]
        return table
