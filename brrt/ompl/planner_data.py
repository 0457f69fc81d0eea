"""What OMPL's `PlannerData` says of a planner's trees or graph at a moment."""

from dataclasses import dataclass
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
    """

    states: list[Any]
    q: Floats
    tree: Ints
    parent: Ints
    links: Ints
    bridges: Ints
    starts: list[int]


def read_graph(planner: Any, space: Space) -> PlannerGraph:
    """Read a planner's data now; it must not be in the midst of changing them."""
    data = base.PlannerData(planner.getSpaceInformation())
    planner.getPlannerData(data)
    name, n = type(planner).__name__, data.numVertices()
    states = [data.getVertex(i).getState() for i in range(n)]
    q = np.array([space.read(state) for state in states], np.float64).reshape(n, space.dof)
    q += 0.0  # no negative zeros, whose bits differ from those of zeros
    ends = [(i, j) for i in range(n) for j in data.getEdges(i)]
    edges = np.array(ends, np.int64).reshape(-1, 2)
    tree = np.zeros(n, np.int64)
    if name in TWO_TREES:
        tree[:] = [data.getVertex(i).getTag() == _GOAL_TAG for i in range(n)]
    starts = [data.getStartIndex(i) for i in range(data.numStartVertices())]
    if not starts:  # BFMT* states none
        starts = np.flatnonzero((tree == 0) & ~np.isin(np.arange(n), edges[:, 1])).tolist()
    return _oriented(states, q, tree, edges, starts, name in TWO_TREES + ONE_TREE)


def _oriented(
    states: list[Any], q: Floats, tree: Ints, edges: Ints, starts: list[int], has_parents: bool
) -> PlannerGraph:
    """Tell edges to parents from others: OMPL's lead from the start to the goal in both trees."""
    parent = np.full(len(states), -1, np.int64)
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
    return PlannerGraph(states, q, tree, parent, links, bridges, starts)
