"""Rules about searches on a lattice: best first, by shortest ways, to the goal or to the end."""

from itertools import product

import numpy as np
from numpy.typing import NDArray

from brrt.collision.motions import all_clear
from brrt.events import Kind, Status, Table
from brrt.scenario.contract import Lattice
from brrt.verification.context import CLOSE, Context
from brrt.verification.result import RuleResult
from brrt.verification.rules.lattice import adjacent, indices, lattice_of
from brrt.verification.rules.log import text

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]

_BITS = 21

MOST = 2000
"""Of more cells than this, so many are looked at, evenly spread over the log."""


def _estimates(context: Context, table: Table) -> Floats:
    """Estimates of the cost-to-go of cells as they stood when they were expanded, shape (n,)."""
    raised = context.events[Kind.HEURISTIC]
    h = context.distance(np.asarray(table["q"]), context.goal[None])
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


def best_first(context: Context, result: RuleResult) -> None:
    """A search expands cells in the order of their cost and estimate together."""
    table = context.events[Kind.EXPAND]
    if lattice_of(context) is None or not len(table):
        return
    f = table["cost"] + _estimates(context, table)
    before = np.append(-np.inf, f[:-1])
    before[table["parent"] < 0] = -np.inf
    result.look(
        table, ~context.at_most(before, f),
        lambda i: f"cell {table['cell'][i]} at {f[i]:.12g} after one at {before[i]:.12g}",
    )  # fmt: skip


def _keys(places: Ints) -> Ints:
    """One number for each place on the lattice, by which it is found, shape (n,)."""
    keys = np.zeros(len(places), np.int64)
    for k in range(places.shape[1]):
        keys = keys << _BITS | np.clip(places[:, k] + (1 << _BITS - 1), 0, (1 << _BITS) - 1)
    return keys


def _motions(number: Ints, keys: Ints) -> NDArray[np.uint64]:
    """One number for each motion from a cell to a place, shape (n,)."""
    mixed = number.astype(np.uint64) * np.uint64(0x9E3779B97F4A7C15)
    return (mixed ^ keys.astype(np.uint64)) * np.uint64(0xC2B2AE3D27D4EB4F)


class _Expanded:
    """Cells that were expanded, each once, and what was found to be blocked between them.

    Attributes:
        born: Where each first stands among all expansions, shape (n,); cells lie in the order of
            their places, so that neighbours are found without leaping about in memory.
        table: Its expansion then.
        steps: To a cell's neighbours.
    """

    def __init__(self, context: Context, lattice: Lattice) -> None:
        table, rejects = context.events[Kind.EXPAND], context.events[Kind.REJECT]
        keys = _keys(indices(context, lattice, table["q"]))
        self._keys, self.born = np.unique(keys, return_index=True)
        self.table = table[self.born]
        gone = _keys(indices(context, lattice, rejects["q"]))
        self._blocked = np.unique(_motions(rejects["node"].astype(np.int64), gone))
        dim = table["q"].shape[1]
        steps = [s for s in product((-1, 0, 1), repeat=dim) if any(s)]
        self.steps = [s for s in steps if lattice.diagonals or sum(map(abs, s)) == 1]

    def neighbours(self, step: tuple[int, ...]) -> tuple[Ints, Flags]:
        """For each cell the row of its neighbour or -1, and whether the way there is open."""
        wanted = self._keys + sum(x << _BITS * (len(step) - 1 - k) for k, x in enumerate(step))
        other = np.minimum(np.searchsorted(self._keys, wanted), len(wanted) - 1)
        other = np.where(self._keys[other] == wanted, other, -1)
        shut = self._is_blocked(_motions(self.table["cell"].astype(np.int64), wanted))
        back = _motions(self.table["cell"][other].astype(np.int64), self._keys)
        return other, ~shut & ((other < 0) | ~self._is_blocked(back))

    def _is_blocked(self, motions: NDArray[np.uint64]) -> Flags:
        if not len(self._blocked):
            return np.zeros(len(motions), bool)
        at = np.minimum(np.searchsorted(self._blocked, motions), len(self._blocked) - 1)
        return np.asarray(self._blocked[at] == motions)

    def in_order(self) -> Ints:
        """Rows in the order in which they were expanded."""
        return np.argsort(self.born)


def shortest_ways(context: Context, result: RuleResult) -> None:
    """Where no robot moves meanwhile, no cell is reached cheaper over a neighbour expanded before.

    So, as cells are expanded best first, each is reached by a shortest way on the lattice.
    """
    lattice = lattice_of(context)
    if lattice is None or lattice.lookahead is not None or not len(context.events[Kind.EXPAND]):
        return
    cells = _Expanded(context, lattice)
    cost = np.asarray(cells.table["cost"])
    least = np.full(len(cost), np.inf)
    for step in cells.steps:
        other, is_open = cells.neighbours(step)
        there = is_open & (other >= 0) & (cells.born[other] < cells.born)
        through = cost[other] + lattice.epsilon * sum(map(abs, step)) ** 0.5
        least = np.where(there, np.minimum(least, through), least)
    order = cells.in_order()
    table, cost, least = cells.table[order], cost[order], least[order]
    result.look(
        table, ~context.at_most(cost, least),
        lambda i: f"cell {table['cell'][i]} costs {cost[i]:.12g}; {least[i]:.12g} is a way",
    )  # fmt: skip


def nothing_left(context: Context, result: RuleResult) -> None:
    """Where it is proved that there is no path, all that can be reached was looked at."""
    lattice = lattice_of(context)
    if (
        lattice is None
        or context.outcome is not Status.NO_PATH
        or not len(context.events[Kind.EXPAND])
    ):
        return
    cells = _Expanded(context, lattice)
    wrong = np.zeros(len(cells.table), bool)
    for step in cells.steps:
        other, is_open = cells.neighbours(step)
        wrong |= is_open & (other < 0)
    order = cells.in_order()
    table = cells.table[order]
    result.look(
        table, wrong[order],
        lambda i: f"cell {table['cell'][i]} has a neighbour that nobody looked at",
    )  # fmt: skip


def neighbours(context: Context, result: RuleResult) -> None:
    """Of the cells around one that is looked at, those are turned down that cannot be reached.

    All rejections are looked at, and of many cells 2,000.
    """
    lattice = lattice_of(context)
    table, rejects = context.events[Kind.EXPAND], context.events[Kind.REJECT]
    if lattice is None or not len(table):
        return
    places, gone = (indices(context, lattice, some["q"]) for some in (table, rejects))
    motions = _motions(rejects["node"].astype(np.int64), _keys(gone))
    again = np.ones(len(rejects), bool)
    again[np.unique(motions, return_index=True)[1]] = False
    last = np.searchsorted(table["seq"], rejects["seq"]) - 1
    q = np.asarray(rejects["q"])
    off = np.abs(q - context.start - lattice.epsilon * gone).max(axis=1, initial=0)
    wrong = again | (last < 0) | (table["cell"][last] != rejects["node"])
    wrong |= ~adjacent(lattice, places[last], gone)
    wrong |= ~(off <= CLOSE * lattice.epsilon + context.blur)
    result.look(
        rejects, wrong,
        lambda i: (
            f"{text(q[i])} is turned down again" if again[i]
            else f"{text(q[i])} is turned down, no neighbour of the cell just expanded"
        ),
    )  # fmt: skip
    _look_open(context, result, lattice, np.unique(motions))


def _look_open(
    context: Context, result: RuleResult, lattice: Lattice, blocked: NDArray[np.uint64]
) -> None:
    """See that what was not turned down can be reached."""
    table = context.events[Kind.EXPAND]
    table = table[: len(table) - context.cut]
    table = table[np.sort(np.unique(table["cell"], return_index=True)[1])]
    # Where the goal is in reach nobody looks around.
    far = context.distance(np.asarray(table["q"]), context.goal[None])
    table = table[~context.at_most(far, lattice.max_move)]
    if not len(table):
        return
    table = table[np.linspace(0, len(table) - 1, min(MOST, len(table))).astype(np.int64)]
    steps = np.array([s for s in product((-1, 0, 1), repeat=context.dof) if any(s)])
    if not lattice.diagonals:
        steps = steps[np.abs(steps).sum(axis=1) == 1]
    around = (indices(context, lattice, table["q"])[:, None] + steps).reshape(-1, context.dof)
    some = np.repeat(table, len(steps))
    is_open = ~np.isin(_motions(some["cell"].astype(np.int64), _keys(around)), blocked)
    some, to = some[is_open], context.start + lattice.epsilon * around[is_open]
    out = ~((context.lower - context.blur <= to) & (to <= context.upper + context.blur)).all(axis=1)
    hit = out | (context.blocked(np.asarray(some["q"]), to) >= 0)
    result.look(
        some, hit,
        lambda i: f"cell {some['cell'][i]}: {text(to[i])} is not turned down, but out of reach",
    )  # fmt: skip


def goal_taken(context: Context, result: RuleResult) -> None:
    """Where the goal is within a straight free move of a cell, the search ends there."""
    lattice, table = lattice_of(context), context.events[Kind.EXPAND]
    if lattice is None or not len(table):
        return
    q = np.asarray(table["q"])
    far = context.distance(q, context.goal[None])
    near = np.flatnonzero(far < lattice.max_move * (1 - CLOSE) - context.blur)
    some, a = table[near], q[near]
    clear = all_clear(context.obstacles, context.robot, a, np.broadcast_to(context.goal, a.shape))
    ends = np.append(table["seq"][1:], 1 << 62)
    # Who goes on with another lookahead plans anew.
    ends[:-1][np.diff(context.stretch(table)) > 0] = 1 << 62
    ends = ends[near]
    moves = context.events[Kind.MOVE]
    # From a cell at the goal there is no move to make; the path is told all the same.
    moved = moves["seq"][(np.asarray(moves["q"]) == context.goal).all(axis=1)]
    taken = np.sort(np.concatenate([moved, context.events[Kind.PATH]["seq"]]))
    next_ = np.append(taken, 1 << 61)[np.searchsorted(taken, some["seq"])]
    wrong = clear & (ends < 1 << 62) & (next_ > ends)
    result.look(
        some, np.asarray(wrong),
        lambda i: f"cell {some['cell'][i]} is {far[near[i]]:.9g} from the goal; the search goes on",
    )  # fmt: skip


RULES = (neighbours, best_first, shortest_ways, nothing_left, goal_taken)
"""All rules of this file; see `brrt.verification`."""
