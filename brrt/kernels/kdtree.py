"""Incremental nearest neighbours: a bucket k-d tree that grows with the planner's tree."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brrt.kernels.jit import borrowing, inlined
from brrt.kernels.space import gap, measure

Floats = NDArray[np.float64]

BUCKET = 16
_LEAF = -1
_NODES, _CELLS, _BUCKETS, _DEPTH = range(4)
_STACK = 256
_MEAN_FILL = 4
"""Buckets are planned for at least this many nodes; splits at the mean fill them with about 10."""


class KdTree(NamedTuple):
    """Cells are split at the mean of their widest axis once they hold more than 16 nodes.

    Attributes:
        axis: Axis that splits each cell, -1 for a leaf; shape (cells,).
        split: Coordinate of the split, shape (cells,).
        child: Cell below and cell above the split; for a leaf its bucket and how many it holds;
            shape (cells, 2).
        points: Coordinates, 16 rows a bucket, shape (16 buckets, d).
        nodes: Node number of each row, shape (16 buckets,).
        counts: Nodes, cells and buckets in use and the depth of the tree, shape (4,).
        stack: Cells to visit, shape (more than the depth,).
        stack_bound: Lower bounds of the distance to what they hold, shape as `stack`.
    """

    axis: NDArray[np.int8]
    split: Floats
    child: NDArray[np.int32]
    points: Floats
    nodes: NDArray[np.int32]
    counts: NDArray[np.int64]
    stack: NDArray[np.int32]
    stack_bound: Floats


def rooted_kdtree(root: Floats, capacity: int) -> KdTree:
    """Make a tree that holds node 0 at `root`, shape (d,), with room for `capacity` nodes."""
    tree = _empty_kdtree(len(root), capacity, _STACK)
    tree.points[0], tree.nodes[0], tree.child[0, 1], tree.counts[_NODES] = root, 0, 1, 1
    return tree


def _empty_kdtree(d: int, capacity: int, stack: int) -> KdTree:
    buckets = capacity // _MEAN_FILL + 2
    tree = KdTree(
        axis=np.empty(2 * buckets, np.int8),
        split=np.empty(2 * buckets),
        child=np.empty((2 * buckets, 2), np.int32),
        points=np.empty((BUCKET * buckets, d)),
        nodes=np.empty(BUCKET * buckets, np.int32),
        counts=np.array([0, 1, 1, 0]),
        stack=np.empty(stack, np.int32),
        stack_bound=np.empty(stack),
    )
    tree.axis[0], tree.child[0] = _LEAF, (0, 0)
    return tree


def grown_kdtree(tree: KdTree, capacity: int) -> KdTree:
    """Return the same tree with room for `capacity` nodes."""
    stack = max(len(tree.stack), 2 * int(tree.counts[_DEPTH]))
    larger = _empty_kdtree(tree.points.shape[1], capacity, stack)
    cells, buckets = int(tree.counts[_CELLS]), int(tree.counts[_BUCKETS])
    for name in ("axis", "split", "child"):
        getattr(larger, name)[:cells] = getattr(tree, name)[:cells]
    for name in ("points", "nodes"):
        getattr(larger, name)[: BUCKET * buckets] = getattr(tree, name)[: BUCKET * buckets]
    larger.counts[:] = tree.counts
    return larger


@inlined
def has_room(tree: KdTree) -> bool:
    """Whether another node fits, even if it splits a bucket."""
    buckets = (tree.counts[_BUCKETS] + 1) * BUCKET <= len(tree.nodes)
    return buckets and tree.counts[_DEPTH] + 1 < len(tree.stack)


@borrowing
def _split(tree: KdTree, cell: int, d: int) -> bool:
    """Share a full leaf's nodes between two new leaves; False if they all coincide."""
    bucket = tree.child[cell, 0]
    first = bucket * BUCKET
    axis, widest, least, most, mean = -1, 0.0, 0.0, 0.0, 0.0
    for k in range(d):
        low, high, total = np.inf, -np.inf, 0.0
        for row in range(first, first + BUCKET):
            x = tree.points[row, k]
            low, high, total = min(low, x), max(high, x), total + x
        if high - low > widest:
            axis, widest, least, most, mean = k, high - low, low, high, total / BUCKET
    if axis < 0:
        return False
    split = mean if mean > least else most
    other = tree.counts[_BUCKETS]
    below, above = 0, 0
    for row in range(first, first + BUCKET):
        if tree.points[row, axis] >= split:
            target = other * BUCKET + above
            above += 1
        else:
            target = first + below
            below += 1
        for k in range(d):
            tree.points[target, k] = tree.points[row, k]
        tree.nodes[target] = tree.nodes[row]
    left = tree.counts[_CELLS]
    right = left + 1
    tree.counts[_CELLS] += 2
    tree.counts[_BUCKETS] += 1
    tree.axis[cell], tree.split[cell] = axis, split
    tree.child[cell, 0], tree.child[cell, 1] = left, right
    tree.axis[left], tree.child[left, 0], tree.child[left, 1] = _LEAF, bucket, below
    tree.axis[right], tree.child[right, 0], tree.child[right, 1] = _LEAF, other, above
    return True


@inlined
def _leaf_of(tree: KdTree, Q: Floats, row: int) -> int:
    cell, depth = 0, 0
    while tree.axis[cell] >= 0:
        axis = tree.axis[cell]
        cell = tree.child[cell, 1 if Q[row, axis] >= tree.split[cell] else 0]
        depth += 1
    tree.counts[_DEPTH] = max(tree.counts[_DEPTH], depth)
    return cell


@inlined
def insert(tree: KdTree, space: Any, node: int, Q: Floats, row: int) -> None:  # noqa: ANN401
    """Add a node at Q[row]; the caller saw to it that the tree `has_room`.

    A node that coincides with 16 others is left out: they answer for it.
    """
    d = len(space.lower)
    cell = _leaf_of(tree, Q, row)
    if tree.child[cell, 1] == BUCKET:
        if not _split(tree, cell, d):
            return
        cell = _leaf_of(tree, Q, row)
    at = tree.child[cell, 0] * BUCKET + tree.child[cell, 1]
    for k in range(d):
        tree.points[at, k] = Q[row, k]
    tree.nodes[at] = node
    tree.child[cell, 1] += 1
    tree.counts[_NODES] += 1


@inlined
def nearest(tree: KdTree, space: Any, Q: Floats, row: int) -> int:  # noqa: ANN401
    """Return the node nearest to Q[row] in the robot's metric; -1 from an empty tree."""
    best, node, cell, top = np.inf, -1, 0, 0
    while True:
        axis = tree.axis[cell]
        if axis >= 0:
            x, split = Q[row, axis], tree.split[cell]
            side = 1 if x >= split else 0
            bound = gap(space, axis, x, split)
            if bound < best:
                tree.stack[top], tree.stack_bound[top] = tree.child[cell, 1 - side], bound
                top += 1
            cell = tree.child[cell, side]
            continue
        first = tree.child[cell, 0] * BUCKET
        for at in range(first, first + tree.child[cell, 1]):
            measured = measure(space, tree.points, at, Q, row)
            if measured < best:
                best, node = measured, tree.nodes[at]
        while top > 0 and tree.stack_bound[top - 1] >= best:
            top -= 1
        if top == 0:
            return node
        top -= 1
        cell = tree.stack[top]
