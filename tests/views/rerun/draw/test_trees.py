"""Drawn trees are those of the fold, growing or on pages; links and rewired edges are drawn."""

from pathlib import Path

import numpy as np
import pytest

from brrt import Events, Kind, Memory, Run, forest
from brrt.events import Table, table_dtype
from brrt.views.colours import tree_style
from brrt.views.rerun.draw import decimate, pages
from brrt.views.rerun.drawing import draw_run
from tests.support.drawings import (
    as_set,
    drawn,
    edges_of,
    items_of,
    rows_below,
    rows_of,
    scenario,
    visible,
)

START_PAGES = "/world/tree/start_pages/"


@pytest.mark.parametrize(("planner", "number"), [("rrt-star", 0), ("bi-rrt-star", 1)])
def test_pages_are_the_tree(planner: str, number: int, tmp_path: Path) -> None:
    """Whenever pages are logged they show the tree after that event, and at the end all of it."""
    path = tmp_path / "run.rrd"
    log = drawn(path, scenario(planner))
    found = rows_below(path, f"/world/tree/{tree_style(number)[0]}_pages/", ":strips")
    instants = sorted({at for page in found.values() for at, _ in page})
    assert len(instants) > 100
    for seq in [*instants[:40], *instants[40 :: len(instants) // 20], len(log)]:
        shown, wanted = visible(found, seq), edges_of(log.until(seq=seq), number)
        assert len(shown) == len(wanted)
        assert as_set(shown) == as_set(wanted)


def test_pages_lag_little(tmp_path: Path) -> None:
    """A drawing shows nearly all changes, and its pages stay in proportion to the changes."""
    path = tmp_path / "run.rrd"
    log = drawn(path, scenario("rrt-star"))
    found = rows_below(path, START_PAGES, ":strips")
    changed = np.sort(np.concatenate([log[Kind.EDGE]["seq"], log[Kind.REWIRE]["seq"]]))
    instants = sorted({at for page in found.values() for at, _ in page})
    unseen = np.diff(np.searchsorted(changed, instants, "right"), prepend=0)
    assert unseen.max() <= 0.06 * len(changed)
    logged = sum(len(value) for page in found.values() for _, value in page)
    assert logged <= (pages._PER_CHANGE + 1) * len(changed)
    assert len(found) <= pages._MOST_PAGES


def test_pages_grow_when_there_are_too_many(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Full pages take twice as many items, and no item stays on its old page."""
    monkeypatch.setattr(pages, "_MOST_PAGES", 4)
    monkeypatch.setattr(pages, "_FIRST_SIZE", 16)
    path = tmp_path / "run.rrd"
    log = drawn(path, scenario("rrt-star"))
    found = rows_below(path, START_PAGES, ":strips")
    assert len(found) == 4
    instants = sorted({at for page in found.values() for at, _ in page})
    for seq in instants[:: len(instants) // 30]:
        assert as_set(visible(found, seq)) == as_set(edges_of(log.until(seq=seq)))


def chain_then_rewires() -> list[Events]:
    """Return a tree that grows in two batches and is rewired in a third."""
    edges = np.zeros(100, table_dtype(Kind.EDGE, 2))
    edges["seq"] = edges["node"] = edges["iteration"] = np.arange(100)
    edges["parent"] = edges["node"] - 1
    edges["q"] = np.random.default_rng(0).random((100, 2))
    rewires = np.zeros(2, table_dtype(Kind.REWIRE, 2))
    rewires["seq"] = rewires["iteration"] = [100, 101]
    rewires["node"], rewires["parent"] = [50, 70], 0
    tables: list[dict[Kind, Table]]
    tables = [{Kind.EDGE: edges[:40]}, {Kind.EDGE: edges[40:]}, {Kind.REWIRE: rewires}]
    return [Events(2, table) for table in tables]


def test_tree_that_is_rewired_late(tmp_path: Path) -> None:
    """At the first rewired edge pages take the place of the growing entity, which shrinks."""
    run, path, memory = Run(scenario("rrt")), tmp_path / "run.rrd", Memory()
    for batch in chain_then_rewires():
        memory.write(batch)
    draw_run(path, memory.recording(run.manifest, run.problem.world))
    log = memory.events()
    grown = items_of(path, "/world/tree/start", ":strips")
    assert as_set(grown) == as_set(edges_of(log.until(seq=99)))
    ((at, (scale,)),) = rows_of(path, "/world/tree/start", ":scale")
    assert (at, max(scale)) == (100, pytest.approx(1e-6))
    found = rows_below(path, START_PAGES, ":strips")
    assert min(seq for page in found.values() for seq, _ in page) == 100
    for seq in (100, 101):
        assert as_set(visible(found, seq)) == as_set(edges_of(log.until(seq=seq)))


def test_trees_that_never_rewire_just_grow(tmp_path: Path) -> None:
    """Both trees of a bidirectional planner are drawn row by row, and their link once."""
    path = tmp_path / "run.rrd"
    log = drawn(path, scenario("bi-rrt"))
    for number, name in enumerate(("start", "goal")):
        assert as_set(items_of(path, f"/world/tree/{name}", ":strips")) == as_set(
            edges_of(log, number)
        )
    assert not rows_below(path, "/world/tree/start_pages", "")
    (link,), trees = log[Kind.CONNECT], forest(log)
    ((at, (line,)),) = rows_of(path, "/world/link", ":strips")
    assert at == link["seq"]
    ends = trees[0].q[link["node"]], trees[1].q[link["other"]]
    assert np.array_equal(line, np.array(ends, np.float32))


def test_rewired_edges_are_drawn(tmp_path: Path) -> None:
    """Each rewired edge is drawn at its time."""
    path = tmp_path / "run.rrd"
    log = drawn(path, scenario("rrt-star"))
    rewires, q = log[Kind.REWIRE], log[Kind.EDGE]["q"]
    assert len(rewires) < decimate.IN_FULL
    wanted = np.stack([q[rewires["parent"]], q[rewires["node"]]], axis=1)
    lines = items_of(path, "/world/rewired/start", ":strips")
    assert np.array_equal(lines, wanted.astype(np.float32))
