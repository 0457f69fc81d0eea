"""Rules about searches on a lattice: cells, expansions, estimates, and the moves they lead to."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrt.events import Kind, Phase, Stage, Status, Table
from brrt.scenario.contract import Lattice
from brrt.verification.context import CLOSE, Context
from brrt.verification.result import RuleResult
from brrt.verification.rules.log import text

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Cell = tuple[int, ...]

_KINDS = (Kind.EXPAND, Kind.HEURISTIC, Kind.MOVE)


def lattice_of(context: Context) -> Lattice | None:
    """The lattice that the planner promises, if it is one to reckon with."""
    lattice = context.contract.lattice
    return lattice if lattice is not None and lattice.epsilon > 0 else None


def indices(context: Context, lattice: Lattice, q: Any) -> Ints:
    """Integer coordinates of the cells nearest to places, shape (n, d)."""
    cells = np.rint((np.asarray(q) - context.start) / lattice.epsilon)
    return np.asarray(np.where(np.abs(cells) < 1 << 40, cells, 1 << 40).astype(np.int64))


def cells_on_lattice(context: Context, result: RuleResult) -> None:
    """Every cell lies a whole number of edges from the start along each axis."""
    lattice = lattice_of(context)
    for kind in _KINDS if lattice is not None else ():
        assert lattice is not None  # noqa: S101 - the loop has no rounds otherwise
        table = _with_cells(context.events[kind])
        q = np.asarray(table["q"])
        there = context.start + lattice.epsilon * indices(context, lattice, q)
        off = np.abs(q - there).max(axis=1, initial=0)
        wrong = ~(off <= CLOSE * lattice.epsilon + context.blur)
        result.look(
            table, wrong,
            lambda i, t=table, off=off: f"cell {t['cell'][i]} is {off[i]:.3g} off the lattice",  # type: ignore[misc]
        )  # fmt: skip


def _with_cells(table: Table) -> Table:
    return table[table["cell"] >= 0] if "cell" in (table.dtype.names or ()) else table


def cells_keep_their_numbers(context: Context, result: RuleResult) -> None:
    """A number means one cell and a cell has one number; the start's is 0."""
    lattice = lattice_of(context)
    if lattice is None:
        return
    tables = [_with_cells(context.events[kind]) for kind in _KINDS]
    for table in [context.events[kind] for kind in (Kind.EXPAND, Kind.HEURISTIC)]:
        below = table["cell"] < 0
        result.look(
            table[below], below[below],
            lambda i, t=table[below]: f"there is no cell {t['cell'][i]}",  # type: ignore[misc]
        )  # fmt: skip
    cell = np.concatenate([np.asarray(table["cell"], np.int64) for table in tables])
    if not len(cell):
        return
    seq = np.concatenate([table["seq"] for table in tables])
    places = np.concatenate([indices(context, lattice, table["q"]) for table in tables])
    order = np.argsort(seq, kind="stable")
    cell, places = cell[order], places[order]
    _, place = np.unique(places, axis=0, return_inverse=True)
    place = place.reshape(-1)
    wrong = (_first_with(cell, place) != place) | (_first_with(place, cell) != cell)
    wrong |= (cell == 0) != (places == 0).all(axis=1)
    heads = np.concatenate([table[["seq", "t"]] for table in tables])[order]
    result.look(heads, wrong, lambda i: f"number {cell[i]} and place {places[i].tolist()} disagree")


def _first_with(keys: Ints, values: Ints) -> Ints:
    """For each row the value that came with the first of its key, shape (n,)."""
    _, first, inverse = np.unique(keys, return_index=True, return_inverse=True)
    return np.asarray(values[first][inverse.reshape(-1)])


def adjacent(lattice: Lattice, a: Ints, b: Ints) -> NDArray[np.bool_]:
    """Whether cells are neighbours, integer coordinates of shape (n, d)."""
    apart = np.abs(b - a)
    if lattice.diagonals:
        return np.asarray(apart.max(axis=1, initial=0) == 1)
    return np.asarray(apart.sum(axis=1) == 1)


def expansions(context: Context, result: RuleResult) -> None:
    """A cell is reached from a neighbour that its search expanded, freely; its cost is right.

    A search begins where the robot is, and expands no cell twice.
    """
    lattice, table = lattice_of(context), context.events[Kind.EXPAND]
    if lattice is None or not len(table):
        return
    _look_begun(context, result, lattice, table)
    parent = _parents(table)
    root = table["parent"] < 0
    result.look(
        table, (~root & (parent < 0)) | (root & (table["cost"] != 0)),
        lambda i: (
            f"cell {table['cell'][i]} from {table['parent'][i]} at cost {table['cost'][i]:g}: "
            "its search has not expanded that cell"
        ),
    )  # fmt: skip
    some, above = table[parent >= 0], table[parent[parent >= 0]]
    a, b = np.asarray(above["q"]), np.asarray(some["q"])
    apart = ~adjacent(lattice, indices(context, lattice, a), indices(context, lattice, b))
    result.look(
        some, apart,
        lambda i: f"cells {above['cell'][i]} and {some['cell'][i]} are no neighbours",
    )  # fmt: skip
    cost = above["cost"] + context.distance(a, b)
    result.look(
        some, ~context.same(some["cost"], cost),
        lambda i: f"cell {some['cell'][i]} costs {cost[i]:.12g}, not {some['cost'][i]:.12g}",
    )  # fmt: skip
    context.look_free(result, some, a, b, "motion between cells")


def _look_begun(context: Context, result: RuleResult, lattice: Lattice, table: Table) -> None:
    """See that searches begin where the robot is then, once at each place, and repeat no cell."""
    root = table["parent"] < 0
    search = np.cumsum(root)
    again = np.ones(len(table), bool)
    again[np.unique(np.stack([search, table["cell"]]), axis=1, return_index=True)[1]] = False
    result.look(table, again, lambda i: f"cell {table['cell'][i]} is expanded again in one search")
    moves, paths = context.events[Kind.MOVE], context.events[Kind.PATH]
    begins = table[root]
    moved = np.searchsorted(moves["seq"], begins["seq"])
    told = np.searchsorted(paths["seq"], begins["seq"])
    q, back = context.start + np.zeros((len(begins), context.dof)), moved == 0
    last = moves[np.maximum(moved, 1) - 1] if len(moves) else moves
    if len(moves):
        # A path is told on arrival, and the next trial begins at the start.
        back |= (last["cell"] < 0) | (np.append(-1, paths["seq"])[told] > last["seq"])
        q[~back] = last["q"][~back]
    off = np.abs(np.asarray(begins["q"]) - q).max(axis=1, initial=0)
    # Who goes on with another lookahead plans anew.
    idle = np.diff(moved + told, prepend=-1) == 0
    idle &= np.diff(context.stretch(begins), prepend=0) == 0
    result.look(
        begins, ~(off <= CLOSE * lattice.epsilon + context.blur) | idle,
        lambda i: (
            f"another search from cell {begins['cell'][i]} without a move" if idle[i]
            else f"a search from {text(begins['q'][i])}; the robot is at {text(q[i])}"
        ),
    )  # fmt: skip


def _parents(table: Table) -> Ints:
    """Row at which the same search expanded each row's parent before, or -1, shape (n,)."""
    search = np.cumsum(table["parent"] < 0).astype(np.int64) << 32
    cell = np.where(table["cell"] >= 0, table["cell"], (1 << 32) - 1).astype(np.int64)
    keys = search | cell
    order = np.argsort(keys, kind="stable")
    wanted = search | np.maximum(table["parent"], 0)
    at = np.minimum(np.searchsorted(keys[order], wanted), len(keys) - 1)
    rows = order[at]
    found = (keys[rows] == wanted) & (rows < np.arange(len(table))) & (table["parent"] >= 0)
    return np.asarray(np.where(found, rows, -1))


def estimates(context: Context, result: RuleResult) -> None:
    """An estimate of the cost-to-go begins as the distance to the goal, and only rises."""
    table = context.events[Kind.HEURISTIC]
    if lattice_of(context) is None or not len(table):
        return
    h = np.asarray(table["h"])
    order = np.argsort(table["cell"], kind="stable")
    same = np.diff(table["cell"][order], prepend=-(1 << 31)) == 0
    before = context.distance(np.asarray(table["q"]), context.goal[None])
    before[order[same]] = h[order[np.flatnonzero(same) - 1]]
    # The first is compared with a distance, which is rounded.
    slack = np.full(len(table), context.blur)
    slack[order[same]] = 0.0
    wrong = ~(h > before - slack)
    result.look(
        table, wrong,
        lambda i: f"cell {table['cell'][i]}: an estimate of {h[i]:.12g} after {before[i]:.12g}",
    )  # fmt: skip


def estimates_admissible(context: Context, result: RuleResult) -> None:
    """No estimate exceeds what a robot then spent to the goal from there, or along a path."""
    lattice, table = lattice_of(context), context.events[Kind.HEURISTIC]
    if lattice is None or not len(table):
        return
    spent = _spent(context, lattice)
    places = [tuple(p) for p in indices(context, lattice, table["q"]).tolist()]
    most = np.array([spent.get(place, np.inf) for place in places])
    judged = np.isfinite(most)
    some, limit = table[judged], most[judged]
    result.look(
        some, ~context.at_most(np.asarray(some["h"]), limit),
        lambda i: f"cell {some['cell'][i]}: {some['h'][i]:.12g}, but {limit[i]:.12g} is a way",
    )  # fmt: skip


def _spent(context: Context, lattice: Lattice) -> dict[Cell, float]:
    """Least cost from cells to the goal that the log itself shows."""
    ways = [path for event, path in context.paths if event["stage"] != Stage.SMOOTHED]
    table = context.events[Kind.MOVE]
    for trial in np.unique(table["trial"]).tolist():
        q = np.asarray(table["q"][table["trial"] == trial])
        ways.append(np.concatenate([context.start[None], q]))
    least: dict[Cell, float] = {}
    for way in ways:
        if not len(way) or (way[-1] != context.goal).any():
            continue
        cells = indices(context, lattice, way)
        on = np.abs(context.start + lattice.epsilon * cells - way).max(axis=1) <= (
            CLOSE * lattice.epsilon + context.blur
        )
        lengths = context.distance(way[:-1], way[1:])
        left = np.append(np.cumsum(lengths[::-1])[::-1], 0.0)
        for cell, cost, good in zip(map(tuple, cells.tolist()), left.tolist(), on, strict=True):
            if good:
                least[cell] = min(cost, least.get(cell, np.inf))
    return least


def lattice_moves(context: Context, result: RuleResult) -> None:
    """A robot on a lattice moves to a neighbour; the goal alone may be anywhere."""
    lattice, table = lattice_of(context), _planned_moves(context)
    if lattice is None or not len(table):
        return
    before = _origins(context, table)
    goal = table["cell"] < 0
    near = adjacent(lattice, *(indices(context, lattice, q) for q in (before, table["q"])))
    wrong = np.where(goal, (np.asarray(table["q"]) != context.goal).any(axis=1), ~near)
    result.look(
        table, wrong,
        lambda i: f"a move from {text(before[i])} to {text(table['q'][i])}, no neighbour",
    )  # fmt: skip


def _planned_moves(context: Context) -> Table:
    """Moves that a search made itself, without a path to execute."""
    phases, table = context.events[Kind.PHASE], context.events[Kind.MOVE]
    begins = phases["seq"][(phases["name"] == Phase.EXECUTE) & (phases["status"] == Status.BEGIN)]
    return table[table["seq"] < begins[0]] if len(begins) else table


def _origins(context: Context, table: Table) -> Floats:
    """Where moves begin, shape (n, dof)."""
    q = np.asarray(table["q"])
    before = np.concatenate([context.start[None], q])[:-1]
    before[np.diff(table["trial"], prepend=-1) != 0] = context.start
    return before


RULES = (
    cells_on_lattice, cells_keep_their_numbers, expansions, estimates, estimates_admissible,
    lattice_moves,
)  # fmt: skip
"""All rules of this file; see `brrt.verification`."""
