"""The events of graphs and of pruning, as `brrt.record` takes them."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import brrt
from brrt import BrrtError, Kind, World, read, record
from brrt.events import GRAPH_KINDS, table_dtype
from brrt.recorder.rows import row_struct

WORLD = World(
    "open",
    lower=np.zeros(2),
    upper=np.full(2, 10.0),
    start=np.ones(2),
    goal=np.full(2, 9.0),
)


def test_every_graph_event(tmp_path: Path) -> None:
    """One by one, with numbers, costs and configurations that the recorder adds."""
    with record(tmp_path / "mine.mcap", world=WORLD) as rec:
        assert [rec.vertex(q) for q in ([1, 1], [4, 5], [9, 9])] == [0, 1, 2]
        rec.check(0, 1)
        rec.link(0, 1)
        rec.check(1, None, 0.25, q=[8, 8])
        rec.link(1, 2, cost=7)
        rec.cut(1, 0)
        rec.remove(0)
        assert rec.vertex([2, 2], node=3) == 3
    recording = read(tmp_path / "mine.mcap")
    log = recording.events()
    rows = {kind: [tuple(row)[3:] for row in log[kind].tolist()] for kind in GRAPH_KINDS}
    vertices = [(0, 0, [1, 1]), (0, 1, [4, 5]), (0, 2, [9, 9]), (0, 3, [2, 2])]
    assert [(*row[:-1], list(row[-1])) for row in rows[Kind.VERTEX]] == vertices
    assert rows[Kind.LINK] == [(0, 0, 1, 5.0), (0, 1, 2, 7.0)]
    assert rows[Kind.CUT] == [(0, 1, 0)]
    assert rows[Kind.REMOVE] == [(0, 0)]
    checks = [(0, 0, 1, 1.0, [4, 5]), (0, 1, -1, 0.25, [8, 8])]
    assert [(*row[:-1], list(row[-1])) for row in rows[Kind.CHECK]] == checks
    assert recording.manifest.format == "3"


def test_arrays_of_graph_events(tmp_path: Path) -> None:
    """They are the same events as one by one."""
    q = np.random.default_rng(0).uniform(1, 9, (20, 2))
    a, b = np.arange(19), np.arange(1, 20)
    part = np.linspace(0, 1, 19)
    with record(tmp_path / "many.mcap", world=WORLD) as rec:
        assert rec.vertices(q).tolist() == list(range(20))
        rec.checks(a, b, part)
        rec.links(a, b)
        rec.cuts(a[:3], b[:3])
        rec.removes([5, 7])
    with record(tmp_path / "one.mcap", world=WORLD) as rec:
        for each in q:
            rec.vertex(each)
        for i, j, free in zip(a.tolist(), b.tolist(), part, strict=True):
            rec.check(i, j, free)
        for i, j in zip(a.tolist(), b.tolist(), strict=True):
            rec.link(i, j)
        for i, j in zip(a[:3].tolist(), b[:3].tolist(), strict=True):
            rec.cut(i, j)
        rec.remove(5)
        rec.remove(7)
    one, many = (read(tmp_path / f"{name}.mcap").events() for name in ("one", "many"))
    for kind in Kind:
        names = [name for name in table_dtype(kind, 2).names or () if name != "t"]
        for name in names:
            same = np.allclose if name == "cost" else np.array_equal
            assert same(one[kind][name], many[kind][name])


IMPOSSIBLE: list[tuple[Any, str]] = [
    (lambda rec: rec.vertex([1, 2, 3]), "q must be 2 finite numbers"),
    (lambda rec: rec.vertex([1, 2], node=9), "node of tree 0 must be 4"),
    (lambda rec: rec.link(1, 1), "other must not be the node itself, 1"),
    (lambda rec: rec.link(1, 4), "other must be a node of tree 0, not 4"),
    (lambda rec: rec.link(1, 0), "other must be a node of tree 0; 0 was removed"),
    (lambda rec: rec.link(1, 2, cost=np.nan), "cost must be a finite number"),
    (lambda rec: rec.cut(1, 3), "other must be joined to node 1 of tree 0; 3 is not"),
    (lambda rec: rec.cut(1), "other must be given: node 1 of tree 0 has no parent"),
    (lambda rec: rec.remove("1"), "node must be a node of tree 0"),
    (lambda rec: rec.remove(0), "node must be a node of tree 0; 0 was removed"),
    (lambda rec: rec.check(1, 2, 1.5), "part must be a number from 0 to 1, not 1.5"),
    (lambda rec: rec.check(1), "q must be given for a motion that ends at no node"),
    (lambda rec: rec.checks([1, 2], [2, 3], [0.5, -1]), "part must be numbers from 0 to 1"),
    (lambda rec: rec.checks([1], [2], q=[[1, 1], [2, 2]]), "q must have 1 rows, not 2"),
    (lambda rec: rec.links([1, 2], [2, 0]), "other must be nodes of tree 0; 0 was removed"),
    (lambda rec: rec.links([1, 2], [2, 2]), "other must not be the node itself, 2"),
    (lambda rec: rec.edge([1, 2], 1), "parent 1 has none, for no root is above it"),
    (lambda rec: rec.edges([[1, 2]], [1]), "parent 1 has none, for no root is above it"),
    (lambda rec: rec.edge([1, 2], 0), "parent must be a node of tree 0; 0 was removed"),
    (lambda rec: rec.edges([[1, 2]], [0]), "parent must be nodes of tree 0; 0 was removed"),
    (lambda rec: rec.reject([1, 2], 0), "node must be a node of tree 0; 0 was removed"),
    (lambda rec: rec.rewire(1, 2), "parent 2 has none, for no root is above it"),
]


@pytest.mark.parametrize("case", range(len(IMPOSSIBLE)))
def test_impossible_graph_values(tmp_path: Path, case: int) -> None:
    """They are errors at the call, which name the field."""
    call, words = IMPOSSIBLE[case]
    with record(tmp_path / "x.mcap", world=WORLD) as rec:
        for q in ([1, 1], [2, 2], [3, 3], [4, 4]):
            rec.vertex(q)
        rec.link(1, 2)
        rec.remove(0)
        with pytest.raises(BrrtError, match=words):
            call(rec)
    assert len(read(tmp_path / "x.mcap").events()) == 8


def test_costs_across_cuts(tmp_path: Path) -> None:
    """A node that is cut off keeps its subtree, whose costs follow once it has a parent again."""
    with record(tmp_path / "x.mcap", world=WORLD) as rec:
        rec.edge([0, 0])
        rec.edge([3, 0], 0)
        rec.edge([3, 4], 1)
        rec.cut(1)
        with pytest.raises(BrrtError, match="cost must be given"):
            rec.edge([3, 5], 2)
        rec.rewire(1, 0, cost=10)
        rec.edge([3, 5], 2)
        rec.remove(1)
        with pytest.raises(BrrtError, match="cost must be given"):
            rec.edge([3, 6], 3)
    assert read(tmp_path / "x.mcap").events()[Kind.EDGE]["cost"].tolist() == [0, 3, 7, 15]


def test_log_of_graphs(tmp_path: Path) -> None:
    """`brrt.log` has the same methods, and does nothing outside of a recording."""
    assert brrt.log.vertex([1, 1]) is None
    brrt.log.link(0, 1)
    with record(tmp_path / "x.mcap", world=WORLD):
        assert brrt.log.vertex([1, 1]) == 0
        assert brrt.log.vertex([2, 2]) == 1
        brrt.log.link(0, 1)
        brrt.log.check(0, 1, part=1)
        brrt.log.cut(0, 1)
        brrt.log.remove(1)
    assert read(tmp_path / "x.mcap").manifest.graph


def test_rows_hold_every_field() -> None:
    """The layout of a row has a place for the number and the configuration of a check."""
    assert row_struct(3).size > 0
