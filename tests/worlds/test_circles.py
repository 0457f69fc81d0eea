"""OMPL's circle files, and blocks that reach outside their boundary."""

from functools import partial
from pathlib import Path

import pytest

from brrt.worlds import load_world, make_world
from tests.support.world_files import CIRCLES, QUERIES, REAL, refused


def test_circles(tmp_path: Path) -> None:
    """The bounds are those of the circles plus the margin."""
    path = tmp_path / "c.txt"
    path.write_text(CIRCLES.replace("\n", "\r\n"))
    world = load_world(path)
    assert world.balls.tolist() == [[5, 5, 2], [0, 1, 1]]
    assert (world.lower.tolist(), world.upper.tolist()) == ([-1, 0], [7, 7])
    assert make_world(f"{path}:margin=0.5").upper.tolist() == [7.5, 7.5]
    assert (world.start, world.goal, world.notes) == (None, None, ())


def test_queries(tmp_path: Path) -> None:
    """Queries are chosen by number; their circles are in the same folder or where the user says."""
    (tmp_path / "circle_obstacles.txt").write_text(CIRCLES)
    (tmp_path / "other.txt").write_text("units: meter\nx y r\n1 0 0 9\n")
    path = tmp_path / "circle_queries.txt"
    path.write_text(QUERIES)
    for spec, goal in (("", [1, 3]), ("#0", [1, 3]), ("#7", [1, 5])):
        world = make_world(f"{path}{spec}")
        assert world.goal is not None
        assert world.goal.tolist() == goal
        assert bool(world.notes) == (not spec)
    assert load_world(path).notes == (f"{path}: query 0 of 2; choose one as {path}#7",)
    assert make_world(f"{path}:obstacles=other.txt#0").balls.tolist() == [[0, 0, 9]]
    for spec, message in {
        "#3": ": no query 3; there are 2",
        "#x": "#x: a query must be a whole number from 0",
        ":obstacles=none.txt": f": {tmp_path / 'none.txt'}: No such file or directory",
    }.items():
        assert refused(partial(make_world, f"{path}{spec}")).startswith(f"{path}{message}")
    path.write_text("0 start: 1 2\n0 goal: 70 2\n")
    assert refused(lambda: load_world(path)) == (
        f"{path}: the goal 70, 2 is outside the bounds of the circles; give {path}:margin=63"
    )
    assert make_world(f"{path}:margin=63").goal is not None
    path.rename(tmp_path / "queries_of_no_circles.txt")
    assert "queries_of_no_circles.txt:obstacles=PATH" in refused(
        lambda: load_world(tmp_path / "queries_of_no_circles.txt")
    )


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("3 1 2", "3 words; there must be 4: number, x, y, radius"),
        ("3 1 2 3 4", "5 words; there must be 4"),
        ("3 1 two 3", "'3 1 two 3' is not all numbers"),
        ("3 1 nan 3", "a number is not finite"),
        ("3 1 1e101 3", "a number is beyond 1e+100"),
        ("3 1 2 -1", "the radius must be at least 0, not -1"),
        ("x y r", "3 words; there must be 4"),
    ],
)
def test_wrong_circles(line: str, message: str, tmp_path: Path) -> None:
    """The error is one line with file and line number."""
    path = tmp_path / "c.txt"
    path.write_text(f"{CIRCLES}{line}\n")
    assert refused(lambda: load_world(path)).startswith(f"{path}:5: {message}")
    path.write_text("units: meter\n")
    assert refused(lambda: load_world(path)).startswith(f"{path}: no circles; each is a line of")
    path.write_text("units: meter\n1 2 3 0\n")
    assert refused(lambda: load_world(path)).startswith(
        f"{path}: the bounds of the circles have no area; give"
    )


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("8 start: 1", ":5: a line must read 'NUMBER start: X Y' or 'NUMBER goal: X Y'"),
        ("8 begin: 1 2", ":5: a line must read"),
        ("eight start: 1 2", ":5: a query must be a whole number"),
        ("7 start: 1 2", ":5: a second start of query 7"),
        ("8 start: 1 inf", ":5: a number is not finite"),
        ("8 start: 1 2", ": no query 8; it has only a start"),
    ],
)
def test_wrong_queries(line: str, message: str, tmp_path: Path) -> None:
    """The error is one line with file and line number."""
    (tmp_path / "obstacles.txt").write_text(CIRCLES)
    path = tmp_path / "queries.txt"
    path.write_text(f"{QUERIES}{line}\n")
    query = "7" if line.startswith("7") else "8"
    assert refused(lambda: make_world(f"{path}#{query}")).startswith(f"{path}{message}")


@pytest.mark.skipif(not REAL.exists(), reason="no real worlds here")
def test_real_queries() -> None:
    """All 100 queries are within the bounds and touch no circle."""
    for i in range(100):
        world = make_world(f"{REAL}/ompl_circles/circle_queries.txt#{i}")
        assert world.balls.shape == (70, 3)
        for end in (world.start, world.goal):
            assert end is not None
            assert world.inside(end)
            assert world.obstacle_at(end) is None


def test_blocks_outside_are_named(tmp_path: Path) -> None:
    """Blocks outside the boundary are obstacles too; ten have notes, the others are counted."""
    path = tmp_path / "b.txt"
    path.write_text(
        "boundary 0 0 0 9 9 9\n# walls\nblock 1 1 1 9 9 9\nblock 8 1 1 9.5 2 2\n\n"
        "block 1 -2 1 2 1 12\nblock 20 1 20 21 2 21\n"
    )
    world = load_world(path)
    assert len(world.boxes) == 4
    assert world.notes == (
        f"{path}: block in line 4 reaches outside the boundary by 0.5 in x",
        f"{path}: block in line 6 reaches outside the boundary by 2 in y and 3 in z",
        f"{path}: block in line 7 is entirely outside the boundary by 12 in x and 12 in z",
    )
    path.write_text("boundary 0 0 0 1 1 1\n" + "block 0 0 0 2 1 1\n" * 15)
    assert len(load_world(path).notes) == 11
    assert load_world(path).notes[-1] == f"{path}: 5 more blocks reach outside the boundary"


def test_rows_alone_are_circles(tmp_path: Path) -> None:
    """Unit and header are optional."""
    path = tmp_path / "hand.txt"
    path.write_text("1 5 5 1\n2 10 -1e1 2.5\n")
    assert load_world(path).balls.tolist() == [[5, 5, 1], [10, -10, 2.5]]
