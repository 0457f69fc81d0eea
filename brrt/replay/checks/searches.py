"""Rules about searches on a lattice: best first, by shortest ways, to the goal or to the end."""

from itertools import product

import numpy as np
from numpy.typing import NDArray

from brrt.events import Kind, Status, Table
from brrt.planners.contract import Lattice
from brrt.replay.checks.case import CLOSE, Case
from brrt.replay.checks.lattice import adjacent, indices, lattice_of
from brrt.replay.checks.log import text
from brrt.replay.checks.motions import all_clear
from brrt.replay.checks.tally import Tally

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]

_BITS = 21

MOST = 2000
"""Of more cells than this, so many are looked at, evenly spread over the log."""


def _estimates(case: Case, table: Table) -> Floats:
    """Estimates of the cost-to-go of cells as they stood when they were expanded, shape (n,)."""
    raised = case.events[Kind.HEURISTIC]
    h = case.distance(np.asarray(table["q"]), case.goal[None])
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


def best_first(case: Case, tally: Tally) -> None:
    """A search expands cells in the order of their cost and estimate together."""
    table = case.events[Kind.EXPAND]
    if lattice_of(case) is None or not len(table):
        return
    f = table["cost"] + _estimates(case, table)
    before = np.append(-np.inf, f[:-1])
    before[table["parent"] < 0] = -np.inf
    tally.look(
        table, ~case.at_most(before, f),
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

    def __init__(self, case: Case, lattice: Lattice) -> None:
        table, rejects = case.events[Kind.EXPAND], case.events[Kind.REJECT]
        keys = _keys(indices(case, lattice, table["q"]))
        self._keys, self.born = np.unique(keys, return_index=True)
        self.table = table[self.born]
        gone = _keys(indices(case, lattice, rejects["q"]))
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


def shortest_ways(case: Case, tally: Tally) -> None:
    """Where no robot moves meanwhile, no cell is reached cheaper over a neighbour expanded before.

    So, as cells are expanded best first, each is reached by a shortest way on the lattice.
    """
    lattice = lattice_of(case)
    if lattice is None or lattice.lookahead is not None or not len(case.events[Kind.EXPAND]):
        return
    cells = _Expanded(case, lattice)
    cost = np.asarray(cells.table["cost"])
    least = np.full(len(cost), np.inf)
    for step in cells.steps:
        other, is_open = cells.neighbours(step)
        there = is_open & (other >= 0) & (cells.born[other] < cells.born)
        through = cost[other] + lattice.epsilon * sum(map(abs, step)) ** 0.5
        least = np.where(there, np.minimum(least, through), least)
    order = cells.in_order()
    table, cost, least = cells.table[order], cost[order], least[order]
    tally.look(
        table, ~case.at_most(cost, least),
        lambda i: f"cell {table['cell'][i]} costs {cost[i]:.12g}; {least[i]:.12g} is a way",
    )  # fmt: skip


def nothing_left(case: Case, tally: Tally) -> None:
    """Where it is proved that there is no path, all that can be reached was looked at."""
    lattice = lattice_of(case)
    if lattice is None or case.outcome is not Status.NO_PATH or not len(case.events[Kind.EXPAND]):
        return
    cells = _Expanded(case, lattice)
    wrong = np.zeros(len(cells.table), bool)
    for step in cells.steps:
        other, is_open = cells.neighbours(step)
        wrong |= is_open & (other < 0)
    order = cells.in_order()
    table = cells.table[order]
    tally.look(
        table, wrong[order],
        lambda i: f"cell {table['cell'][i]} has a neighbour that nobody looked at",
    )  # fmt: skip


def neighbours(case: Case, tally: Tally) -> None:
    """Of the cells around one that is looked at, those are turned down that cannot be reached.

    All rejections are looked at, and of many cells 2,000.
    """
    lattice = lattice_of(case)
    table, rejects = case.events[Kind.EXPAND], case.events[Kind.REJECT]
    if lattice is None or not len(table):
        return
    places, gone = (indices(case, lattice, some["q"]) for some in (table, rejects))
    motions = _motions(rejects["node"].astype(np.int64), _keys(gone))
    again = np.ones(len(rejects), bool)
    again[np.unique(motions, return_index=True)[1]] = False
    last = np.searchsorted(table["seq"], rejects["seq"]) - 1
    q = np.asarray(rejects["q"])
    off = np.abs(q - case.start - lattice.epsilon * gone).max(axis=1, initial=0)
    wrong = again | (last < 0) | (table["cell"][last] != rejects["node"])
    wrong |= ~adjacent(lattice, places[last], gone)
    wrong |= ~(off <= CLOSE * lattice.epsilon + case.blur)
    tally.look(
        rejects, wrong,
        lambda i: (
            f"{text(q[i])} is turned down again" if again[i]
            else f"{text(q[i])} is turned down, no neighbour of the cell just expanded"
        ),
    )  # fmt: skip
    _look_open(case, tally, lattice, np.unique(motions))


def _look_open(case: Case, tally: Tally, lattice: Lattice, blocked: NDArray[np.uint64]) -> None:
    """See that what was not turned down can be reached."""
    table = case.events[Kind.EXPAND]
    table = table[: len(table) - case.cut]
    table = table[np.sort(np.unique(table["cell"], return_index=True)[1])]
    # Where the goal is in reach nobody looks around.
    far = case.distance(np.asarray(table["q"]), case.goal[None])
    table = table[~case.at_most(far, lattice.max_move)]
    if not len(table):
        return
    table = table[np.linspace(0, len(table) - 1, min(MOST, len(table))).astype(np.int64)]
    steps = np.array([s for s in product((-1, 0, 1), repeat=case.dof) if any(s)])
    if not lattice.diagonals:
        steps = steps[np.abs(steps).sum(axis=1) == 1]
    around = (indices(case, lattice, table["q"])[:, None] + steps).reshape(-1, case.dof)
    some = np.repeat(table, len(steps))
    is_open = ~np.isin(_motions(some["cell"].astype(np.int64), _keys(around)), blocked)
    some, to = some[is_open], case.start + lattice.epsilon * around[is_open]
    out = ~((case.lower - case.blur <= to) & (to <= case.upper + case.blur)).all(axis=1)
    hit = out | (case.blocked(np.asarray(some["q"]), to) >= 0)
    tally.look(
        some, hit,
        lambda i: f"cell {some['cell'][i]}: {text(to[i])} is not turned down, but out of reach",
    )  # fmt: skip


def goal_taken(case: Case, tally: Tally) -> None:
    """Where the goal is within a straight free move of a cell, the search ends there."""
    lattice, table = lattice_of(case), case.events[Kind.EXPAND]
    if lattice is None or not len(table):
        return
    q = np.asarray(table["q"])
    far = case.distance(q, case.goal[None])
    near = np.flatnonzero(far < lattice.max_move * (1 - CLOSE) - case.blur)
    some, a = table[near], q[near]
    clear = all_clear(case.obstacles, case.robot, a, np.broadcast_to(case.goal, a.shape))
    ends = np.append(table["seq"][1:], 1 << 62)
    # Who goes on with another lookahead plans anew.
    ends[:-1][np.diff(case.stretch(table)) > 0] = 1 << 62
    ends = ends[near]
    moves = case.events[Kind.MOVE]
    # From a cell at the goal there is no move to make; the path is told all the same.
    moved = moves["seq"][(np.asarray(moves["q"]) == case.goal).all(axis=1)]
    taken = np.sort(np.concatenate([moved, case.events[Kind.PATH]["seq"]]))
    next_ = np.append(taken, 1 << 61)[np.searchsorted(taken, some["seq"])]
    wrong = clear & (ends < 1 << 62) & (next_ > ends)
    tally.look(
        some, np.asarray(wrong),
        lambda i: f"cell {some['cell'][i]} is {far[near[i]]:.9g} from the goal; the search goes on",
    )  # fmt: skip


RULES = (neighbours, best_first, shortest_ways, nothing_left, goal_taken)
"""All rules of this file; see `brrt.replay.checks`."""
