"""The first difference of two logs is found, whatever the batches."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from brrt import Events, Kind, Scenario, first_difference
from tests.conftest import recorded
from tests.support.logs import split

SCENARIO = Scenario(world="circles2d:n=40,seed=3", seed=7, clock="logical")


@settings(max_examples=60)
@given(data=st.data())
def test_first_difference_is_the_first(data: st.DataObject) -> None:
    """One field of one event is changed: exactly that event is found."""
    _, log = recorded(SCENARIO)
    kind = data.draw(st.sampled_from([k for k in Kind if len(log[k])]))
    table = log[kind].copy()
    row = data.draw(st.integers(0, len(table) - 1))
    name = data.draw(st.sampled_from([n for n in table.dtype.names or () if n not in ("seq", "t")]))
    value = np.copy(table[name][row])
    changed = np.asarray(value + 1 if value.dtype != bool else ~value)
    if name in ("name", "status", "source", "reason", "stage"):
        changed = np.asarray(1 - min(int(value), 1))
    table[name][row] = changed
    other = Events(log.dof, {**log.tables, kind: table})
    sizes = [data.draw(st.integers(20, 500)) for _ in range(2)]
    found = first_difference(split(log, sizes[0]), split(other, sizes[1]))
    if np.array_equal(value, changed):
        assert found is None
        return
    assert found is not None
    assert found.seq == table["seq"][row]
    assert found.left is not None
    assert name.removesuffix("s") in str(found)


def test_times_do_not_count() -> None:
    """Logs that differ only in their times are equal."""
    _, log = recorded(SCENARIO)
    later = {k: t.copy() for k, t in log.tables.items()}
    for table in later.values():
        table["t"] += 12345
    assert first_difference([log], [Events(2, later)]) is None


def test_an_end_is_a_difference() -> None:
    """A log that ends early differs at its end, whichever of the two it is."""
    _, log = recorded(SCENARIO)
    short = log.until(seq=40)
    one, two = first_difference([log], [short]), first_difference([short], [log])
    assert one is not None
    assert two is not None
    assert (one.seq, two.seq) == (41, 41)
    assert "the second log has ended" in str(one)
    assert "the first log has ended" in str(two)
    assert first_difference([], []) is None


def test_other_kind_and_other_dimension() -> None:
    """A different kind of event and a different robot are named."""
    _, log = recorded(SCENARIO)
    _, other = recorded(Scenario(world="circles2d:n=40,seed=3", seed=8, clock="logical"))
    found = first_difference([log], [other])
    assert found is not None
    assert found.seq == 2
    _, solid = recorded(Scenario(world="boxes3d", seed=8, clock="logical"))
    found = first_difference([log], [solid])
    assert found is not None
    assert "dof 2 against 3" in str(found)
