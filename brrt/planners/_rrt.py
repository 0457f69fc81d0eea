"""RRT's compiled loop."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brrt.events import Kind, Reason, Source, Stage, Status
from brrt.kernels.emit import Buffer, emit, emit_end, room
from brrt.kernels.forest import Forest, add, emit_path, emit_roots, fits
from brrt.kernels.jit import inline_helper, kernel
from brrt.kernels.kdtree import nearest
from brrt.kernels.random import Random, uniform
from brrt.kernels.space import distance, interpolate, sample_uniform, segment_free, steer
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

REJECT, SAMPLE = int(Kind.REJECT), int(Kind.SAMPLE)
UNIFORM, GOAL = int(Source.UNIFORM), int(Source.GOAL)
COLLISION, NO_PROGRESS = int(Reason.COLLISION), int(Reason.NO_PROGRESS)
GOAL_BLOCKED = int(Reason.GOAL_BLOCKED)
START_TREE, RAW = 0, int(Stage.RAW)
SOLVED = int(Status.SOLVED)

BEGUN, UNTESTED, GOAL_NODE, COUNTS = range(OWN, OWN + 4)
"""Places in `Tree.counts` of whether the root has been said, the newest node while it is not yet
tested for the goal or -1, and the node at the goal or -1; and how many places there are."""

_DRAWN, _NEW, _TARGET = range(3)
"""Rows of `Tree.scratch`: the sample, the new node, the goal."""


class Options(NamedTuple):
    """What of the settings the loop needs; see `RRT`."""

    step: float
    goal_bias: float
    line_of_sight: bool
    slices: int
    count_failed: bool


class Tree(NamedTuple):
    """The tree so far, and the loop's place in it.

    Attributes:
        forest: The tree.
        counts: See `drive` and above, shape (COUNTS,).
        scratch: The sample, the new node and the goal, shape (3, dof).
    """

    forest: Forest
    counts: NDArray[np.int64]
    scratch: Floats


@inline_helper
def extend(tree: Tree, space: Any, log: Buffer, near: int, options: Options) -> int:
    """Grow from `near` towards the sample by at most a step; return the new node, or -1."""
    scratch, draw = tree.scratch, tree.counts[DRAWS]
    moved = steer(space, tree.forest.q, near, scratch, _DRAWN, options.step, scratch, _NEW)
    reason = -1
    if moved == 0.0:
        reason = NO_PROGRESS
    elif not segment_free(space, tree.forest.q, near, scratch, _NEW):
        reason = COLLISION
    if reason >= 0:
        emit(log, REJECT, draw, START_TREE, near, reason, 0.0, scratch, _NEW)
        return -1
    node, q = near, tree.forest.q
    for part in range(1, options.slices + 1):
        row = _NEW
        if part < options.slices:
            # The sample is not needed any more; its row carries the configurations in between.
            row = _DRAWN
            interpolate(space, q, near, scratch, _NEW, part / options.slices, scratch, row)
        node = add(tree.forest, space, log, draw, START_TREE, node, scratch, row)
    return node


@inline_helper
def reach_goal(tree: Tree, space: Any, log: Buffer, node: int, options: Options) -> bool:
    """Try to join the goal to the newest node, as the goal test allows."""
    scratch, draw = tree.scratch, tree.counts[DRAWS]
    far = distance(space, tree.forest.q, node, scratch, _TARGET)
    if far == 0.0:
        tree.counts[GOAL_NODE] = node
        return True
    if far > options.step and not options.line_of_sight:
        return False
    if not segment_free(space, tree.forest.q, node, scratch, _TARGET):
        emit(log, REJECT, draw, START_TREE, node, GOAL_BLOCKED, 0.0, scratch, _TARGET)
        return False
    goal = add(tree.forest, space, log, draw, START_TREE, node, scratch, _TARGET)
    tree.counts[GOAL_NODE] = goal
    return True


@kernel
def advance(
    tree: Tree,
    space: Any,
    rng: Random,
    log: Buffer,
    options: Options,
    limit: int,
    draw_limit: int,
) -> int:
    """Run until solved, out of room, or until `limit` iterations or `draw_limit` draws are made."""
    counts, scratch, forest = tree.counts, tree.scratch, tree.forest
    newest = counts[UNTESTED]
    if not counts[BEGUN]:
        counts[BEGUN] = 1
        emit_roots(forest, log)
    while True:
        if counts[GOAL_NODE] >= 0:
            goal = counts[GOAL_NODE]
            counts[POINTS] = emit_path(forest, log, counts[DRAWS], RAW, forest.cost[goal], goal, -1)
            if counts[POINTS] > 0:
                return BATCH_FULL
            emit_end(log, counts[DRAWS], SOLVED)
            return ENDED
        if room(log) < options.slices + 3:
            return BATCH_FULL
        if not fits(forest, options.slices + 1):
            return STATE_FULL
        if newest >= 0:
            counts[UNTESTED] = -1
            if reach_goal(tree, space, log, newest, options):
                continue
        if counts[COUNTED] >= limit or counts[DRAWS] >= draw_limit:
            return LIMIT
        counts[DRAWS] += 1
        source = GOAL if uniform(rng) < options.goal_bias else UNIFORM
        if source == GOAL:
            for k in range(len(space.lower)):
                scratch[_DRAWN, k] = scratch[_TARGET, k]
        else:
            sample_uniform(space, rng, scratch, _DRAWN)
        emit(log, SAMPLE, counts[DRAWS], START_TREE, source, 0, 0.0, scratch, _DRAWN)
        near = nearest(forest.neighbours, space, scratch, _DRAWN, START_TREE)
        newest = extend(tree, space, log, near, options)
        counts[UNTESTED] = newest
        if newest >= 0 or options.count_failed:
            counts[COUNTED] += 1
