"""Batches that wait and sinks on a thread: all comes out, in order, and in time."""

import time
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from brrt import Events, Kind, RecordingError, Run, Scenario
from brrt.events import table_dtype
from brrt.formats.background import BackgroundSink
from brrt.formats.batching import Batching
from brrt.recording import Result

NOTHING = Events(0, {})


def batch(first: int, count: int) -> Events:
    """Events of two kinds, numbered on."""
    tables = {}
    numbers = np.arange(first, first + count)
    for kind, mine in ((Kind.SAMPLE, numbers[::2]), (Kind.REJECT, numbers[1::2])):
        if len(mine):
            tables[kind] = np.zeros(len(mine), table_dtype(kind, 2))
            tables[kind]["seq"] = mine
    return Events(2, tables)


@given(
    arrivals=st.lists(st.tuples(st.integers(0, 9), st.integers(0, 30))),
    enough=st.integers(1, 40),
    patience=st.integers(0, 60),
)
def test_nothing_is_lost_or_late(
    arrivals: list[tuple[int, int]], enough: int, patience: int
) -> None:
    """What comes out is what came in, in batches of enough events unless one has waited."""
    now, seen = 0.0, 0
    born: list[float] = []
    out: list[Events] = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("brrt.formats.batching.time.monotonic", lambda: now)
        held = Batching(2, enough, patience)
        for count, pause in arrivals:
            now += pause
            born += [now] * count
            due = held.add(batch(len(born) - count, count))
            waiting = len(born) - seen
            if due is not None:
                assert len(due) == waiting
                assert waiting >= enough or now - born[seen] >= patience
                seen = len(born)
                out.append(due)
            elif waiting:
                assert waiting < enough
                assert now - born[seen] < patience
    rest = held.take()
    assert (rest is None) == (seen == len(born))
    assert held.take() is None
    out += [] if rest is None else [rest]
    assert [len(each) > 0 for each in out] == [True] * len(out)
    assert all(a.last.t <= b.last.t for a, b in pairwise(out))
    log = Events.concat(2, out)
    first, kinds = log.kinds_in_order()
    assert (first, len(kinds)) == (0, len(born))


def test_nothing_waits_for_a_slow_planner() -> None:
    """A sink in the background is asked to write what it has while no batch comes."""
    out: list[Events] = []

    class Sink:
        held = Batching(2, 1000, 0.3)

        def write(self, events: Events) -> None:
            due = self.held.add(events)
            out.extend([] if due is None else [due])

        def close(self, result: Result | None) -> None:
            assert result is not None

    background = BackgroundSink(Sink())
    background.write(batch(0, 5))
    end = time.monotonic() + 10
    while not out and time.monotonic() < end:
        time.sleep(0.01)
    background.close({})
    assert [len(each) for each in out] == [5]


class FailingSink:
    """Fails at its second batch.

    Args:
        error: What it raises.
    """

    def __init__(self, error: BaseException) -> None:
        self.error, self.sizes, self.closed = error, list[int](), False

    def write(self, events: Events) -> None:
        """Note the size of the batch."""
        self.sizes.append(len(events))
        if len(self.sizes) == 2:
            raise self.error

    def close(self, result: Result | None) -> None:
        """See that no result is written after missing events."""
        self.closed = True
        assert result is None


@pytest.mark.parametrize("error", [MemoryError("too much"), RecordingError("broken")])
def test_an_error_reaches_the_planner(error: BaseException) -> None:
    """What a sink raises on its thread ends the run; batches after that one are left out."""
    sink, run = FailingSink(error), Run(Scenario(world="circles2d:n=40", seed=3), batch=20)
    with pytest.raises(type(error), match=str(error)):
        run.execute([BackgroundSink(sink)])
    assert sink.closed
    assert len(sink.sizes) == 2


def test_the_planner_waits_for_a_slow_sink() -> None:
    """A batch waits a fraction of a second at most, however many the planner has."""
    waited, born = list[float](), dict[int, float]()

    class Sink:
        def write(self, events: Events) -> None:
            if len(events):
                waited.append(time.monotonic() - born[int(events[Kind.SAMPLE]["seq"][0])])
                time.sleep(0.05)

        def close(self, result: Result | None) -> None:
            assert result is not None

    background = BackgroundSink(Sink())
    for first in range(0, 60, 2):
        born[first] = time.monotonic()
        background.write(batch(first, 2))
    background.close({})
    assert len(waited) == 30
    assert max(waited) < 1.0  # with a queue of 24 batches it is 1.2 s
