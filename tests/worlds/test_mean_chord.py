"""The mean length of lines in free space."""

from dataclasses import replace
from itertools import groupby

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from brrt import World, make_world
from brrt.worlds.mean_chord import mean_chord
from brrt.worlds.occupancy import Grid


def lengths(cells: np.ndarray) -> list[int]:
    """Lengths of the runs of free cells in all rows."""
    return [len(list(run)) for row in cells.tolist() for full, run in groupby(row) if not full]


@given(arrays(bool, array_shapes(min_dims=2, max_dims=2, max_side=8)), st.floats(0.01, 10))
def test_runs_of_a_grid(cells: np.ndarray, side: float) -> None:
    """The harmonic mean over the axes of the mean length of the runs of free cells."""
    world = World.of_grid("grid", Grid(cells, np.zeros(2), side))
    if cells.all():
        assert mean_chord(world) == world.extent
        return
    means = [np.mean(lengths(each)) for each in (cells, cells.T)]
    assert mean_chord(world) == pytest.approx(2 * side / sum(1 / mean for mean in means))


@pytest.mark.parametrize("factor", [1e-6, 1, 1e6])
def test_it_scales_with_the_world(factor: float) -> None:
    """It does not depend on the unit of length."""
    world = make_world("circles2d:n=200,seed=1")
    scaled = World("scaled", factor * world.lower, factor * world.upper, balls=factor * world.balls)
    assert mean_chord(scaled) == pytest.approx(factor * mean_chord(world), rel=0.01)
    assert 3 < mean_chord(world) < 10


def test_other_obstacles_and_no_free_cell() -> None:
    """A grid and other obstacles count together; a world that is full has its longest side."""
    grid = Grid(np.zeros((10, 10), bool), np.zeros(2), 1.0)
    open_, half = World.of_grid("grid", grid), np.array([[5.0, 0.0, 10.0, 10.0]])
    assert mean_chord(open_) == 10
    assert mean_chord(replace(open_, boxes=half)) == pytest.approx(2 / (1 / 5 + 1 / 10), rel=0.02)
    assert mean_chord(replace(open_, boxes=np.array([[0.0, 0.0, 10.0, 10.0]]))) == 10
    assert mean_chord(make_world("empty3d")) == 100
