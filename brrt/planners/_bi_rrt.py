"""The compiled loop of bidirectional RRT, for all of its variants.

Each pass of the loop makes one extension: of one tree towards the sample, or of the other tree
towards the newest node of the first. So it can stop between any two extensions, and each helper is
compiled into it only once.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brrt.events import Reason, Source, Stage, Status
from brrt.kernels.emit import (
    Buffer,
    emit_connect,
    emit_plan_end,
    emit_reject,
    emit_sample,
    paused,
    room,
)
from brrt.kernels.forest import ForestArrays, add, emit_roots, emit_tree_path, fits
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
    PAUSED,
    POINTS,
    STATE_FULL,
)

Floats = NDArray[np.float64]

SOLVED = int(Status.SOLVED)
UNIFORM, OTHER_TREE = int(Source.UNIFORM), int(Source.OTHER_TREE)
COLLISION, NO_PROGRESS = int(Reason.COLLISION), int(Reason.NO_PROGRESS)
LINK_BLOCKED, RAW = int(Reason.LINK_BLOCKED), int(Stage.RAW)

ALTERNATE, SMALLER, COIN = range(3)
"""Which tree grows; see `BiRRT.turn`."""

STAGE, TURN, TREE, FROM, GREW, NEWEST = range(OWN, OWN + 6)
"""Places in `BiRRTState.counts`: the stage, the tree whose turn it is, the tree that is being
extended, the node to extend it from or -1 if it has to be found, whether this iteration added a
node, and from here on the newest node of each tree (two places)."""
COUNTS = NEWEST + 2

_BEGIN, _DRAW, _GROW, _LINK, _DONE = range(5)
"""Stages: emit the roots, draw a sample, extend a tree towards it, extend the other tree towards
the newest node, emit the path."""

_TARGET, _NEW = range(2)
"""Rows of `BiRRTState.scratch`: the configuration that an extension heads for, and the new node."""


class BiRRTOptions(NamedTuple):
    """The settings that the loop needs; see `BiRRT`."""

    step: float
    grow_connects: bool
    link_connects: bool
    turn: int
    always_link: bool


class BiRRTState(NamedTuple):
    """Both trees and the state of the loop.

    Attributes:
        forest: Tree 0 grows from the start, tree 1 from the goal.
        counts: See `kernel_planner` and above, shape (COUNTS,).
        cost: Cost of the path, once there is one, shape (1,).
        scratch: The target and the new node, shape (2, dof).
    """

    forest: ForestArrays
    counts: NDArray[np.int64]
    cost: Floats
    scratch: Floats


@inline_helper
def draw(state: BiRRTState, space: Any, rng: Random, log: Buffer, options: BiRRTOptions) -> int:
    """Choose a tree and its target; return the next stage."""
    counts, sizes = state.counts, state.forest.nodes
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
        sample_uniform(space, rng, state.scratch, _TARGET)
    else:
        target_newest(state, space, 1 - counts[TREE])
    emit_sample(log, counts[DRAWS], counts[TREE], source, state.scratch, _TARGET)
    return stage


@inline_helper
def target_newest(state: BiRRTState, space: Any, tree: int) -> None:
    """Make a tree's newest node the target of the next extensions."""
    for k in range(len(space.lower)):
        state.scratch[_TARGET, k] = state.forest.q[state.counts[NEWEST + tree], k]


@inline_helper
def connect(state: BiRRTState, log: Buffer, tree: int, node: int, far: float) -> None:
    """Connect `node` of a tree and the newest node of the other tree."""
    forest, counts = state.forest, state.counts
    counts[NEWEST + tree] = node
    start, goal = counts[NEWEST], counts[NEWEST + 1]
    cost = forest.cost[start] + far + forest.cost[goal]
    state.cost[0] = cost
    start, goal = forest.number[start], forest.number[goal]
    emit_connect(log, counts[DRAWS], start, goal, cost)


@kernel
def advance(
    state: BiRRTState,
    space: Any,
    rng: Random,
    log: Buffer,
    options: BiRRTOptions,
    limit: int,
    draw_limit: int,
) -> int:
    """Run until solved, out of room, or until `limit` iterations or `draw_limit` draws are made."""
    forest, counts, scratch = state.forest, state.counts, state.scratch
    if counts[STAGE] == _BEGIN:
        emit_roots(forest, log)
        counts[STAGE] = _DRAW
        if distance(space, forest.q, 0, forest.q, 1) <= options.step:
            # If the roots are within reach of each other, connect them without a draw.
            counts[STAGE], counts[TREE], counts[FROM] = _LINK, 1, 1
    while True:
        if counts[STAGE] == _DONE:
            start, goal = counts[NEWEST], counts[NEWEST + 1]
            cost = state.cost[0]
            counts[POINTS] = emit_tree_path(forest, log, counts[DRAWS], RAW, cost, start, goal)
            if counts[POINTS] > 0:
                return BATCH_FULL
            emit_plan_end(log, counts[DRAWS], SOLVED)
            return ENDED
        if room(log) < 2:
            return BATCH_FULL
        if not fits(forest, 1):
            return STATE_FULL
        if counts[STAGE] == _DRAW and (counts[COUNTED] >= limit or counts[DRAWS] >= draw_limit):
            return LIMIT
        if paused(log):
            return PAUSED
        if counts[STAGE] == _DRAW:
            counts[STAGE] = draw(state, space, rng, log, options)
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
            emit_reject(log, counts[DRAWS], tree, number, reason, scratch, _NEW)
        elif linking and reached:
            connect(state, log, tree, near, far)
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
            target_newest(state, space, tree)
            counts[STAGE], counts[TREE], counts[FROM] = _LINK, 1 - tree, -1
        else:
            counts[STAGE] = _DRAW
            counts[COUNTED] = counts[DRAWS]
