"""Worlds and their files: round trips, geometry and errors."""

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from brrt.errors import BrrtError
from brrt.worlds import GENERATORS, World, load_world, make_world
from brrt.worlds.arrays import LEAST

Floats = NDArray[np.float64]

MAPS = Path(__file__).parents[3] / "shared" / "worlds" / "ece276b"
EVERY = pytest.mark.parametrize("name", list(GENERATORS))


def assert_same(one: World, other: World) -> None:
    """Assert that two worlds are equal bit by bit, except for the name."""
    for field in ("lower", "upper", "balls", "boxes", "start", "goal"):
        a, b = getattr(one, field), getattr(other, field)
        if a is None or b is None:
            assert a is b, field
        else:
            assert a.shape == b.shape, field
            assert a.tobytes() == b.tobytes(), field
    for a, b in zip(one.polygons, other.polygons, strict=True):
        assert a.tobytes() == b.tobytes()


def refused(action: Callable[[], object]) -> str:
    """Return the message of the BrrtError that an action raises; it must be one line."""
    with pytest.raises(BrrtError) as error:
        action()
    assert "\n" not in str(error.value)
    return str(error.value)


# World and JSON


@st.composite
def worlds(draw: st.DrawFn) -> World:
    """Draw any valid world."""
    dim = draw(st.sampled_from([2, 3]))
    number = st.floats(-1e99, 1e99)
    point = st.lists(number, min_size=dim, max_size=dim)
    ball = st.tuples(point, st.just(0.0) | st.floats(LEAST, 1e100)).map(lambda it: [*it[0], it[1]])
    box = st.tuples(point, point).map(lambda it: np.sort(it, axis=0).ravel())
    low, high = np.sort([draw(point), draw(point)], axis=0)
    high = np.maximum(high, np.nextafter(low + 2 * LEAST, np.inf))
    start, goal = (draw(st.none() | point.map(np.array)) for _ in range(2))
    balls, boxes = draw(st.lists(ball, max_size=3)), draw(st.lists(box, max_size=3))
    return World("w", low, high, np.array(balls), np.array(boxes), start, goal)


@given(worlds())
def test_json_round_trip(world: World) -> None:
    """from_json reads back what to_json wrote, to the last bit."""
    again = World.from_json(world.to_json())
    assert_same(world, again)
    assert again.name == world.name
    assert again.to_json() == world.to_json()


@EVERY
def test_file_round_trip(name: str, tmp_path: Path) -> None:
    """A generated world that was saved is loaded bit by bit, under the name of its file."""
    path = tmp_path / "it.json"
    world = make_world(name)
    world.save(path)
    assert_same(world, load_world(path))
    assert_same(world, make_world(str(path)))
    assert load_world(path).name == str(path)


GOOD: dict[str, Any] = {
    "schema": "brrt.world", "version": 1, "name": "good",
    "lower": [0, 0], "upper": [4, 3],
    "balls": [[1, 1, 0.5]], "boxes": [[2, 0, 3, 1]], "start": [0, 0], "goal": [4, 3],
}  # fmt: skip


def test_good_json() -> None:
    """The base of the wrong files below is valid, and so is a minimal one."""
    world = World.from_json(json.dumps(GOOD))
    assert world.boxes.tolist() == [[2, 0, 3, 1]]
    assert world.balls.tolist() == [[1, 1, 0.5]]
    bare = World.from_json(
        json.dumps({key: GOOD[key] for key in ("schema", "version", "lower", "upper")})
    )
    assert bare.start is None
    assert bare.goal is None
    assert bare.balls.shape == (0, 3)
    assert bare.boxes.shape == (0, 4)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"schema": "other"}, 'the field "schema" must be "brrt.world"'),
        ({"schema": None}, 'the field "schema" must be "brrt.world"'),
        ({"version": 4}, "world version 4 is not 1, 2 or 3; update brrt"),
        ({"version": None}, "world version None is not 1, 2 or 3"),
        ({"lower": ...}, 'the field "lower" is missing'),
        ({"upper": ...}, 'the field "upper" is missing'),
        ({"lower": [0]}, "bounds must have 2 or 3 coordinates"),
        ({"lower": [0, 0, 0]}, "bounds must have 2 or 3 coordinates"),
        ({"lower": [0, 0, 0, 0], "upper": [1, 1, 1, 1]}, "bounds must have 2 or 3 coordinates"),
        ({"lower": [5, 0]}, "each upper bound must be above its lower bound"),
        ({"lower": [4, 0]}, "each upper bound must be above its lower bound"),
        ({"lower": ["a", "b"]}, "lower must be"),
        ({"lower": [[0], [0, 1]]}, "lower"),
        ({"lower": None}, "world: "),
        ({"lower": {"x": 1}}, "world: "),
        ({"upper": [1e200, 1]}, "upper"),
        ({"balls": [[0, 0, 1e200]]}, "balls"),
        ({"upper": [1e999, 1]}, "upper must be finite numbers up to 1e+100"),
        ({"upper": [float("nan"), 1]}, "upper must be finite numbers up to 1e+100"),
        ({"upper": [10**400, 1]}, "upper"),
        ({"balls": [[1, 1]]}, "balls must be rows of 3 numbers"),
        ({"balls": [[1, 2], [3, 4], [5, 6]]}, "balls must be rows of 3 numbers"),
        ({"balls": [[1, 1, 1], [1, 1]]}, "balls must be rows of 3 numbers; row 1 is not"),
        ({"balls": [[1, 1, -0.5]]}, "balls[0]: the radius must be at least 0, not -0.5"),
        ({"balls": [[1, 1, float("inf")]]}, "balls must be finite numbers up to 1e+100"),
        ({"balls": "many"}, "balls must be rows of 3 numbers"),
        ({"balls": True}, "balls must be rows of 3 numbers"),
        ({"boxes": [[0, 0, 1]]}, "boxes must be rows of 4 numbers"),
        ({"boxes": [[0, 0, 0, 1, 1, 1], [2, 2, 2, 3, 3, 3]]}, "boxes must be rows of 4 numbers"),
        ({"boxes": [[3, 0, 2, 1]]}, "boxes[0] has a minimum above its maximum: 3, 0, 2, 1"),
        ({"boxes": [[0, 0, float("nan"), 1]]}, "boxes must be finite numbers up to 1e+100"),
        ({"boxes": {"a": 1}}, "boxes must be rows of 4 numbers"),
        ({"polygon": [[[0, 0], [1, 0]]]}, "unknown field of a world 'polygon'; did you mean"),
        ({"start": [1]}, "start must be"),
        ({"start": []}, "start must be"),
        ({"start": [1, 1, 2, 2]}, "start must be"),
        ({"goal": [1, "x"]}, "goal must be"),
        ({"goal": [1, float("nan")]}, "goal must be finite numbers up to 1e+100"),
    ],
)
def test_wrong_json(changes: dict[str, Any], message: str, tmp_path: Path) -> None:
    """Each error names the field, and the file if there is one."""
    data = {key: value for key, value in (GOOD | changes).items() if value is not ...}
    text = json.dumps(data)
    assert message in refused(lambda: World.from_json(text))
    path = tmp_path / "wrong.json"
    path.write_text(text)
    assert refused(lambda: load_world(path)).startswith(f"{path}: ")


@pytest.mark.parametrize(
    "text", ["", "{", "[]", "7", "null", '"text"', "[" * 100_000, "\x00", "{}", "nan"]
)
def test_no_json_world(text: str) -> None:
    """Texts that are not JSON or not a world are refused."""
    assert re.search(
        "not a (JSON|brrt) world|not a whole brrt world", refused(lambda: World.from_json(text))
    )


json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: (
        st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=3), inner, max_size=2)
    ),
    max_leaves=8,
)


@settings(max_examples=200)
@given(st.sampled_from(["lower", "upper", "balls", "boxes", "start", "goal", "name"]), json_values)
def test_any_json_value_is_read_or_refused(field: str, value: Any) -> None:
    """Any value of a field gives a world or a BrrtError."""
    try:
        world = World.from_json(json.dumps(GOOD | {field: value}))
    except BrrtError:
        return
    assert_same(world, World.from_json(world.to_json()))


def test_closed_obstacles() -> None:
    """A point on the border of an obstacle touches it, one on the bounds is inside."""
    world = World("w", np.zeros(2), np.full(2, 9.0), [[5.0, 5.0, 2.0]], [[1.0, 1.0, 2.0, 2.0]])  # type: ignore[arg-type]
    assert "box 0" in str(world.obstacle_at([2, 2]))
    assert "box 0" in str(world.obstacle_at([1, 1.5]))
    assert "ball 0" in str(world.obstacle_at([5, 7]))
    assert "ball 0" in str(world.obstacle_at([5, 5]))
    assert world.obstacle_at([2.0000001, 2]) is None
    assert world.obstacle_at([5, 7.0000001]) is None
    assert world.inside([0, 9])
    assert not world.inside([0, 9.0000001])
    assert world.extent == 9


# Blocks


def blocks(text: str, tmp_path: Path) -> World:
    """Load a text as a map of blocks."""
    path = tmp_path / "map.txt"
    path.write_bytes(text.encode())
    return load_world(path)


def test_blocks(tmp_path: Path) -> None:
    """Comments, blank lines, tabs, colours or none, capitals, CRLF, blocks outside."""
    text = (
        "# a map\n\n"
        "boundary 0 0 0 10 20 30 120 120 120\n"
        "  block\t1 1 1\t2 2 2 # six\n"
        "\t\n"
        "BLOCK -1.5 0 0 3e0 +4 5.25 1 2 3\n"
        "#block 0 0 0 1 1 1\n"
        "block 5 5 5 5 6 7\n"
    )
    world = blocks(text, tmp_path)
    assert world.lower.tolist() == [0, 0, 0]
    assert world.upper.tolist() == [10, 20, 30]
    assert world.boxes.tolist() == [
        [1, 1, 1, 2, 2, 2],
        [-1.5, 0, 0, 3, 4, 5.25],
        [5, 5, 5, 5, 6, 7],
    ]
    assert (world.start, world.goal) == (None, None)
    assert_same(world, blocks(text.replace("\n", "\r\n"), tmp_path))
    assert_same(world, blocks(text.rstrip("\n"), tmp_path))


def test_the_boundary_may_come_last_and_blocks_may_be_missing(tmp_path: Path) -> None:
    """Order does not matter, and a map may be empty."""
    assert len(blocks("block 1 1 1 2 2 2\nboundary 0 0 0 9 9 9", tmp_path).boxes) == 1
    assert len(blocks("boundary 0 0 0 9 9 9", tmp_path).boxes) == 0


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("wall 0 0 0 1 1 1", "unknown keyword 'wall'; a line begins with 'boundary' or 'block'"),
        ("0 0 0 1 1 1", "unknown keyword '0'"),
        ("block", "0 numbers; there must be 6"),
        ("block 1 2 3 4 5", "5 numbers; there must be 6"),
        ("block 1 2 3 4 5 6 7", "7 numbers; there must be 6"),
        ("block 1 2 3 4 5 6 7 8", "8 numbers; there must be 6"),
        ("block 1 2 3 4 5 6 7 8 9 10", "10 numbers; there must be 6"),
        ("block 1 2 3 4 5 # 6", "5 numbers; there must be 6"),
        ("block 0 0 0 1 one 1", "is not all numbers"),
        ("block 0,0,0,1,1,1", "1 numbers; there must be 6"),
        ("block 0 0 0 1 1 1 red green blue", "is not all numbers"),
        ("block 0 0 0 1 nan 1", "a number is not finite"),
        ("block 0 0 0 1 1 1e999", "a number is not finite"),
        ("block 2 0 0 1 1 1", "xmin 2 is above xmax 1"),
        ("block 0 2 0 1 1 1", "ymin 2 is above ymax 1"),
        ("block 0 0 2 1 1 1", "zmin 2 is above zmax 1"),
        ("boundary 0 0 0 1 1 1", "a second boundary; a map has one"),
    ],
)
def test_wrong_blocks_name_file_and_line(line: str, message: str, tmp_path: Path) -> None:
    """Each error of a line begins with file:line."""
    error = refused(lambda: blocks(f"# map\nboundary 0 0 0 9 9 9\r\n\n{line}\n", tmp_path))
    assert error.startswith(f"{tmp_path / 'map.txt'}:4: ")
    assert message in error


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "no 'boundary' line; a map has one"),
        ("# nothing\n", "no 'boundary' line"),
        ("block 0 0 0 1 1 1\n", "no 'boundary' line"),
        ("boundary 0 0 0 1 1 0\n", "the boundary has no volume"),
    ],
)
def test_maps_that_lack_something(text: str, message: str, tmp_path: Path) -> None:
    """Errors without a line name the file."""
    error = refused(lambda: blocks(text, tmp_path))
    assert error.startswith(f"{tmp_path / 'map.txt'}:")
    assert message in error


# Files


@pytest.mark.parametrize("name", ["none.json", "none.txt", "deep/er/none.txt"])
def test_missing_file(name: str, tmp_path: Path) -> None:
    """The error names a missing file."""
    path = tmp_path / name
    assert refused(lambda: make_world(str(path))).startswith(f"{path}: No such file")


@pytest.mark.parametrize("name", ["map.txt", "map.json"])
def test_binary_file(name: str, tmp_path: Path) -> None:
    """Binary files are refused."""
    path = tmp_path / name
    path.write_bytes(bytes(range(256)))
    assert refused(lambda: load_world(path)) == f"{path}: not a text file"


@pytest.mark.parametrize("name", ["map.zip", "map", "map.TXT.gz"])
def test_foreign_file(name: str, tmp_path: Path) -> None:
    """A file of an unknown format is refused; the message lists the suffixes."""
    path = tmp_path / name
    path.write_text("wall 0 0 0 1 1 1")
    error = refused(lambda: make_world(str(path)))
    assert error.startswith(f"{path}: unknown format; brrt loads worlds from .json, .txt, .map, ")


@pytest.mark.parametrize("name", ["folder.txt", "folder.json"])
def test_a_folder_is_no_world(name: str, tmp_path: Path) -> None:
    """A folder with the name of a world is refused."""
    (tmp_path / name).mkdir()
    assert refused(lambda: make_world(str(tmp_path / name))).startswith(str(tmp_path / name))


@pytest.mark.skipif(not MAPS.exists(), reason="no course maps here")
@pytest.mark.parametrize(
    ("name", "count", "upper"),
    [
        ("single_cube", 1, None),
        ("maze", 20, [15, 15, 6]),
        ("monza", 3, [4.3, 20, 5]),
        ("flappy_bird", None, None),
        ("window", None, None),
        ("tower", None, [5, 5, 20]),
        ("room", None, None),
    ],
)
def test_real_maps(name: str, count: int | None, upper: list[float] | None) -> None:
    """The course maps load with all their blocks, and their queries are free."""
    path = MAPS / f"{name}.txt"
    world = load_world(path)
    lines = re.findall(r"(?m)^\s*block\b", path.read_text())
    assert len(world.boxes) == len(lines)
    assert count is None or count == len(lines)
    assert upper is None or world.upper.tolist() == upper
    for end in json.loads((MAPS / "queries.json").read_text())["queries"][name]:
        assert world.inside(end)
        assert world.obstacle_at(end) is None
    assert_same(world, World.from_json(world.to_json()))


# Polygons


def polygon_world(*polygons: object) -> World:
    """A square world with polygons."""
    return World("w", np.zeros(2), np.full(2, 9.0), polygons=polygons)  # type: ignore[arg-type]


def test_polygons_are_brought_in_order() -> None:
    """Polygons become counter-clockwise, without repeated or collinear vertices."""
    world = polygon_world(
        [[1, 1], [1, 3], [2, 3], [3, 3], [3, 3], [3, 1]], [[5, 5], [6, 5]], [[5, 5], [6, 5], [5, 5]]
    )
    square, line, same_line = world.polygons
    assert len(square) == 4
    assert {tuple(p) for p in square.tolist()} == {(1, 1), (3, 1), (3, 3), (1, 3)}
    after = np.roll(square, -1, axis=0)
    assert (square[:, 0] * after[:, 1] - square[:, 1] * after[:, 0]).sum() > 0
    assert line.tolist() == same_line.tolist()[::-1] or line.tolist() == same_line.tolist()
    assert_same(world, World.from_json(world.to_json()))


@pytest.mark.parametrize(
    ("polygon", "message"),
    [
        ([[0, 0]], "polygons[0] must be 2 or more vertices"),
        ([[0, 0, 0], [1, 0, 0]], "each a pair of numbers"),
        ([[0, 0], [0, 0]], "2 or more different vertices"),
        ([[0, 0], [4, 0], [1, 1], [0, 4]], "is not convex at (1, 1); split it"),
        ([[0, 0], [2, 2], [2, 0], [0, 2]], "is not convex"),
        ([[0, 3], [2, -3], [-3, 1], [3, 1], [-2, -3]], "is not convex"),
        ([[0, 0], [1, 1], [2, 2]], "has no area; give a line segment"),
        ([[0, 0], [1, float("nan")]], "finite numbers"),
        ([[0, 0], [1, 1e101]], "up to 1e+100"),
        ("line", "must be 2 or more vertices"),
        (
            [[i, i * i] for i in range(30_001)],
            "polygons[0] has 30,001 vertices, and may have at most 30,000; leave some out",
        ),
    ],
)
def test_bad_polygons(polygon: object, message: str) -> None:
    """The error is one line that names the polygon and the remedy."""
    assert message in refused(lambda: polygon_world(polygon))


def test_polygons_are_for_the_plane() -> None:
    """A 3D world cannot have polygons."""
    corner = [[0, 0], [1, 0], [0, 1]]
    flat, cube = (np.zeros(2), np.ones(2)), (np.zeros(3), np.ones(3))
    why = refused(lambda: World("w", *cube, polygons=(np.array(corner),)))
    assert "polygons are for 2D worlds; this one is 3D" in why
    why = refused(lambda: World("w", *flat, polygons=3))  # type: ignore[arg-type]
    assert "polygons must be a list" in why


def test_closed_polygons() -> None:
    """A point on an edge, a corner or a line segment touches it."""
    world = polygon_world([[1, 1], [3, 1], [1, 3]], [[5, 5], [7, 7]])
    for p in ([1, 1], [2, 2], [2, 1], [1.2, 1.2]):
        assert "polygon 0" in str(world.obstacle_at(p))
    for p in ([5, 5], [6, 6], [7, 7]):
        assert "polygon 1" in str(world.obstacle_at(p))
    for p in ([2.01, 2.01], [0.99, 1], [4.99, 4.99], [7.01, 7.01], [6, 6.01]):
        assert world.obstacle_at(p) is None


def test_a_body_touches_obstacles_of_every_kind() -> None:
    """`obstacle_touching` names what a square touches."""
    square = np.array([[4.0, 4.0], [5.0, 4.0], [5.0, 5.0], [4.0, 5.0]])
    for gap, touches in ((0.0, True), (1e-6, False)):
        ball = World("w", np.zeros(2), np.full(2, 9.0), [[5 + gap + 0.6, 5.8, 1.0]])  # type: ignore[arg-type]
        box = World("w", np.zeros(2), np.full(2, 9.0), boxes=[[5 + gap, 0.0, 6.0, 4.5]])  # type: ignore[arg-type]
        line = polygon_world([[5 + gap, 0], [5 + gap, 9]])
        assert (ball.obstacle_touching(square) is not None) == touches
        assert (box.obstacle_touching(square) is not None) == touches
        assert (line.obstacle_touching(square) is not None) == touches
