"""Drawn cells are those that were expanded, in the colour of their cost or estimate."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from brrt import Kind, Run, Scenario
from brrt.views.colours import heat, packed
from brrt.views.rerun.layout import CELLS_ENTITY, SEARCH_ENTITY
from tests.support.drawings import drawn, items_of, rows_below, rows_of, scenario, visible


@pytest.mark.parametrize("planner", ["lrta-star", "a-star"])
def test_cells(planner: str, tmp_path: Path) -> None:
    """Each expanded cell is drawn, in the colour of its newest estimate."""
    path, given = tmp_path / "run.rrd", scenario(planner)
    log = drawn(path, given)
    expands = log[Kind.EXPAND]
    wanted = {tuple(q) for q in expands["q"].astype(np.float32).tolist()}
    if planner == "a-star":
        dots = items_of(path, CELLS_ENTITY, ":positions")
        assert len(dots) == len(expands)
        assert len(items_of(path, SEARCH_ENTITY, ":strips")) == len(expands)
    else:
        wanted |= {tuple(q) for q in log[Kind.HEURISTIC]["q"].astype(np.float32).tolist()}
        dots = visible(rows_below(path, "/world/cells/learnt/", ":positions"), len(log))
        assert len(dots) == len(wanted)
        colours = visible(rows_below(path, "/world/cells/learnt/", ":colors"), len(log))
        manifest = Run(given).manifest
        goal, start = np.array(manifest.goal), np.array(manifest.start)
        known = {tuple(e["q"].astype("f4")): np.hypot(*(e["q"] - goal)) for e in expands}
        known |= {tuple(e["q"].astype("f4")): e["h"] for e in log[Kind.HEURISTIC]}
        h = np.array([known[tuple(np.array(dot, "f4"))] for dot in dots])
        assert np.array_equal(colours, packed(heat(h / (h + np.hypot(*(goal - start))))))
    assert {tuple(dot) for dot in dots} == wanted


def test_search_in_3d(tmp_path: Path) -> None:
    """Each part of the world that was searched has one cell, so that one sees through them."""
    path, world = tmp_path / "run.rrd", "boxes3d:size=30,n=5,min_side=2,max_side=4,seed=2"
    log = drawn(path, Scenario(planner="a-star", world=world, params={"cell": 0.75}))
    dots = np.array(items_of(path, CELLS_ENTITY, ":positions"))
    cells = log[Kind.EXPAND]["q"]

    def parts(places: NDArray[Any]) -> list[tuple[int, ...]]:
        steps = (places.astype("f4") * (20 / np.full(3, 30.0))).astype(int)
        return list(map(tuple, np.minimum(steps, 19).tolist()))

    assert len(set(parts(dots))) == len(dots) < len(cells) / 3
    assert set(parts(dots)) == set(parts(cells))
    assert {tuple(dot) for dot in dots} <= {tuple(q) for q in cells.astype("f4").tolist()}
    assert not rows_of(path, SEARCH_ENTITY, ":strips")
