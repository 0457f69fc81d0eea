"""Rules about a robot that moves: step by step, on a lattice or along its path."""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from brrt.collision.motions import towards
from brrt.events import Kind, Phase, Status, Table
from brrt.replay.text import vector
from brrt.verification.context import Context
from brrt.verification.rule import Rule
from brrt.verification.tolerances import CLOSE

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]


_ROUNDED = 1e-12
"""Part by which a motion may exceed a whole number of moves."""


class MoveRule(Rule):
    """A rule that judges all moves."""

    def finish(self) -> None:
        """Judge the moves, with where each begins and which are the first of a trial."""
        table = self.context.events[Kind.MOVE]
        first = np.diff(table["trial"], prepend=-1) != 0
        first[:1] = True
        before = np.concatenate([table["q"][:1], table["q"][:-1]])
        before[first] = self.context.start
        self.judge_moves(table, before, first)

    def judge_moves(self, table: Table, before: Floats, first: Flags) -> None:
        """Judge moves.

        Args:
            table: The moves, shape (n,).
            before: Where each begins, shape (n, dof).
            first: Which are the first of a trial, shape (n,).
        """
        raise NotImplementedError


class Moves(MoveRule):
    name = "moves"
    promise = "Trials count 0, 1, 2 ..., and the moves of each 1, 2, 3 ..."

    def judge_moves(self, table: Table, before: Floats, first: Flags) -> None:
        trial = np.cumsum(first) - 1
        starts = np.flatnonzero(first)
        step = np.arange(len(table)) - (starts[trial] if len(table) else 0) + 1
        self.judge(
            table, (table["trial"] != trial) | (table["step"] != step),
            lambda i: (
                f"step {table['step'][i]} of trial {table['trial'][i]}, not "
                f"step {step[i]} of trial {trial[i]}"
            ),
        )  # fmt: skip


class MoveCosts(MoveRule):
    name = "move costs"
    promise = "A move's cost is that of the move before plus its own length."
    assumes = ("motions", "costs")

    def judge_moves(self, table: Table, before: Floats, first: Flags) -> None:
        stated = np.asarray(table["cost"])
        previous = np.append(0.0, stated)[:-1]
        cost = np.where(first, 0.0, previous) + self.context.distance(before, table["q"])
        self.judge(
            table, ~self.context.equal(stated, cost),
            lambda i: f"the moves cost {cost[i]:.12g} so far, not {stated[i]:.12g}",
        )  # fmt: skip


class MoveLengths(MoveRule):
    name = "move lengths"
    promise = "No move is longer than allowed."
    assumes = ("motions",)

    def judge_moves(self, table: Table, before: Floats, first: Flags) -> None:
        context, lattice = self.context, self.context.contract.lattice
        length, limit = context.distance(before, table["q"]), np.full(len(table), np.inf)
        if lattice is not None:
            diagonal = lattice.cell * (np.sqrt(context.world.dim) if lattice.diagonals else 1.0)
            limit[:] = max(lattice.max_move, diagonal)
        limit[_along_path(context, table)] = context.manifest.scenario.max_move
        self.judge(
            table, ~context.at_most(length, limit),
            lambda i: f"a move of {length[i]:.12g}; the limit is {limit[i]:.12g}",
        )  # fmt: skip


def _along_path(context: Context, table: Table) -> Flags:
    """Return which moves execute a path, in a phase of its own, shape (n,)."""
    phases = context.events[Kind.PHASE]
    begins = phases["seq"][(phases["name"] == Phase.EXECUTE) & (phases["status"] == Status.BEGIN)]
    first = int(begins[0]) if len(begins) else 1 << 62
    return np.asarray((table["seq"] > first) & (table["cell"] < 0))


class MovesFree(MoveRule):
    name = "moves free"
    promise = "Every move is free of obstacles."
    assumes = ("motions", "collisions")

    def judge_moves(self, table: Table, before: Floats, first: Flags) -> None:
        self.judge_free(table, before, table["q"], "move")


class Arrival(Rule):
    name = "arrival"
    promise = "A robot that has arrived made its last move to the goal."
    of_end = True

    def finish(self) -> None:
        context = self.context
        table, phases = context.events[Kind.MOVE], context.events[Kind.PHASE]
        done = ((phases["name"] == Phase.EXECUTE) & (phases["status"] == Status.DONE)).any()
        stopped = (phases["status"][-1:] == Status.INTERRUPTED).any()
        solved = context.outcome is Status.SOLVED and (len(table) or context.contract.learns)
        if context.is_cut or stopped or not (done or solved):
            return
        last = np.asarray(table["q"][-1]) if len(table) else context.start
        wrong = None if (last == context.goal).all() else f"the last move ends at {vector(last)}"
        self.judge_one(table[-1] if len(table) else None, wrong)


class PathsWalked(Rule):
    name = "paths walked"
    promise = "The path of a trial of LRTA* is where the robot went, reported on arrival."
    needs = "lattice"

    def finish(self) -> None:
        context, lattice = self.context, self.context.contract.lattice
        table, paths = context.events[Kind.MOVE], context.planned_paths
        if lattice is None or lattice.lookahead is None:
            return
        for trial, (event, path) in enumerate(paths):
            mine = table[table["trial"] == trial]
            walked = np.concatenate([context.start[None], mine["q"]])
            wrong = None
            if len(mine) and mine["seq"][-1] > event["seq"]:
                wrong = f"trial {trial} continues after its path was reported"
            elif len(mine) and mine["cell"][-1] < 0 and mine["seq"][-1] + 1 != event["seq"]:
                wrong = f"trial {trial} arrived before, with event {mine['seq'][-1]}"
            elif not np.array_equal(walked, path):
                wrong = f"not where the robot went in trial {trial}"
            self.judge_one(event, wrong)
        more = table[table["trial"] > len(paths)][:1]
        self.judge(
            more, np.ones(len(more), bool),
            lambda i: f"trial {more['trial'][i]} begins; only {len(paths)} have arrived",
        )  # fmt: skip
        if context.outcome is Status.SOLVED and len(paths) < lattice.trials:
            self.judge_one(None, f"{len(paths)} of {lattice.trials} trials arrived")


class MovesAlongPath(MoveRule):
    name = "moves along path"
    promise = "A robot that executes a path moves along it, forwards, without shortcuts."

    def judge_moves(self, table: Table, before: Floats, first: Flags) -> None:
        context, chosen = self.context, _along_path(self.context, table)
        if not chosen.any():
            return
        if not context.paths:
            self.judge_one(table[chosen][0], "a move without a path")
            return
        path, at = _Polyline(context, context.paths[-1][1]), 0.0
        for event, a in zip(table[chosen], before[chosen], strict=True):
            at = 0.0 if (a == context.start).all() else at
            wrong, q = None, np.asarray(event["q"])
            end, length = path.position(q, at), float(context.distance(a[None], q[None])[0])
            if end is None:
                wrong = f"{vector(q)} is not ahead on the path"
            elif abs(end - at - length) > path.tolerance:
                wrong = f"{vector(q)} is {end - at:.12g} ahead on the path, but {length:.12g} away"
            at = at if end is None else end
            self.judge_one(event, wrong)


class MoveCounts(MoveRule):
    name = "move counts"
    promise = "A robot that executes a path makes the fewest moves that the limit allows."

    def judge_moves(self, table: Table, before: Floats, first: Flags) -> None:
        context, chosen = self.context, _along_path(self.context, table)
        table = table[chosen]
        if not len(table) or not context.paths or len(context.paths[-1][1]) < 2:
            return
        path = context.paths[-1][1]
        far = np.asarray(context.distance(path[:-1], path[1:]))
        limit = context.manifest.scenario.max_move
        moves = np.maximum(np.ceil(far / limit * (1 - _ROUNDED)), 1)
        made, row = np.cumsum(moves), np.arange(len(table))
        motion = np.searchsorted(made, row, side="right")
        missing = motion == len(far)
        motion[missing] = 0
        part = (row - made[motion] + moves[motion] + 1) / moves[motion]
        here = np.append(0.0, np.cumsum(far))[motion] + part * far[motion]
        here[missing] = np.nan
        length = np.cumsum(context.distance(before[chosen], table["q"]))
        self.judge(
            table, ~context.equal(length, here),
            lambda i: f"move {i + 1} ends {length[i]:.12g} along the path, not {here[i]:.12g}",
        )  # fmt: skip


class _Polyline:
    """A path on which positions are looked up.

    Attributes:
        tolerance: Absolute tolerance of positions.
    """

    def __init__(self, context: Context, path: Floats) -> None:
        self._robot, self._path = context.robot, path
        self._steps = towards(context.robot, path[:-1], path[1:])
        self._ends = np.append(0.0, np.cumsum(context.distance(path[:-1], path[1:])))
        self.tolerance = CLOSE * float(self._ends[-1]) + context.tolerance

    def position(self, q: Floats, least: float) -> float | None:
        """Return how far along the path a configuration is, from `least` on; None if it is not."""
        for i, (begin, end) in enumerate(pairwise(map(float, self._ends))):
            if end < least - self.tolerance:
                continue
            step, offset = self._steps[i], towards(self._robot, self._path[i][None], q[None])[0]
            square = float(step @ step)
            part = min(max(float(offset @ step) / square, 0.0), 1.0) if square else 0.0
            at = begin + part * (end - begin)
            apart = np.abs(offset - part * step).max()
            if apart <= self.tolerance and at >= least - self.tolerance:
                return max(at, least)
        return None


RULES = (Moves, MoveCosts, MoveLengths, MovesFree, Arrival, PathsWalked, MovesAlongPath, MoveCounts)
