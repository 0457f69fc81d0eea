"""Trees of planners: nodes with parents, costs-to-come and nearest neighbours."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brrt.kernels.arrays import enlarged
from brrt.kernels.emit import Buffer, emit_edge, emit_path, point_room, room, take_points
from brrt.kernels.jit import inline_helper
from brrt.kernels.kdtree import KdTree, enlarged_kdtree, has_room, insert, rooted_kdtree
from brrt.kernels.space import distance

Floats = NDArray[np.float64]

RESERVED_NODES = 1 << 22
"""Nodes to allocate at once. The system provides memory only as it is written, so this costs
nothing, and a tree that is never enlarged never needs its memory twice."""


class ForestArrays(NamedTuple):
    """Trees that share their arrays; node r is the root of tree r.

    Attributes:
        q: Configuration of each node, shape (capacity, dof).
        parent: Parent of each node, -1 for a root, shape (capacity,).
        cost: Cost-to-come of each node, shape (capacity,).
        number: Number of each node within its own tree, shape (capacity,).
        neighbours: A k-d tree for each tree.
        nodes: Number of nodes in all, then in each tree, shape (1 + trees,).
    """

    q: Floats
    parent: NDArray[np.int32]
    cost: Floats
    number: NDArray[np.int32]
    neighbours: KdTree
    nodes: NDArray[np.int64]


def rooted_forest(roots: Floats, capacity: int) -> ForestArrays:
    """Make a tree for each root, shape (trees, dof), with room for `capacity` nodes in all."""
    trees, dof = roots.shape
    capacity = max(min(capacity, RESERVED_NODES), trees)
    forest = ForestArrays(
        q=np.empty((capacity, dof)),
        parent=np.empty(capacity, np.int32),
        cost=np.empty(capacity),
        number=np.empty(capacity, np.int32),
        neighbours=rooted_kdtree(roots, capacity),
        nodes=np.array([trees, *([1] * trees)]),
    )
    forest.q[:trees], forest.parent[:trees] = roots, -1
    forest.cost[:trees], forest.number[:trees] = 0.0, 0
    return forest


def enlarged_forest(forest: ForestArrays) -> ForestArrays:
    """Return the same trees with room for twice as many nodes."""
    n, capacity = int(forest.nodes[0]), 2 * len(forest.parent)
    return forest._replace(
        q=enlarged(forest.q, n, capacity),
        parent=enlarged(forest.parent, n, capacity),
        cost=enlarged(forest.cost, n, capacity),
        number=enlarged(forest.number, n, capacity),
        neighbours=enlarged_kdtree(forest.neighbours, capacity),
    )


@inline_helper
def fits(forest: ForestArrays, nodes: int) -> bool:
    """Whether so many more nodes fit, and at least one into the k-d trees."""
    return int(forest.nodes[0]) + nodes <= len(forest.parent) and has_room(forest.neighbours)


@inline_helper
def add(
    forest: ForestArrays,
    space: Any,
    log: Buffer,
    iteration: int,
    tree: int,
    parent: int,
    Q: Floats,
    row: int,
) -> int:
    """Add Q[row] to a tree as a child of `parent`, emit the edge, and return the new node."""
    node = int(forest.nodes[0])
    for k in range(len(space.lower)):
        forest.q[node, k] = Q[row, k]
    forest.parent[node] = parent
    forest.cost[node] = forest.cost[parent] + distance(space, forest.q, parent, Q, row)
    forest.number[node] = forest.nodes[1 + tree]
    insert(forest.neighbours, space, forest.q, node, tree)
    forest.nodes[0] += 1
    forest.nodes[1 + tree] += 1
    number, parent_number = forest.number[node], forest.number[parent]
    emit_edge(log, iteration, tree, number, parent_number, forest.cost[node], Q, row)
    return node


@inline_helper
def emit_roots(forest: ForestArrays, log: Buffer) -> None:
    """Emit the roots of the trees."""
    for root in range(len(forest.nodes) - 1):
        emit_edge(log, 0, root, 0, -1, 0.0, forest.q, root)


@inline_helper
def _depth(forest: ForestArrays, node: int) -> int:
    """Number of nodes from the root to `node`, both included; 0 for node -1."""
    depth = 0
    while node >= 0:
        depth += 1
        node = forest.parent[node]
    return depth


@inline_helper
def emit_tree_path(
    forest: ForestArrays,
    log: Buffer,
    iteration: int,
    stage: int,
    cost: float,
    start: int,
    goal: int,
) -> int:
    """Emit the path from the root of one tree to `start`, and from `goal` to the other root.

    Args:
        forest: The trees.
        log: Events.
        iteration: The planner's count.
        stage: A `Stage`.
        cost: Length of the path.
        start: A node of the tree that is rooted at the start.
        goal: A node of the other tree; -1 if there is one tree. It is left out if it has the same
            configuration as `start`.

    Returns:
        0, or the number of waypoints if the log has no room for them and nothing was emitted.
    """
    there, back = _depth(forest, start), _depth(forest, goal)
    if goal >= 0:
        same = True
        for k in range(forest.q.shape[1]):
            same = same and forest.q[start, k] == forest.q[goal, k]
        if same:
            goal, back = forest.parent[goal], back - 1
    n = there + back
    if room(log) < 2 or point_room(log) < n:
        return n
    first = take_points(log, n)
    for i in range(there):
        for k in range(forest.q.shape[1]):
            log.points[first + there - 1 - i, k] = forest.q[start, k]
        start = forest.parent[start]
    for i in range(there, n):
        for k in range(forest.q.shape[1]):
            log.points[first + i, k] = forest.q[goal, k]
        goal = forest.parent[goal]
    emit_path(log, iteration, stage, cost, first, n)
    return 0
