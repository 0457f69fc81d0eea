"""Generators and files: what they promise, and what they refuse."""

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

Floats = NDArray[np.float64]

MAPS = Path(__file__).parents[2] / "shared" / "worlds" / "ece276b"
EVERY = pytest.mark.parametrize("name", list(GENERATORS))
BALLS, BOXES = ("circles2d", "spheres3d"), ("squares2d", "boxes2d", "boxes3d")
POLYGONS = ("polygons2d",)
ULPS = 1e-12
"""Sums of coordinates may round by this part of the map."""


def assert_same(one: World, other: World) -> None:
    """Two worlds are equal bit by bit, but for the name."""
    for field in ("lower", "upper", "balls", "boxes", "start", "goal"):
        a, b = getattr(one, field), getattr(other, field)
        if a is None or b is None:
            assert a is b, field
        else:
            assert a.shape == b.shape, field
            assert a.tobytes() == b.tobytes(), field
    for a, b in zip(one.polygons, other.polygons, strict=True):
        assert a.tobytes() == b.tobytes()


def corners(world: World) -> tuple[Floats, Floats]:
    """Least and greatest corner of each obstacle."""
    d, balls, boxes = world.dim, world.balls, world.boxes
    least, most = [balls[:, :d] - balls[:, d:], boxes[:, :d]], [balls[:, :d] + balls[:, d:]]
    most.append(boxes[:, d:])
    for polygon in world.polygons:
        least.append(polygon.min(axis=0, keepdims=True))
        most.append(polygon.max(axis=0, keepdims=True))
    return np.concatenate(least), np.concatenate(most)


def refused(action: Callable[[], object]) -> str:
    """The message of the BrrtError that an action raises: one line."""
    with pytest.raises(BrrtError) as error:
        action()
    assert "\n" not in str(error.value)
    return str(error.value)


# Generators


@EVERY
@settings(max_examples=25, deadline=None)
@given(st.integers(0, 300), st.integers(0, 2**70), st.sampled_from([1.0, 33.3, 100.0, 1e6, 1e-3]))
def test_obstacles_are_as_asked(name: str, n: int, seed: int, size: float) -> None:
    """As many as asked for, within the map, sizes in range, start and goal free."""
    world = make_world(f"{name}:n={n},seed={seed},size={size!r},{sizes(name, size)}")
    d = world.dim
    assert d == (3 if name.endswith("3d") else 2)
    counts = (len(world.balls), len(world.boxes), len(world.polygons))
    assert counts == tuple(n * (name in kind) for kind in (BALLS, BOXES, POLYGONS))
    assert (world.lower == 0).all()
    assert (world.upper == size).all()
    least, most = corners(world)
    assert (least >= -ULPS * size).all()
    assert (most <= size * (1 + ULPS)).all()
    if name in BALLS:
        radii = world.balls[:, d]
        assert ((0.01 * size <= radii) & (radii <= 0.08 * size)).all()
    elif name in BOXES:
        sides = world.boxes[:, d:] - world.boxes[:, :d]
        assert (sides >= 0.02 * size * (1 - 1e-9)).all()
        assert (sides <= 0.15 * size * (1 + 1e-9)).all()
        if name == "squares2d":
            np.testing.assert_allclose(sides[:, 0], sides[:, 1], atol=ULPS * size)
    else:
        assert all(3 <= len(polygon) <= 7 for polygon in world.polygons)
        assert (most - least <= 0.16 * size * (1 + 1e-9)).all()
    for part, end in ((0.05, world.start), (0.95, world.goal)):
        assert end is not None
        assert (end == part * size).all()
        assert world.obstacle_at(end) is None


def sizes(name: str, size: float) -> str:
    """Sizes of obstacles in proportion to the map, as parameters."""
    if name not in BOXES:
        return f"min_radius={0.01 * size!r},max_radius={0.08 * size!r}"
    return f"min_side={0.02 * size!r},max_side={0.15 * size!r}"


@EVERY
def test_seeded(name: str) -> None:
    """The same seed gives the same world, another seed another one."""
    one = make_world(f"{name}:n=20,seed=7")
    assert_same(one, make_world(f"{name}:seed=7,n=20"))
    assert_same(make_world(name), make_world(f"{name}:seed=0"))
    other = make_world(f"{name}:n=20,seed=8")
    assert one.to_json() != other.to_json().replace("seed=8", "seed=7")


@EVERY
@settings(max_examples=25, deadline=None)
@given(st.data())
def test_given_ends_are_never_covered(name: str, data: st.DataObject) -> None:
    """Obstacles keep off start and goal wherever a user wants them, walls and corners included."""
    dim = 3 if name.endswith("3d") else 2
    end = st.lists(st.floats(0, 100), min_size=dim, max_size=dim).map(np.array)
    start, goal = data.draw(end), data.draw(end)
    seed = data.draw(st.integers(0, 99))
    world = make_world(f"{name}:n=150,seed={seed}", start, goal)
    for given_end, own in ((start, world.start), (goal, world.goal)):
        assert own is not None
        assert (own == given_end).all()
        assert world.obstacle_at(given_end) is None


@EVERY
def test_obstacles_are_spread_over_the_map(name: str) -> None:
    """Centres lie in every quarter of every axis, in numbers that are not far apart."""
    least, most = corners(make_world(f"{name}:n=4000"))
    centres = (least + most) / 2
    for axis in range(centres.shape[1]):
        shares = np.histogram(centres[:, axis], bins=4, range=(0, 100))[0]
        assert shares.min() > 600
        assert shares.max() < 1400


@EVERY
def test_only_one_end_given(name: str) -> None:
    """The other end stays in its corner."""
    dim = 3 if name.endswith("3d") else 2
    world = make_world(name, np.full(dim, 50.0))
    assert world.start is not None
    assert world.goal is not None
    assert (world.start == 50).all()
    assert (world.goal == 95).all()


@pytest.mark.parametrize(
    ("spec", "message"),
    [
        (
            "circles2d:max_radios=5",
            "unknown parameter of world circles2d 'max_radios'; did you mean 'max_radius'?",
        ),
        ("circles2d:min_side=5", "unknown parameter of world circles2d 'min_side'"),
        ("boxes3d:max_radius=5", "unknown parameter of world boxes3d 'max_radius'"),
        ("circles2d:n=-1", "n must be at least 0, not -1"),
        ("circles2d:n=2.5", "n must be a whole number, not '2.5'"),
        ("circles2d:n=10000001", "n must be at most 1e+07"),
        ("circles2d:n=nan", "n must be a whole number, not 'nan'"),
        ("circles2d:size=0", "size must be above 0, not 0"),
        ("circles2d:size=-3", "size must be above 0, not -3"),
        ("circles2d:size=nan", "size must be a finite number, not nan"),
        ("circles2d:size=inf", "size must be a finite number, not inf"),
        ("spheres3d:min_radius=nan", "min_radius must be a finite number, not nan"),
        ("spheres3d:max_radius=0", "max_radius must be above 0, not 0"),
        ("boxes2d:max_side=nan", "max_side must be a finite number, not nan"),
        ("circles2d:seed=-1", "seed must be at least 0, not -1"),
        ("circles2d:seed=x", "seed must be a whole number, not 'x'"),
        ("circles2d:min_radius=9", "min_radius 9 is above max_radius 8"),
        ("squares2d:min_side=20", "min_side 20 is above max_side 15"),
        ("circles2d:max_radius=51", "max_radius 51 does not fit the map; it is at most 50"),
        ("boxes3d:max_side=100.5", "max_side 100.5 does not fit the map; it is at most 100"),
        ("circles2d:size=10", "max_radius 8 does not fit the map; it is at most 5"),
        ("circles2d:n", "'n' must read name=value"),
        ("circles2d:5", "'5' must read name=value"),
        ("circles2d:n=", "n must be a whole number, not ''"),
        ("circels2d", "unknown world 'circels2d'; did you mean 'circles2d'?"),
        ("Circles2D", "did you mean 'circles2d'?"),
        ("nothing", "unknown world 'nothing'; there is: boxes2d, boxes3d, circles2d"),
        ("maps/none.txt", "maps/none.txt: No such file"),
        ("maps/none", "maps/none: no such file"),
        ("none.zip", "none.zip: no such file"),
    ],
)
def test_wrong_specifications(spec: str, message: str) -> None:
    """Each error names what is wrong, the value, and where there is one the nearest name."""
    assert message in refused(lambda: make_world(spec))


@pytest.mark.parametrize(
    "spec", ["circles2d:n=1,min_radius=50,max_radius=50", "squares2d:n=5,min_side=99,max_side=100"]
)
def test_no_room_for_start_and_goal(spec: str) -> None:
    """Obstacles that cannot but cover start or goal are an error, not a loop without end."""
    start = np.full(2, 50.0)
    assert "leave no room for start and goal" in refused(lambda: make_world(spec, start))


@EVERY
def test_spaces_and_empty_parts_do_not_matter(name: str) -> None:
    """Parameters may be set apart by spaces, and a comma too many does no harm."""
    assert_same(make_world(f"{name}: n = 5 ,, seed=1,"), make_world(f"{name}:n=5,seed=1"))


# World and JSON


@st.composite
def worlds(draw: st.DrawFn) -> World:
    """Any world that is one."""
    dim = draw(st.sampled_from([2, 3]))
    number = st.floats(-1e99, 1e99)
    point = st.lists(number, min_size=dim, max_size=dim)
    ball = st.tuples(point, st.floats(0, 1e100)).map(lambda it: [*it[0], it[1]])
    box = st.tuples(point, point).map(lambda it: np.sort(it, axis=0).ravel())
    low, high = np.sort([draw(point), draw(point)], axis=0)
    high = np.maximum(high, np.nextafter(low, np.inf))
    start, goal = (draw(st.none() | point.map(np.array)) for _ in range(2))
    balls, boxes = draw(st.lists(ball, max_size=3)), draw(st.lists(box, max_size=3))
    return World("w", low, high, np.array(balls), np.array(boxes), start, goal)


@given(worlds())
def test_json_round_trip(world: World) -> None:
    """What to_json writes, from_json reads back to the last bit."""
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
    """The file that the wrong ones below are made from is right, as is a bare one."""
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
        ({"version": 3}, "world version 3 is not 1 or 2; update brrt"),
        ({"version": None}, "world version None is not 1 or 2"),
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
        ({"upper": [1e999, 1]}, "upper must hold finite numbers only"),
        ({"upper": [float("nan"), 1]}, "upper must hold finite numbers only"),
        ({"upper": [10**400, 1]}, "upper"),
        ({"balls": [[1, 1]]}, "balls must be rows of 3 numbers"),
        ({"balls": [[1, 2], [3, 4], [5, 6]]}, "balls must be rows of 3 numbers"),
        ({"balls": [[1, 1, 1], [1, 1]]}, "balls must be rows of 3 numbers"),
        ({"balls": [[1, 1, -0.5]]}, "a radius is below zero"),
        ({"balls": [[1, 1, float("inf")]]}, "balls must hold finite numbers only"),
        ({"balls": "many"}, "balls must be rows of 3 numbers"),
        ({"balls": True}, "balls must be rows of 3 numbers"),
        ({"boxes": [[0, 0, 1]]}, "boxes must be rows of 4 numbers"),
        ({"boxes": [[0, 0, 0, 1, 1, 1], [2, 2, 2, 3, 3, 3]]}, "boxes must be rows of 4 numbers"),
        ({"boxes": [[3, 0, 2, 1]]}, "a box has a minimum above its maximum"),
        ({"boxes": [[0, 0, float("nan"), 1]]}, "boxes must hold finite numbers only"),
        ({"boxes": {"a": 1}}, "boxes must be rows of 4 numbers"),
        ({"polygon": [[[0, 0], [1, 0]]]}, "unknown field of a world 'polygon'; did you mean"),
        ({"start": [1]}, "start must be"),
        ({"start": []}, "start must be"),
        ({"start": [1, 1, 2, 2]}, "start must be"),
        ({"goal": [1, "x"]}, "goal must be"),
        ({"goal": [1, float("nan")]}, "goal must hold finite numbers only"),
    ],
)
def test_wrong_json(changes: dict[str, Any], message: str, tmp_path: Path) -> None:
    """Each error names the field, and the file where there is one."""
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
    """Texts that are no JSON or no world are refused."""
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
    """A field of any kind leads to a world or to a BrrtError, never to another error."""
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
    """Errors of the whole name the file."""
    error = refused(lambda: blocks(text, tmp_path))
    assert error.startswith(f"{tmp_path / 'map.txt'}:")
    assert message in error


# Files


@pytest.mark.parametrize("name", ["none.json", "none.txt", "deep/er/none.txt"])
def test_missing_file(name: str, tmp_path: Path) -> None:
    """A file that is not there is named."""
    path = tmp_path / name
    assert refused(lambda: make_world(str(path))).startswith(f"{path}: No such file")


@pytest.mark.parametrize("name", ["map.txt", "map.json"])
def test_binary_file(name: str, tmp_path: Path) -> None:
    """Bytes that are no text are refused."""
    path = tmp_path / name
    path.write_bytes(bytes(range(256)))
    assert refused(lambda: load_world(path)) == f"{path}: not a text file"


@pytest.mark.parametrize("name", ["map.zip", "map", "map.TXT.gz"])
def test_foreign_file(name: str, tmp_path: Path) -> None:
    """A file of another kind is refused, and the message says which kinds there are."""
    path = tmp_path / name
    path.write_text("wall 0 0 0 1 1 1")
    error = refused(lambda: make_world(str(path)))
    assert error.startswith(f"{path}: not a world that brrt reads; it reads .json, .txt, .map, ")


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
    """The course maps load; a count by other means finds as many blocks; their queries are free."""
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
    """Counter-clockwise, without vertices that repeat or lie on an edge; and that stays so."""
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
    ],
)
def test_bad_polygons(polygon: object, message: str) -> None:
    """One line that names the polygon and the remedy."""
    assert message in refused(lambda: polygon_world(polygon))


def test_polygons_are_for_the_plane() -> None:
    """A 3D world has none."""
    corner = [[0, 0], [1, 0], [0, 1]]
    flat, cube = (np.zeros(2), np.ones(2)), (np.zeros(3), np.ones(3))
    why = refused(lambda: World("w", *cube, polygons=(np.array(corner),)))
    assert "polygons stand in the plane, and this world is 3D" in why
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
