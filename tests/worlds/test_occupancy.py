"""Occupancy grids: covered points, rectangles, JSON, and segments between cells."""

import base64
import json
import zlib
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from brrt import Grid, Problem, World, make_robot
from brrt.errors import BrrtError
from brrt.kernels.broad_phase import ObstacleGrid, build_obstacle_grid, segment_hits
from brrt.kernels.jit import kernel
from brrt.worlds import load_world
from tests.conftest import Result
from tests.support import naive

Floats = NDArray[np.float64]

MANY = settings(max_examples=100, deadline=None)


@kernel
def _hits(obstacles: ObstacleGrid, A: Floats, B: Floats, out: NDArray[np.bool_]) -> None:
    """Whether each segment from A[i] to B[i] touches an obstacle."""
    for i in range(len(A)):
        out[i] = segment_hits(obstacles, A, i, B, i)


def hits(world: World, A: Floats, B: Floats) -> NDArray[np.bool_]:
    """Test segments, shape (n, 2) each, with the kernel."""
    out = np.zeros(len(A), bool)
    _hits(build_obstacle_grid(world), A, B, out)
    return out


@st.composite
def tables(draw: st.DrawFn, most: int = 12) -> NDArray[np.bool_]:
    """Draw grids from one to a few dozen cells, from empty to full."""
    rows, columns = draw(st.integers(1, most)), draw(st.integers(1, most))
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    return rng.random((rows, columns)) < draw(st.sampled_from([0.0, 0.05, 0.3, 0.7, 1.0]))


@MANY
@given(tables(30))
def test_rectangles_are_the_blocked_cells(cells: NDArray[np.bool_]) -> None:
    """The rectangles cover exactly the blocked cells, each once."""
    painted = np.zeros(cells.shape, int)
    for x0, y0, x1, y1 in Grid(cells, np.zeros(2), 1.0).rectangles:
        painted[y0:y1, x0:x1] += 1
    assert (painted == cells).all()


def test_runs_of_rows_are_merged() -> None:
    """A block is one rectangle, a frame four."""
    block = Grid(np.ones((300, 200), bool), np.zeros(2), 1.0)
    assert block.rectangles.tolist() == [[0, 0, 200, 300]]
    frame = np.ones((5, 6), bool)
    frame[1:-1, 1:-1] = False
    assert len(Grid(frame, np.zeros(2), 1.0).rectangles) == 4


@MANY
@given(tables(), st.integers(0, 2**32))
def test_lattice_segments_agree_exactly(cells: NDArray[np.bool_], seed: int) -> None:
    """Segments between corners, edges and middles of cells: the kernel is exact."""
    rng = np.random.default_rng(seed)
    world = World.of_grid("cells", Grid(cells, np.array([3.0, -2.0]), 0.5))
    sides = 2 * np.array(cells.shape[::-1])
    A, B = (world.lower + rng.integers(0, sides + 1, (60, 2)) / 4 for _ in range(2))
    solid = world.without_grid()
    truth = [naive.hits(solid, a, b) for a, b in zip(A, B, strict=True)]
    assert hits(world, A, B).tolist() == truth
    assert hits(world, B, A).tolist() == truth


@MANY
@given(
    tables(25),
    st.integers(0, 2**32),
    st.sampled_from([0.05, 1.0, 1e-6, 1e6]),
    st.sampled_from([0.0, 1e3, -5e6]),
)
def test_any_segments(cells: NDArray[np.bool_], seed: int, unit: float, offset: float) -> None:
    """The kernel misses no contact, and hits only contacts up to rounding."""
    rng = np.random.default_rng(seed)
    world = World.of_grid("cells", Grid(cells, np.array([offset, -offset]) * unit, unit))
    A = rng.uniform(world.lower, world.upper, (40, 2))
    B = np.clip(A + rng.normal(size=(40, 2)) * world.extent * 0.3, world.lower, world.upper)
    solid = world.without_grid()
    for a, b, said in zip(A, B, hits(world, A, B), strict=True):
        truth = naive.hits(solid, a, b)
        assert said or not truth, (a.tolist(), b.tolist())
        assert truth or not said or naive.nearly_hits(solid, a, b), (a.tolist(), b.tolist())


def test_long_free_stretches_are_crossed_in_strides() -> None:
    """A single distant cell is found from every direction."""
    rng = np.random.default_rng(0)
    for _ in range(30):
        cells = np.zeros((200, 300), bool)
        row, column = rng.integers(0, 200), rng.integers(0, 300)
        cells[row, column] = True
        world = World.of_grid("cells", Grid(cells, np.zeros(2), 1.0))
        through = np.array([column, row]) + rng.integers(0, 2, (100, 2))
        A = rng.uniform(0, [300, 200], (100, 2))
        A, B = np.round(A), np.round(through + (through - np.round(A)))
        inside = (B >= 0).all(axis=1) & (B <= [300, 200]).all(axis=1)
        assert hits(world, A[inside], B[inside]).all()
        clear = np.array([[0.0, row - 0.5], [column - 0.5, 0.0]])
        kept = (clear > -0.1).all(axis=1)
        ends = np.array([[300.0, row - 0.5], [column - 0.5, 200.0]])
        assert not hits(world, clear[kept], ends[kept]).any()


@MANY
@given(tables(), st.integers(0, 2**32), st.floats(-4, 4), st.sampled_from([0.0, 4e6]))
def test_turned_grids(cells: NDArray[np.bool_], seed: int, yaw: float, offset: float) -> None:
    """The grid and its polygons give the same hits, except for grazing segments."""
    rng = np.random.default_rng(seed)
    grid = Grid(cells, np.array([offset, -offset]), 0.05, yaw)
    world = World.of_grid("turned", grid)
    solid = world.without_grid()
    assert solid.grid is None
    A, B = (rng.uniform(world.lower, world.upper, (100, 2)) for _ in range(2))
    assert (hits(world, A, B) == hits(solid, A, B)).mean() > 0.98
    assert (hits(world, A, A) == grid.covers(A)).mean() > 0.98
    for a in A[:20]:
        assert (world.obstacle_at(a) is None) == (not grid.covers(a[None])[0])
    inside = grid.to_world(rng.random((50, 2)) * grid.size)
    at = np.floor(grid.to_cells(inside)).astype(int).clip(0, np.array(cells.shape[::-1]) - 1)
    assert (grid.covers(inside) == cells[at[:, 1], at[:, 0]]).mean() > 0.98


def test_bounds_beyond_the_grid_are_blocked() -> None:
    """The outside of a map is blocked for points and bodies."""
    grid = Grid(np.zeros((4, 4), bool), np.array([1.0, 1.0]), 1.0)
    world = World("wide", np.zeros(2), np.full(2, 6.0), grid=grid)
    A = np.array([[2.0, 2.0], [0.5, 3.0], [2.0, 2.0], [3.0, 5.5]])
    B = np.array([[4.0, 4.0], [3.0, 3.0], [5.5, 4.0], [3.0, 5.5]])
    assert hits(world, A, B).tolist() == [False, True, True, True]
    assert hits(world.without_grid(), A, B).tolist() == [False, True, True, True]
    assert "blocked cells" in str(world.obstacle_at([0.5, 3.0]))
    body = make_robot("polygon:length=1,width=1")
    assert body.collision(world, np.array([3.0, 3.0, 0.0])) is None
    assert "blocked" in str(body.collision(world, np.array([1.2, 3.0, 0.0])))


def test_bodies_among_cells() -> None:
    """A body collides with cells as with equal boxes."""
    rng = np.random.default_rng(5)
    cells = rng.random((30, 30)) < 0.05
    for yaw in (0.0, 0.3):
        world = World.of_grid("cells", Grid(cells, np.zeros(2), 1.0, yaw))
        body, solid = make_robot("polygon:length=2,width=0.5"), world.without_grid()
        free = []
        for _ in range(300):
            q = rng.uniform([*world.lower, -3], [*world.upper, 3])
            said, same = body.collision(world, q), body.collision(solid, q)
            assert (said is None) == (same is None)
            free += [q] if said is None else []
        assert len(free) > 20
        assert Problem(world, body, free[0], free[1]).dof == 3


def test_json_round_trip() -> None:
    """Cells, origin and yaw are read back to the last bit; the version is 2."""
    rng = np.random.default_rng(1)
    for shape in ((1, 1), (3, 5), (64, 9)):
        grid = Grid(rng.random(shape) < 0.4, rng.normal(size=2), 0.05, 0.3)
        world = World.of_grid("grid", grid, start=grid.corners[0])
        text = world.to_json()
        again = World.from_json(text)
        assert again.grid is not None
        assert (again.grid.cells == grid.cells).all()
        assert again.grid.origin.tolist() == grid.origin.tolist()
        assert (again.grid.resolution, again.grid.yaw) == (0.05, 0.3)
        assert json.loads(text)["version"] == 2
        assert again.to_json() == text


def bits(count: int) -> str:
    """Return cells as they are stored in JSON."""
    return base64.b64encode(zlib.compress(bytes(count))).decode()


GOOD = {
    "rows": 4, "columns": 4, "origin": [0, 0], "resolution": 1, "yaw": 0, "cells": bits(2),
}  # fmt: skip


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"rows": 0}, "rows must be a whole number above 0"),
        ({"rows": 2.5}, "rows must be a whole number above 0"),
        ({"rows": True}, "rows must be a whole number above 0"),
        ({"rows": 10**6, "columns": 10**6}, "are more than"),
        ({"rows": 5}, "a bit for each of rows x columns"),
        ({"cells": bits(3)}, "a bit for each of rows x columns"),
        ({"cells": bits(10**8)}, "a bit for each of rows x columns"),
        ({"cells": "%"}, "deflated bits"),
        ({"cells": "AAAA"}, "deflated bits"),
        ({"cells": 7}, "deflated bits"),
        ({"origin": [0]}, "origin must be 2 finite numbers"),
        ({"origin": "here"}, "origin must be 2 finite numbers"),
        ({"origin": [0, float("nan")]}, "origin must be finite numbers"),
        ({"resolution": 0}, "resolution must be above 0, not 0"),
        ({"resolution": -1}, "resolution must be above 0, not -1"),
        ({"resolution": [1]}, "resolution must be a finite number"),
        ({"resolution": 1e100}, "corners must be"),
        ({"yaw": None}, "yaw must be a finite number"),
        ({"yaw": float("inf")}, "yaw must be a finite number"),
        ({"extra": 1}, "with the fields rows, columns"),
    ],
)
def test_wrong_grids(changes: dict[str, Any], message: str) -> None:
    """Each error names what is wrong."""
    data = {"schema": "brrt.world", "version": 2, "lower": [0, 0], "upper": [4, 4]}
    assert World.from_json(json.dumps(data | {"grid": GOOD})).grid is not None
    with pytest.raises(BrrtError, match=message):
        World.from_json(json.dumps(data | {"grid": GOOD | changes}))


def test_wrong_cells() -> None:
    """Cells must be a 2D array of truth values, and the world 2D."""
    tables: list[Any] = [np.zeros(3), np.zeros((2, 0)), np.full((2, 2), 7), np.array([["a"]])]
    for cells in tables:
        with pytest.raises(BrrtError, match="cell"):
            Grid(cells, np.zeros(2), 1.0)
    with pytest.raises(BrrtError, match="grids are for 2D worlds"):
        World("w", np.zeros(3), np.ones(3), grid=Grid(np.zeros((2, 2), bool), np.zeros(2), 1.0))


def test_touching_is_exact_in_thirds() -> None:
    """A diagonal between two blocked cells that share a corner is blocked."""
    cells = np.array([[0, 1], [1, 0]], bool)
    world = World.of_grid("corner", Grid(cells, np.zeros(2), float(Fraction(1, 3))))
    third = 1 / 3
    A, B = np.array([[0.0, 0.0]]), np.array([[2 * third, 2 * third]])
    assert hits(world, A, B).all()
    assert not hits(world, A, B * 0.49).any()


def test_pictures_stand_as_the_file_does(tmp_path: Path, brrt: Callable[..., Result]) -> None:
    """A grid map's first line is drawn at the top, also after the world is saved."""
    (tmp_path / "m.map").write_text("type octile\nheight 2\nwidth 4\nmap\n@@@@\n....\n")
    brrt("worlds", "make", "m.map", "--out", "m.json")
    for name in ("m.map", "m.json"):
        assert load_world(name).y_down
        lines = brrt("worlds", "show", name).out.splitlines()
        assert "█" in lines[1] or "#" in lines[1]
        frame = next(i for i, line in enumerate(lines[1:], 1) if line[0] in "└+")
        assert not lines[frame - 1].strip("│| ")
    with pytest.raises(BrrtError, match="y_down must be true or false"):
        World.from_json(load_world("m.json").to_json().replace('"y_down": true', '"y_down": 1'))
