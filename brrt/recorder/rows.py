"""A batch of events as rows, each written by one `struct.pack_into`."""

import struct
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrt.errors import BrrtError
from brrt.event_columns import CONFIGURATIONS, INTEGERS, LAYOUT, REALS, WIDTH, EventColumns
from brrt.events import Events, Kind

Floats = NDArray[np.float64]

ROOM = 8192
"""Events of a batch."""

_PADDING = -(4 * WIDTH[INTEGERS] + 1) % 8


def row_dtype(dof: int) -> np.dtype[np.void]:
    """Return the layout of a row."""
    return np.dtype(
        [
            ("t", "<i8"), ("iteration", "<i8"), (REALS, "<f8", (WIDTH[REALS],)),
            (CONFIGURATIONS, "<f8", (WIDTH[CONFIGURATIONS] * dof,)),
            (INTEGERS, "<i4", (WIDTH[INTEGERS],)), ("kind", "u1"), ("padding", f"V{_PADDING}"),
        ]
    )  # fmt: skip


def row_struct(dof: int) -> struct.Struct:
    """Return what packs a row: time, iteration, a float, a configuration, three integers, kind."""
    if (WIDTH[INTEGERS], WIDTH[REALS], WIDTH[CONFIGURATIONS]) != (3, 1, 1):
        raise TypeError("a kind has more fields than Rows.put takes")
    return struct.Struct(f"<qqd{dof}d3iB{_PADDING}x")


class Rows:
    """The events that are recorded and not yet written.

    Args:
        dof: Numbers in a configuration.
        clock: Returns the time in ns.
        origin: What it returned when the run began.
        make_room: Called before an event for which there is no room; takes the others.

    Attributes:
        count: How many there are.
        room: How many there may be; 0 once no more may be recorded.
        last_t: Time of the last event in ns.
    """

    def __init__(
        self, dof: int, clock: Callable[[], int], origin: int, make_room: Callable[[], None]
    ) -> None:
        packed = row_struct(dof)
        self._dof, self._pack, self._size = dof, packed.pack_into, packed.size
        self._clock, self._origin, self._make_room = clock, origin, make_room
        self.room = ROOM
        self._nowhere = (0.0,) * dof
        self._first, self.last_t = 0, -1
        self._clear()

    def _clear(self) -> None:
        self._bytes, self.count = bytearray(ROOM * self._size), 0
        self._rows = np.frombuffer(self._bytes, row_dtype(self._dof))
        self._points: list[Floats] = []
        self._points_count = 0

    def now(self) -> int:
        """Return the time in ns since the run began."""
        return self._clock() - self._origin

    def put(
        self,
        kind: Kind,
        iteration: int,
        real: float,
        q: Sequence[float] | None,
        first: int = 0,
        second: int = 0,
        third: int = 0,
        t: int | None = None,
    ) -> None:
        """Append an event. It does all by itself: a call more is a tenth of its time.

        Args:
            kind: What happened.
            iteration: The planner's count.
            real: The kind's float, 0 without one.
            q: The kind's configuration, shape (dof,); None without one.
            first: The first of the kind's whole numbers, in the order of `events.FIELDS`.
            second: The second of them.
            third: The third.
            t: Time in ns, by default now; an event is at least 1 ns after the one before.

        Raises:
            BrrtError: A number has the wrong type, or is too large.
        """
        if self.count >= self.room:
            self._make_room()
        if t is None:
            t = self._clock() - self._origin
        if t <= self.last_t:
            t = self.last_t + 1
        try:
            self._pack(
                self._bytes, self.count * self._size, t, iteration, real,
                *(self._nowhere if q is None else q), first, second, third, kind,
            )  # fmt: skip
        except (struct.error, TypeError) as error:
            raise BrrtError(f"a {kind.label} event cannot be recorded: {error}") from None
        self.last_t = t
        self.count += 1

    def put_path(
        self, iteration: int, stage: int, cost: float, waypoints: Floats, t: int | None = None
    ) -> None:
        """Append a path, whose waypoints stay in the batch of its event; see `put`."""
        if self.count >= self.room:
            self._make_room()
        first = self._points_count
        self.put(Kind.PATH, iteration, cost, None, stage, first, len(waypoints), t)
        self._points.append(waypoints)
        self._points_count += len(waypoints)

    def put_many(self, kind: Kind, iteration: Any, fields: Mapping[str, Any], part: slice) -> int:
        """Append as many events of one kind as there is room for, 1 ns apart; return how many.

        Args:
            kind: What happened.
            iteration: Of each, shape (n,), or one for all.
            fields: Each field, shape (n,) or (n, dof), or one value for all.
            part: Which of the n to append.
        """
        count: int = min(part.stop - part.start, ROOM - self.count)
        part = slice(part.start, part.start + count)
        rows = self._rows[self.count : self.count + count]
        first = max(self.now(), self.last_t + 1)
        rows["t"] = np.arange(first, first + count)
        rows["iteration"] = iteration[part] if np.ndim(iteration) else iteration
        rows["kind"] = kind
        for field, column, at in LAYOUT[kind]:
            values = fields[field.name]
            if field.type == "q":
                rows[column][:, at * self._dof : (at + 1) * self._dof] = values[part]
            else:
                rows[column][:, at] = values[part] if np.ndim(values) else values
        self.last_t, self.count = first + count - 1, self.count + count
        return count

    def put_columns(self, columns: EventColumns, part: slice) -> int:
        """Append as many events without waypoints as there is room for; return how many."""
        count: int = min(part.stop - part.start, ROOM - self.count)
        rows = self._rows[self.count : self.count + count]
        for name in ("kind", "t", "iteration", INTEGERS, REALS, CONFIGURATIONS):
            rows[name] = getattr(columns, name)[part.start : part.start + count]
        self.last_t, self.count = int(rows["t"][-1]), self.count + count
        return count

    def take(self) -> Events:
        """Return the events as a batch, and begin another one."""
        rows, first = self._rows[: self.count], self._first
        points = np.concatenate([np.empty((0, self._dof)), *self._points])
        columns = EventColumns(
            first, self._dof, rows["kind"], rows["t"], rows["iteration"], rows[INTEGERS],
            rows[REALS], rows[CONFIGURATIONS], points,
        )  # fmt: skip
        self._first += len(rows)
        self._clear()
        return columns.events()
