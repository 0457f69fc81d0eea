"""Generators: common properties of all worlds, each generator's own, and errors."""

import hashlib
import re
from dataclasses import fields, replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from brrt.errors import BrrtError
from brrt.worlds import GENERATORS, World, make_world
from brrt.worlds.generators.box_subtraction import merge_cells, subtract_box
from brrt.worlds.generators.generator import Seeded
from brrt.worlds.generators.scattered import Scattered
from tests.worlds.test_worlds import assert_same, refused

Floats = NDArray[np.float64]
Pairs = NDArray[np.int64]

EVERY = pytest.mark.parametrize("name", list(GENERATORS))
BALLS, BOXES = ("circles2d", "spheres3d"), ("squares2d", "boxes2d", "boxes3d")
POLYGONS = ("polygons2d",)
SCATTERED = pytest.mark.parametrize("name", [*BALLS, *BOXES, *POLYGONS])
SEEDED = pytest.mark.parametrize(
    "name", [name for name, kind in GENERATORS.items() if issubclass(kind, Seeded)]
)
CELLS = {2: 400, 3: 80}
"""Cells along a map's longest side that show a path through every default world."""
ULPS = 1e-12
"""Relative rounding error of sums of coordinates."""


def corners(world: World) -> tuple[Floats, Floats]:
    """Return the least and the greatest corner of each obstacle."""
    d, balls, boxes = world.dim, world.balls, world.boxes
    least, most = [balls[:, :d] - balls[:, d:], boxes[:, :d]], [balls[:, :d] + balls[:, d:]]
    most.append(boxes[:, d:])
    for polygon in world.polygons:
        least.append(polygon.min(axis=0, keepdims=True))
        most.append(polygon.max(axis=0, keepdims=True))
    return np.concatenate(least), np.concatenate(most)


# What holds for every world


def occupied(world: World, points: Floats) -> NDArray[np.bool_]:
    """Whether an obstacle touches each point, shape (n, d), tested one obstacle at a time."""
    d, found = world.dim, np.zeros(len(points), np.bool_)
    for ball in world.balls:
        found |= np.linalg.norm(points - ball[:d], axis=1) <= ball[d]
    for box in world.boxes:
        found |= ((box[:d] <= points) & (points <= box[d:])).all(axis=1)
    for polygon in world.polygons:
        ahead = np.roll(polygon, -1, axis=0) - polygon
        aside = points[:, None] - polygon
        turns = ahead[:, 0] * aside[..., 1] - ahead[:, 1] * aside[..., 0]
        found |= (turns >= 0).all(axis=1)
    return found


def way(world: World, cells: int) -> bool:
    """Whether a path of free cells that share sides leads from start to goal.

    A cell is called free when its middle is further from every obstacle than its corners are from
    its middle.
    """
    cell = world.extent / cells
    shape = tuple(np.ceil((world.upper - world.lower) / cell - 1e-9).astype(int))
    reach = cell * np.sqrt(world.dim) / 2
    middles = world.lower + cell * (np.argwhere(np.ones(shape)).reshape(*shape, -1) + 0.5)
    free = np.ones(shape, np.bool_)
    least, most = corners(world)
    for number, (low, high) in enumerate(zip(least, most, strict=True)):
        first = np.maximum(np.floor((low - reach - world.lower) / cell), 0).astype(int)
        last = np.ceil((high + reach - world.lower) / cell).astype(int) + 1
        part = tuple(slice(i, j) for i, j in zip(first, last, strict=True))
        free[part] &= apart(world, number, middles[part]) > reach
    free = np.pad(free, 1)
    first, last = (
        np.ravel_multi_index(tuple(((end - world.lower) / cell).astype(int) + 1), free.shape)
        for end in (world.start, world.goal)
        if end is not None
    )
    unseen, steps = free.ravel().copy(), np.array(free.strides)
    front = np.array([first])[unseen[[first]]]
    while len(front):
        unseen[front] = False
        near = np.unique(np.concatenate([front[:, None] + steps, front[:, None] - steps]))
        front = near[unseen[near]]
    return bool(free.flat[last] and not unseen[last])


def world_dim(name: str) -> int:
    """Return 2 or 3, from the name."""
    return 3 if name.endswith("3d") else 2


def apart(world: World, number: int, points: Floats) -> Floats:
    """Return a lower bound of points' distance from an obstacle, numbered as in `corners`."""
    d, balls, boxes = world.dim, len(world.balls), len(world.boxes)
    if number < balls:
        ball = world.balls[number]
        return np.asarray(np.linalg.norm(points - ball[:d], axis=-1) - ball[d])
    if number < balls + boxes:
        box = world.boxes[number - balls]
        beyond = np.maximum(0, np.maximum(box[:d] - points, points - box[d:]))
        return np.asarray(np.linalg.norm(beyond, axis=-1))
    polygon = world.polygons[number - balls - boxes]
    ahead = np.roll(polygon, -1, axis=0) - polygon
    ahead /= np.linalg.norm(ahead, axis=1)[:, None]
    aside = points[..., None, :] - polygon
    return np.asarray((ahead[:, 1] * aside[..., 0] - ahead[:, 0] * aside[..., 1]).max(axis=-1))


@EVERY
def test_a_point_can_solve_every_default_world(name: str) -> None:
    """A path of free cells leads from start to goal."""
    assert way(make_world(name), CELLS[world_dim(name)])


@EVERY
def test_seeded_or_without_a_seed(name: str) -> None:
    """Equal specifications give equal worlds, other seeds others; fixed worlds have no seed."""
    world = make_world(name)
    assert world.name == name
    assert_same(world, make_world(name))
    if issubclass(GENERATORS[name], Seeded):
        assert_same(world, make_world(f"{name}:seed=0"))
        one, other = make_world(f"{name}:seed=7"), make_world(f"{name}:seed=8")
        assert one.to_json() != other.to_json().replace("seed=8", "seed=7")
    else:
        why = refused(lambda: make_world(f"{name}:seed=1"))
        assert f"unknown parameter of world {name} 'seed'" in why


@st.composite
def parameters(draw: st.DrawFn, name: str) -> dict[str, object]:
    """Draw some parameters from their ranges, lengths in proportion to the map."""
    # A density of obstacles that are tiny on their map would take millions of them.
    scattered = issubclass(GENERATORS[name], Scattered)
    size = draw(st.sampled_from([100.0, 60.0, 1.0] + [1e-6, 12345.6] * (not scattered)))
    values: dict[str, object] = {"size": size}
    for field in fields(GENERATORS[name]):
        meta, hint = field.metadata, str(field.type)
        if field.name in ("size", "connected") or draw(st.booleans()):
            continue
        if hint == "<class 'int'>":
            most = 2**70 if field.name == "seed" else min(meta["high"], 20)
            values[field.name] = draw(st.integers(meta["low"], most))
        elif meta["high"] is not None:
            most = 0.9 if field.name == "density" else meta["high"]
            values[field.name] = draw(st.floats(meta["low"], most))
        else:
            least = 0.03 if scattered else 1e-3
            values[field.name] = size * draw(st.floats(least, 0.3) | st.floats(0.3, 1.1))
    return values


@EVERY
@settings(max_examples=25, deadline=None)
@given(st.data(), st.floats(0, 0.2))
def test_any_parameters_make_a_world_or_one_line(
    name: str, data: st.DataObject, room: float
) -> None:
    """Obstacles lie within the bounds; start and goal are inside and free."""
    values = data.draw(parameters(name))
    try:
        generator = GENERATORS[name].parse(name, values)
        world = generator.make(name, room=room * generator.size)
    except BrrtError as error:
        assert "\n" not in str(error)
        return
    assert world.extent == generator.size
    rounding = 1e-9 * generator.size
    least, most = corners(world)
    assert (least >= world.lower - rounding).all()
    assert (most <= world.upper + rounding).all()
    assert (most > least).all()
    for end in (world.start, world.goal):
        assert end is not None
        assert world.inside(end)
        assert not occupied(world, end[None]).any()
        if name in (*BALLS, *BOXES, "forest2d", "forest3d"):
            distances = [apart(world, number, end) for number in range(len(least))]
            assert min(distances, default=np.inf) >= room * generator.size


@EVERY
@settings(max_examples=10, deadline=None)
@given(st.data())
def test_a_world_grows_with_its_size(name: str, data: st.DataObject) -> None:
    """Default lengths are in proportion to the map."""
    if name in (*BALLS, *BOXES, *POLYGONS):
        return
    size = data.draw(st.floats(1e-3, 1e6))
    one, other = make_world(f"{name}:size=1"), make_world(f"{name}:size={size!r}")
    for a, b in zip(corners(one), corners(other), strict=True):
        np.testing.assert_allclose(a * size, b, atol=1e-9 * size)


@EVERY
def test_given_ends_are_kept(name: str) -> None:
    """Given ends are kept even in a wall: the query refuses them later."""
    dim = world_dim(name)
    start, goal = np.full(dim, 23.4), np.full(dim, 12.3)
    world = make_world(name, start, goal)
    assert world.start is not None
    assert world.goal is not None
    assert (world.start == start).all()
    assert (world.goal == goal).all()


@SEEDED
def test_seeds_of_any_length(name: str) -> None:
    """Seeds have no maximum, and all digits count."""
    one, other = (make_world(f"{name}:seed={10**40 + i}") for i in range(2))
    assert (
        one.boxes.tobytes() + one.balls.tobytes() != other.boxes.tobytes() + other.balls.tobytes()
        or name in POLYGONS
    )


# What is scattered


@SCATTERED
@settings(max_examples=25, deadline=None)
@given(st.integers(0, 300), st.integers(0, 2**70), st.sampled_from([1.0, 33.3, 100.0, 1e6, 1e-3]))
def test_obstacles_are_as_asked(name: str, n: int, seed: int, size: float) -> None:
    """The requested number, within the map, with sizes in range; start and goal are free."""
    world = make_world(f"{name}:n={n},seed={seed},size={size!r},{sizes(name, size)}")
    d = world.dim
    assert d == world_dim(name)
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
    """Return sizes of obstacles in proportion to the map, as parameters."""
    if name not in BOXES:
        return f"min_radius={0.01 * size!r},max_radius={0.08 * size!r}"
    return f"min_side={0.02 * size!r},max_side={0.15 * size!r}"


@SCATTERED
def test_seeded(name: str) -> None:
    """Equal seeds give equal worlds, other seeds others."""
    one = make_world(f"{name}:n=20,seed=7")
    assert_same(one, make_world(f"{name}:seed=7,n=20"))
    assert_same(make_world(name), make_world(f"{name}:seed=0"))
    other = make_world(f"{name}:n=20,seed=8")
    assert one.to_json() != other.to_json().replace("seed=8", "seed=7")


@SCATTERED
@settings(max_examples=25, deadline=None)
@given(st.data())
def test_given_ends_are_never_covered(name: str, data: st.DataObject) -> None:
    """No obstacle covers a given start or goal, also at walls and in corners."""
    dim = world_dim(name)
    end = st.lists(st.floats(0, 100), min_size=dim, max_size=dim).map(np.array)
    start, goal = data.draw(end), data.draw(end)
    seed = data.draw(st.integers(0, 99))
    world = make_world(f"{name}:n=150,seed={seed}", start, goal)
    for given_end, own in ((start, world.start), (goal, world.goal)):
        assert own is not None
        assert (own == given_end).all()
        assert world.obstacle_at(given_end) is None


@SCATTERED
def test_obstacles_are_spread_over_the_map(name: str) -> None:
    """Centres are distributed uniformly over quarters of every axis."""
    least, most = corners(make_world(f"{name}:n=4000"))
    centres = (least + most) / 2
    for axis in range(centres.shape[1]):
        shares = np.histogram(centres[:, axis], bins=4, range=(0, 100))[0]
        assert shares.min() > 600
        assert shares.max() < 1400


@SCATTERED
def test_only_one_end_given(name: str) -> None:
    """If one end is given, the other stays in its corner."""
    dim = world_dim(name)
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
        ("circles2d:n=10000001", "n must be at most 10,000,000"),
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
        ("circles2d:density=1.1", "density must be at most 1, not 1.1"),
        ("circles2d:density=-0.1", "density must be at least 0, not -0.1"),
        ("boxes3d:density=0.2,n=20", "n 20 and density 0.2 exclude each other; give one"),
        ("circles2d:connected=maybe", "connected must be true or false, not 'maybe'"),
        ("forest2d:radius=51", "radius 51 does not fit the map; it is at most 50"),
        ("forest2d:radius=0.1,gap=0.1", "trees 0.3 apart are too many for the map; make twice"),
        ("forest2d:min_height=0.3", "unknown parameter of world forest2d 'min_height'"),
        ("forest3d:min_height=0.9,max_height=0.8", "min_height 0.9 is above max_height 0.8"),
        ("maze2d:cells=1", "cells must be at least 2, not 1"),
        ("maze2d:wall=12", "wall 12 leaves no room for 10 cells; make it below 11.1111"),
        ("maze3d:corridor=20", "corridor 20 leaves no room for walls between 5 cells; make it"),
        ("maze2d:corridor=5,wall=5", "corridor and wall follow from each other"),
        ("rooms2d:door=24", "door 24 does not fit; a room's side is 23.125"),
        ("rooms2d:wall=40", "wall 40 leaves no room for 4 cells"),
        ("spiral2d:wall=20", "wall 20 leaves no room for 7 cells; make it below 16.6666"),
        ("gap2d:gap=101", "gap 101 does not fit the map; it is at most 100"),
        ("passage3d:wall=81", "wall 81 does not fit the map; it is at most 80"),
        ("gap2d:height=0.5", "unknown parameter of world gap2d 'height'"),
        ("walls2d:walls=10,wall=8", "wall 8 does not fit the map; it is at most 7.2"),
        ("enclosure2d:side=41", "side 41 does not fit the map; it is at most 40"),
        ("enclosure3d:wall=12", "wall 12 does not fit the map; it is at most 11.25"),
        ("enclosure2d:gap=20.5", "gap 20.5 does not fit the map; it is at most 20"),
        ("bugtrap2d:gap=20", "gap 20 does not fit the map; it is at most 18"),
        ("bugtrap3d:side=90", "side 90 does not fit the map; it is at most 80"),
        ("cube3d:n=3", "unknown parameter of world cube3d 'n'"),
        ("circles2d:n", "'n' must read name=value"),
        ("circles2d:5", "'5' must read name=value"),
        ("circles2d:n=", "n must be a whole number, not ''"),
        ("circels2d", "unknown world 'circels2d'; did you mean 'circles2d'?"),
        ("Circles2D", "did you mean 'circles2d'?"),
        ("nothing", "unknown world 'nothing'; choose from: boxes2d, boxes3d, bugtrap2d"),
        ("maps/none.txt", "maps/none.txt: No such file"),
        ("maps/none", "maps/none: no such file"),
        ("none.zip", "none.zip: no such file"),
    ],
)
def test_wrong_specifications(spec: str, message: str) -> None:
    """Each error names the parameter, the value, and the nearest name if there is one."""
    assert message in refused(lambda: make_world(spec))


def test_no_room_for_start_and_goal() -> None:
    """Obstacles that always cover start or goal are an error, not an endless loop."""
    spec = "squares2d:n=5,min_side=99,max_side=100"
    assert "leave no room for start and goal" in refused(lambda: make_world(spec))


@SCATTERED
def test_spaces_and_empty_parts_do_not_matter(name: str) -> None:
    """Spaces around parameters and extra commas are ignored."""
    assert_same(make_world(f"{name}: n = 5 ,, seed=1,"), make_world(f"{name}:n=5,seed=1"))


DIGESTS = {
    "circles2d": "1d08802a0ab638f7",
    "squares2d:n=200,seed=3": "695d54c468fd3b17",
    "boxes2d:n=30,seed=11,size=40": "2ec3c03085dad262",
    "boxes3d:n=1000,seed=5": "3bb6772f102b591d",
    "spheres3d:seed=1180591620717411303424": "deeb2a4ba4de8fdb",
}


@pytest.mark.parametrize("spec", DIGESTS)
def test_worlds_stay_what_they_were(spec: str) -> None:
    """Recordings name their world by its specification, so that its meaning must not change."""
    world = make_world(spec)
    data = world.balls.tobytes() + world.boxes.tobytes()
    assert hashlib.sha256(data).hexdigest()[:16] == DIGESTS[spec]


@SCATTERED
@pytest.mark.parametrize("density", [0.03, 0.3, 0.6])
def test_density(name: str, density: float) -> None:
    """The least number of obstacles covers the share, and the note states both."""
    points = np.random.default_rng(5).random((5000, world_dim(name))) * 100
    world = make_world(f"{name}:density={density},seed=4")
    (note,) = world.notes
    count, share = re.fullmatch(
        rf"density {density}: (\d+) obstacles cover (0\.\d+) of the map", note
    ).groups()  # type: ignore[union-attr]
    assert int(count) == len(world.balls) + len(world.boxes) + len(world.polygons)
    error = 4 * np.sqrt(density / len(points)) + 0.003
    assert abs(occupied(world, points).mean() - float(share)) < error
    assert float(share) >= density
    less = replace(
        world, balls=world.balls[:-1], boxes=world.boxes[:-1], polygons=world.polygons[:-1]
    )
    assert occupied(less, points).mean() < density + error


@SCATTERED
def test_a_denser_world_holds_the_sparser_one(name: str) -> None:
    """The sequence of obstacles depends only on the seed; density 0 gives none."""
    worlds = [make_world(f"{name}:density={density}") for density in (0, 0.1, 0.3, 0.6)]
    assert len(corners(worlds[0])[0]) == 0
    for less, more in pairwise(worlds):
        for one, other in zip(corners(less), corners(more), strict=True):
            assert len(one) < len(other)
            assert (one == other[: len(one)]).all()


def test_tiny_obstacles_may_be_many() -> None:
    """Many small obstacles reach the requested share in bounded time."""
    world = make_world("circles2d:density=0.05,min_radius=0.1,max_radius=0.1")
    # Few overlap: 1 - exp(-x) of the map is covered where their areas sum up to x.
    assert abs(len(world.balls) - -np.log(0.95) / (np.pi * 1e-6)) < 1000


@pytest.mark.parametrize("spec", ["density=0.995", "density=1", "density=0.99,max_radius=30"])
def test_a_density_out_of_reach(spec: str) -> None:
    """Corners and the surroundings of start and goal stay free, so that some densities fail."""
    why = refused(lambda: make_world(f"circles2d:min_radius=2,{spec}"))
    assert "cannot be reached" in why
    assert "obstacles cover only 0.9" in why


def test_a_density_of_specks() -> None:
    """Obstacles that are too small are refused at once, not after ten million draws."""
    why = refused(lambda: make_world("spheres3d:density=0.2,min_radius=0.1,max_radius=0.1"))
    assert "density 0.2 would take more than 10,000,000 obstacles of this size; ask for" in why


# Forests


def trunks(world: World) -> tuple[Floats, float]:
    """Return the middles of the trunks and their radius."""
    if world.dim == 2:
        return world.balls[:, :2], float(world.balls[0, 2])
    sides = world.boxes[:, 3:5] - world.boxes[:, :2]
    np.testing.assert_allclose(sides, sides[0, 0])
    return (world.boxes[:, :2] + world.boxes[:, 3:5]) / 2, float(sides[0, 0]) / np.sqrt(2)


@pytest.mark.parametrize("name", ["forest2d", "forest3d"])
@settings(max_examples=20, deadline=None)
@given(st.floats(0.005, 0.05), st.floats(1e-6, 0.1), st.integers(0, 999), st.floats(0, 0.1))
def test_trees_keep_their_distance(
    name: str, radius: float, gap: float, seed: int, room: float
) -> None:
    """Trees keep their distance from each other, the ends and the border, and fill the map."""
    gap = max(gap, 0.03 - radius)
    size = 60.0
    radius, gap, room = radius * size, gap * size, room * size
    spec = f"{name}:size={size},radius={radius!r},gap={gap!r},seed={seed}"
    world = make_world(spec, None, np.full(world_dim(name), 30.0), room)
    trees, trunk = trunks(world)
    assert trunk == pytest.approx(radius)
    apart = np.linalg.norm(trees[:, None] - trees, axis=2) + np.diag(np.full(len(trees), np.inf))
    assert apart.min() >= (2 * radius + gap) * (1 - 1e-9)
    assert world.start is not None
    assert world.goal is not None
    ends = np.stack([world.start[:2], world.goal[:2]])
    # Trunks are left out by their real distance; square ones are closer at their corners alone.
    inner = radius if world.dim == 2 else radius / np.sqrt(2)
    assert np.linalg.norm(trees[:, None] - ends, axis=2).min() >= inner + room
    assert (trees >= radius * (1 - 1e-9)).all()
    assert (trees <= size - radius * (1 - 1e-9)).all()
    trees, _ = trunks(make_world(spec))
    ends = np.array([[0.05, 0.05], [0.95, 0.95]]) * size
    others = np.random.default_rng(seed).uniform(radius, size - radius, (2000, 2))
    fit = np.linalg.norm(others[:, None] - trees, axis=2).min(axis=1) > 2 * radius + gap
    fit &= np.linalg.norm(others[:, None] - ends, axis=2).min(axis=1) > radius + 0.01 * size
    assert fit.mean() < 0.02


def test_heights_of_trees() -> None:
    """Trees start at the floor and have the requested heights."""
    boxes = make_world("forest3d:min_height=0.2,max_height=0.4,size=50").boxes
    assert (boxes[:, 2] == 0).all()
    assert 10 <= boxes[:, 5].min() < 12
    assert 18 < boxes[:, 5].max() <= 20


# Connected


@EVERY
def test_a_world_that_is_connected_stays_as_it_is(name: str) -> None:
    """Connected worlds are not drawn again."""
    assert_same(make_world(name), make_world(f"{name}:connected=true"))


def test_connected_on_request() -> None:
    """Worlds without a path are drawn again until there is one, reproducibly."""
    redrawn = 0
    for seed in range(3):
        spec = f"squares2d:n=800,seed={seed}"
        plain, world = (make_world(spec + more) for more in ("", ",connected=true"))
        assert way(world, 1600)
        assert_same(world, make_world(spec + ",connected=true"))
        differs = plain.boxes.tobytes() != world.boxes.tobytes()
        notes = [note for note in world.notes if "is the first with a path" in note]
        assert len(notes) == differs
        redrawn += differs
    assert redrawn


@pytest.mark.parametrize(
    ("spec", "start", "message"),
    [
        ("walls2d:gap=0.01", [5, 5], "(no free cells of 0.0977 lead to the goal); ask for"),
        ("walls2d", [50, 50], "(the start touches box 1 (48.5, 10 to 51.5, 100)); ask for"),
        ("empty3d", [50, 50, -1], "(the start lies outside the bounds); ask for"),
        ("circles2d:n=5", [-1, 50], "(the start lies outside the bounds); ask for"),
    ],
)
def test_no_way(spec: str, start: list[float], message: str) -> None:
    """The error gives the reason and a remedy."""
    spec += ":connected=true" if ":" not in spec else ",connected=true"
    why = refused(lambda: make_world(spec, np.array(start, np.float64)))
    assert f"world {spec}: no path from start to goal was found {message}" in why


def test_no_way_in_any_draw(monkeypatch: pytest.MonkeyPatch) -> None:
    """The error counts the draws."""
    monkeypatch.setattr(Seeded, "draws", 2)
    why = refused(lambda: make_world("squares2d:n=3000,min_side=10,max_side=12,connected=true"))
    assert "(no free cells of 0.0977 lead to the goal in the last of 2 draws); ask for" in why


# Boxes with holes


@given(st.data(), st.sampled_from([2, 3]))
def test_a_box_without_a_hole(data: st.DataObject, dim: int) -> None:
    """Every unit cell of the box except the hole is in exactly one of the boxes."""
    cells = np.zeros((5,) * dim, np.int64)
    low, high = np.sort(data.draw(arrays(int, (2, dim), elements=st.integers(-3, 8))), axis=0)
    for box in subtract_box(np.zeros(dim), np.full(dim, 5), [low, high]).astype(int):
        assert (box[:dim] < box[dim:]).all()
        cells[tuple(slice(i, j) for i, j in zip(box[:dim], box[dim:], strict=True))] += 1
    inside = np.argwhere(np.ones_like(cells))
    hole = ((low <= inside) & (inside < high)).all(axis=1)
    assert (cells.ravel() == ~hole).all()


@given(st.integers(1, 3), st.integers(1, 6), st.integers(0, 2**32), st.sampled_from([0.3, 0.8, 1]))
def test_merged_boxes_are_the_blocked_cells(dim: int, n: int, seed: int, part: float) -> None:
    """The boxes cover exactly the blocked cells, each once; a full grid is one box."""
    rng = np.random.default_rng(seed)
    blocked = rng.random((n,) * dim) < part
    edges = np.cumsum(rng.random(n + 1))
    boxes = np.searchsorted(edges, merge_cells(blocked, edges))
    painted = np.zeros(blocked.shape, np.int64)
    for box in boxes:
        painted[tuple(slice(i, j) for i, j in zip(box[:dim], box[dim:], strict=True))] += 1
    assert (painted == blocked).all()
    assert part < 1 or len(boxes) == 1


@pytest.mark.parametrize(
    ("name", "plug"),
    [
        ("gap2d", [48, 70, 52, 77]),
        ("gap3d", [48, 70, 23, 52, 77, 30]),
        ("passage2d", [40, 72, 42, 76]),
        ("passage3d", [40, 68, 22, 45, 78, 32]),
        ("walls2d", [48, 0, 52, 10]),
        ("walls3d", [48, 0, 0, 52, 100, 10]),
        ("spiral2d", [0, 40, 13.1, 44]),
        ("enclosure2d", [13, 38, 15, 62]),
        ("enclosure3d", [13, 38, 38, 15, 62, 62]),
        ("bugtrap2d", [44, 47, 48, 53]),
        ("bugtrap3d", [45, 47, 47, 49, 53, 53]),
        ("window3d", [46, 17, 23, 50, 31, 37]),
        ("tower3d", [3, 27, 26, 14, 38, 31]),
        ("hurdles3d", [49, 0, 15, 51, 24, 20]),
        ("offset3d", [41, 5, 27, 44, 15, 37]),
    ],
)
def test_there_is_no_other_way(name: str, plug: list[float]) -> None:
    """A plug in the opening leaves no path: the walls have no leaks."""
    world = make_world(name)
    plugged = replace(world, boxes=np.vstack([*world.boxes, plug]))
    assert not way(plugged, CELLS[world_dim(name)])


# Cells and ways


def cell_graph(world: World, cells: int, side: float, wall: float) -> Pairs:
    """Return neighbours without a wall between them, as flat indices, shape (n, 2)."""
    places = np.argwhere(np.ones((cells,) * world.dim))
    middles = np.asarray(side / 2 + places * (side + wall), np.float64)
    assert not occupied(world, middles).any()
    pairs = []
    for axis in range(world.dim):
        inner = np.flatnonzero(places[:, axis] < cells - 1)
        between = middles[inner] + np.eye(world.dim)[axis] * ((side + wall) / 2)
        others = inner + cells ** (world.dim - 1 - axis)
        pairs.append(np.stack([inner, others], axis=1)[~occupied(world, between)])
    return np.concatenate(pairs)


def reached(pairs: Pairs, cells: int) -> int:
    """Return how many cells can be reached from the first."""
    root = list(range(cells))

    def find(i: int) -> int:
        while root[i] != i:
            i = root[i]
        return i

    for a, b in pairs.tolist():
        root[find(a)] = find(b)
    return sum(find(i) == find(0) for i in range(cells))


@pytest.mark.parametrize("name", ["maze2d", "maze3d"])
@settings(max_examples=20, deadline=None)
@given(st.integers(2, 9), st.integers(0, 999), st.floats(0.01, 0.95), st.booleans())
def test_mazes_are_perfect(name: str, cells: int, seed: int, part: float, by_wall: bool) -> None:
    """Connections are a spanning tree; corridors and walls have the requested widths."""
    size = 60.0
    if by_wall:
        wall = part * size / (cells - 1)
        side = (size - (cells - 1) * wall) / cells
        spec = f"wall={wall!r}"
    else:
        side = part * size / cells
        wall = (size - cells * side) / (cells - 1)
        spec = f"corridor={side!r}"
    world = make_world(f"{name}:cells={cells},seed={seed},size={size},{spec}")
    d = world.dim
    pairs = cell_graph(world, cells, side, wall)
    assert len(pairs) == cells**d - 1
    assert reached(pairs, cells**d) == cells**d
    # The boxes do not overlap and leave free the cells and these ways alone.
    volume = np.prod(world.boxes[:, d:] - world.boxes[:, :d], axis=1).sum()
    free = cells**d * side**d + len(pairs) * side ** (d - 1) * wall
    np.testing.assert_allclose(volume + free, size**d, rtol=1e-9)


def test_a_large_maze_has_few_boxes() -> None:
    """Walls in line are merged into one box."""
    assert len(make_world("maze2d:cells=50").boxes) < 1600


@settings(max_examples=20, deadline=None)
@given(st.integers(1, 7), st.integers(0, 999), st.sampled_from([0, 0.5, 1]), st.floats(0.02, 0.95))
def test_rooms_have_doors(rooms: int, seed: int, loops: float, part: float) -> None:
    """Doors connect all rooms; loops=0 gives a tree, loops=1 a door in every wall."""
    side, wall = 100 / rooms * 0.9 + 10 / rooms / rooms, 10 / rooms
    door = part * side * (1 - 1e-9)
    world = make_world(f"rooms2d:rooms={rooms},seed={seed},loops={loops},door={door!r}")
    doors = 0
    for axis in range(2):
        for i in range(rooms - 1):
            level = i * (side + wall) + side + wall / 2
            faces = world.boxes[:, [axis, axis + 2]]
            here = world.boxes[np.isclose(faces, [level - wall / 2, level + wall / 2]).all(axis=1)]
            blocked = (here[:, 3 - axis] - here[:, 1 - axis]).sum()
            count = (100 - blocked) / door
            assert abs(count - round(count)) < 1e-6
            doors += round(count)
    least, most = rooms**2 - 1, 2 * rooms * (rooms - 1)
    assert least <= doors <= most
    if loops in (0, 1):
        assert doors == (most if loops else least)


@pytest.mark.parametrize("turns", [1, 2, 3, 8])
def test_the_spiral_is_one_corridor(turns: int) -> None:
    """The corridor is one path through all cells that ends in the middle."""
    cells = 2 * turns + 1
    wall = 10 / cells
    world = make_world(f"spiral2d:turns={turns}")
    pairs = cell_graph(world, cells, (100 - (cells - 1) * wall) / cells, wall)
    assert len(pairs) == cells**2 - 1
    assert reached(pairs, cells**2) == cells**2
    ways = np.bincount(pairs.ravel())
    assert sorted(ways)[:3] == [1, 1, 2][: len(ways)]
    assert ways.max() == 2
    assert ways[cells**2 // 2] == 1
