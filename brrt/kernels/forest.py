"""The trees that planners grow: nodes with parents, costs-to-come and nearest neighbours."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brrt.events import Kind
from brrt.kernels.emit import Buffer, emit, point_room, room, take_points
from brrt.kernels.jit import inline_helper
from brrt.kernels.kdtree import KdTree, grown_kdtree, has_room, insert, rooted_kdtree
from brrt.kernels.space import distance

Floats = NDArray[np.float64]

_EDGE, _PATH = int(Kind.EDGE), int(Kind.PATH)

RESERVED_NODES = 1 << 22
"""Room that is asked for at once. Memory is taken only as it fills, so asking costs nothing, and a
tree that never has to grow never stands in memory twice."""


class Forest(NamedTuple):
    """Trees that share their arrays; tree r begins with node r, its root.

    Attributes:
        q: Configuration of each node, shape (capacity, dof).
        parent: Parent of each node, -1 for a root, shape (capacity,).
        cost: Cost-to-come of each node, shape (capacity,).
        number: Number of each node within its own tree, shape (capacity,).
        neighbours: Nearest neighbours, tree by tree.
        nodes: Nodes in all, then in each tree, shape (1 + trees,).
    """

    q: Floats
    parent: NDArray[np.int32]
    cost: Floats
    number: NDArray[np.int32]
    neighbours: KdTree
    nodes: NDArray[np.int64]


def rooted_forest(roots: Floats, capacity: int) -> Forest:
    """Make a tree for each root, shape (trees, dof), with room for `capacity` nodes in all."""
    trees, dof = roots.shape
    capacity = max(min(capacity, RESERVED_NODES), trees)
    forest = Forest(
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


def grown_forest(forest: Forest) -> Forest:
    """Return the same trees with twice the room, whatever they ran out of."""
    n, capacity = int(forest.nodes[0]), 2 * len(forest.parent)
    return forest._replace(
        q=grown(forest.q, n, capacity),
        parent=grown(forest.parent, n, capacity),
        cost=grown(forest.cost, n, capacity),
        number=grown(forest.number, n, capacity),
        neighbours=grown_kdtree(forest.neighbours, capacity),
    )


def grown(column: NDArray[Any], n: int, capacity: int) -> NDArray[Any]:
    """Return a column with its first n rows and room for `capacity`."""
    larger = np.empty((capacity, *column.shape[1:]), column.dtype)
    larger[:n] = column[:n]
    return larger


@inline_helper
def fits(forest: Forest, nodes: int) -> bool:
    """Whether so many more nodes fit, and one of them among the neighbours."""
    return int(forest.nodes[0]) + nodes <= len(forest.parent) and has_room(forest.neighbours)


@inline_helper
def add(
    forest: Forest, space: Any, log: Buffer, iteration: int, tree: int, parent: int, Q: Floats,
    row: int,
) -> int:  # fmt: skip
    """Join Q[row] to a tree below `parent`, say so, and return the new node."""
    node = int(forest.nodes[0])
    for k in range(len(space.lower)):
        forest.q[node, k] = Q[row, k]
    forest.parent[node] = parent
    forest.cost[node] = forest.cost[parent] + distance(space, forest.q, parent, Q, row)
    forest.number[node] = forest.nodes[1 + tree]
    insert(forest.neighbours, space, forest.q, node, tree)
    forest.nodes[0] += 1
    forest.nodes[1 + tree] += 1
    above = forest.number[parent]
    emit(log, _EDGE, iteration, tree, forest.number[node], above, forest.cost[node], Q, row)
    return node


@inline_helper
def emit_roots(forest: Forest, log: Buffer) -> None:
    """Say where the trees begin."""
    for root in range(len(forest.nodes) - 1):
        emit(log, _EDGE, 0, root, 0, -1, 0.0, forest.q, root)


@inline_helper
def _depth(forest: Forest, node: int) -> int:
    """Nodes from a root to `node`, both included; 0 for no node."""
    depth = 0
    while node >= 0:
        depth += 1
        node = forest.parent[node]
    return depth


@inline_helper
def emit_path(
    forest: Forest, log: Buffer, iteration: int, stage: int, cost: float, start: int, goal: int
) -> int:
    """Say that there is a path from the root of one tree to `start`, and on over `goal`.

    Args:
        forest: The trees.
        log: Events.
        iteration: The planner's count.
        stage: A `Stage`.
        cost: Its length.
        start: A node of the tree that begins at the start.
        goal: A node of the other tree, from which it leads down to the root; -1 for none. Where it
            coincides with `start`, it is left out.

    Returns:
        0, or how many waypoints it has where these do not fit into the log any more; then nothing
        was said.
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
    emit(log, _PATH, iteration, stage, first, n, cost, forest.q, 0)
    return 0
