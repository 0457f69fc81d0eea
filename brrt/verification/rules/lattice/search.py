"""Rules about searches on a lattice: best first, by shortest paths, to the goal or to the end."""

from itertools import product

import numpy as np
from numpy.typing import NDArray

from brrt.collision.motions import all_clear
from brrt.events import Kind, Status, Table
from brrt.replay.text import vector
from brrt.scenario.contract import Lattice
from brrt.verification.context import Context
from brrt.verification.rule import LatticeRule
from brrt.verification.rules.lattice.cells import adjacent, indices
from brrt.verification.tolerances import CLOSE

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]
Keys = NDArray[np.uint64]
Step = tuple[int, ...]

_BITS = 21

MOST = 2000
"""Cells whose neighbours are judged, spread over the log."""


def _estimates(context: Context, table: Table) -> Floats:
    """Return the estimates of the cost-to-go of cells when they were expanded, shape (n,)."""
    raised = context.events[Kind.HEURISTIC]
    h = context.distance(table["q"], context.goal[None])
    if not len(raised):
        return h
    cell = np.concatenate([raised["cell"], table["cell"]])
    seq = np.concatenate([raised["seq"], table["seq"]])
    order = np.lexsort((seq, cell))
    rises = order < len(raised)
    last = np.maximum.accumulate(np.where(rises, np.arange(len(order)), -1))
    known = (last >= 0) & (cell[order][last] == cell[order]) & ~rises
    h[order[known] - len(raised)] = raised["h"][order[last[known]]]
    return h


class BestFirst(LatticeRule):
    name = "best first"
    promise = "A search expands cells in the order of the sum of their cost and estimate."

    def judge_search(self, lattice: Lattice, table: Table) -> None:
        total = table["cost"] + _estimates(self.context, table)
        before = np.append(-np.inf, total[:-1])
        before[table["parent"] < 0] = -np.inf
        self.judge(
            table, ~self.context.at_most(before, total),
            lambda i: f"cell {table['cell'][i]} at {total[i]:.12g} after one at {before[i]:.12g}",
        )  # fmt: skip


def steps_of(lattice: Lattice, dim: int) -> list[Step]:
    """Return the steps from a cell to its neighbours."""
    steps = [step for step in product((-1, 0, 1), repeat=dim) if any(step)]
    return [step for step in steps if lattice.diagonals or sum(map(abs, step)) == 1]


def cell_keys(cells: Ints) -> Ints:
    """Return a number for each cell, by its integer coordinates, shape (n,)."""
    keys = np.zeros(len(cells), np.int64)
    for k in range(cells.shape[1]):
        keys = keys << _BITS | np.clip(cells[:, k] + (1 << _BITS - 1), 0, (1 << _BITS) - 1)
    return keys


def motion_keys(number: Ints, cell_keys: Ints) -> Keys:
    """Return a number for each motion from a numbered cell to another cell, shape (n,)."""
    mixed = number.astype(np.uint64) * np.uint64(0x9E3779B97F4A7C15)
    return (mixed ^ cell_keys.astype(np.uint64)) * np.uint64(0xC2B2AE3D27D4EB4F)


def contains(keys: Keys, wanted: Keys) -> Flags:
    """Return which numbers are among sorted keys, shape (n,)."""
    if not len(keys):
        return np.zeros(len(wanted), bool)
    return np.asarray(keys[np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)] == wanted)


class _Expanded:
    """The cells that were expanded, each once, and the motions between them that are blocked.

    Attributes:
        born: Where each first occurs among all expansions, shape (n,). The cells are sorted by
            place, so that neighbours are close in memory.
        table: Its expansion then.
    """

    def __init__(self, context: Context, lattice: Lattice) -> None:
        table, rejects = context.events[Kind.EXPAND], context.events[Kind.REJECT]
        keys = cell_keys(indices(context, lattice, table["q"]))
        self._keys, self.born = np.unique(keys, return_index=True)
        self.table = table[self.born]
        targets = cell_keys(indices(context, lattice, rejects["q"]))
        self._blocked = np.unique(motion_keys(rejects["node"].astype(np.int64), targets))

    def neighbours(self, step: Step) -> tuple[Ints, Flags]:
        """Return for each cell the row of its neighbour or -1, and whether the motion is free."""
        wanted = self._keys + sum(x << _BITS * (len(step) - 1 - k) for k, x in enumerate(step))
        other = np.minimum(np.searchsorted(self._keys, wanted), len(wanted) - 1)
        other = np.where(self._keys[other] == wanted, other, -1)
        numbers = self.table["cell"].astype(np.int64)
        blocked = contains(self._blocked, motion_keys(numbers, wanted))
        back = contains(self._blocked, motion_keys(numbers[other], self._keys))
        return other, ~blocked & ((other < 0) | ~back)

    def in_order(self) -> Ints:
        """Return the rows in the order of the log."""
        return np.argsort(self.born)


class ShortestPaths(LatticeRule):
    name = "shortest paths"
    promise = (
        "If no robot moves meanwhile, no cell is reached at less cost from a neighbour that was "
        "expanded before."
    )

    def judge_search(self, lattice: Lattice, table: Table) -> None:
        if lattice.lookahead is not None:
            return
        cells = _Expanded(self.context, lattice)
        cost = np.asarray(cells.table["cost"])
        least = np.full(len(cost), np.inf)
        for step in steps_of(lattice, self.context.dof):
            other, is_free = cells.neighbours(step)
            exists = is_free & (other >= 0) & (cells.born[other] < cells.born)
            through = cost[other] + lattice.cell * sum(map(abs, step)) ** 0.5
            least = np.where(exists, np.minimum(least, through), least)
        order = cells.in_order()
        first, cost, least = cells.table[order], cost[order], least[order]
        self.judge(
            first, ~self.context.at_most(cost, least),
            lambda i: f"cell {first['cell'][i]} costs {cost[i]:.12g}; a path costs {least[i]:.12g}",
        )  # fmt: skip


class SearchExhausted(LatticeRule):
    name = "search exhausted"
    promise = "Before a search reports that there is no path, it expands all that it can reach."

    def judge_search(self, lattice: Lattice, table: Table) -> None:
        if self.context.outcome is not Status.NO_PATH:
            return
        cells = _Expanded(self.context, lattice)
        wrong = np.zeros(len(cells.table), bool)
        for step in steps_of(lattice, self.context.dof):
            other, is_free = cells.neighbours(step)
            wrong |= is_free & (other < 0)
        order = cells.in_order()
        first = cells.table[order]
        self.judge(
            first, wrong[order],
            lambda i: f"cell {first['cell'][i]} has a neighbour that was not expanded",
        )  # fmt: skip


class CellNeighbours(LatticeRule):
    name = "neighbours"
    promise = "Of the neighbours of an expanded cell, those that cannot be reached are rejected."

    def judge_search(self, lattice: Lattice, table: Table) -> None:
        context, rejects = self.context, self.context.events[Kind.REJECT]
        cells, targets = (indices(context, lattice, some["q"]) for some in (table, rejects))
        motions = motion_keys(rejects["node"].astype(np.int64), cell_keys(targets))
        again = np.ones(len(rejects), bool)
        again[np.unique(motions, return_index=True)[1]] = False
        last = np.searchsorted(table["seq"], rejects["seq"]) - 1
        off = np.abs(rejects["q"] - context.start - lattice.cell * targets)
        wrong = again | (last < 0) | (table["cell"][last] != rejects["node"])
        wrong |= ~adjacent(lattice, cells[last], targets)
        wrong |= ~(off.max(axis=1, initial=0) <= CLOSE * lattice.cell + context.tolerance)
        self.judge(
            rejects, wrong,
            lambda i: (
                f"{vector(rejects['q'][i])} is rejected again" if again[i]
                else f"{vector(rejects['q'][i])} is no neighbour of the last expanded cell"
            ),
        )  # fmt: skip
        self._judge_reachable(lattice, table, np.unique(motions))

    def _judge_reachable(self, lattice: Lattice, table: Table, blocked: Keys) -> None:
        """Judge whether neighbours that were not rejected can be reached."""
        context = self.context
        table = table[: len(table) - context.is_cut]
        table = table[np.sort(np.unique(table["cell"], return_index=True)[1])]
        # Within a move of the goal neighbours are not examined.
        far = context.distance(table["q"], context.goal[None])
        table = table[~context.at_most(far, lattice.max_move)]
        if not len(table):
            return
        table = table[np.linspace(0, len(table) - 1, min(MOST, len(table))).astype(np.int64)]
        steps = np.array(steps_of(lattice, context.dof))
        around = indices(context, lattice, table["q"])[:, None] + steps
        around = around.reshape(-1, context.dof)
        table = np.repeat(table, len(steps))
        keys = motion_keys(table["cell"].astype(np.int64), cell_keys(around))
        rest = ~contains(blocked, keys)
        table, to = table[rest], context.start + lattice.cell * around[rest]
        low, high = context.lower - context.tolerance, context.upper + context.tolerance
        out = ~((low <= to) & (to <= high)).all(axis=1)
        self.judge(
            table, out | (context.first_hits(table["q"], to) >= 0),
            lambda i: f"cell {table['cell'][i]}: {vector(to[i])} is out of reach but not rejected",
        )  # fmt: skip


class GoalReached(LatticeRule):
    name = "goal reached"
    promise = (
        "If the goal is within a straight free move of a cell, the search ends there, and no path "
        "ends with a longer one."
    )

    def judge_search(self, lattice: Lattice, table: Table) -> None:
        self._judge_last_motions(lattice)
        context = self.context
        far = context.distance(table["q"], context.goal[None])
        near = np.flatnonzero(far < lattice.max_move * (1 - CLOSE) - context.tolerance)
        cells, far = table[near], far[near]
        a = np.asarray(cells["q"])
        goals = np.broadcast_to(context.goal, a.shape)
        clear = all_clear(context.obstacles, context.robot, a, goals)
        ends = np.append(table["seq"][1:], 1 << 62)
        # A branch with another lookahead searches again.
        ends[:-1][np.diff(context.stretch(table)) > 0] = 1 << 62
        ends = ends[near]
        moves = context.events[Kind.MOVE]
        # From a cell at the goal there is no move to make, but the path is reported.
        moved = moves["seq"][(moves["q"] == context.goal).all(axis=1)]
        reached = np.sort(np.concatenate([moved, context.events[Kind.PATH]["seq"]]))
        following = np.append(reached, 1 << 61)[np.searchsorted(reached, cells["seq"])]
        self.judge(
            cells, np.asarray(clear & (ends < 1 << 62) & (following > ends)),
            lambda i: f"cell {cells['cell'][i]} is {far[i]:.9g} from the goal; the search goes on",
        )  # fmt: skip

    def _judge_last_motions(self, lattice: Lattice) -> None:
        """Judge whether paths end with a move of the allowed length, or between neighbours."""
        context = self.context
        for event, path in context.planned_paths:
            if len(path) < 2:
                continue
            last = path[-2:]
            cells, far = indices(context, lattice, last), context.distance(last[:1], last[1:])
            off = np.abs(context.start + lattice.cell * cells - last).max()
            along = off <= CLOSE * lattice.cell + context.tolerance
            along &= adjacent(lattice, cells[:1], cells[1:]).all()
            right = along or context.at_most(far, lattice.max_move).all()
            wrong = f"the motion to the goal is {far[0]:.9g} long, not {lattice.max_move:g} at most"
            self.judge_one(event, None if right else wrong)


RULES = (CellNeighbours, BestFirst, ShortestPaths, SearchExhausted, GoalReached)
