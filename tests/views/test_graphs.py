"""Drawn graphs have, at each instant, the links of the fold."""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import brrt
from brrt import Recorder, Recording, World, forest
from brrt.views.matplotlib.playback import Playback
from brrt.views.rerun.drawing import draw_run
from tests.support import graph_planners
from tests.support.drawings import as_set, rows_below, visible
from tests.support.files import part


def by_hand(rec: Recorder, _: World, _rng: np.random.Generator) -> None:
    """Grow a graph, cut links, remove nodes and link again, each in batches of its own."""
    nodes = [rec.vertex(q) for q in np.linspace((1.0, 1.0), (9.0, 2.0), 12)]
    rec.flush()
    for a, b in pairwise(nodes):
        rec.link(a, b)
        rec.flush()
    rec.cut(nodes[3], nodes[4])
    rec.flush()
    rec.remove(nodes[7])
    rec.flush()
    rec.link(nodes[4], nodes[3])
    rec.flush()


PLANNERS: dict[str, Any] = {
    "prm": graph_planners.prm, "lazy_prm": graph_planners.lazy_prm, "by hand": by_hand,
}  # fmt: skip


def recorded(planner: str, path: Path) -> Recording:
    """Record a planner in a world of circles."""
    world = brrt.make_world("circles2d:n=30,seed=4")
    rng = np.random.default_rng(3)
    with brrt.record(path, world=world, start=world.start, goal=world.goal, planner=planner) as rec:
        PLANNERS[planner](rec, world, rng)
    return brrt.read(path)


def links_at(recording: Recording, seq: int) -> Any:
    """Return the ends of the links after an event, shape (n, 2, 2)."""
    tree = forest(recording.events().until(seq=seq)).get(0)
    if tree is None:
        return np.empty((0, 2, 2))
    return tree.q[np.stack([tree.links["node"], tree.links["other"]], axis=1)]


def undirected(lines: Any) -> set[tuple[float, ...]]:
    """Return lines that are longer than a dot, each from its smaller end."""
    ends = np.sort(np.asarray(lines, np.float32).reshape(-1, 2, 2).view("f4,f4")[..., 0], axis=1)
    plain = ends.view(np.float32).reshape(-1, 2, 2)
    return as_set(plain[(plain[:, 0] != plain[:, 1]).any(axis=1)])


@pytest.mark.parametrize("planner", PLANNERS)
def test_links_of_a_graph(planner: str, tmp_path: Path) -> None:
    """In Rerun and in figures; what is cut is gone."""
    recording = recorded(planner, tmp_path / "run.mcap")
    log = recording.events()
    bounds = [*range(0, len(log), 1 + len(log) // 40), len(log)]
    batches = [part(log, *each) for each in pairwise(bounds)]
    draw_run(tmp_path / "run.rrd", replace(recording, batches=lambda: batches))
    pages = rows_below(tmp_path / "run.rrd", "/world/graph/", ":strips")
    playback = Playback(recording)
    instants = sorted({at for page in pages.values() for at, _ in page})
    assert len(instants) > 10
    for seq in [*instants[:: 1 + len(instants) // 40], len(log) - 1]:
        wanted = undirected(links_at(recording, seq))
        assert undirected(visible(pages, seq)) == wanted
        assert undirected(playback.links(0, seq)) == wanted
        tree = forest(log.until(seq=seq))[0]
        assert playback.nodes(seq) == len(tree) - len(tree.removed)
