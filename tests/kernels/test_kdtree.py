"""The compiled nearest-neighbour tree against brute force.

Distances are compared exactly: both sides sum the same squares in the same order.
"""

import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from brrt.kernels.jit import config, kernel
from brrt.kernels.kdtree import (
    BUCKET,
    KdTree,
    enlarged_kdtree,
    has_room,
    insert,
    near,
    nearest,
    rooted_kdtree,
)
from brrt.kernels.spaces.point import PointSpace, point_space
from brrt.robots import Point
from brrt.worlds import World
from tests.support import naive

Floats = NDArray[np.float64]

DIMS = pytest.mark.parametrize("dim", [2, 3])


def space_of(dim: int) -> PointSpace:
    """A point robot in an empty world; nearest neighbours do not mind the bounds."""
    return point_space(Point(), World("empty", np.zeros(dim), np.ones(dim)))


@kernel
def insert_some(tree: KdTree, space: PointSpace, points: Floats, first: int) -> int:
    """Insert points from `first` on while there is room; return the first that is not in."""
    n = first
    while n < len(points) and has_room(tree):
        insert(tree, space, points, n, 0)
        n += 1
    return n


@kernel
def nearest_of_all(
    tree: KdTree, space: PointSpace, queries: Floats, nodes: NDArray[np.int64]
) -> None:
    """Find the node nearest to each query."""
    for row in range(len(queries)):
        nodes[row] = nearest(tree, space, queries, row, 0)


def test_python_is_refused() -> None:
    """A call from Python is an error; without a wrapper it would crash."""
    points = np.zeros((2, 2))
    tree, space = rooted_kdtree(points[:1], 4), space_of(2)
    nearest_of_all(tree, space, points, np.zeros(2, np.int64))
    with pytest.raises(TypeError, match="nearest can only be called by kernels"):
        nearest(tree, space, points, 0, 0)


def planted(points: Floats, capacity: int = 4) -> KdTree:
    """The tree of all points, inserted one by one, grown whenever it is full."""
    space, tree = space_of(points.shape[1]), rooted_kdtree(points[:1], capacity)
    done = 1
    while done < len(points):
        done = insert_some(tree, space, points, done)
        if done < len(points):
            capacity *= 2
            tree = enlarged_kdtree(tree, capacity)
    return tree


def found(tree: KdTree, queries: Floats) -> NDArray[np.int64]:
    """The node that the tree takes for the nearest to each query."""
    nodes = np.full(len(queries), -2)
    nearest_of_all(tree, space_of(queries.shape[1]), queries, nodes)
    return nodes


def check(tree: KdTree, points: Floats, queries: Floats) -> None:
    """Compare the tree with brute force: no other point is nearer."""
    for query, node in zip(queries, found(tree, queries), strict=True):
        assert 0 <= node < len(points)
        squares = naive.squared_distances(points, query)
        assert squares[node] == squares.min(), (query.tolist(), node, int(squares.argmin()))


def clustered(rng: np.random.Generator, dim: int, n: int) -> Floats:
    """Points in a few clusters of very different sizes."""
    centres, spreads = rng.random((5, dim)), 10.0 ** -rng.uniform(1, 17, 5)
    which = rng.integers(0, 5, n)
    return centres[which] + spreads[which, None] * rng.normal(size=(n, dim))


def collinear(rng: np.random.Generator, dim: int, n: int) -> Floats:
    """Points on a line, along an axis or across all."""
    along = rng.integers(0, 2, dim) * rng.normal(size=dim)
    return rng.random(dim) + rng.random((n, 1)) * along


def repeated(rng: np.random.Generator, dim: int, n: int) -> Floats:
    """Points of which most are equal to others."""
    return rng.integers(0, 3, (n, dim)) / 3


def neighbours(rng: np.random.Generator, dim: int, n: int) -> Floats:
    """Points that differ in their last bits alone."""
    start = rng.random(dim)
    return start + rng.integers(0, 3, (n, dim)) * np.spacing(start)


def uniform(rng: np.random.Generator, dim: int, n: int) -> Floats:
    """Points spread evenly."""
    return rng.random((n, dim))


@DIMS
@pytest.mark.parametrize("kind", [uniform, clustered, collinear, repeated, neighbours])
@pytest.mark.parametrize("n", [1, 2, BUCKET, BUCKET + 1, 100, 2000])
def test_nearest_is_nearest(dim: int, kind, n: int) -> None:  # type: ignore[no-untyped-def]  # noqa: ANN001
    """No point is nearer than the one that the tree finds, near the points and far from them."""
    rng = np.random.default_rng(n + dim)
    for _ in range(3):
        points = kind(rng, dim, n)
        tree = planted(points)
        check(tree, points, rng.uniform(-1, 2, (60, dim)))
        check(tree, points, points[rng.integers(0, n, 60)])
        check(tree, points, kind(rng, dim, 60))


@DIMS
def test_while_growing(dim: int) -> None:
    """The answers are right after each insertion, also across splits and growth."""
    rng = np.random.default_rng(dim)
    points, space = clustered(rng, dim, 400), space_of(dim)
    tree = rooted_kdtree(points[:1], 1)
    for n in range(1, len(points)):
        while insert_some(tree, space, points[: n + 1], n) == n:
            tree = enlarged_kdtree(tree, 2 * n)
        check(tree, points[: n + 1], rng.random((3, dim)))
        check(tree, points[: n + 1], points[n : n + 1])


coordinate = st.integers(0, 4).map(float) | st.integers(0, 3).map(
    lambda k: 0.1 + k * np.spacing(0.1)
)


@settings(max_examples=150, deadline=None)
@given(st.data(), st.sampled_from([2, 3]), st.integers(1, 80))
def test_any_points(data: st.DataObject, dim: int, n: int) -> None:
    """Equal and nearly equal points, in any order."""
    numbers = data.draw(st.lists(coordinate, min_size=dim, max_size=24))
    order = data.draw(st.integers(0, 2**32 - 1))
    points = np.random.default_rng(order).choice(numbers, (n, dim))
    tree = planted(points)
    check(tree, points, points)
    check(tree, points, np.random.default_rng(order).uniform(-1, 5, (10, dim)))


@DIMS
def test_all_but_equal_points(dim: int) -> None:
    """Points an ulp apart, whose mean may round to beyond them all."""
    for seed in range(200):
        rng = np.random.default_rng(seed)
        start = rng.random(dim)
        points = start - rng.integers(0, 2, (40, dim)) * np.spacing(start)
        check(planted(points), points, points)


@DIMS
@pytest.mark.parametrize("share", [0.5, 0.8, 0.99])
def test_most_points_share_a_coordinate(dim: int, share: float) -> None:
    """Points that no split of the longest side parts evenly cost no more than others do."""
    rng = np.random.default_rng(dim)
    points = rng.random((20_000 if not config.DISABLE_JIT else 500, dim))
    points[rng.random(len(points)) < share, 0] = 0.0
    points[:, 0] *= 3
    planted(points[:2])  # compiles
    began = time.perf_counter()
    tree = planted(points)
    assert time.perf_counter() - began < 5, "takes 0.05 s where no cell is rebuilt in vain"
    check(tree, points, rng.random((30, dim)))


@DIMS
def test_a_node_beside_many_equal_ones(dim: int) -> None:
    """Equal nodes may be left out where there are enough of them, another one never."""
    for n in range(1, 60):
        points = np.zeros((n + 1, dim))
        points[n, n % dim] = 1.0
        check(planted(points), points, points[[0, n]])


@DIMS
def test_growth_keeps_the_answers(dim: int) -> None:
    """Growing changes no answer, and a tree of ample room gives the same as one grown often."""
    rng = np.random.default_rng(dim)
    points, queries = rng.random((3000, dim)), rng.random((500, dim))
    often, never = planted(points, 1), planted(points, 100_000)
    before = found(often, queries)
    assert (before == found(never, queries)).all()
    assert (before == found(enlarged_kdtree(often, 50_000), queries)).all()


@pytest.mark.parametrize("capacity", [4, 100_000])
@pytest.mark.parametrize("dim", [2, 3])
def test_points_that_come_in_order(dim: int, capacity: int) -> None:
    """A line of points, one after the other, is the worst order for a tree."""
    n = 50_000 if not config.DISABLE_JIT else 500
    points = np.repeat(np.arange(n, dtype=np.float64)[:, None], dim, axis=1)
    tree = planted(points, capacity)
    rng = np.random.default_rng(dim)
    check(tree, points, points[rng.integers(0, n, 30)])
    check(tree, points, rng.random((30, dim)) * n)


@kernel
def insert_each(
    tree: KdTree, space: PointSpace, points: Floats, roots: NDArray[np.int64], first: int
) -> int:
    """Insert points into the trees that they belong to; return the first that is not in."""
    n = first
    while n < len(points) and has_room(tree):
        insert(tree, space, points, n, roots[n])
        n += 1
    return n


@kernel
def nearest_in(tree: KdTree, space: PointSpace, queries: Floats, row: int, root: int) -> int:
    """Find the node of one tree that is nearest to a query."""
    return nearest(tree, space, queries, row, root)


@kernel
def near_in(
    tree: KdTree,
    space: PointSpace,
    queries: Floats,
    row: int,
    root: int,
    radius: float,
    nodes: NDArray[np.int32],
    far: Floats,
) -> int:
    """Find the nodes of one tree that are near a query."""
    return near(tree, space, queries, row, root, radius, nodes, far)


def planted_each(points: Floats, roots: NDArray[np.int64], capacity: int = 4) -> KdTree:
    """Several trees in the same arrays; the first points are their roots."""
    trees = int(roots.max()) + 1
    tree = rooted_kdtree(points[:trees], capacity)
    done = trees
    while done < len(points):
        done = insert_each(tree, space_of(points.shape[1]), points, roots, done)
        if done < len(points):
            capacity = 2 * max(capacity, trees)
            tree = enlarged_kdtree(tree, capacity)
    return tree


def check_near(
    tree: KdTree, points: Floats, roots: NDArray[np.int64], queries: Floats, radii: Floats
) -> None:
    """Compare the near nodes of each tree and their distances with brute force."""
    space, nodes = space_of(points.shape[1]), np.empty(len(points), np.int32)
    far = np.empty(len(points))
    for row, query in enumerate(queries):
        distances = np.sqrt(naive.squared_distances(points, query))
        for root in range(int(roots.max()) + 1):
            mine = np.flatnonzero(roots == root)
            closest = nearest_in(tree, space, queries, row, root)
            assert roots[closest] == root
            assert distances[closest] == distances[mine].min()
            for radius in radii:
                count = near_in(tree, space, queries, row, root, radius, nodes, far)
                wanted = mine[distances[mine] <= radius]
                assert sorted(nodes[:count].tolist()) == wanted.tolist()
                assert (far[:count] == distances[nodes[:count]]).all()


@DIMS
@pytest.mark.parametrize("kind", [uniform, clustered, collinear])
@pytest.mark.parametrize("trees", [1, 2, 5])
@pytest.mark.parametrize("n", [5, BUCKET + 5, 600])
def test_near_is_near_in_each_tree(dim: int, kind, trees: int, n: int) -> None:  # type: ignore[no-untyped-def]  # noqa: ANN001
    """Each tree finds its own nodes alone: all within the radius, none beyond, none twice."""
    rng = np.random.default_rng(n + dim + trees)
    points = np.unique(kind(rng, dim, n), axis=0)
    rng.shuffle(points)
    trees = min(trees, len(points))
    roots = rng.integers(0, trees, len(points))
    roots[:trees] = np.arange(trees)
    queries = np.concatenate(
        [points[rng.integers(0, len(points), 6)], rng.uniform(-1, 2, (6, dim))]
    )
    exact = np.sqrt(naive.squared_distances(points, queries[0]))[rng.integers(0, len(points), 2)]
    radii = np.array([0.0, 1e-12, 0.01, 0.2, 1.0, 1e200, np.inf, *exact])
    check_near(planted_each(points, roots), points, roots, queries, radii)


@DIMS
def test_trees_that_share_their_room_grow(dim: int) -> None:
    """One tree grows far beyond the other, in order: its cells are rebuilt again and again."""
    n = 3000
    rng = np.random.default_rng(dim)
    points = rng.random((n, dim)) + np.arange(n)[:, None] / 100
    roots = (rng.random(n) < 0.02).astype(np.int64)
    roots[:2] = 0, 1
    queries = points[rng.integers(0, n, 20)] + rng.normal(size=(20, dim)) * 0.1
    for capacity in (2, 10_000):
        tree = planted_each(points, roots, capacity)
        check_near(tree, points, roots, queries, np.array([0.0, 0.3, np.inf]))


@settings(max_examples=60, deadline=None)
@given(st.data(), st.sampled_from([2, 3]), st.integers(2, 60))
def test_near_any_points(data: st.DataObject, dim: int, n: int) -> None:
    """Equal and nearly equal points: all within the radius, or 16 of the equal ones."""
    numbers = data.draw(st.lists(coordinate, min_size=dim, max_size=24))
    rng = np.random.default_rng(data.draw(st.integers(0, 2**32 - 1)))
    points = rng.choice(numbers, (n, dim))
    roots = rng.integers(0, 2, n)
    roots[:2] = 0, 1
    tree, space = planted_each(points, roots), space_of(dim)
    nodes, far = np.empty(n, np.int32), np.empty(n)
    for row, root in ((0, 0), (0, 1), (n - 1, 0), (n - 1, 1)):
        distances = np.sqrt(naive.squared_distances(points, points[row]))
        for radius in (0.0, 1.0, float(distances.max()), np.inf):
            count = near_in(tree, space, points, row, root, radius, nodes, far)
            listed = nodes[:count].tolist()
            wanted = np.flatnonzero((roots == root) & (distances <= radius)).tolist()
            assert len(set(listed)) == count
            assert set(listed) <= set(wanted)
            for node in set(wanted) - set(listed):
                assert (points[listed] == points[node]).all(axis=1).sum() >= BUCKET
