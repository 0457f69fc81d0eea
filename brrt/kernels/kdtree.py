"""Incremental nearest neighbours: a bucket k-d tree that grows with the planner's trees."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brrt.kernels.jit import helper, inline_helper
from brrt.kernels.space import box_measure, length, measure

Floats = NDArray[np.float64]

BUCKET = 16
_FRESH = 12
"""Most nodes of a bucket after rebuilding, so that it is not split soon."""

_LEAF = -1
_STACK = 256
"""More than twice the depth of a balanced tree of 2^31 nodes."""

_MEAN_FILL = 4
"""Nodes per bucket for which arrays are allocated; the average is about 10."""

_AXIS, _LEFT, _RIGHT, _SIZE = range(4)
"""Columns of `KdTree.cells`; `_LEFT` of a leaf is its bucket."""

_REBUILD_NEEDS = 4
"""Free buckets that are needed to split a full one."""

_NODES, _CELLS, _BUCKETS, _FREE_CELLS, _FREE_BUCKETS = range(5)


class KdTree(NamedTuple):
    """A cell is split when it has more than 16 nodes, and rebuilt when it is unbalanced.

    Coordinates are stored twice, in the planner's array and in the buckets, where those of a leaf
    fit into a few cache lines. Several trees may share the arrays: cell r is the root of tree r.

    Attributes:
        cells: Splitting axis, lower and upper child, and number of nodes of each cell; for a leaf
            -1, its bucket, -1, and its number of nodes; shape (cells, 4).
        boxes: Least and greatest coordinates of each cell's nodes, and the coordinate at which it
            splits; together they fit into two cache lines; shape (cells, 2 d + 1).
        built: Number of nodes of each cell when it was split or rebuilt, shape (cells,).
        points: Coordinates, 16 rows per bucket, shape (16 buckets, d).
        nodes: Node number of each row, shape (16 buckets,).
        counts: Nodes, cells and buckets in use, free cells and free buckets, shape (5,).
        free_cells: Cells to use again, shape (cells,).
        free_buckets: Buckets to use again, shape (buckets,).
        gathered: Nodes of a cell that is being rebuilt, shape (capacity,).
        stack: Cells to visit, shape (256,).
        work: Cells to rebuild, and their range of gathered nodes, shape (256, 3).
    """

    cells: NDArray[np.int32]
    boxes: Floats
    built: NDArray[np.int32]
    points: Floats
    nodes: NDArray[np.int32]
    counts: NDArray[np.int64]
    free_cells: NDArray[np.int32]
    free_buckets: NDArray[np.int32]
    gathered: NDArray[np.int32]
    stack: NDArray[np.int32]
    work: NDArray[np.int64]


def rooted_kdtree(roots: Floats, capacity: int) -> KdTree:
    """Make a tree for each root, shape (trees, d), with room for `capacity` nodes in all.

    Node r is the root of tree r.
    """
    trees, d = roots.shape
    tree = _empty_kdtree(d, max(capacity, trees))
    tree.counts[:3] = trees
    for r, q in enumerate(roots):
        tree.cells[r] = _LEAF, r, -1, 1
        tree.built[r] = 1
        tree.boxes[r, :-1], tree.nodes[BUCKET * r] = np.concatenate([q, q]), r
        tree.points[BUCKET * r] = q
    return tree


def enlarged_kdtree(tree: KdTree, capacity: int) -> KdTree:
    """Return the same tree with room for `capacity` nodes."""
    larger = _empty_kdtree(tree.points.shape[1], capacity)
    cells, buckets = int(tree.counts[_CELLS]), int(tree.counts[_BUCKETS])
    # Copy only what is in use: memory is provided when it is written.
    used = dict.fromkeys(("cells", "boxes", "built"), cells)
    used |= dict.fromkeys(("points", "nodes"), BUCKET * buckets)
    used["counts"] = len(tree.counts)
    used["free_cells"] = int(tree.counts[_FREE_CELLS])
    used["free_buckets"] = int(tree.counts[_FREE_BUCKETS])
    for name, n in used.items():
        getattr(larger, name)[:n] = getattr(tree, name)[:n]
    return larger


def _empty_kdtree(d: int, capacity: int) -> KdTree:
    buckets = capacity // _MEAN_FILL + 2 * _REBUILD_NEEDS
    cells = 2 * buckets
    return KdTree(
        cells=np.empty((cells, 4), np.int32),
        boxes=np.empty((cells, 2 * d + 1)),
        built=np.empty(cells, np.int32),
        points=np.empty((BUCKET * buckets, d)),
        nodes=np.empty(BUCKET * buckets, np.int32),
        counts=np.zeros(5, np.int64),
        free_cells=np.empty(cells, np.int32),
        free_buckets=np.empty(buckets, np.int32),
        gathered=np.empty(capacity, np.int32),
        stack=np.empty(_STACK, np.int32),
        work=np.empty((_STACK, 3), np.int64),
    )


@inline_helper
def _buckets_left(tree: KdTree) -> int:
    counts = tree.counts
    return len(tree.free_buckets) - int(counts[_BUCKETS] - counts[_FREE_BUCKETS])


@inline_helper
def has_room(tree: KdTree) -> bool:
    """Whether another node fits, even if a bucket has to be split."""
    return _buckets_left(tree) >= _REBUILD_NEEDS and int(tree.counts[_NODES]) < len(tree.gathered)


@inline_helper
def _new_cell(tree: KdTree) -> int:
    if tree.counts[_FREE_CELLS] > 0:
        tree.counts[_FREE_CELLS] -= 1
        return int(tree.free_cells[tree.counts[_FREE_CELLS]])
    tree.counts[_CELLS] += 1
    return int(tree.counts[_CELLS] - 1)


@inline_helper
def _new_bucket(tree: KdTree) -> int:
    if tree.counts[_FREE_BUCKETS] > 0:
        tree.counts[_FREE_BUCKETS] -= 1
        return int(tree.free_buckets[tree.counts[_FREE_BUCKETS]])
    tree.counts[_BUCKETS] += 1
    return int(tree.counts[_BUCKETS] - 1)


@inline_helper
def _stretch(tree: KdTree, cell: int, q: Floats, node: int, d: int) -> None:
    """Extend a cell's box to a node."""
    for k in range(d):
        tree.boxes[cell, k] = min(tree.boxes[cell, k], q[node, k])
        tree.boxes[cell, d + k] = max(tree.boxes[cell, d + k], q[node, k])


@inline_helper
def _open_leaf(tree: KdTree, cell: int, bucket: int, d: int) -> None:
    tree.cells[cell, _AXIS], tree.cells[cell, _SIZE] = _LEAF, 0
    tree.cells[cell, _LEFT], tree.cells[cell, _RIGHT] = bucket, -1
    for k in range(d):
        tree.boxes[cell, k], tree.boxes[cell, d + k] = np.inf, -np.inf


@inline_helper
def _put(tree: KdTree, cell: int, node: int, q: Floats, row: int, d: int) -> None:
    """Add a node with the coordinates q[row] to a leaf that has room."""
    at = tree.cells[cell, _LEFT] * BUCKET + tree.cells[cell, _SIZE]
    _stretch(tree, cell, q, row, d)
    for k in range(d):
        tree.points[at, k] = q[row, k]
    tree.nodes[at] = node
    tree.cells[cell, _SIZE] += 1


@inline_helper
def _widest_axis(tree: KdTree, cell: int, d: int) -> int:
    """Return the axis of the longest side of a cell's box; -1 if all its nodes coincide."""
    axis, widest = -1, 0.0
    for k in range(d):
        if tree.boxes[cell, d + k] - tree.boxes[cell, k] > widest:
            axis, widest = k, tree.boxes[cell, d + k] - tree.boxes[cell, k]
    return axis


@inline_helper
def _gather(tree: KdTree, root: int) -> int:
    """List the nodes below a cell and free its descendants and buckets; return their number."""
    n, top = 0, 1
    tree.stack[0] = root
    while top > 0:
        top -= 1
        cell = tree.stack[top]
        if tree.cells[cell, _AXIS] == _LEAF:
            bucket = tree.cells[cell, _LEFT]
            for at in range(bucket * BUCKET, bucket * BUCKET + tree.cells[cell, _SIZE]):
                tree.gathered[n] = tree.nodes[at]
                n += 1
            tree.free_buckets[tree.counts[_FREE_BUCKETS]] = bucket
            tree.counts[_FREE_BUCKETS] += 1
        else:
            tree.stack[top], tree.stack[top + 1] = tree.cells[cell, _LEFT], tree.cells[cell, _RIGHT]
            top += 2
        if cell != root:
            tree.free_cells[tree.counts[_FREE_CELLS]] = cell
            tree.counts[_FREE_CELLS] += 1
    return n


@inline_helper
def _partition(ids: NDArray[np.int32], lo: int, hi: int, q: Floats, axis: int, split: float) -> int:
    """Move the nodes below the split to the front; return the index of the first other one."""
    middle = lo
    for i in range(lo, hi):
        if q[ids[i], axis] < split:
            ids[i], ids[middle] = ids[middle], ids[i]
            middle += 1
    return middle


@inline_helper
def _median(ids: NDArray[np.int32], lo: int, hi: int, q: Floats, axis: int) -> float:
    """Coordinate of the median of the nodes ids[lo:hi] (quickselect, in place)."""
    middle = (lo + hi) // 2
    left, right = lo, hi - 1
    while left < right:
        pivot = q[ids[(left + right) // 2], axis]
        i, j = left, right
        while i <= j:
            while q[ids[i], axis] < pivot:
                i += 1
            while q[ids[j], axis] > pivot:
                j -= 1
            if i <= j:
                ids[i], ids[j] = ids[j], ids[i]
                i += 1
                j -= 1
        if middle <= j:
            right = j
        elif middle >= i:
            left = i
        else:
            break
    return float(q[ids[middle], axis])


@helper
def _rebuild(tree: KdTree, q: Floats, root: int, d: int) -> None:
    """Rebuild a cell by halving at the median of the longest side, down to the buckets."""
    if _buckets_left(tree) < max(tree.cells[root, _SIZE] // 4, _REBUILD_NEEDS):
        return
    tree.work[0, 0], tree.work[0, 1], tree.work[0, 2] = root, 0, _gather(tree, root)
    ids, top = tree.gathered, 1
    while top > 0:
        top -= 1
        cell, lo, hi = tree.work[top, 0], tree.work[top, 1], tree.work[top, 2]
        tree.cells[cell, _SIZE] = tree.built[cell] = hi - lo
        for k in range(d):
            tree.boxes[cell, k], tree.boxes[cell, d + k] = np.inf, -np.inf
        for i in range(lo, hi):
            _stretch(tree, cell, q, ids[i], d)
        axis = _widest_axis(tree, cell, d)
        if hi - lo <= _FRESH or axis < 0:
            _open_leaf(tree, cell, _new_bucket(tree), d)
            for i in range(lo, hi):
                _put(tree, cell, ids[i], q, ids[i], d)
            continue
        split = _median(ids, lo, hi, q, axis)
        if split <= tree.boxes[cell, axis]:
            # Half of the nodes have the least coordinate: split at the next one.
            least, split = split, np.inf
            for i in range(lo, hi):
                if q[ids[i], axis] > least:
                    split = min(split, q[ids[i], axis])
        middle = _partition(ids, lo, hi, q, axis, split)
        left, right = _new_cell(tree), _new_cell(tree)
        tree.cells[cell, _AXIS], tree.boxes[cell, 2 * d] = axis, split
        tree.cells[cell, _LEFT], tree.cells[cell, _RIGHT] = left, right
        tree.work[top, 0], tree.work[top, 1], tree.work[top, 2] = left, lo, middle
        tree.work[top + 1, 0], tree.work[top + 1, 1], tree.work[top + 1, 2] = right, middle, hi
        top += 2


@inline_helper
def _side(tree: KdTree, cell: int, x: float, d: int) -> int:
    """Return the child for a coordinate along the splitting axis."""
    return int(tree.cells[cell, _RIGHT if x >= tree.boxes[cell, 2 * d] else _LEFT])


@helper
def _split(tree: KdTree, cell: int, axis: int, d: int) -> None:
    """Divide a full leaf's nodes between two new leaves, at their mean along an axis."""
    bucket, other = tree.cells[cell, _LEFT], _new_bucket(tree)
    left, right = _new_cell(tree), _new_cell(tree)
    first = bucket * BUCKET
    mean = 0.0
    for at in range(first, first + BUCKET):
        mean += tree.points[at, axis] / BUCKET
    # Because of rounding the mean may be beyond all nodes, and one leaf would get them all.
    low, high = tree.boxes[cell, axis], tree.boxes[cell, d + axis]
    split = mean if low < mean <= high else high
    _open_leaf(tree, left, bucket, d)
    _open_leaf(tree, right, other, d)
    for at in range(first, first + BUCKET):
        # The left leaf reuses the bucket; it is never filled faster than it is read.
        child = right if tree.points[at, axis] >= split else left
        _put(tree, child, tree.nodes[at], tree.points, at, d)
    tree.cells[cell, _AXIS], tree.boxes[cell, 2 * d] = axis, split
    tree.cells[cell, _LEFT], tree.cells[cell, _RIGHT] = left, right
    tree.built[cell] = BUCKET


@inline_helper
def insert(tree: KdTree, space: Any, q: Floats, node: int, root: int) -> None:
    """Add node q[node] to a tree, which must have room (`has_room`).

    A cell with 3/4 of its nodes on one side is rebuilt (a scapegoat tree; Galperin and Rivest
    1993): planners' trees grow outwards, so without this their frontier would become ever deeper.
    A node that coincides with 16 others is left out, as they are equally near to every query.
    """
    d = len(space.lower)
    cell, unbalanced = root, -1
    while tree.cells[cell, _AXIS] != _LEAF:
        _stretch(tree, cell, q, node, d)
        tree.cells[cell, _SIZE] += 1
        child = _side(tree, cell, q[node, tree.cells[cell, _AXIS]], d)
        size = tree.cells[cell, _SIZE]
        uneven = 4 * tree.cells[child, _SIZE] > 3 * size + 4 * BUCKET
        # Equal halves become that uneven only after the number of nodes has doubled. A cell that
        # cannot be halved, because most nodes have the same coordinate, is not rebuilt earlier.
        if unbalanced < 0 and uneven and size >= 2 * tree.built[cell]:
            unbalanced = cell
        cell = child
    if tree.cells[cell, _SIZE] == BUCKET:
        # Include the new node in the box: 16 nodes that coincide are split for another one.
        _stretch(tree, cell, q, node, d)
        axis = _widest_axis(tree, cell, d)
        if axis < 0:
            return
        _split(tree, cell, axis, d)
        tree.cells[cell, _SIZE] += 1
        cell = _side(tree, cell, q[node, axis], d)
    _put(tree, cell, node, q, node, d)
    tree.counts[_NODES] += 1
    if unbalanced >= 0:
        _rebuild(tree, q, unbalanced, d)


@inline_helper
def nearest(tree: KdTree, space: Any, Q: Floats, row: int, root: int) -> int:
    """Return a tree's nearest node to Q[row] in the robot's metric.

    Cells are pruned by the boxes of their nodes, not by the half-spaces of the splits: most samples
    are far from a young tree, whose outer cells would be unbounded on that side.
    """
    d, stack = len(space.lower), tree.stack
    best, node, cell, top = np.inf, -1, root, 0
    while True:
        while tree.cells[cell, _AXIS] != _LEAF:
            side = 1 if Q[row, tree.cells[cell, _AXIS]] >= tree.boxes[cell, 2 * d] else 0
            stack[top] = tree.cells[cell, _RIGHT - side]
            top += 1
            cell = tree.cells[cell, _LEFT + side]
        first = tree.cells[cell, _LEFT] * BUCKET
        for at in range(first, first + tree.cells[cell, _SIZE]):
            measured = measure(space, tree.points, at, Q, row)
            if measured < best:
                best, node = measured, tree.nodes[at]
        while True:
            if top == 0:
                return node
            top -= 1
            cell = stack[top]
            if box_measure(space, tree.boxes, cell, Q, row) < best:
                break


@inline_helper
def near(
    tree: KdTree,
    space: Any,
    Q: Floats,
    row: int,
    root: int,
    radius: float,
    found: NDArray[np.int32],
    far: Floats,
) -> int:
    """List a tree's nodes within a radius of Q[row], in arbitrary order.

    Args:
        tree: The trees.
        space: Configuration space.
        Q: Configurations, shape (n, d).
        row: Row of the configuration in Q.
        root: Number of the tree.
        radius: Greatest distance in the robot's metric.
        found: The nodes are written here; it has room for all nodes.
        far: Their distances are written here; same shape.

    Returns:
        Their number.
    """
    stack, top, count = tree.stack, 1, 0
    stack[0] = root
    while top > 0:
        top -= 1
        cell = stack[top]
        if length(space, box_measure(space, tree.boxes, cell, Q, row)) > radius:
            continue
        if tree.cells[cell, _AXIS] != _LEAF:
            stack[top], stack[top + 1] = tree.cells[cell, _LEFT], tree.cells[cell, _RIGHT]
            top += 2
            continue
        first = tree.cells[cell, _LEFT] * BUCKET
        for at in range(first, first + tree.cells[cell, _SIZE]):
            distance = length(space, measure(space, tree.points, at, Q, row))
            if distance <= radius:
                found[count], far[count] = tree.nodes[at], distance
                count += 1
    return count
