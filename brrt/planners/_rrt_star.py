"""The compiled loop of RRT*, with one tree or with two.

Each pass of the loop makes one extension with the choice of a parent and the rewiring that follow
it: of one tree towards the sample or, where there are two, of the other towards the newest node of
the first. So it can stop between any two, and each kernel is compiled into it once.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brrt.events import Kind, Reason, Source, Stage, Status
from brrt.kernels.emit import Buffer, emit, emit_end, room
from brrt.kernels.forest import Forest, add, emit_path, emit_roots, fits
from brrt.kernels.jit import helper, inline_helper, kernel
from brrt.kernels.kdtree import near, nearest
from brrt.kernels.random import Random, uniform
from brrt.kernels.space import distance, sample_informed, sample_uniform, segment_free, steer
from brrt.planners.base.kernel_planner import (
    BATCH_FULL,
    COUNTED,
    DRAWS,
    ENDED,
    EVENTS,
    LIMIT,
    OWN,
    POINTS,
    STATE_FULL,
)

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

SAMPLE, REJECT, REWIRE = int(Kind.SAMPLE), int(Kind.REJECT), int(Kind.REWIRE)
CONNECT, SOLVED = int(Kind.CONNECT), int(Status.SOLVED)
UNIFORM, GOAL, INFORMED = int(Source.UNIFORM), int(Source.GOAL), int(Source.INFORMED)
COLLISION, NO_PROGRESS = int(Reason.COLLISION), int(Reason.NO_PROGRESS)
LINK_BLOCKED, NEAR_BLOCKED = int(Reason.LINK_BLOCKED), int(Reason.NEAR_BLOCKED)
NO_GAIN = int(Reason.NO_GAIN)
RAW, IMPROVED = int(Stage.RAW), int(Stage.IMPROVED)

STAGE, TREE, TURN, GOAL_NODE, GOAL_NEAR, LINKS, BEST, PATHS, NEWEST = range(OWN, OWN + 9)
"""Places in `Star.counts`: what is under way, the tree that is being extended, the tree whose turn
it is, the node at the goal or -1 (of one tree), whether the next sample is to be the goal because
it is within reach, links between two trees, the best of them or -1, paths so far, and from here on
the newest node of each tree (two places)."""
COUNTS = NEWEST + 2

_BEGIN, _DRAW, _GROW, _LINK, _TELL = range(5)
"""Stages: say where the trees begin, draw a sample, grow towards it, link the other tree to what
has grown, say what has come of it."""

_TARGET, _NEW, _GOAL, _START = range(4)
"""Rows of `Star.scratch`: what an extension heads for, the new node, goal and start."""

_UNKNOWN, _FREE, _BLOCKED = range(3)
"""What is known of the motion between the new node and one near it."""

_TOLD, _LEAST = range(2)
"""Places in `Star.best`: the cost of the best path that was told, and of the best over any link."""


class Options(NamedTuple):
    """What of the settings the loop needs; see `RRTStar` and `BiRRTStar`."""

    step: float
    goal_bias: float
    gamma: float
    informed: bool
    stop_at_first: bool
    link: float


class Star(NamedTuple):
    """The trees so far, and the loop's place in them.

    Attributes:
        forest: Tree 0 grows from the start; tree 1, if there is one, from the goal.
        edge: Length of the edge to each node's parent, shape (capacity,).
        child: First child of each node or -1, shape (capacity,).
        sibling: The next and the previous child of a node's parent or -1, shape (capacity, 2).
        near: Nodes near the new one, shape (capacity,).
        far: How far they are, shape (capacity,).
        known: What is known of the motions to them, shape (capacity,).
        stack: Nodes whose cost has changed, shape (capacity,).
        links: For each link its node of tree 0 and of tree 1, and the next link at either node or
            -1, shape (capacity, 4); with one tree there are none, nor the two that follow.
        link_far: Length of each link, shape (capacity,).
        linked: The last link at each node or -1, shape (capacity,).
        counts: See `drive` and above, shape (COUNTS,).
        best: See above, shape (2,).
        scratch: The target, the new node, goal and start, shape (4, dof).
    """

    forest: Forest
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
    """Whether a motion is free; compiled once, for it is asked for in four places."""
    return bool(segment_free(space, A, i, B, j))


@inline_helper
def draw(star: Star, space: Any, rng: Random, log: Buffer, options: Options) -> None:
    """Choose a tree and what it heads for."""
    counts, scratch = star.counts, star.scratch
    two = len(star.forest.nodes) > 2
    counts[DRAWS] += 1
    if two and counts[DRAWS] > 1:
        counts[TURN] = 1 - counts[TURN]
    counts[TREE] = counts[TURN]
    source = UNIFORM
    if not two and counts[GOAL_NODE] < 0:
        # Where the newest node can reach the goal, nothing is gained by waiting for the bias.
        if counts[GOAL_NEAR] or uniform(rng) < options.goal_bias:
            source = GOAL
    elif options.informed and counts[PATHS] > 0:
        source = INFORMED
    if source == GOAL:
        counts[GOAL_NEAR] = 0
        for k in range(len(space.lower)):
            scratch[_TARGET, k] = scratch[_GOAL, k]
    elif source == INFORMED:
        sample_informed(space, rng, scratch, _START, _GOAL, star.best[_TOLD], scratch, _TARGET)
    else:
        sample_uniform(space, rng, scratch, _TARGET)
    emit(log, SAMPLE, counts[DRAWS], counts[TREE], source, 0, 0.0, scratch, _TARGET)


@inline_helper
def radius(star: Star, space: Any, tree: int, options: Options) -> float:
    """Return the radius of the neighbourhood of a node that is about to join a tree."""
    n = star.forest.nodes[1 + tree] + 1.0
    return float(min(options.step, options.gamma * (math.log(n) / n) ** (1.0 / len(space.lower))))


@inline_helper
def reject(star: Star, log: Buffer, tree: int, node: int, reason: int, Q: Floats, row: int) -> None:
    """Say that a motion from a node to Q[row] was of no use."""
    number = star.forest.number[node]
    emit(log, REJECT, star.counts[DRAWS], tree, number, reason, 0.0, Q, row)


@inline_helper
def choose_parent(
    star: Star, space: Any, log: Buffer, tree: int, nearest_node: int, step: float, count: int
) -> int:
    """Return the node over which the new one costs least; the nearest one is known to be free.

    The cheapest candidate is looked at first, so that as a rule one motion is checked.
    """
    forest, scratch = star.forest, star.scratch
    parent, cost = nearest_node, forest.cost[nearest_node] + step
    while True:
        best, least = -1, cost
        for a in range(count):
            if star.known[a] == _UNKNOWN:
                through = forest.cost[star.near[a]] + star.far[a]
                if through < least:
                    best, least = a, through
        if best < 0:
            return parent
        candidate = star.near[best]
        if free(space, forest.q, candidate, scratch, _NEW):
            star.known[best] = _FREE
            return int(candidate)
        star.known[best] = _BLOCKED
        reject(star, log, tree, candidate, NEAR_BLOCKED, scratch, _NEW)


@inline_helper
def adopt(star: Star, node: int, parent: int) -> None:
    """Enter a node among its parent's children."""
    first = star.child[parent]
    star.sibling[node, 0], star.sibling[node, 1] = first, -1
    if first >= 0:
        star.sibling[first, 1] = node
    star.child[parent] = node


@inline_helper
def leave(star: Star, node: int) -> None:
    """Strike a node from its parent's children."""
    after, before = star.sibling[node, 0], star.sibling[node, 1]
    if before >= 0:
        star.sibling[before, 0] = after
    else:
        star.child[star.forest.parent[node]] = after
    if after >= 0:
        star.sibling[after, 1] = before


@inline_helper
def look_at_links(star: Star, node: int) -> None:
    """See whether the links at a node have become the best, now that the node costs less."""
    if len(star.linked) == 0:
        return
    cost, link = star.forest.cost, star.linked[node]
    while link >= 0:
        start, goal = star.links[link, 0], star.links[link, 1]
        through = cost[start] + star.link_far[link] + cost[goal]
        if through < star.best[_LEAST]:
            star.best[_LEAST], star.counts[BEST] = through, link
        link = star.links[link, 2 if start == node else 3]


@inline_helper
def settle(star: Star, node: int) -> None:
    """Let the costs below a node follow its own."""
    cost, top = star.forest.cost, 1
    star.stack[0] = node
    while top > 0:
        top -= 1
        above = star.stack[top]
        look_at_links(star, above)
        child = star.child[above]
        while child >= 0:
            cost[child] = cost[above] + star.edge[child]
            star.stack[top] = child
            top += 1
            child = star.sibling[child, 0]


@inline_helper
def rewire(star: Star, space: Any, log: Buffer, tree: int, node: int, count: int) -> None:
    """Make the new node the parent of those near it that it serves better."""
    forest = star.forest
    for a in range(count):
        other = star.near[a]
        cost = forest.cost[node] + star.far[a]
        if star.known[a] == _BLOCKED or cost >= forest.cost[other]:
            continue
        if star.known[a] == _UNKNOWN and not free(space, forest.q, node, forest.q, other):
            reject(star, log, tree, node, NEAR_BLOCKED, forest.q, other)
            continue
        leave(star, other)
        forest.parent[other], forest.cost[other], star.edge[other] = node, cost, star.far[a]
        adopt(star, other, node)
        settle(star, other)
        mine, new = forest.number[other], forest.number[node]
        emit(log, REWIRE, star.counts[DRAWS], tree, mine, new, cost, forest.q, other)


@inline_helper
def extend(star: Star, space: Any, log: Buffer, options: Options) -> int:
    """Extend a tree towards the target: steer, choose a parent, add, rewire.

    Returns:
        The new node, -1 where there is none, or -2 where the log has too little room, and nothing
        has happened.
    """
    forest, counts, scratch = star.forest, star.counts, star.scratch
    tree = counts[TREE]
    close = nearest(forest.neighbours, space, scratch, _TARGET, tree)
    moved = steer(space, forest.q, close, scratch, _TARGET, options.step, scratch, _NEW)
    if moved == 0.0:
        reject(star, log, tree, close, NO_PROGRESS, scratch, _NEW)
        return -1
    if options.informed and counts[PATHS] > 0:
        there = distance(space, scratch, _START, scratch, _NEW)
        back = distance(space, scratch, _NEW, scratch, _GOAL)
        if there + back >= star.best[_TOLD]:
            reject(star, log, tree, close, NO_GAIN, scratch, _NEW)
            return -1
    reach = radius(star, space, tree, options)
    count = near(forest.neighbours, space, scratch, _NEW, tree, reach, star.near, star.far)
    if room(log) < 2 * count + 6:
        counts[EVENTS] = 2 * count + 6
        return -2
    if not free(space, forest.q, close, scratch, _NEW):
        reject(star, log, tree, close, COLLISION, scratch, _NEW)
        return -1
    for a in range(count):
        star.known[a] = _FREE if star.near[a] == close else _UNKNOWN
    parent = choose_parent(star, space, log, tree, close, moved, count)
    node = add(forest, space, log, counts[DRAWS], tree, parent, scratch, _NEW)
    star.edge[node] = distance(space, forest.q, parent, forest.q, node)
    star.child[node] = -1
    if len(star.linked) > 0:
        star.linked[node] = -1
    adopt(star, node, parent)
    rewire(star, space, log, tree, node, count)
    counts[NEWEST + tree] = node
    return node


@inline_helper
def link(star: Star, space: Any, log: Buffer, options: Options) -> None:
    """Join the trees at their newest nodes, if these are close and the motion is free."""
    forest, counts = star.forest, star.counts
    start, goal = counts[NEWEST], counts[NEWEST + 1]
    far = distance(space, forest.q, start, forest.q, goal)
    if far > options.link:
        return
    if not free(space, forest.q, start, forest.q, goal):
        reject(star, log, 0, start, LINK_BLOCKED, forest.q, goal)
        return
    cost = forest.cost[start] + far + forest.cost[goal]
    mine, other = forest.number[start], forest.number[goal]
    emit(log, CONNECT, counts[DRAWS], mine, other, 0, cost, forest.q, start)
    new = counts[LINKS]
    star.links[new, 0], star.links[new, 2], star.linked[start] = start, star.linked[start], new
    star.links[new, 1], star.links[new, 3], star.linked[goal] = goal, star.linked[goal], new
    star.link_far[new] = far
    counts[LINKS] += 1
    look_at_links(star, start)


@inline_helper
def path_cost(star: Star) -> float:
    """Return the cost of the best path as it stands."""
    if len(star.forest.nodes) > 2:
        return float(star.best[_LEAST])
    goal = star.counts[GOAL_NODE]
    return float(star.forest.cost[goal]) if goal >= 0 else np.inf


@inline_helper
def tell(star: Star, log: Buffer) -> bool:
    """Say that there is a better path, if there is one; return whether the log had room for it."""
    forest, counts = star.forest, star.counts
    cost = path_cost(star)
    if cost >= star.best[_TOLD]:
        return True
    start, goal = counts[GOAL_NODE], -1
    if len(forest.nodes) > 2:
        start, goal = star.links[counts[BEST], 0], star.links[counts[BEST], 1]
    stage = IMPROVED if counts[PATHS] > 0 else RAW
    counts[POINTS] = emit_path(forest, log, counts[DRAWS], stage, cost, start, goal)
    if counts[POINTS] > 0:
        return False
    star.best[_TOLD] = cost
    counts[PATHS] += 1
    return True


@inline_helper
def grown(star: Star, space: Any, options: Options, node: int) -> int:
    """Decide what follows an extension; return the next stage."""
    counts, scratch = star.counts, star.scratch
    if len(star.forest.nodes) > 2:
        if counts[STAGE] == _LINK or node < 0:
            return _TELL
        for k in range(len(space.lower)):
            scratch[_TARGET, k] = star.forest.q[node, k]
        counts[TREE] = 1 - counts[TREE]
        return _LINK
    if node >= 0 and counts[GOAL_NODE] < 0:
        far = distance(space, star.forest.q, node, scratch, _GOAL)
        if far == 0.0:
            counts[GOAL_NODE] = node
        else:
            counts[GOAL_NEAR] = int(far <= options.step)
    return _TELL


@kernel
def advance(
    star: Star,
    space: Any,
    rng: Random,
    log: Buffer,
    options: Options,
    limit: int,
    draw_limit: int,
) -> int:
    """Run until done, out of room, or until `limit` iterations or `draw_limit` draws are made."""
    counts = star.counts
    if counts[STAGE] == _BEGIN:
        emit_roots(star.forest, log)
        if len(star.forest.nodes) > 2:
            link(star, space, log, options)
        counts[STAGE] = _TELL
    while True:
        if counts[STAGE] == _TELL:
            if not tell(star, log):
                return BATCH_FULL
            counts[COUNTED] = counts[DRAWS]
            counts[STAGE] = _DRAW
            if options.stop_at_first and counts[PATHS] > 0:
                emit_end(log, counts[DRAWS], SOLVED)
                return ENDED
        if room(log) < 6:
            return BATCH_FULL
        if not fits(star.forest, 1):
            return STATE_FULL
        if counts[STAGE] == _DRAW:
            if counts[COUNTED] >= limit or counts[DRAWS] >= draw_limit:
                return LIMIT
            draw(star, space, rng, log, options)
            counts[STAGE] = _GROW
        node = extend(star, space, log, options)
        if node == -2:
            return BATCH_FULL
        stage = grown(star, space, options, node)
        if counts[STAGE] == _LINK:
            link(star, space, log, options)
        counts[STAGE] = stage
