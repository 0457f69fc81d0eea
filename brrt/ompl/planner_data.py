"""What OMPL's `PlannerData` says of a planner's trees or graph at a moment."""

from dataclasses import dataclass
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import NDArray
from ompl import base

from brrt.ompl.spaces import Space

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

GRAPHS = ("PRM", "PRMstar")
"""Planners whose edges lead both ways."""

TWO_TREES = ("RRTConnect", "BFMT", "BKPIECE1", "LBKPIECE1", "AORRTC")
"""Planners that grow a second tree from the goal; its vertices have the tag `_GOAL_TAG`."""

ONE_TREE = ("RRT", "RRTstar", "InformedRRTstar", "SORRTstar", "BITstar", "FMT", "KPIECE1")
"""Planners that grow a tree from the start."""

_GOAL_TAG = 2


@dataclass(frozen=True, slots=True, eq=False)
class PlannerGraph:
    """The vertices and edges of a planner.

    Attributes:
        states: The states, n of them.
        q: Their configurations, shape (n, dof).
        tree: 0 for vertices of the start's tree, 1 for those of the goal's, shape (n,).
        parent: Vertex of each one's parent, or -1, shape (n,).
        links: Pairs of vertices of one tree that have an edge beside, shape (m, 2).
        bridges: Pairs of vertices of tree 0 and tree 1 that have an edge, shape (k, 2).
        starts: Vertices that the planner counts as starts: FMT* all that have no parent yet.
        goals: Vertices that it counts as goals.
    """

    states: list[Any]
    q: Floats
    tree: Ints
    parent: Ints
    links: Ints
    bridges: Ints
    starts: list[int]
    goals: list[int]

    def path_to(self, vertex: int) -> list[int]:
        """Return the vertices from a root to a vertex."""
        path = [vertex]
        while self.parent[path[-1]] >= 0:
            path.append(int(self.parent[path[-1]]))
        return path[::-1]


def read_graph(planner: Any, space: Space) -> PlannerGraph:
    """Read a planner's data now; it must not be in the midst of changing them."""
    data = base.PlannerData(planner.getSpaceInformation())
    planner.getPlannerData(data)
    name, n = type(planner).__name__, data.numVertices()
    states = [data.getVertex(i).getState() for i in range(n)]
    numbers = chain.from_iterable(map(space.read, states))
    q = np.fromiter(numbers, np.float64, n * space.dof).reshape(n, space.dof)
    q += 0.0  # no negative zeros, whose bits differ from those of zeros
    targets = [data.getEdges(i) for i in range(n)]
    counts = np.fromiter(map(len, targets), np.int64, n)
    ends = np.fromiter(chain.from_iterable(targets), np.int64, int(counts.sum()))
    edges = np.stack([np.repeat(np.arange(n), counts), ends], axis=1)
    tree = np.zeros(n, np.int64)
    if name in TWO_TREES:
        tree[:] = [data.getVertex(i).getTag() == _GOAL_TAG for i in range(n)]
    starts = [data.getStartIndex(i) for i in range(data.numStartVertices())]
    if not starts:  # BFMT* states none
        starts = np.flatnonzero((tree == 0) & ~np.isin(np.arange(n), edges[:, 1])).tolist()
    goals = [data.getGoalIndex(i) for i in range(data.numGoalVertices())]
    parent, links, bridges = _oriented(tree, edges, name in TWO_TREES + ONE_TREE)
    return PlannerGraph(states, q, tree, parent, links, bridges, starts, goals)


def _oriented(tree: Ints, edges: Ints, has_parents: bool) -> tuple[Ints, Ints, Ints]:
    """Return parents, links and bridges: OMPL's edges lead from start to goal in both trees."""
    parent = np.full(len(tree), -1, np.int64)
    of = tree[edges]
    bridges, inner = edges[of[:, 0] != of[:, 1]], edges[of[:, 0] == of[:, 1]]
    bridges = np.take_along_axis(bridges, np.argsort(tree[bridges], axis=1), axis=1)
    links = inner
    if has_parents:
        down = np.where(tree[inner[:, :1]] == 0, inner, inner[:, ::-1])
        _, first = np.unique(down[:, 1], return_index=True)
        parent[down[first, 1]] = down[first, 0]
        links = np.delete(down, first, axis=0)
    links = np.unique(np.sort(links, axis=1), axis=0)
    return parent, links, bridges
