"""Rules about what planners turn down: one that is lazily careful keeps every other promise."""

import numpy as np
from numpy.typing import NDArray

from brrt.collision.motions import all_clear
from brrt.events import Kind, Reason, Stage, Table, table_dtype
from brrt.scenario.contract import Contract
from brrt.verification.context import CLOSE, Context, Windows
from brrt.verification.result import RuleResult
from brrt.verification.retention import Thinned
from brrt.verification.rules.log import text

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

MOST = 20_000
"""Of more rejections than this, so many are looked at, evenly spread over the log."""

_SEEN_IN_TREES = (Reason.NO_PROGRESS, Reason.LINK_BLOCKED, Reason.COLLISION)
"""Reasons that are held to where nodes are."""

_BLOCKED = (Reason.COLLISION, Reason.GOAL_BLOCKED, Reason.LINK_BLOCKED, Reason.NEAR_BLOCKED)


def rejections(context: Context, result: RuleResult) -> Windows:
    """What is rejected for a collision touches something; of many, 20,000 are looked at.

    A point touches within 1e-9 of the lengths at hand, a body within 2e-6 of the map's longest
    side: twice the clearance that the planners' own check tells from a touch.
    """
    kept = Thinned(table_dtype(Kind.REJECT, context.dof), MOST)
    while (window := (yield)) is not None:
        table = window[Kind.REJECT]
        kept.add(table[np.isin(table["reason"], [int(reason) for reason in _BLOCKED])])
    if not context.known:
        return
    table = kept.rows()
    a, b = _origins(context, table), np.asarray(table["q"])
    there = np.isfinite(a).all(axis=1)
    result.look(
        table[~there], np.ones(int((~there).sum()), bool),
        lambda i: f"an extension from node {table['node'][~there][i]}, which is not there",
    )  # fmt: skip
    some, a, b = table[there], a[there], b[there]
    clear = all_clear(context.obstacles, context.robot, a, b)
    # Beyond the bounds there is nothing to be clear of.
    clear &= ((context.lower <= b) & (b <= context.upper)).all(axis=1)
    result.look(
        some, clear,
        lambda i: f"rejected, but the motion from {text(a[i])} to {text(b[i])} is clear",
    )  # fmt: skip


def reasons(context: Context, result: RuleResult) -> Windows:
    """What is rejected is so for a reason that the planner has, and that holds.

    An extension makes no progress where it ends at its node, is of no gain where the best path told
    costs no more, and a link leads to the other tree's newest node. Where that takes a look at the
    trees, 20,000 are looked at.
    """
    kept, best, name = Thinned(table_dtype(Kind.REJECT, context.dof), MOST), np.inf, Reason.label_of
    while (window := (yield)) is not None:
        table, paths = window[Kind.REJECT], window[Kind.PATH]
        paths = paths[paths["stage"] != Stage.SMOOTHED]
        costs = np.append(best, paths["cost"])
        told, best = costs[np.searchsorted(paths["seq"], table["seq"])], float(costs[-1])
        if not _has_reasons(context):
            continue
        q, reason = np.asarray(table["q"]), table["reason"]
        through = context.distance(context.start[None], q) + context.distance(q, context.goal[None])
        no_gain = through >= told * (1 - CLOSE) - context.blur
        to_goal = (q == context.goal).all(axis=1)
        right = np.isin(reason, _possible(context.ruling(window)))
        right &= (reason != Reason.NO_GAIN) | no_gain
        right &= (reason != Reason.GOAL_BLOCKED) | to_goal
        result.look(
            table, np.asarray(~right),
            lambda i, r=reason, q=q: f"{name(int(r[i]))} is no reason for {text(q[i])} to be",  # type: ignore[misc]
        )  # fmt: skip
        kept.add(table[np.isin(reason, _SEEN_IN_TREES)])
    if context.contract.growth is not None:
        _look_at_trees(context, result, kept.rows())


def _look_at_trees(context: Context, result: RuleResult, table: Table) -> None:
    """Hold reasons to where the nodes of the trees are."""
    q, reason = np.asarray(table["q"]), table["reason"]
    stays = reason == Reason.NO_PROGRESS
    way = context.distance(_origins(context, table), q)
    result.look(
        table, stays & ~(way <= context.blur),
        lambda i: f"an extension of {way[i]:.9g} is said to make no progress",
    )  # fmt: skip
    # Trees that rewire head for each other's nodes without the aim of joining them.
    links = reason == Reason.LINK_BLOCKED
    to_newest = np.zeros(len(table), bool)
    for tree in (tree for tree in context.trees if len(tree.edges)):
        theirs = np.flatnonzero(table["tree"] == 1 - tree.number)
        newest = np.searchsorted(tree.edges["seq"], table["seq"][theirs]) - 1
        ends = np.asarray(tree.edges["q"])[newest]
        to_newest[theirs] = (newest >= 0) & (q[theirs] == ends).all(axis=1)
    judged = links | ((reason == Reason.COLLISION) & (context.contract.near is None))
    result.look(
        table, judged & (links != to_newest),
        lambda i: f"{text(q[i])} is{'' if to_newest[i] else ' not'} the other tree's newest node",
    )  # fmt: skip


def _has_reasons(context: Context) -> bool:
    return context.contract.growth is not None or context.contract.lattice is not None


def _possible(contract: Contract) -> list[int]:
    """Why a planner may reject something."""
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


def limits(context: Context, result: RuleResult) -> Windows:
    """What is rejected for the limits lies beyond them; of a lattice, nothing else does."""
    while (window := (yield)) is not None:
        table = window[Kind.REJECT]
        q, beyond = np.asarray(table["q"]), table["reason"] == Reason.LIMITS
        within = ((context.lower + context.blur < q) & (q < context.upper - context.blur)).all(
            axis=1
        )
        wrong = beyond & within
        if context.contract.lattice is not None:
            wrong |= ~beyond & (
                (q < context.lower - context.blur) | (context.upper + context.blur < q)
            ).any(1)
        some, at = table[beyond | wrong], wrong[beyond | wrong]
        result.look(
            some, np.asarray(at),
            lambda i, t=some: (  # type: ignore[misc]
                f"rejected, but {text(t['q'][i])} is within" if t["reason"][i] == Reason.LIMITS
                else f"{text(t['q'][i])} is beyond the limits, and that is not said"
            ),
        )  # fmt: skip


def _origins(context: Context, table: Table) -> Floats:
    """Where extensions left from, nan where no such node was there; shape (n, dof)."""
    q = np.full((len(table), context.dof), np.nan)
    if context.contract.lattice is not None:
        seen = context.events[Kind.EXPAND]
        _fill(q, np.ones(len(table), bool), table, seen["cell"], seen)
    for tree in context.trees:
        mine = table["tree"] == tree.number
        _fill(q, mine, table, np.arange(len(tree.edges)), tree.edges)
    return q


def _fill(q: Floats, mine: NDArray[np.bool_], table: Table, numbers: Ints, nodes: Table) -> None:
    """Look nodes up by their numbers; each must have been told of before it is named."""
    if not len(nodes):
        return
    order = np.argsort(numbers, kind="stable")
    rows = np.flatnonzero(mine)
    at = np.searchsorted(numbers, table["node"][rows], sorter=order)
    found = order[np.minimum(at, len(order) - 1)]
    right = (numbers[found] == table["node"][rows]) & (nodes["seq"][found] < table["seq"][rows])
    q[rows[right]] = nodes["q"][found[right]]


RULES = (rejections, reasons, limits)
"""All rules of this file; see `brrt.verification`."""
