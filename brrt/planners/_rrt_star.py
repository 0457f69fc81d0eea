"""The compiled loop of RRT*, with one tree or two.

Each pass of the loop makes one extension, with the choice of a parent and the rewiring: of one tree
towards the sample or, if there are two, of the other tree towards the newest node of the first. So
each helper is compiled into it only once. It can stop between any two extensions, and within one
before any motion check.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brrt.events import Reason, Source, Stage, Status
from brrt.kernels.emit import (
    Buffer,
    emit_connect,
    emit_plan_end,
    emit_reject,
    emit_rewire,
    emit_sample,
    paused,
    room,
)
from brrt.kernels.forest import ForestArrays, add, emit_roots, emit_tree_path, fits
from brrt.kernels.jit import helper, inline_helper, kernel
from brrt.kernels.kdtree import near, nearest
from brrt.kernels.random import Random, uniform
from brrt.kernels.space import distance, sample_informed, sample_uniform, segment_free, steer
from brrt.planners.base.kernel_planner import (
    BATCH_FULL,
    COUNTED,
    DRAWS,
    ENDED,
    LIMIT,
    OWN,
    PAUSED,
    POINTS,
    STATE_FULL,
)

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

SOLVED = int(Status.SOLVED)
UNIFORM, GOAL, INFORMED = int(Source.UNIFORM), int(Source.GOAL), int(Source.INFORMED)
COLLISION, NO_PROGRESS = int(Reason.COLLISION), int(Reason.NO_PROGRESS)
LINK_BLOCKED, NEAR_BLOCKED = int(Reason.LINK_BLOCKED), int(Reason.NEAR_BLOCKED)
NO_GAIN = int(Reason.NO_GAIN)
RAW, IMPROVED = int(Stage.RAW), int(Stage.IMPROVED)

(
    STAGE, PART, TREE, TURN, CLOSE, NEAR, NEXT, GOAL_NODE, GOAL_NEAR, LINKS, BEST, PATHS, NEWEST,
) = range(OWN, OWN + 13)  # fmt: skip
"""Places in `RRTStarState.counts`: the stage, the part of an extension, the tree that is being
extended, the tree whose turn it is, the node nearest to the target, the number of nodes near the
new one and which of them to rewire next, the node at the goal or -1 (of one tree), whether the goal
is the next sample because it is within reach, the number of links between two trees, the best link
or -1, the number of paths, and from here on the newest node of each tree (two places)."""
COUNTS = NEWEST + 2

_BEGIN, _DRAW, _GROW, _LINK, _REPORT = range(5)
"""Stages: emit the roots, draw a sample, extend a tree towards it, extend the other tree towards
the newest node, emit the path if it is better."""

_STEER, _CHOOSE, _REWIRE = range(3)
"""Parts of an extension: steer and find the nodes near the new one, choose its parent, rewire."""

_TARGET, _NEW, _GOAL, _START = range(4)
"""Rows of `RRTStarState.scratch`: the configuration that an extension heads for, the new node, goal
and start."""

_UNKNOWN, _FREE, _BLOCKED = range(3)
"""Results of the motion checks between the new node and those near it."""

_NO_NODE, _UNFINISHED = -1, -2
"""Results of an extension that is not a node."""

_REPORTED, _LEAST, _MOVED = range(3)
"""Places in `RRTStarState.best`: the cost of the best path that was emitted, the least cost over
any link, and the length of the current extension."""


class RRTStarOptions(NamedTuple):
    """The settings that the loop needs; see `RRTStar` and `BiRRTStar`."""

    step: float
    goal_bias: float
    gamma: float
    informed: bool
    stop_at_first: bool
    link: float


class RRTStarState(NamedTuple):
    """The trees and the state of the loop.

    Attributes:
        forest: Tree 0 grows from the start; tree 1, if there is one, from the goal.
        edge: Length of the edge to each node's parent, shape (capacity,).
        child: First child of each node or -1, shape (capacity,).
        sibling: The next and the previous child of a node's parent or -1, shape (capacity, 2).
        near: Nodes near the new one, shape (capacity,).
        far: Their distances from it, shape (capacity,).
        known: Results of the motion checks to them, shape (capacity,).
        stack: Nodes whose cost has changed, shape (capacity,).
        links: Nodes of tree 0 and of tree 1 of each link, and the next link at either node or -1,
            shape (capacity, 4); empty if there is one tree, as are the next two.
        link_far: Length of each link, shape (capacity,).
        linked: The newest link at each node or -1, shape (capacity,).
        counts: See `kernel_planner` and above, shape (COUNTS,).
        best: See above, shape (3,).
        scratch: The target, the new node, goal and start, shape (4, dof).
    """

    forest: ForestArrays
    edge: Floats
    child: Ints
    sibling: Ints
    near: Ints
    far: Floats
    known: NDArray[np.uint8]
    stack: Ints
    links: Ints
    link_far: Floats
    linked: Ints
    counts: NDArray[np.int64]
    best: Floats
    scratch: Floats


@helper
def free(space: Any, A: Floats, i: int, B: Floats, j: int) -> bool:
    """Whether a motion is free; compiled only once, because it is called in four places."""
    return bool(segment_free(space, A, i, B, j))


@inline_helper
def draw(
    state: RRTStarState, space: Any, rng: Random, log: Buffer, options: RRTStarOptions
) -> None:
    """Choose a tree and its target."""
    counts, scratch = state.counts, state.scratch
    two = len(state.forest.nodes) > 2
    counts[DRAWS] += 1
    if two and counts[DRAWS] > 1:
        counts[TURN] = 1 - counts[TURN]
    counts[TREE] = counts[TURN]
    source = UNIFORM
    if not two and counts[GOAL_NODE] < 0:
        # If the goal is within reach of the newest node, draw it now.
        if counts[GOAL_NEAR] or uniform(rng) < options.goal_bias:
            source = GOAL
    elif options.informed and counts[PATHS] > 0:
        source = INFORMED
    if source == GOAL:
        counts[GOAL_NEAR] = 0
        for k in range(len(space.lower)):
            scratch[_TARGET, k] = scratch[_GOAL, k]
    elif source == INFORMED:
        best = state.best[_REPORTED]
        sample_informed(space, rng, scratch, _START, _GOAL, best, scratch, _TARGET)
    else:
        sample_uniform(space, rng, scratch, _TARGET)
    emit_sample(log, counts[DRAWS], counts[TREE], source, scratch, _TARGET)


@inline_helper
def near_radius(state: RRTStarState, space: Any, tree: int, options: RRTStarOptions) -> float:
    """Radius within which nodes are near a node that is about to join a tree."""
    n = state.forest.nodes[1 + tree] + 1.0
    return float(min(options.step, options.gamma * (math.log(n) / n) ** (1.0 / len(space.lower))))


@inline_helper
def reject(
    state: RRTStarState, log: Buffer, tree: int, node: int, reason: int, Q: Floats, row: int
) -> None:
    """Emit that the extension from a node to Q[row] failed."""
    emit_reject(log, state.counts[DRAWS], tree, state.forest.number[node], reason, Q, row)


@inline_helper
def choose_parent(
    state: RRTStarState, space: Any, log: Buffer, tree: int, nearest_node: int
) -> int:
    """Return the parent over which the new node costs least; the nearest node's motion is free.

    Candidates are checked in the order of cost, so that usually one motion is checked.

    Returns:
        The parent; -2 if it is not chosen yet because the loop is to return.
    """
    forest, scratch = state.forest, state.scratch
    parent, cost = nearest_node, forest.cost[nearest_node] + state.best[_MOVED]
    while True:
        # An event of this function or the new edge, and an event of `link`.
        if room(log) < 2 or paused(log):
            return _UNFINISHED
        best, least = -1, cost
        for a in range(state.counts[NEAR]):
            if state.known[a] == _UNKNOWN:
                through = forest.cost[state.near[a]] + state.far[a]
                if through < least:
                    best, least = a, through
        if best < 0:
            return int(parent)
        candidate = state.near[best]
        if free(space, forest.q, candidate, scratch, _NEW):
            state.known[best] = _FREE
            return int(candidate)
        state.known[best] = _BLOCKED
        reject(state, log, tree, candidate, NEAR_BLOCKED, scratch, _NEW)


@inline_helper
def add_child(state: RRTStarState, node: int, parent: int) -> None:
    """Add a node to the children of its parent."""
    first = state.child[parent]
    state.sibling[node, 0], state.sibling[node, 1] = first, -1
    if first >= 0:
        state.sibling[first, 1] = node
    state.child[parent] = node


@inline_helper
def remove_child(state: RRTStarState, node: int) -> None:
    """Remove a node from the children of its parent."""
    after, before = state.sibling[node, 0], state.sibling[node, 1]
    if before >= 0:
        state.sibling[before, 0] = after
    else:
        state.child[state.forest.parent[node]] = after
    if after >= 0:
        state.sibling[after, 1] = before


@inline_helper
def update_best_link(state: RRTStarState, node: int) -> None:
    """Update the best link after the cost of a node has decreased."""
    if len(state.linked) == 0:
        return
    cost, link = state.forest.cost, state.linked[node]
    while link >= 0:
        start, goal = state.links[link, 0], state.links[link, 1]
        through = cost[start] + state.link_far[link] + cost[goal]
        if through < state.best[_LEAST]:
            state.best[_LEAST], state.counts[BEST] = through, link
        link = state.links[link, 2 if start == node else 3]


@inline_helper
def update_costs(state: RRTStarState, node: int) -> None:
    """Update the costs of a node's descendants."""
    cost, top = state.forest.cost, 1
    state.stack[0] = node
    while top > 0:
        top -= 1
        above = state.stack[top]
        update_best_link(state, above)
        child = state.child[above]
        while child >= 0:
            cost[child] = cost[above] + state.edge[child]
            state.stack[top] = child
            top += 1
            child = state.sibling[child, 0]


@inline_helper
def rewire(state: RRTStarState, space: Any, log: Buffer, tree: int, node: int) -> bool:
    """Make the new node the parent of the nodes near it whose cost this decreases.

    Returns:
        Whether all are rewired; if not, the loop is to return.
    """
    forest, counts = state.forest, state.counts
    for a in range(counts[NEXT], counts[NEAR]):
        other = state.near[a]
        cost = forest.cost[node] + state.far[a]
        if state.known[a] == _BLOCKED or cost >= forest.cost[other]:
            continue
        if room(log) < 2 or paused(log):
            counts[NEXT] = a
            return False
        if state.known[a] == _UNKNOWN and not free(space, forest.q, node, forest.q, other):
            reject(state, log, tree, node, NEAR_BLOCKED, forest.q, other)
            continue
        remove_child(state, other)
        forest.parent[other], forest.cost[other], state.edge[other] = node, cost, state.far[a]
        add_child(state, other, node)
        update_costs(state, other)
        number, parent = forest.number[other], forest.number[node]
        emit_rewire(log, counts[DRAWS], tree, number, parent, cost)
    return True


@inline_helper
def begin_extension(
    state: RRTStarState, space: Any, log: Buffer, options: RRTStarOptions, tree: int
) -> bool:
    """Steer to a new configuration and find the nodes near it; return whether it is reached."""
    forest, counts, scratch = state.forest, state.counts, state.scratch
    close = nearest(forest.neighbours, space, scratch, _TARGET, tree)
    moved = steer(space, forest.q, close, scratch, _TARGET, options.step, scratch, _NEW)
    if moved == 0.0:
        reject(state, log, tree, close, NO_PROGRESS, scratch, _NEW)
        return False
    if options.informed and counts[PATHS] > 0:
        there = distance(space, scratch, _START, scratch, _NEW)
        back = distance(space, scratch, _NEW, scratch, _GOAL)
        if there + back >= state.best[_REPORTED]:
            reject(state, log, tree, close, NO_GAIN, scratch, _NEW)
            return False
    if not free(space, forest.q, close, scratch, _NEW):
        reject(state, log, tree, close, COLLISION, scratch, _NEW)
        return False
    reach = near_radius(state, space, tree, options)
    count = near(forest.neighbours, space, scratch, _NEW, tree, reach, state.near, state.far)
    for a in range(count):
        state.known[a] = _FREE if state.near[a] == close else _UNKNOWN
    counts[CLOSE], counts[NEAR], state.best[_MOVED] = close, count, moved
    return True


@inline_helper
def extend(state: RRTStarState, space: Any, log: Buffer, options: RRTStarOptions) -> int:
    """Extend a tree towards the target: steer, choose a parent, add, rewire.

    Returns:
        The new node; -1 if there is none; -2 if it is not finished because the loop is to return.
    """
    forest, counts, scratch = state.forest, state.counts, state.scratch
    tree = counts[TREE]
    if counts[PART] == _STEER:
        if not begin_extension(state, space, log, options, tree):
            return _NO_NODE
        counts[PART] = _CHOOSE
    if counts[PART] == _CHOOSE:
        parent = choose_parent(state, space, log, tree, int(counts[CLOSE]))
        if parent == _UNFINISHED:
            return _UNFINISHED
        node = add(forest, space, log, counts[DRAWS], tree, parent, scratch, _NEW)
        state.edge[node] = distance(space, forest.q, parent, forest.q, node)
        state.child[node] = -1
        if len(state.linked) > 0:
            state.linked[node] = -1
        add_child(state, node, parent)
        counts[NEWEST + tree], counts[NEXT], counts[PART] = node, 0, _REWIRE
    node = int(counts[NEWEST + tree])
    if not rewire(state, space, log, tree, node):
        return _UNFINISHED
    counts[PART] = _STEER
    return node


@inline_helper
def link(state: RRTStarState, space: Any, log: Buffer, options: RRTStarOptions) -> None:
    """Link the trees at their newest nodes, if these are close and the motion is free."""
    forest, counts = state.forest, state.counts
    start, goal = counts[NEWEST], counts[NEWEST + 1]
    far = distance(space, forest.q, start, forest.q, goal)
    if far > options.link:
        return
    if not free(space, forest.q, start, forest.q, goal):
        reject(state, log, 0, start, LINK_BLOCKED, forest.q, goal)
        return
    cost = forest.cost[start] + far + forest.cost[goal]
    emit_connect(log, counts[DRAWS], forest.number[start], forest.number[goal], cost)
    new = counts[LINKS]
    state.links[new, 0], state.links[new, 2], state.linked[start] = start, state.linked[start], new
    state.links[new, 1], state.links[new, 3], state.linked[goal] = goal, state.linked[goal], new
    state.link_far[new] = far
    counts[LINKS] += 1
    update_best_link(state, start)


@inline_helper
def path_cost(state: RRTStarState) -> float:
    """Return the cost of the best path; infinite if there is none."""
    if len(state.forest.nodes) > 2:
        return float(state.best[_LEAST])
    goal = state.counts[GOAL_NODE]
    return float(state.forest.cost[goal]) if goal >= 0 else np.inf


@inline_helper
def report_path(state: RRTStarState, log: Buffer) -> bool:
    """Emit the best path if it is better than before; return False if the log has no room."""
    forest, counts = state.forest, state.counts
    cost = path_cost(state)
    if cost >= state.best[_REPORTED]:
        return True
    start, goal = counts[GOAL_NODE], -1
    if len(forest.nodes) > 2:
        start, goal = state.links[counts[BEST], 0], state.links[counts[BEST], 1]
    stage = IMPROVED if counts[PATHS] > 0 else RAW
    counts[POINTS] = emit_tree_path(forest, log, counts[DRAWS], stage, cost, start, goal)
    if counts[POINTS] > 0:
        return False
    state.best[_REPORTED] = cost
    counts[PATHS] += 1
    return True


@inline_helper
def next_stage(state: RRTStarState, space: Any, options: RRTStarOptions, node: int) -> int:
    """Return the stage that follows an extension."""
    counts, scratch = state.counts, state.scratch
    if len(state.forest.nodes) > 2:
        if counts[STAGE] == _LINK or node < 0:
            return _REPORT
        for k in range(len(space.lower)):
            scratch[_TARGET, k] = state.forest.q[node, k]
        counts[TREE] = 1 - counts[TREE]
        return _LINK
    if node >= 0 and counts[GOAL_NODE] < 0:
        far = distance(space, state.forest.q, node, scratch, _GOAL)
        if far == 0.0:
            counts[GOAL_NODE] = node
        else:
            counts[GOAL_NEAR] = int(far <= options.step)
    return _REPORT


@kernel
def advance(
    state: RRTStarState,
    space: Any,
    rng: Random,
    log: Buffer,
    options: RRTStarOptions,
    limit: int,
    draw_limit: int,
) -> int:
    """Run until done, out of room, or until `limit` iterations or `draw_limit` draws are made."""
    counts = state.counts
    if counts[STAGE] == _BEGIN:
        emit_roots(state.forest, log)
        if len(state.forest.nodes) > 2:
            link(state, space, log, options)
        counts[STAGE] = _REPORT
    while True:
        if counts[STAGE] == _REPORT:
            if not report_path(state, log):
                return BATCH_FULL
            counts[COUNTED] = counts[DRAWS]
            counts[STAGE] = _DRAW
            if options.stop_at_first and counts[PATHS] > 0:
                emit_plan_end(log, counts[DRAWS], SOLVED)
                return ENDED
        if room(log) < 6:
            return BATCH_FULL
        if not fits(state.forest, 1):
            return STATE_FULL
        if counts[STAGE] == _DRAW and (counts[COUNTED] >= limit or counts[DRAWS] >= draw_limit):
            return LIMIT
        if paused(log):
            return PAUSED
        if counts[STAGE] == _DRAW:
            draw(state, space, rng, log, options)
            counts[STAGE] = _GROW
        node = extend(state, space, log, options)
        if node == _UNFINISHED:
            continue
        stage = next_stage(state, space, options, node)
        if counts[STAGE] == _LINK:
            link(state, space, log, options)
        counts[STAGE] = stage
