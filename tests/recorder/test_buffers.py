"""`Recorder.take`: events that a planner's own compiled kernel wrote to a buffer."""

from pathlib import Path
from typing import Any

import numba
import numpy as np
import pytest

from brrt import BrrtError, Kind, Memory, Recorder, Scenario, forest, read, record, verify
from brrt.kernels.emit import (
    Buffer,
    emit_connect,
    emit_edge,
    emit_expand,
    emit_path,
    emit_phase,
    emit_reject,
    emit_rewire,
    emit_sample,
    empty_buffer,
    room,
    take_points,
)
from brrt.scenario.query import Query
from tests.recorder.test_recorder import WORLD

Floats = np.ndarray[Any, np.dtype[np.float64]]


@numba.njit
def grow(buffer: Buffer, Q: Floats, parent: Any, cost: Floats, done: int) -> int:
    """Join nodes while there is room, each after a sample; return how many there are."""
    while done < len(Q) and room(buffer) >= 2:
        if done > 0:
            emit_sample(buffer, done, 0, 0, Q, done)
        emit_edge(buffer, done, 0, done, parent[done], cost[done], Q, done)
        done += 1
    return done


def nodes(n: int) -> tuple[Floats, Any, Floats]:
    """A tree."""
    rng = np.random.default_rng(n)
    q = rng.uniform(0, 10, (n, 2))
    q[0] = WORLD.start
    parent, cost = np.arange(n) // 2 - 1, np.zeros(n)
    parent[1:] = np.arange(n - 1) // 2
    for i in range(1, n):
        cost[i] = cost[parent[i]] + np.hypot(*(q[i] - q[parent[i]]))
    return q, parent, cost


@pytest.mark.parametrize("capacity", [2, 100, 20_000])
def test_a_compiled_kernel_records(capacity: int, tmp_path: Path) -> None:
    """The same events as calls from Python, at the times that the kernel read."""
    n = 200 if capacity == 2 else 9000
    q, parent, cost = nodes(n)
    buffer, done = empty_buffer(2, capacity), 0
    with record(tmp_path / "x.mcap", world=WORLD, planner="mine") as rec:
        while done < n:
            done = grow(buffer, q, parent, cost, done)
            rec.take(buffer)
            assert buffer.state[0] == 0
        rec.take(buffer)
        assert rec.edge([5.0, 5.0], 3) == n
    recording = read(tmp_path / "x.mcap")
    log = recording.events()
    assert verify(recording).findings == []
    np.testing.assert_array_equal(log[Kind.EDGE]["q"][:n], q)
    assert log[Kind.EDGE]["cost"][n] == pytest.approx(cost[3] + np.hypot(*(q[3] - 5)))
    assert log[Kind.EDGE]["iteration"].tolist() == [*range(n), n - 1]
    assert log.last.t < 60e9


@numba.njit
def tell(buffer: Buffer, Q: Floats, what: int) -> None:
    """Write an event of each kind; `what` spoils one of them."""
    emit_edge(buffer, 1, 0, 0, -1, 0.0, Q, 0)
    emit_edge(buffer, 1, 1, 0, -1, 0.0, Q, 3)
    emit_sample(buffer, 2, 0, 9 if what == 1 else 0, Q, 4 if what == 2 else 1)
    emit_edge(buffer, 2, 0, 7 if what == 3 else 1, 5 if what == 4 else 0, 1.0, Q, 1)
    emit_edge(buffer, 1 if what == 5 else 3, 2 if what == 6 else 0, 2, 1, 2.0, Q, 2)
    emit_reject(buffer, 3, 0, 8 if what == 7 else 2, 0, Q, 3)
    emit_rewire(buffer, 3, 0, 1 if what == 8 else 2, 2 if what == 8 else 0, 1.5)
    emit_connect(buffer, 3, 2, 6 if what == 9 else 0, np.nan if what == 10 else 4.0)
    first = take_points(buffer, 2)
    for row in range(2):
        for k in range(2):
            buffer.points[first + row, k] = np.inf if what == 11 else Q[row * 3, k]
    emit_path(buffer, 3, 0, 4.0, 50 if what == 12 else first, 0 if what == 13 else 2)
    emit_expand(buffer, 4, -2 if what == 14 else 0, -1, 0.0, Q, 0)
    if what == 15:
        emit_phase(buffer, 4, 0, 0)


Q = np.array([[1.0, 1.0], [2.0, 1.0], [3.0, 1.0], [9.0, 9.0], [np.nan, 0.0]])


def told(what: int) -> Buffer:
    """A buffer with events, of which one may be impossible."""
    buffer = empty_buffer(2, 100)
    tell(buffer, Q, what)  # type: ignore[call-arg, type-var]
    return buffer


def test_every_kind() -> None:
    """Paths with their waypoints; nodes and costs go on from there."""
    sink = Memory()
    rec = Recorder(sink, Query.of(Scenario(), WORLD))
    rec.sample([4, 4])
    rec.take(told(0))
    assert rec.iteration == 4
    assert rec.edge([3, 2], 2) == 3
    rec.expand(1, 0, [1, 2], 1.0)
    rec.close()
    log = sink.events()
    assert log[Kind.PATH]["waypoints"][0].tolist() == [[1, 1], [9, 9]]
    assert forest(log)[0].parent.tolist() == [-1, 0, 0, 2]
    assert log[Kind.EDGE]["cost"].tolist() == [0, 0, 1, 2, 2.5]
    assert log[Kind.CONNECT]["cost"].tolist() == [4]
    assert log[Kind.EXPAND]["cell"].tolist() == [0, 1]
    t = np.sort(np.concatenate([table["t"] for table in log.tables.values()]))
    assert (np.diff(t) > 0).all()


@pytest.mark.parametrize(
    ("what", "message"),
    [
        (1, r"source of event 2 of the buffer \(sample\) cannot be 9"),
        (2, r"q of event 2 of the buffer \(sample\)"),
        (3, "node of event 3"),
        (4, "parent of event 3 of the buffer .* cannot be 5"),
        (5, "iteration must not fall in a buffer"),
        (6, "tree of .* cannot be 2"),
        (7, "node of event 5"),
        (8, "parent of event 6 of the buffer .* cannot be 2"),
        (9, "other of event 7"),
        (10, "cost of event 7 of the buffer .* cannot be nan"),
        (11, "waypoints must be finite"),
        (12, "waypoints must be one at least of those in the buffer"),
        (13, "waypoints must be one at least"),
        (14, "cell of .* cannot be -2"),
        (15, "kind must be one of sample, reject"),
    ],
)
def test_impossible_events_are_errors_at_the_call(what: int, message: str) -> None:
    """And nothing of the buffer is recorded."""
    sink = Memory()
    rec = Recorder(sink, Query.of(Scenario(), WORLD))
    with pytest.raises(BrrtError, match=message):
        rec.take(told(what))
    rec.take(told(0))
    rec.close()
    assert sink.events().counts[Kind.EDGE] == 4


def test_what_is_no_buffer() -> None:
    """Or one for another robot."""
    rec = Recorder(Memory(), Query.of(Scenario(), WORLD))
    with pytest.raises(BrrtError, match="buffer must be one of"):
        rec.take([1, 2])  # type: ignore[arg-type]
    with pytest.raises(BrrtError, match="buffer must be for a dof of 2, not 3"):
        rec.take(empty_buffer(3, 10))
    rec.close()


def test_a_clock_of_the_caller(tmp_path: Path) -> None:
    """It times the buffer as a whole."""
    ticks = iter(range(10**6, 10**9, 10**6))
    with record(tmp_path / "x.mcap", world=WORLD, clock=lambda: next(ticks)) as rec:
        rec.take(told(0))
    t = read(tmp_path / "x.mcap").events()[Kind.EDGE]["t"]
    assert t.tolist() == [2_000_000, 2_000_001, 2_000_003, 2_000_004]
