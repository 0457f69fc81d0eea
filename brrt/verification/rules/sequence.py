"""Rules about the order of events: iterations, duplicates, and what follows what."""

import numpy as np
from numpy.typing import NDArray

from brrt.events import Events, Kind, Reason, Source, Table
from brrt.scenario.contract import Contract, Growth
from brrt.verification.context import Context
from brrt.verification.rule import ANY_PART, IterationRule, Rule
from brrt.verification.rules.log import heads
from brrt.verification.timeline import followed, last_where, row_keys

Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]

_NEW_NODE = (Reason.COLLISION, Reason.NO_PROGRESS, Reason.NO_GAIN)
"""Why no node joins a tree."""


class Iterations(Rule):
    name = "iterations"
    promise = (
        "Events state their iteration: the number of samples so far; in A*, of expanded cells; in "
        "LRTA*, of moves."
    )
    needs = ANY_PART
    assumes = ("samples", "times")
    begun, before = 0, 0

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        self.counted = Kind.MOVE if context.contract.learns else Kind.EXPAND
        if context.contract.growth is not None:
            self.counted = Kind.SAMPLE
        self.counts = context.contract.growth is not None or context.contract.lattice is not None

    def window(self, events: Events, contract: Contract) -> None:
        if not self.counts:
            return
        log, begins = heads(events), np.sort(events[self.counted]["seq"])
        due = self.begun + np.searchsorted(begins, log["seq"], side="right")
        off = log["iteration"] - due
        # If an event is missing, all later ones are off by as much: that is one finding.
        self.judge(
            log, (off != 0) & (off != np.append(self.before, off[:-1])),
            lambda i: f"an event of iteration {log['iteration'][i]:,}; the log counts {due[i]:,}",
        )  # fmt: skip
        self.begun, self.before = self.begun + len(begins), int(off[-1])


class NoDuplicates(Rule):
    name = "no duplicates"
    promise = "No rejection, rewire or link occurs twice in an iteration."
    needs = ANY_PART
    assumes = ("times",)

    def window(self, events: Events, contract: Contract) -> None:
        for kind, fields in (
            (Kind.REJECT, ("iteration", "tree", "node", "reason")),
            (Kind.REWIRE, ("iteration", "tree", "node", "parent")),
            (Kind.CONNECT, ("iteration", "node", "other")),
        ):
            table = events[kind]
            q = np.asarray(table["q"]) if kind is Kind.REJECT else None
            keys = row_keys([table[name] for name in fields], q)
            again = np.ones(len(table), bool)
            again[np.unique(keys, return_index=True)[1]] = False
            self.judge(table, again, lambda _, k=kind: f"the same {k.label} as before")  # type: ignore[misc]


class Extensions(IterationRule):
    name = "extensions"
    promise = "Each sample is followed by the events that it causes, and by no others."

    def judge_rows(self, rows: Table, contract: Contract, growth: Growth, *, last: bool) -> None:
        rewires = contract.near is not None
        if not (rows["kind"] == Kind.SAMPLE).any():
            return
        if len(rows) < 2 or (not rewires and growth.links is not None):  # see `link attempts`
            return
        rows = rows if last else followed(rows)
        right = _may_follow_rewiring(rows) if rewires else _may_follow(rows)
        begun = np.maximum.accumulate(rows["kind"][:-1] == Kind.SAMPLE)
        self.judge(
            rows[:-1], begun & ~right,
            lambda i: f"{_label(rows[i])} is followed by {_label(rows[i + 1])}",
        )  # fmt: skip
        if not rewires:
            self._judge_slices(rows, growth.slices, last=last)

    def _judge_slices(self, rows: Table, slices: int, *, last: bool) -> None:
        """Judge whether each extension adds as many nodes as a step is cut into."""
        sample, edge = rows["kind"] == Kind.SAMPLE, rows["kind"] == Kind.EDGE
        first = np.flatnonzero(sample)
        # The last row is an appended sample, unless the log ends; a cut log may end anywhere.
        n = len(first) - int(not last or self.context.may_be_unfinished)
        if not len(first) or not n:
            return
        added = np.add.reduceat(edge.astype(np.int64), first)[:n]
        newest = np.append(first[1:], len(rows))[:n] - 1
        # The last edge of a run may be the one to the goal, with a path and the end after it.
        at = last_where(edge)[newest]
        to_goal = (rows["q"][np.maximum(at, 0)] == self.context.goal).all(axis=1)
        wrong = (added != 0) & (added != slices) & ~((added == slices + 1) & to_goal)
        self.judge(
            rows[first[:n]], wrong, lambda i: f"a sample leads to {added[i]} nodes, not {slices}"
        )


def _label(row: np.void) -> str:
    """Name the event of a timeline's row."""
    kind, why = Kind(row["kind"]), int(row["why"])
    names = {Kind.REJECT: Reason, Kind.SAMPLE: Source}.get(kind)
    return f"{kind.label} ({names.label_of(why)})" if names else kind.label


def _may_follow(rows: Table) -> Flags:
    """Return whether each row may be followed by the next, for one tree that does not rewire."""
    now, after = rows[:-1], rows[1:]
    same_tree = after["tree"] == now["tree"]
    edge, reject = after["kind"] == Kind.EDGE, after["kind"] == Kind.REJECT
    failed = reject & np.isin(after["why"], _NEW_NODE)
    to_goal = reject & (after["why"] == Reason.GOAL_BLOCKED) & (after["node"] == now["node"])
    child = edge & (after["parent"] == now["node"])
    ends = np.isin(after["kind"], [Kind.SAMPLE, Kind.PHASE])
    path = after["kind"] == Kind.PATH
    return np.asarray(
        np.select(
            [now["kind"] == Kind.SAMPLE, now["kind"] == Kind.EDGE, now["kind"] == Kind.REJECT],
            [same_tree & (edge | failed), (same_tree & (child | to_goal)) | ends | path, ends],
            default=True,
        )
    )


def _may_follow_rewiring(rows: Table) -> Flags:
    """Return the same for trees that rewire, of which the second one aims at the first's node."""
    now, after = rows[:-1], rows[1:]
    sample = last_where(rows["kind"] == Kind.SAMPLE)[:-1]
    turn = now["tree"][np.maximum(sample, 0)]
    two = bool((rows["tree"] == 1).any())
    # The row in which the current extension has added its node, and that node.
    joined = np.stack(
        [last_where((now["kind"] == Kind.EDGE) & (now["tree"] == tree)) for tree in (0, 1)]
    )
    row = joined[np.clip(now["tree"], 0, 1), np.arange(len(now))]
    added = row > sample
    node = now["node"][np.maximum(row, 0)]
    why, kind = after["why"], after["kind"]
    edge, reject = kind == Kind.EDGE, kind == Kind.REJECT
    near = reject & (why == Reason.NEAR_BLOCKED)
    begins = edge | near | (reject & np.isin(why, _NEW_NODE))
    same, other = after["tree"] == now["tree"], after["tree"] == 1 - now["tree"]
    same_q = (after["q"] == now["q"]).all(axis=1)
    rewires = same & (
        (near & (after["node"] == node)) | ((kind == Kind.REWIRE) & (after["parent"] == node))
    )
    ends = np.isin(kind, [Kind.SAMPLE, Kind.PHASE, Kind.PATH])
    links = (kind == Kind.CONNECT) | (reject & (why == Reason.LINK_BLOCKED))
    first_tree = now["tree"] == turn
    done = np.where(two & first_tree & added, begins & other, ends | (links & ~first_tree))
    near_now = (now["kind"] == Kind.REJECT) & (now["why"] == Reason.NEAR_BLOCKED)
    linked = (now["kind"] == Kind.CONNECT) | (
        (now["kind"] == Kind.REJECT) & (now["why"] == Reason.LINK_BLOCKED)
    )
    return np.asarray(
        np.select(
            [
                now["kind"] == Kind.SAMPLE, linked, near_now & ~added, now["kind"] == Kind.PATH,
                near_now | np.isin(now["kind"], [Kind.EDGE, Kind.REWIRE]),
                now["kind"] == Kind.REJECT,
            ],
            [
                same & begins, ends, same & same_q & (near | edge),
                np.isin(kind, [Kind.SAMPLE, Kind.PHASE]), rewires | done, done & ~added,
            ],
            default=True,
        )
    )  # fmt: skip


RULES = (Iterations, NoDuplicates, Extensions)
