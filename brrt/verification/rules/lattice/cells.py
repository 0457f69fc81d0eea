"""Rules about searches on a lattice: cells, expansions, estimates, and the moves they lead to."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrt.events import Kind, Phase, Status, Table
from brrt.replay.text import vector
from brrt.scenario.contract import Lattice
from brrt.verification.context import Context
from brrt.verification.rule import LatticeRule, Rule
from brrt.verification.rules.moves import MoveRule
from brrt.verification.tolerances import CLOSE

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]
Cell = tuple[int, ...]

_KINDS = (Kind.EXPAND, Kind.HEURISTIC, Kind.MOVE)
_LARGEST = 1 << 40


def indices(context: Context, lattice: Lattice, q: Any) -> Ints:
    """Return the integer coordinates of the cells nearest to configurations, shape (n, d)."""
    cells = np.rint((np.asarray(q) - context.start) / lattice.cell)
    return np.where(np.abs(cells) < _LARGEST, cells, _LARGEST).astype(np.int64)


def adjacent(lattice: Lattice, a: Ints, b: Ints) -> Flags:
    """Return whether cells are neighbours, by their integer coordinates, shape (n, d)."""
    apart = np.abs(b - a)
    if lattice.diagonals:
        return np.asarray(apart.max(axis=1, initial=0) == 1)
    return np.asarray(apart.sum(axis=1) == 1)


def _with_cells(table: Table) -> Table:
    return table[table["cell"] >= 0]


class CellsOnLattice(Rule):
    name = "cells on lattice"
    promise = "Every cell is a whole number of edges from the start along each axis."
    needs = "lattice"
    kind = Kind.EXPAND
    assumes = ("motions",)

    def finish(self) -> None:
        lattice = self.context.contract.lattice
        if lattice is not None:
            for kind in _KINDS:
                self._judge(lattice, _with_cells(self.context.events[kind]))

    def _judge(self, lattice: Lattice, table: Table) -> None:
        context, q = self.context, np.asarray(table["q"])
        centre = context.start + lattice.cell * indices(context, lattice, q)
        off = np.abs(q - centre).max(axis=1, initial=0)
        self.judge(
            table, ~(off <= CLOSE * lattice.cell + context.tolerance),
            lambda i: f"cell {table['cell'][i]} is {off[i]:.3g} off the lattice",
        )  # fmt: skip


class CellNumbers(Rule):
    name = "cell numbers"
    promise = "A number means one cell and a cell has one number; the start has 0."
    needs = "lattice"
    kind = Kind.EXPAND

    def finish(self) -> None:
        context, lattice = self.context, self.context.contract.lattice
        if lattice is None:
            return
        for kind in (Kind.EXPAND, Kind.HEURISTIC):
            self._judge_negative(context.events[kind])
        tables = [_with_cells(context.events[kind]) for kind in _KINDS]
        cell = np.concatenate([np.asarray(table["cell"], np.int64) for table in tables])
        if not len(cell):
            return
        order = np.argsort(np.concatenate([table["seq"] for table in tables]), kind="stable")
        places = np.concatenate([indices(context, lattice, table["q"]) for table in tables])
        heads = np.concatenate([table[["seq", "t"]] for table in tables])[order]
        cell, places = cell[order], places[order]
        _, place = np.unique(places, axis=0, return_inverse=True)
        place = place.reshape(-1)
        wrong = (_first_with(cell, place) != place) | (_first_with(place, cell) != cell)
        wrong |= (cell == 0) != (places == 0).all(axis=1)
        self.judge(
            heads, wrong,
            lambda i: f"cell {cell[i]} is at {places[i].tolist()}, which contradicts other events",
        )  # fmt: skip

    def _judge_negative(self, table: Table) -> None:
        wrong = table[table["cell"] < 0]
        everything = np.ones(len(wrong), bool)
        self.judge(wrong, everything, lambda i: f"cell {wrong['cell'][i]} cannot exist")


def _first_with(keys: Ints, values: Ints) -> Ints:
    """Return for each row the value of the first row with its key, shape (n,)."""
    _, first, inverse = np.unique(keys, return_index=True, return_inverse=True)
    return np.asarray(values[first][inverse.reshape(-1)])


class Expansions(LatticeRule):
    name = "expansions"
    promise = (
        "A cell is reached by a free motion from an expanded neighbour, and its cost is correct."
    )

    def judge_search(self, lattice: Lattice, table: Table) -> None:
        context = self.context
        self._judge_repeats(table)
        self._judge_beginnings(lattice, table)
        parent, root = _parents(table), table["parent"] < 0
        self.judge(
            table, (~root & (parent < 0)) | (root & (table["cost"] != 0)),
            lambda i: (
                f"cell {table['cell'][i]} has parent {table['parent'][i]} and cost "
                f"{table['cost'][i]:g}; its search has not expanded that parent"
            ),
        )  # fmt: skip
        cells, above = table[parent >= 0], table[parent[parent >= 0]]
        a, b = np.asarray(above["q"]), np.asarray(cells["q"])
        apart = ~adjacent(lattice, indices(context, lattice, a), indices(context, lattice, b))
        self.judge(
            cells, apart,
            lambda i: f"cells {above['cell'][i]} and {cells['cell'][i]} are not neighbours",
        )  # fmt: skip
        cost = above["cost"] + context.distance(a, b)
        self.judge(
            cells, ~context.equal(cells["cost"], cost),
            lambda i: f"cell {cells['cell'][i]} costs {cost[i]:.12g}, not {cells['cost'][i]:.12g}",
        )  # fmt: skip
        self.judge_free(cells, a, b, "motion between cells")

    def _judge_repeats(self, table: Table) -> None:
        """Judge whether a search expands a cell twice."""
        search = np.cumsum(table["parent"] < 0)
        again = np.ones(len(table), bool)
        again[np.unique(np.stack([search, table["cell"]]), axis=1, return_index=True)[1]] = False
        self.judge(
            table, again, lambda i: f"cell {table['cell'][i]} is expanded again in one search"
        )

    def _judge_beginnings(self, lattice: Lattice, table: Table) -> None:
        """Judge whether searches begin where the robot is then, one search at each place."""
        context, begins = self.context, table[table["parent"] < 0]
        moves, paths = context.events[Kind.MOVE], context.events[Kind.PATH]
        moved = np.searchsorted(moves["seq"], begins["seq"])
        arrived = np.searchsorted(paths["seq"], begins["seq"])
        q = np.tile(context.start, (len(begins), 1))
        if len(moves):
            # A path is reported on arrival, and the next trial begins at the start.
            last = moves[np.maximum(moved, 1) - 1]
            back = (last["cell"] < 0) | (np.append(-1, paths["seq"])[arrived] > last["seq"])
            moving = ~back & (moved > 0)
            q[moving] = last["q"][moving]
        off = np.abs(begins["q"] - q).max(axis=1, initial=0)
        # A branch with another lookahead searches again.
        idle = np.diff(moved + arrived, prepend=-1) == 0
        idle &= np.diff(context.stretch(begins), prepend=0) == 0
        self.judge(
            begins, ~(off <= CLOSE * lattice.cell + context.tolerance) | idle,
            lambda i: (
                f"another search from cell {begins['cell'][i]} without a move" if idle[i]
                else f"a search from {vector(begins['q'][i])}; the robot is at {vector(q[i])}"
            ),
        )  # fmt: skip


def _parents(table: Table) -> Ints:
    """Return the row at which the same search expanded each row's parent before, or -1."""
    search = np.cumsum(table["parent"] < 0).astype(np.int64) << 32
    cell = np.where(table["cell"] >= 0, table["cell"], (1 << 32) - 1).astype(np.int64)
    keys = search | cell
    order = np.argsort(keys, kind="stable")
    wanted = search | np.maximum(table["parent"], 0)
    rows = order[np.minimum(np.searchsorted(keys[order], wanted), len(keys) - 1)]
    found = (keys[rows] == wanted) & (rows < np.arange(len(table))) & (table["parent"] >= 0)
    return np.asarray(np.where(found, rows, -1))


class Estimates(Rule):
    name = "estimates"
    promise = "An estimate of the cost-to-go begins as the distance to the goal and only rises."
    needs = "lattice"
    assumes = ("costs",)

    def finish(self) -> None:
        context, table = self.context, self.context.events[Kind.HEURISTIC]
        if context.contract.lattice is None or not len(table):
            return
        h = np.asarray(table["h"])
        order = np.argsort(table["cell"], kind="stable")
        same = np.diff(table["cell"][order], prepend=-(1 << 31)) == 0
        before = context.distance(table["q"], context.goal[None])
        before[order[same]] = h[order[np.flatnonzero(same) - 1]]
        # The first is compared with a distance, which is rounded.
        slack = np.full(len(table), context.tolerance)
        slack[order[same]] = 0.0
        self.judge(
            table, ~(h > before - slack),
            lambda i: f"cell {table['cell'][i]}: estimate {h[i]:.12g} after {before[i]:.12g}",
        )  # fmt: skip


class EstimatesAdmissible(Rule):
    name = "estimates admissible"
    promise = "No estimate exceeds the cost of a path to the goal that the log contains."
    needs = "lattice"
    assumes = ("motions", "costs", "collisions")

    def finish(self) -> None:
        context, lattice = self.context, self.context.contract.lattice
        table = context.events[Kind.HEURISTIC]
        if lattice is None or not len(table):
            return
        least = self._least_costs(lattice)
        cells = map(tuple, indices(context, lattice, table["q"]).tolist())
        limit = np.array([least.get(cell, np.inf) for cell in cells])
        known = np.isfinite(limit)
        table, limit = table[known], limit[known]
        self.judge(
            table, ~context.at_most(np.asarray(table["h"]), limit),
            lambda i: (
                f"cell {table['cell'][i]}: estimate {table['h'][i]:.12g}; "
                f"a path to the goal costs {limit[i]:.12g}"
            ),
        )  # fmt: skip

    def _least_costs(self, lattice: Lattice) -> dict[Cell, float]:
        """Return the least cost to the goal from each cell on paths and trials."""
        context = self.context
        ways, table = [path for _, path in context.planned_paths], context.events[Kind.MOVE]
        for trial in np.unique(table["trial"]).tolist():
            q = table["q"][table["trial"] == trial]
            ways.append(np.concatenate([context.start[None], q]))
        least: dict[Cell, float] = {}
        for way in ways:
            if not len(way) or (way[-1] != context.goal).any():
                continue
            cells = indices(context, lattice, way)
            off = np.abs(context.start + lattice.cell * cells - way).max(axis=1)
            at_cell = off <= CLOSE * lattice.cell + context.tolerance
            lengths = context.distance(way[:-1], way[1:])
            left = np.append(np.cumsum(lengths[::-1])[::-1], 0.0)
            for cell, cost in zip(cells[at_cell].tolist(), left[at_cell].tolist(), strict=True):
                least[tuple(cell)] = min(cost, least.get(tuple(cell), np.inf))
        return least


class LatticeMoves(MoveRule):
    name = "lattice moves"
    promise = "A robot on a lattice moves to a neighbour; only the goal may be anywhere."
    needs = "lattice"

    def judge_moves(self, table: Table, before: Floats, first: Flags) -> None:
        context, lattice = self.context, self.context.contract.lattice
        if lattice is None:
            return
        # Moves of the execution follow a path, not the lattice.
        phases = context.events[Kind.PHASE]
        executes = (phases["name"] == Phase.EXECUTE) & (phases["status"] == Status.BEGIN)
        planned = table["seq"] < np.append(phases["seq"][executes], 1 << 62)[0]
        table, before = table[planned], before[planned]
        near = adjacent(lattice, *(indices(context, lattice, q) for q in (before, table["q"])))
        beside_goal = (table["q"] != context.goal).any(axis=1)
        self.judge(
            table, np.where(table["cell"] < 0, beside_goal, ~near),
            lambda i: f"a move from {vector(before[i])} to {vector(table['q'][i])}, no neighbour",
        )  # fmt: skip


RULES = (CellsOnLattice, CellNumbers, Expansions, Estimates, EstimatesAdmissible, LatticeMoves)
