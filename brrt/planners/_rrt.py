"""RRT's compiled loop."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brrt.events import Reason, Source, Stage, Status
from brrt.kernels.emit import Buffer, emit_plan_end, emit_reject, emit_sample, paused, room
from brrt.kernels.forest import ForestArrays, add, emit_roots, emit_tree_path, fits
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
    PAUSED,
    POINTS,
    STATE_FULL,
)

Floats = NDArray[np.float64]

UNIFORM, GOAL = int(Source.UNIFORM), int(Source.GOAL)
COLLISION, NO_PROGRESS = int(Reason.COLLISION), int(Reason.NO_PROGRESS)
GOAL_BLOCKED = int(Reason.GOAL_BLOCKED)
RAW, SOLVED = int(Stage.RAW), int(Status.SOLVED)

START_TREE = 0

BEGUN, UNTESTED, GOAL_NODE, COUNTS = range(OWN, OWN + 4)
"""Places in `RRTState.counts`: whether the root was emitted, the newest node if it still has to be
tested for the goal or -1, the node at the goal or -1; and the number of places."""

_SAMPLE, _NEW, _GOAL = range(3)
"""Rows of `RRTState.scratch`."""


class RRTOptions(NamedTuple):
    """The settings that the loop needs; see `RRT`."""

    step: float
    goal_bias: float
    line_of_sight: bool
    slices: int
    count_failed: bool


class RRTState(NamedTuple):
    """The tree and the state of the loop.

    Attributes:
        forest: The tree.
        counts: See `kernel_planner` and above, shape (COUNTS,).
        scratch: The sample, the new node and the goal, shape (3, dof).
    """

    forest: ForestArrays
    counts: NDArray[np.int64]
    scratch: Floats


@inline_helper
def extend(state: RRTState, space: Any, log: Buffer, near: int, options: RRTOptions) -> int:
    """Extend the tree from `near` towards the sample by at most a step; return the node or -1."""
    scratch, draw = state.scratch, state.counts[DRAWS]
    moved = steer(space, state.forest.q, near, scratch, _SAMPLE, options.step, scratch, _NEW)
    reason = -1
    if moved == 0.0:
        reason = NO_PROGRESS
    elif not segment_free(space, state.forest.q, near, scratch, _NEW):
        reason = COLLISION
    if reason >= 0:
        emit_reject(log, draw, START_TREE, near, reason, scratch, _NEW)
        return -1
    node, q = near, state.forest.q
    for part in range(1, options.slices + 1):
        row = _NEW
        if part < options.slices:
            # The sample is not needed any more; use its row for the configurations in between.
            row = _SAMPLE
            interpolate(space, q, near, scratch, _NEW, part / options.slices, scratch, row)
        node = add(state.forest, space, log, draw, START_TREE, node, scratch, row)
    return node


@inline_helper
def reach_goal(state: RRTState, space: Any, log: Buffer, node: int, options: RRTOptions) -> bool:
    """Try to connect the newest node to the goal, as the goal test allows."""
    scratch, draw = state.scratch, state.counts[DRAWS]
    far = distance(space, state.forest.q, node, scratch, _GOAL)
    if far == 0.0:
        state.counts[GOAL_NODE] = node
        return True
    if far > options.step and not options.line_of_sight:
        return False
    if not segment_free(space, state.forest.q, node, scratch, _GOAL):
        emit_reject(log, draw, START_TREE, node, GOAL_BLOCKED, scratch, _GOAL)
        return False
    goal = add(state.forest, space, log, draw, START_TREE, node, scratch, _GOAL)
    state.counts[GOAL_NODE] = goal
    return True


@kernel
def advance(
    state: RRTState,
    space: Any,
    rng: Random,
    log: Buffer,
    options: RRTOptions,
    limit: int,
    draw_limit: int,
) -> int:
    """Run until solved, out of room, or until `limit` iterations or `draw_limit` draws are made."""
    counts, scratch, forest = state.counts, state.scratch, state.forest
    newest = counts[UNTESTED]
    if not counts[BEGUN]:
        counts[BEGUN] = 1
        emit_roots(forest, log)
    while True:
        if counts[GOAL_NODE] >= 0:
            goal, draw = counts[GOAL_NODE], counts[DRAWS]
            counts[POINTS] = emit_tree_path(forest, log, draw, RAW, forest.cost[goal], goal, -1)
            if counts[POINTS] > 0:
                return BATCH_FULL
            emit_plan_end(log, draw, SOLVED)
            return ENDED
        if room(log) < options.slices + 3:
            return BATCH_FULL
        if not fits(forest, options.slices + 1):
            return STATE_FULL
        if newest >= 0:
            counts[UNTESTED] = -1
            if reach_goal(state, space, log, newest, options):
                continue
        if counts[COUNTED] >= limit or counts[DRAWS] >= draw_limit:
            return LIMIT
        if paused(log):
            return PAUSED
        counts[DRAWS] += 1
        source = GOAL if uniform(rng) < options.goal_bias else UNIFORM
        if source == GOAL:
            for k in range(len(space.lower)):
                scratch[_SAMPLE, k] = scratch[_GOAL, k]
        else:
            sample_uniform(space, rng, scratch, _SAMPLE)
        emit_sample(log, counts[DRAWS], START_TREE, source, scratch, _SAMPLE)
        near = nearest(forest.neighbours, space, scratch, _SAMPLE, START_TREE)
        newest = extend(state, space, log, near, options)
        counts[UNTESTED] = newest
        if newest >= 0 or options.count_failed:
            counts[COUNTED] += 1
