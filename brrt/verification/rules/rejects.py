"""Rules about rejections: a planner that rejects too much keeps every other promise."""

import numpy as np
from numpy.typing import NDArray

from brrt.collision.motions import all_clear
from brrt.events import Events, Kind, Reason, Stage, Table, table_dtype
from brrt.replay.text import vector
from brrt.scenario.contract import Contract
from brrt.verification.context import Context
from brrt.verification.retention import SpreadRows
from brrt.verification.rule import ANY_PART, Rule
from brrt.verification.tolerances import CLOSE

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

MOST = 20_000
"""Rejections that are judged, spread over the log."""

_BY_TREES = (Reason.NO_PROGRESS, Reason.LINK_BLOCKED, Reason.COLLISION)
"""Reasons that are judged by where nodes are."""

_BLOCKED = (Reason.COLLISION, Reason.GOAL_BLOCKED, Reason.LINK_BLOCKED, Reason.NEAR_BLOCKED)


class Rejections(Rule):
    """Judges touches.

    A point touches within 1e-9 of the lengths at hand, a body within 2e-6 of the map's longest
    side: twice the clearance up to which the planners' own checks may report a touch.
    """

    name = "rejections"
    promise = "A motion that is rejected for a collision touches something."
    needs = ANY_PART
    assumes = ("motions", "collisions")

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        self.kept = SpreadRows(table_dtype(Kind.REJECT, context.dof), MOST)

    def window(self, events: Events, contract: Contract) -> None:
        table = events[Kind.REJECT]
        self.kept.add(table[np.isin(table["reason"], [int(reason) for reason in _BLOCKED])])

    def finish(self) -> None:
        context, table = self.context, self.kept.rows()
        origins = _origins(context, table)
        exist = np.isfinite(origins).all(axis=1)
        lost = table[~exist]
        self.judge(
            lost, np.ones(len(lost), bool),
            lambda i: f"an extension from node {lost['node'][i]}, which does not exist",
        )  # fmt: skip
        table, a = table[exist], origins[exist]
        b = np.asarray(table["q"])
        clear = all_clear(context.obstacles, context.robot, a, b)
        clear &= ((context.lower <= b) & (b <= context.upper)).all(axis=1)
        self.judge(
            table, clear,
            lambda i: f"rejected, but the motion from {vector(a[i])} to {vector(b[i])} is clear",
        )  # fmt: skip


class Reasons(Rule):
    name = "reasons"
    promise = "Rejections have a reason that the planner can have, and that is true."
    needs = ANY_PART
    assumes = ("motions", "costs", "times")

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        self.kept = SpreadRows(table_dtype(Kind.REJECT, context.dof), MOST)
        self.best = np.inf
        parts = context.contract.growth, context.contract.lattice
        self.judges = any(part is not None for part in parts)

    def window(self, events: Events, contract: Contract) -> None:
        context, table, paths = self.context, events[Kind.REJECT], events[Kind.PATH]
        paths = paths[paths["stage"] != Stage.SMOOTHED]
        costs = np.append(self.best, paths["cost"])
        best, self.best = costs[np.searchsorted(paths["seq"], table["seq"])], float(costs[-1])
        if not self.judges:
            return
        q, why = np.asarray(table["q"]), table["reason"]
        through = context.distance(context.start[None], q) + context.distance(q, context.goal[None])
        right = np.isin(why, _possible(contract))
        right &= (why != Reason.NO_GAIN) | (through >= best * (1 - CLOSE) - context.tolerance)
        right &= (why != Reason.GOAL_BLOCKED) | (q == context.goal).all(axis=1)
        self.judge(
            table,
            ~right,
            lambda i: f"{vector(q[i])} cannot be rejected for {Reason.label_of(int(why[i]))}",
        )
        self.kept.add(table[np.isin(why, _BY_TREES)])

    def finish(self) -> None:
        context, table = self.context, self.kept.rows()
        if context.contract.growth is None:
            return
        q, why = np.asarray(table["q"]), table["reason"]
        length = context.distance(_origins(context, table), q)
        self.judge(
            table, (why == Reason.NO_PROGRESS) & ~(length <= context.tolerance),
            lambda i: f"an extension of {length[i]:.9g} is rejected for no progress",
        )  # fmt: skip
        links = why == Reason.LINK_BLOCKED
        to_newest = np.zeros(len(table), bool)
        for tree in (tree for tree in context.trees if len(tree)):
            theirs = np.flatnonzero(table["tree"] == 1 - tree.number)
            newest = np.searchsorted(tree.edges["seq"], table["seq"][theirs]) - 1
            to_newest[theirs] = (newest >= 0) & (q[theirs] == tree.q[newest]).all(axis=1)
        # Trees that rewire also aim at each other's nodes without linking to them.
        judged = links | ((why == Reason.COLLISION) & (context.contract.near is None))
        self.judge(
            table, judged & (links != to_newest),
            lambda i: f"{vector(q[i])} is {'' if to_newest[i] else 'not '}the other's newest node",
        )  # fmt: skip


def _possible(contract: Contract) -> list[int]:
    """Return the reasons for which a planner may reject a motion."""
    found = [Reason.COLLISION]
    if contract.lattice is not None:
        found.append(Reason.LIMITS)
    if contract.growth is not None:
        found.append(Reason.NO_PROGRESS)
        found += [Reason.GOAL_BLOCKED] * contract.growth.goal_test
        found += [Reason.LINK_BLOCKED] * (contract.growth.links is not None)
    if contract.near is not None:
        found.append(Reason.NEAR_BLOCKED)
    if contract.draws is not None and contract.draws.informed:
        found.append(Reason.NO_GAIN)
    return [int(reason) for reason in found]


class Limits(Rule):
    name = "limits"
    promise = (
        "Motions rejected for the limits exceed them; on a lattice, no other rejected motion does."
    )
    assumes = ("bounds",)

    def window(self, events: Events, contract: Contract) -> None:
        context, table = self.context, events[Kind.REJECT]
        q, stated = np.asarray(table["q"]), table["reason"] == Reason.LIMITS
        low, high, slack = context.lower, context.upper, context.tolerance
        wrong = stated & ((low + slack < q) & (q < high - slack)).all(axis=1)
        if context.contract.lattice is not None:
            wrong |= ~stated & ((q < low - slack) | (high + slack < q)).any(axis=1)
        judged = stated | wrong
        table, q = table[judged], q[judged]
        self.judge(
            table, wrong[judged],
            lambda i: (
                f"rejected for the limits, but {vector(q[i])} is within them"
                if table["reason"][i] == Reason.LIMITS
                else f"{vector(q[i])} is beyond the limits but rejected for another reason"
            ),
        )  # fmt: skip


def _origins(context: Context, table: Table) -> Floats:
    """Return where rejected motions begin, nan if no such node exists then, shape (n, dof)."""
    q = np.full((len(table), context.dof), np.nan)
    if context.contract.lattice is not None:
        cells = context.events[Kind.EXPAND]
        _fill(q, np.arange(len(table)), table, cells["cell"], cells)
    for tree in context.trees:
        mine = np.flatnonzero(table["tree"] == tree.number)
        _fill(q, mine, table, np.arange(len(tree)), tree.edges)
    return q


def _fill(q: Floats, rows: Ints, table: Table, numbers: Ints, nodes: Table) -> None:
    """Fill in the configurations of the nodes that rows name, if these exist before."""
    if not len(nodes):
        return
    order = np.argsort(numbers, kind="stable")
    at = np.searchsorted(numbers, table["node"][rows], sorter=order)
    found = order[np.minimum(at, len(order) - 1)]
    right = (numbers[found] == table["node"][rows]) & (nodes["seq"][found] < table["seq"][rows])
    q[rows[right]] = nodes["q"][found[right]]


RULES = (Rejections, Reasons, Limits)
