"""Rapidly-exploring random tree (LaValle 1998)."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from brrt.events import Events, Kind, Phase, Stage, Status
from brrt.kernels.emit import EventLog
from brrt.kernels.jit import prepared
from brrt.kernels.kdtree import grown_kdtree, rooted_kdtree
from brrt.planners import _rrt
from brrt.planners.contract import Contract
from brrt.planners.planner import Planner
from brrt.planners.stop import Stop
from brrt.problem import Problem
from brrt.settings import param

_RESERVED_NODES = 1 << 22
"""Room that is asked for at once. Memory is taken only as it fills, so asking costs nothing, and a
tree that never has to grow never stands in memory twice."""

_DRAWS_PER_ITERATION = 1000
"""Where failed draws do not count, a run ends after this many draws for each iteration allowed."""


@dataclass(frozen=True, slots=True)
class RRT(Planner):
    """Rapidly-exploring random tree (LaValle 1998): one tree, grown from the start.

    Each iteration draws a configuration, steers towards it from the nearest node by at most
    `step`, and adds the new node where the motion is free. It stops at the first path.
    """

    step: float | None = param(
        None, "longest edge; 5 % of the map's longest side by default", above=0
    )
    goal_bias: float = param(0.05, "probability of drawing the goal", low=0, high=1)
    goal_test: Literal["step", "line-of-sight"] = param(
        "step", "the goal is reached from the newest node within one step, or from any distance"
    )
    keep_intermediate: bool = param(False, "keep every interpolated point of a vector as a node")
    slices: int = param(10, "points of a vector, with keep_intermediate", low=1, high=1000)
    count_failed: bool = param(True, "draws that add no node count as iterations")

    def contract(self, problem: Problem) -> Contract:
        """See `Planner.contract`."""
        return Contract(step=self._step(problem), line_of_sight=self.goal_test == "line-of-sight")

    def _step(self, problem: Problem) -> float:
        return self.step or 0.05 * problem.world.extent

    def solve(
        self, problem: Problem, rng: np.random.Generator, log: EventLog, stop: Stop
    ) -> Iterator[Events]:
        """See `Planner.solve`."""
        space = problem.space
        options = _rrt.Options(
            step=self._step(problem),
            goal_bias=self.goal_bias,
            line_of_sight=self.goal_test == "line-of-sight",
            slices=self.slices if self.keep_intermediate else 1,
            count_failed=self.count_failed,
        )
        nodes = 2 + (stop.iterations + 1) * options.slices
        tree = _planted_tree(problem, min(nodes, _RESERVED_NODES))
        counts, draw_limit = tree.counts, stop.iterations * _DRAWS_PER_ITERATION
        if self.count_failed:
            draw_limit = stop.iterations
        if stop.draws is not None:
            draw_limit = min(draw_limit, stop.draws)

        log.reserve(options.slices + 8)
        advance = prepared(_rrt.advance, tree, space, rng, log.buffer, options, 0, 0)
        log.emit(Kind.PHASE, 0, name=Phase.PLAN, status=Status.BEGIN)
        log.emit(Kind.EDGE, 0, tree=0, node=0, parent=-1, cost=0.0, q=problem.start)
        began = log.elapsed_s
        status = None
        while status is None:
            due = stop.reached(int(counts[_rrt.COUNTED]), log.elapsed_s - began)
            # Even where the end is due, the kernel still tests the newest node for the goal.
            share = stop.share(int(counts[_rrt.COUNTED])) if due is None else 0
            limit = counts[_rrt.COUNTED] + share
            log.tick()
            result = advance(tree, space, rng, log.buffer, options, int(limit), draw_limit)
            if result == _rrt.BATCH_FULL:
                yield log.drain()
            elif result == _rrt.TREE_FULL:
                tree = _grown_tree(tree)
            elif result == _rrt.SOLVED:
                status = Status.SOLVED
            elif due is None and counts[_rrt.DRAWS] >= draw_limit:
                status = Status.ITERATION_LIMIT
            else:
                status = due
        iteration = int(counts[_rrt.DRAWS])
        if log.room < 2:
            yield log.drain()
        if status is Status.SOLVED:
            goal = int(counts[_rrt.GOAL_NODE])
            waypoints = tree.q[_lineage(tree.parent, goal)]
            log.emit(
                Kind.PATH, iteration, stage=Stage.RAW, cost=tree.cost[goal], waypoints=waypoints
            )
        log.emit(Kind.PHASE, iteration, name=Phase.PLAN, status=status)
        yield log.drain()


def _planted_tree(problem: Problem, capacity: int) -> _rrt.Tree:
    """Make the tree that holds the start alone."""
    dof = problem.dof
    tree = _rrt.Tree(
        q=np.empty((capacity, dof)),
        parent=np.empty(capacity, np.int32),
        cost=np.empty(capacity),
        neighbours=rooted_kdtree(problem.start, capacity),
        counts=np.array([1, 0, 0, 0, -1]),
        scratch=np.array([problem.start, problem.start, problem.goal]),
    )
    tree.q[0], tree.parent[0], tree.cost[0] = problem.start, -1, 0.0
    return tree


def _grown_tree(tree: _rrt.Tree) -> _rrt.Tree:
    """Return the tree with twice the room, whatever it ran out of."""
    n, capacity = int(tree.counts[_rrt.NODES]), 2 * len(tree.parent)
    q, parent = np.empty((capacity, tree.q.shape[1])), np.empty(capacity, np.int32)
    cost = np.empty(capacity)
    q[:n], parent[:n], cost[:n] = tree.q[:n], tree.parent[:n], tree.cost[:n]
    neighbours = grown_kdtree(tree.neighbours, capacity)
    return tree._replace(q=q, parent=parent, cost=cost, neighbours=neighbours)


def _lineage(parent: NDArray[np.int32], node: int) -> list[int]:
    """Nodes from the root to `node`."""
    # A view of the memory reads a number ten times as fast as an array does.
    up: memoryview[int] = parent.data
    nodes = []
    while node >= 0:
        nodes.append(node)
        node = up[node]
    return nodes[::-1]
