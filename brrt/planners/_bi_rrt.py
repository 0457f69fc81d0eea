"""The compiled loop of bidirectional RRT, for every variant of it.

Each pass of the loop makes one extension: of one tree towards the sample, or of the other towards
the newest node of the first. So it can stop between any two, and each kernel that it calls is
compiled into it once.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brrt.events import Kind, Reason, Source, Stage, Status
from brrt.kernels.emit import Buffer, emit, emit_end, room
from brrt.kernels.forest import Forest, add, emit_path, emit_roots, fits
from brrt.kernels.jit import inline_helper, kernel
from brrt.kernels.kdtree import nearest
from brrt.kernels.random import Random, uniform
from brrt.kernels.space import distance, sample_uniform, segment_free, steer
from brrt.planners.base.kernel_planner import (
    BATCH_FULL,
    COUNTED,
    DRAWS,
    ENDED,
    LIMIT,
    OWN,
    POINTS,
    STATE_FULL,
)

Floats = NDArray[np.float64]

SOLVED = int(Status.SOLVED)
REJECT, SAMPLE, CONNECT = int(Kind.REJECT), int(Kind.SAMPLE), int(Kind.CONNECT)
UNIFORM, OTHER_TREE = int(Source.UNIFORM), int(Source.OTHER_TREE)
COLLISION, NO_PROGRESS = int(Reason.COLLISION), int(Reason.NO_PROGRESS)
LINK_BLOCKED, RAW = int(Reason.LINK_BLOCKED), int(Stage.RAW)

ALTERNATE, SMALLER, COIN = range(3)
"""Whose turn it is; see `BiRRT.turn`."""

STAGE, TURN, TREE, FROM, GREW, NEWEST = range(OWN, OWN + 6)
"""Places in `Trees.counts`: what is under way, the tree whose turn it is, the tree that is being
extended, the node that its next extension leaves from or -1 while that is to be found, whether
this iteration added a node, and from here on the newest node of each tree (two places)."""
COUNTS = NEWEST + 2

_BEGIN, _DRAW, _GROW, _LINK, _DONE = range(5)
"""Stages: say where the trees begin, draw a sample, grow towards it, link the other tree to what
has grown, say what the path is."""

_TARGET, _NEW = range(2)
"""Rows of `Trees.scratch`: what an extension heads for, and the new node."""


class Options(NamedTuple):
    """What of the settings the loop needs; see `BiRRT`."""

    step: float
    grow_connects: bool
    link_connects: bool
    turn: int
    always_link: bool


class Trees(NamedTuple):
    """Both trees so far, and the loop's place in them.

    Attributes:
        forest: Tree 0 grows from the start, tree 1 from the goal.
        counts: See `drive` and above, shape (COUNTS,).
        cost: Cost of the path, once there is one, shape (1,).
        scratch: The target and the new node, shape (2, dof).
    """

    forest: Forest
    counts: NDArray[np.int64]
    cost: Floats
    scratch: Floats


@inline_helper
def draw(trees: Trees, space: Any, rng: Random, log: Buffer, options: Options) -> int:
    """Choose a tree and what it heads for; return the stage that begins."""
    counts, sizes = trees.counts, trees.forest.nodes
    counts[DRAWS] += 1
    counts[FROM], counts[GREW] = -1, 0
    stage, source = _GROW, UNIFORM
    if options.turn == COIN and uniform(rng) < 0.5:
        stage, source = _LINK, OTHER_TREE
    elif options.turn == SMALLER and sizes[1] != sizes[2]:
        counts[TURN] = 0 if sizes[1] < sizes[2] else 1
    elif counts[DRAWS] > 1:
        counts[TURN] = 1 - counts[TURN]
    counts[TREE] = counts[TURN]
    if stage == _GROW:
        sample_uniform(space, rng, trees.scratch, _TARGET)
    else:
        aim_at_newest(trees, space, 1 - counts[TREE])
    emit(log, SAMPLE, counts[DRAWS], counts[TREE], source, 0, 0.0, trees.scratch, _TARGET)
    return stage


@inline_helper
def aim_at_newest(trees: Trees, space: Any, tree: int) -> None:
    """Let the next extensions head for a tree's newest node."""
    for k in range(len(space.lower)):
        trees.scratch[_TARGET, k] = trees.forest.q[trees.counts[NEWEST + tree], k]


@inline_helper
def connect(trees: Trees, log: Buffer, tree: int, node: int, far: float) -> None:
    """Say that `node` of a tree has met the newest node of the other one."""
    forest, counts = trees.forest, trees.counts
    counts[NEWEST + tree] = node
    start, goal = counts[NEWEST], counts[NEWEST + 1]
    cost = forest.cost[start] + far + forest.cost[goal]
    trees.cost[0] = cost
    start, goal = forest.number[start], forest.number[goal]
    emit(log, CONNECT, counts[DRAWS], start, goal, 0, cost, trees.scratch, _NEW)


@kernel
def advance(
    trees: Trees,
    space: Any,
    rng: Random,
    log: Buffer,
    options: Options,
    limit: int,
    draw_limit: int,
) -> int:
    """Run until solved, out of room, or until `limit` iterations or `draw_limit` draws are made."""
    forest, counts, scratch = trees.forest, trees.counts, trees.scratch
    if counts[STAGE] == _BEGIN:
        emit_roots(forest, log)
        counts[STAGE] = _DRAW
        if distance(space, forest.q, 0, forest.q, 1) <= options.step:
            # Trees that are within reach from the beginning are joined without a draw.
            counts[STAGE], counts[TREE], counts[FROM] = _LINK, 1, 1
    while True:
        if counts[STAGE] == _DONE:
            start, goal = counts[NEWEST], counts[NEWEST + 1]
            cost = trees.cost[0]
            counts[POINTS] = emit_path(forest, log, counts[DRAWS], RAW, cost, start, goal)
            if counts[POINTS] > 0:
                return BATCH_FULL
            emit_end(log, counts[DRAWS], SOLVED)
            return ENDED
        if room(log) < 2:
            return BATCH_FULL
        if not fits(forest, 1):
            return STATE_FULL
        if counts[STAGE] == _DRAW:
            if counts[COUNTED] >= limit or counts[DRAWS] >= draw_limit:
                return LIMIT
            counts[STAGE] = draw(trees, space, rng, log, options)
        linking = counts[STAGE] == _LINK
        tree = counts[TREE]
        if counts[FROM] < 0:
            counts[FROM] = nearest(forest.neighbours, space, scratch, _TARGET, tree)
        near = counts[FROM]
        far = steer(space, forest.q, near, scratch, _TARGET, options.step, scratch, _NEW)
        reached = True
        for k in range(len(space.lower)):
            reached = reached and scratch[_NEW, k] == scratch[_TARGET, k]
        reason, more = -1, False
        if far == 0.0 and not (linking and reached):
            reason = NO_PROGRESS
        elif not segment_free(space, forest.q, near, scratch, _NEW):
            reason = LINK_BLOCKED if linking and reached else COLLISION
        if reason >= 0:
            number = forest.number[near]
            emit(log, REJECT, counts[DRAWS], tree, number, reason, 0.0, scratch, _NEW)
        elif linking and reached:
            connect(trees, log, tree, near, far)
            counts[STAGE] = _DONE
            continue
        else:
            node = add(forest, space, log, counts[DRAWS], tree, near, scratch, _NEW)
            counts[NEWEST + tree] = counts[FROM] = node
            counts[GREW] = 1
            more = not reached and (options.link_connects if linking else options.grow_connects)
        if more:
            continue
        if not linking and options.turn != COIN and (counts[GREW] or options.always_link):
            aim_at_newest(trees, space, tree)
            counts[STAGE], counts[TREE], counts[FROM] = _LINK, 1 - tree, -1
        else:
            counts[STAGE] = _DRAW
            counts[COUNTED] = counts[DRAWS]
