"""Rules about what planners turn down: one that is lazily careful keeps every other promise."""

import numpy as np
from numpy.typing import NDArray

from brrt.events import Kind, Reason, Table, table_dtype
from brrt.replay.checks.case import Case, Windows
from brrt.replay.checks.keeping import Thinned
from brrt.replay.checks.log import text
from brrt.replay.checks.motions import all_clear
from brrt.replay.checks.tally import Tally

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

MOST = 20_000
"""Of more rejections than this, so many are looked at, evenly spread over the log."""

_BLOCKED = (Reason.COLLISION, Reason.GOAL_BLOCKED, Reason.LINK_BLOCKED, Reason.NEAR_BLOCKED)


def rejections(case: Case, tally: Tally) -> Windows:
    """What is rejected for a collision touches something; of many, 20,000 are looked at.

    A point touches within 1e-9 of the lengths at hand, a body within 2e-6 of the map's longest
    side: twice the clearance that the planners' own check tells from a touch.
    """
    kept = Thinned(table_dtype(Kind.REJECT, case.dof), MOST)
    while (window := (yield)) is not None:
        table = window[Kind.REJECT]
        kept.add(table[np.isin(table["reason"], [int(reason) for reason in _BLOCKED])])
    if not case.known:
        return
    table = kept.rows()
    a, b = _origins(case, table), np.asarray(table["q"])
    there = np.isfinite(a).all(axis=1)
    tally.look(
        table[~there], np.ones(int((~there).sum()), bool),
        lambda i: f"an extension from node {table['node'][~there][i]}, which is not there",
    )  # fmt: skip
    some, a, b = table[there], a[there], b[there]
    clear = all_clear(case.obstacles, case.robot, a, b)
    # Beyond the bounds there is nothing to be clear of.
    clear &= ((case.lower <= b) & (b <= case.upper)).all(axis=1)
    tally.look(
        some, clear,
        lambda i: f"rejected, but the motion from {text(a[i])} to {text(b[i])} is clear",
    )  # fmt: skip


def limits(case: Case, tally: Tally) -> Windows:
    """What is rejected for the limits lies beyond them."""
    while (window := (yield)) is not None:
        table = window[Kind.REJECT]
        table = table[table["reason"] == Reason.LIMITS]
        q = np.asarray(table["q"])
        within = ((case.lower + case.blur < q) & (q < case.upper - case.blur)).all(axis=1)
        tally.look(
            table, np.asarray(within),
            lambda i, q=q: f"rejected, but {text(q[i])} is within",  # type: ignore[misc]
        )  # fmt: skip


def _origins(case: Case, table: Table) -> Floats:
    """Where extensions left from, nan where no such node was there; shape (n, dof)."""
    q = np.full((len(table), case.dof), np.nan)
    if case.contract.lattice is not None:
        seen = case.events[Kind.EXPAND]
        _fill(q, np.ones(len(table), bool), table, seen["cell"], seen)
    for tree in case.trees:
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


RULES = (rejections, limits)
"""All rules of this file; see `brrt.replay.checks`."""
