"""Rules about robots that search several cells ahead: how far, what they learn, where they go.

After a search LSS-LRTA* (Koenig and Sun 2009) raises the estimates of the cells that it expanded to
the least that the cells around them allow, and moves to the cell that it would expand next.
"""

from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from brrt.events import Kind, Table
from brrt.scenario.contract import Lattice
from brrt.verification.context import Context
from brrt.verification.rule import LatticeRule
from brrt.verification.rules.lattice.cells import indices
from brrt.verification.rules.lattice.search import cell_keys, contains, motion_keys, steps_of

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]

MOST = 20_000
"""Cells whose estimates are judged, and cells of searches after which moves are, at most."""

_NEVER = 1 << 62
_SEQ_BITS = 40


class Searches(NamedTuple):
    """The searches of a robot.

    Attributes:
        table: Their expansions, shape (n,).
        first: The row at which each begins, shape (s,).
        ends: The number of the event at which the next one begins, shape (s,).
        arrived: After which the path of a trial is reported, shape (s,).
        complete: Which were followed by all that they lead to, shape (s,).
        lookahead: How many cells each may expand, shape (s,).
    """

    table: Table
    first: Ints
    ends: Ints
    arrived: Flags
    complete: Flags
    lookahead: Ints

    @classmethod
    def of(cls, context: Context, table: Table) -> Self | None:
        """Split expansions into searches; None if a contract states no lookahead."""
        lattices = [contract.lattice for _, contract in context.stretches]
        limits = [each and each.lookahead for each in lattices]
        begins = np.flatnonzero(table["parent"] < 0)
        if not len(begins) or None in limits:
            return None
        table, first = table[begins[0] :], begins - begins[0]
        stretch = context.stretch(table)[first]
        seq = table["seq"][first].astype(np.int64)
        # Where the robot has arrived, the path is reported before the next search.
        paths = context.events[Kind.PATH]["seq"]
        arrived = np.diff(np.searchsorted(paths, np.append(seq, _NEVER))) > 0
        # A branch with another lookahead searches again; the end of a run interrupts the moves.
        complete = np.append(np.diff(stretch) == 0, arrived[-1])
        limit = np.array(limits, np.int64)[stretch]
        return cls(table, first, np.append(seq[1:], _NEVER), arrived, complete, limit)

    @property
    def sizes(self) -> Ints:
        """How many cells each expands, shape (s,)."""
        return np.diff(np.append(self.first, len(self.table)))

    def closed(self, chosen: Flags) -> tuple[Ints, Ints]:
        """Return the cells that searches expanded, but not where they reach the goal.

        Returns:
            The search of each, and its row, shape (n,) each.
        """
        search = np.repeat(np.arange(len(self.first)), self.sizes)
        taken = chosen[search]
        taken[(self.first + self.sizes - 1)[self.arrived]] = False
        return search[taken], np.flatnonzero(taken)


class Lookahead(LatticeRule):
    name = "lookahead"
    promise = (
        "Each search of LRTA* expands as many cells as the lookahead, fewer only if it reaches the "
        "goal, and the robot then moves to a cell that it did not expand."
    )

    def judge_search(self, lattice: Lattice, table: Table) -> None:
        searches = Searches.of(self.context, table)
        if searches is None:
            return
        table, count, limit = searches.table, searches.sizes, searches.lookahead
        ended, again = searches.arrived.copy(), ~searches.complete
        ended[-1], again[-1] = True, False
        first = table[searches.first]
        self.judge(
            first, (count > limit) | ((count < limit) & ~ended & ~again),
            lambda i: f"the search expands {count[i]} cells; the lookahead is {limit[i]}",
        )  # fmt: skip
        search = np.repeat(np.arange(len(first)), count) << 32
        keys = np.sort(search | table["cell"])
        wanted = (np.arange(len(first) - 1) << 32) | first["cell"][1:]
        at = np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)
        inside = (keys[at] == wanted) & ~ended[:-1] & ~again[:-1]
        self.judge(
            first[1:], inside,
            lambda i: f"a search from cell {first['cell'][i + 1]}, which the last one expanded",
        )  # fmt: skip


class _EstimateHistory:
    """The estimates of all cells at every moment.

    Args:
        context: The recording.
        lattice: The lattice.
    """

    def __init__(self, context: Context, lattice: Lattice) -> None:
        self._context, self._lattice = context, lattice
        raised = context.events[Kind.HEURISTIC]
        keys = cell_keys(indices(context, lattice, raised["q"]))
        self._keys, rank = np.unique(keys, return_inverse=True)
        moments = rank.reshape(-1).astype(np.int64) << _SEQ_BITS | raised["seq"]
        order = np.argsort(moments, kind="stable")
        self._moments, self._h = moments[order], np.asarray(raised["h"])[order]

    def before(self, cells: Ints, seq: Ints) -> Floats:
        """Return the estimates of cells, shape (n, d), before events, shape (n,)."""
        q = self._context.start + self._lattice.cell * cells
        h = self._context.distance(q, self._context.goal[None])
        if len(self._keys):
            keys = cell_keys(cells)
            rank = np.minimum(np.searchsorted(self._keys, keys), len(self._keys) - 1)
            seq = np.minimum(seq, (1 << _SEQ_BITS) - 1)
            last = np.searchsorted(self._moments, rank << _SEQ_BITS | seq) - 1
            known = (self._keys[rank] == keys) & (last >= 0)
            known &= self._moments[last] >> _SEQ_BITS == rank
            h[known] = self._h[last[known]]
        return h


class _Around(NamedTuple):
    """The neighbours of cells.

    Attributes:
        cells: Their integer coordinates, shape (n, k, d).
        keys: Their numbers by place, shape (n, k).
        costs: The length of the motion to each; inf if it is blocked, shape (n, k).
    """

    cells: Ints
    keys: Ints
    costs: Floats

    @classmethod
    def of(cls, context: Context, lattice: Lattice, table: Table) -> Self:
        """Find the neighbours of expanded cells, and which of them were rejected."""
        steps, rejects = steps_of(lattice, context.dof), context.events[Kind.REJECT]
        places = indices(context, lattice, table["q"])
        cells = places[:, None] + np.array(steps)
        keys = cell_keys(cells.reshape(-1, context.dof))
        targets = cell_keys(indices(context, lattice, rejects["q"]))
        blocked = np.unique(motion_keys(rejects["node"].astype(np.int64), targets))
        numbers = np.repeat(table["cell"].astype(np.int64), len(steps))
        is_blocked = contains(blocked, motion_keys(numbers, keys)).reshape(len(table), -1)
        lengths = lattice.cell * np.sqrt([sum(map(abs, step)) for step in steps])
        costs = np.where(is_blocked, np.inf, lengths)
        return cls(cells, keys.reshape(costs.shape), costs)


class Learning(LatticeRule):
    name = "learning"
    promise = (
        "With a lookahead of more than 1 the estimates of the cells that a search expanded become "
        "the least that the cells around them allow."
    )

    def judge_search(self, lattice: Lattice, table: Table) -> None:
        context, searches = self.context, Searches.of(self.context, table)
        if searches is None or not lattice.backs_up:
            return
        search, row = searches.closed(searches.complete & (searches.lookahead > 1))
        if not len(row):
            return
        some = np.linspace(0, len(row) - 1, min(MOST, len(row))).astype(np.int64)
        search, cells = search[some], searches.table[row[some]]
        around, estimates = _Around.of(context, lattice, cells), _EstimateHistory(context, lattice)
        ends, places = searches.ends[search], indices(context, lattice, cells["q"])
        n, k, dof = around.cells.shape
        there = estimates.before(around.cells.reshape(-1, dof), np.repeat(ends, k)).reshape(n, k)
        least = (around.costs + there).min(axis=1)
        here = estimates.before(places, ends)
        self.judge(
            cells, ~context.equal(here, least),
            lambda i: (
                f"after the search the estimate of cell {cells['cell'][i]} is {here[i]:.12g}; "
                f"the cells around it allow {least[i]:.12g}"
            ),
        )  # fmt: skip


class FrontierMoves(LatticeRule):
    name = "frontier moves"
    promise = (
        "With a lookahead of more than 1 the robot moves to the cell of least cost and estimate "
        "that its search did not expand, by the shortest way that the search found."
    )

    def judge_search(self, lattice: Lattice, table: Table) -> None:
        context, searches = self.context, Searches.of(self.context, table)
        if searches is None or not lattice.backs_up:
            return
        chosen = searches.complete & (searches.lookahead > 1) & ~searches.arrived
        chosen &= np.arange(len(chosen)) % -(-len(searches.table) // MOST) == 0
        search, row = searches.closed(chosen)
        if not len(row):
            return
        cells = searches.table[row]
        around, estimates = _Around.of(context, lattice, cells), _EstimateHistory(context, lattice)
        n, k, dof = around.cells.shape
        begins = searches.table["seq"][searches.first].astype(np.int64)
        # The search used what was known when it began.
        h = estimates.before(around.cells.reshape(-1, dof), np.repeat(begins[search], k))
        own = cell_keys(indices(context, lattice, cells["q"]))
        expanded = np.sort(motion_keys(search, own))
        is_open = ~contains(expanded, motion_keys(np.repeat(search, k), around.keys.reshape(-1)))
        through = np.where(is_open.reshape(n, k), cells["cost"][:, None] + around.costs, np.inf)
        total = through + h.reshape(n, k)
        # The robot's place is that of the next search.
        following = searches.table[searches.first[np.minimum(search + 1, len(chosen) - 1)]]
        target = cell_keys(indices(context, lattice, following["q"]))[:, None] == around.keys
        starts = np.flatnonzero(np.diff(search, prepend=-1))
        least = np.minimum.reduceat(total.min(axis=1), starts)
        cost, taken = (
            np.minimum.reduceat(np.where(target, values, np.inf).min(axis=1), starts)
            for values in (through, total)
        )
        heads, number = following[starts], search[starts]
        walked = self._walked(begins[number], searches.ends[number])
        far = ~context.at_most(taken, least) & np.isfinite(taken)
        self.judge(
            heads, far | (~context.equal(walked, cost) & np.isfinite(cost)),
            lambda i: (
                f"the robot moves to a cell of cost and estimate {taken[i]:.12g}; the least is "
                f"{least[i]:.12g}" if far[i]
                else f"the robot moves {walked[i]:.12g} to a cell that is {cost[i]:.12g} away"
            ),
        )  # fmt: skip

    def _walked(self, begins: Ints, ends: Ints) -> Floats:
        """Return how far the robot moves between events, shape (n,)."""
        moves = self.context.events[Kind.MOVE]
        at = np.concatenate([self.context.start[None], moves["q"]])
        length = self.context.distance(at[:-1], at[1:])
        # Each trial begins at the start.
        first = np.diff(moves["trial"], prepend=0) != 0
        length[first] = self.context.distance(self.context.start[None], moves["q"][first])
        total = np.append(0.0, np.cumsum(length))
        return np.asarray(
            total[np.searchsorted(moves["seq"], ends)]
            - total[np.searchsorted(moves["seq"], begins)]
        )


RULES = (Lookahead, Learning, FrontierMoves)
