"""Costs as they stood at each moment of a tree that rewires: a fold, one event after another."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brrt.events import Events, Kind, Table
from brrt.kernels.jit import helper, kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

Distance = Callable[[Floats, Floats], Floats]
"""A robot's metric: distances between rows of configurations, shapes (m, dof) to (m,)."""

_AT_ONCE = 1 << 18
"""Edges that are measured at once."""

SOUND, NO_PARENT, NO_NODE, CIRCLE = range(4)
"""Whether a change could be made: all is well, the new parent does not exist (yet), the rewired
node does not exist (yet), the new parent descends from the node."""


class Changes(NamedTuple):
    """What happens to one tree, in order; node n is the one that the n-th edge made.

    Attributes:
        seq: Number of the event, shape (m,).
        node: Which node joins or is rewired, shape (m,).
        parent: Its parent from now on; below 0 for a root; shape (m,).
        stated: Its cost-to-come, as the event states it, shape (m,).
        joins: Whether the node joins the tree (an edge) or was there (a rewire), shape (m,).
    """

    seq: Ints
    node: Ints
    parent: Ints
    stated: Floats
    joins: NDArray[np.bool_]


class Ledger(NamedTuple):
    """The tree after all changes, and how each change found it.

    Attributes:
        parent: Parents, shape (n,).
        cost: Costs-to-come, shape (n,).
        parent_cost: Cost of the parent when the change was made, nan without one, shape (m,).
        before: Cost of the node right before the change, nan where it joins, shape (m,).
        verdict: Whether the change could be made; one that could not is left out; shape (m,).
        answers: What the nodes that were asked for cost then, nan where they were not there.
    """

    parent: Ints
    cost: Floats
    parent_cost: Floats
    before: Floats
    verdict: NDArray[np.uint8]
    answers: Floats


def changes(events: Events, tree: int) -> Changes:
    """Merge the edges and rewires of a tree in the order of the log."""
    edges, rewires = (
        table[table["tree"] == tree] for table in (events[Kind.EDGE], events[Kind.REWIRE])
    )
    return merged(edges, rewires, 0)


def joined(edges: Table) -> Changes:
    """List what happens to a tree that only grows: its edges, and no copies of them."""
    nodes = np.arange(len(edges))
    return Changes(edges["seq"], nodes, edges["parent"], edges["cost"], np.ones(len(nodes), bool))


def merged(edges: Table, rewires: Table, first: int) -> Changes:
    """Merge edges and rewires of one tree; its nodes are numbered on from `first`."""
    seq = np.concatenate([edges["seq"], rewires["seq"]])
    order = np.argsort(seq, kind="stable")
    joins = order < len(edges)
    node = np.concatenate([np.arange(first, first + len(edges)), rewires["node"]])
    parent = np.concatenate([edges["parent"], rewires["parent"]]).astype(np.int64)
    stated = np.concatenate([edges["cost"], rewires["cost"]])
    return Changes(seq[order], node[order].astype(np.int64), parent[order], stated[order], joins)


def edge_lengths(q: Floats, made: Changes, distance: Distance) -> Floats:
    """Measure the edge that each change makes, shape (m,); nan for roots and for what is no node.

    Args:
        q: Configurations of the nodes, shape (n, dof).
        made: The changes.
        distance: The robot's metric.
    """
    n, length = len(q), np.full(len(made.seq), np.nan)
    for first in range(0, len(length), _AT_ONCE):
        some = slice(first, first + _AT_ONCE)
        node, parent = made.node[some], made.parent[some]
        there = np.flatnonzero((parent >= 0) & (parent < n) & (node >= 0) & (node < n))
        length[first + there] = distance(q[parent[there]], q[node[there]])
    return length


class Questions(NamedTuple):
    """What nodes cost at certain moments, to be answered on the way.

    Attributes:
        seq: After the events up to this one, rising, shape (k,).
        node: Of which node, shape (k,).
    """

    seq: Ints
    node: Ints


NONE = Questions(np.empty(0, np.int64), np.empty(0, np.int64))


def fold(made: Changes, length: Floats | None = None, asked: Questions = NONE) -> Ledger:
    """Make the changes one after another; the costs of all descendants follow each.

    Args:
        made: The changes.
        length: Length of the edge that each change makes, shape (m,). By default it is what the
            event states less the parent's cost at that moment, which is right to a rounding of
            the cost; so costs are right to about depth roundings.
        asked: Questions.
    """
    nodes = int(made.joins.sum())
    if length is None:
        length = np.full(len(made.seq), np.nan)
    parent, links = np.full(nodes, -1, np.int64), np.full((nodes, 3), -1, np.int64)
    cost, lengths = np.zeros(nodes), np.zeros(nodes)
    parent_cost, before = np.full(len(made.seq), np.nan), np.full(len(made.seq), np.nan)
    verdict = np.zeros(len(made.seq), np.uint8)
    answers = np.full(len(asked.seq), np.nan)
    moments = np.searchsorted(made.seq, asked.seq, side="right")
    _fold(
        moments, np.asarray(asked.node, np.int64), answers,
        made.node, made.parent, made.stated, made.joins, np.ascontiguousarray(length, np.float64),
        parent, links, cost, lengths, parent_cost, before, verdict, _nothing_yet(),
    )  # fmt: skip
    return Ledger(parent, cost, parent_cost, before, verdict, answers)


def _nothing_yet() -> Ints:
    """Return the place of a fold that has not begun."""
    return np.array([0, 1])


def sum_up(made: Changes, length: Floats, asked: Questions = NONE) -> Ledger:
    """Fold a tree that only grows, see `fold`: no cost changes, so there is less to keep."""
    nodes = np.arange(len(made.seq))
    there = (made.parent >= 0) & (made.parent < nodes)
    parent = np.where(there, made.parent, -1).astype(np.int64)
    cost = np.array(made.stated, np.float64)
    _sum_up(parent, length, cost)
    verdict = np.where(there | (made.parent < 0), SOUND, NO_PARENT).astype(np.uint8)
    born = np.searchsorted(made.seq, asked.seq, side="right")
    known = (asked.node >= 0) & (asked.node < born)
    answers = np.full(len(asked.seq), np.nan)
    answers[known] = cost[asked.node[known]]
    parent_cost = np.where(there, cost[parent], np.nan)
    return Ledger(parent, cost, parent_cost, np.broadcast_to(np.nan, len(nodes)), verdict, answers)


@kernel
def _sum_up(parent: Ints, length: Floats, cost: Floats) -> None:
    """Make each cost the parent's and the length; of what has no parent it stays."""
    for i in range(len(parent)):
        if parent[i] >= 0:
            cost[i] = cost[parent[i]] + length[i]


class Standing:
    """A tree that rewires as it stands, brought forward batch by batch, at 48 bytes a node.

    Attributes:
        nodes: Nodes so far.
    """

    def __init__(self) -> None:
        self.nodes = 0
        self._place = _nothing_yet()
        self._parent, self._links = np.empty(0, np.int64), np.empty((0, 3), np.int64)
        self._cost, self._lengths = np.empty(0), np.empty(0)

    @property
    def parent(self) -> Ints:
        """Parents, shape (n,)."""
        return self._parent[: self.nodes]

    @property
    def cost(self) -> Floats:
        """Costs-to-come, shape (n,)."""
        return self._cost[: self.nodes]

    def change(self, made: Changes) -> NDArray[np.uint8]:
        """Make changes, those that follow the ones so far; return whether each could be made.

        Args:
            made: The changes; nodes are numbered through.
        """
        self._make_room(int(made.joins.sum()))
        m = len(made.seq)
        verdict, nothing = np.zeros(m, np.uint8), np.empty(0)
        _fold(
            NONE.seq, NONE.node, nothing,
            made.node, made.parent, made.stated, made.joins, np.full(m, np.nan),
            self._parent, self._links, self._cost, self._lengths, np.empty(m), np.empty(m),
            verdict, self._place,
        )  # fmt: skip
        return verdict

    def _make_room(self, more: int) -> None:
        self.nodes += more
        room = len(self._parent)
        if self.nodes <= room:
            return
        room = max(self.nodes, room + room // 2)
        for name, blank in (("_parent", -1), ("_links", -1), ("_cost", 0), ("_lengths", 0)):
            old = getattr(self, name)
            new = np.full((room, *old.shape[1:]), blank, old.dtype)
            new[: len(old)] = old
            setattr(self, name, new)


_CHILD, _NEXT, _LAST = range(3)
"""Columns of the links: a node's first child, its next sibling, its sibling before."""


@helper
def _below(root: int, at: int, parent: Ints, links: Ints) -> int:
    """Return the descendant of `root` that comes after `at` on a walk from above, or -1."""
    if links[at, _CHILD] >= 0:
        return int(links[at, _CHILD])
    while at != root and links[at, _NEXT] < 0:
        at = parent[at]
    return -1 if at == root else int(links[at, _NEXT])


@helper
def _descends(root: int, node: int, parent: Ints) -> bool:
    """Whether `node` is `root` or below it."""
    while node not in (-1, root):
        node = parent[node]
    return node == root


@helper
def _leave(v: int, parent: Ints, links: Ints) -> None:
    """Take a node from among its parent's children."""
    after, ahead = links[v, _NEXT], links[v, _LAST]
    if ahead >= 0:
        links[ahead, _NEXT] = after
    elif parent[v] >= 0:
        links[parent[v], _CHILD] = after
    if after >= 0:
        links[after, _LAST] = ahead


@helper
def _join(v: int, p: int, parent: Ints, links: Ints) -> None:
    """Put a node first among a parent's children."""
    first = links[p, _CHILD]
    parent[v] = p
    links[p, _CHILD], links[v, _NEXT], links[v, _LAST] = v, first, -1
    if first >= 0:
        links[first, _LAST] = v


@helper
def _answer(
    question: int, i: int, moments: Ints, asked: Ints, answers: Floats, cost: Floats, born: int
) -> int:
    """Answer what is asked after i changes, from `question` on; return the next question."""
    while question < len(asked) and moments[question] <= i:
        if 0 <= asked[question] < born:
            answers[question] = cost[asked[question]]
        question += 1
    return question


@kernel
def _fold(
    moments: Ints,
    asked: Ints,
    answers: Floats,
    node: Ints,
    new_parent: Ints,
    stated: Floats,
    joins: NDArray[np.bool_],
    length: Floats,
    parent: Ints,
    links: Ints,
    cost: Floats,
    lengths: Floats,
    parent_cost: Floats,
    before: Floats,
    verdict: NDArray[np.uint8],
    place: Ints,
) -> None:
    """See `fold`; a question waits for its number of changes; from `parent` on it writes.

    The place, where to go on, is how many nodes there are, and whether no edge is below 0.
    """
    born, question, rising = place[0], 0, place[1] == 1
    for i in range(len(node)):
        question = _answer(question, i, moments, asked, answers, cost, born)
        v, p = node[i], new_parent[i]
        if joins[i]:
            born += 1
            cost[v] = stated[i]
        elif not 0 <= v < born:
            verdict[i] = NO_NODE
            continue
        else:
            before[i] = cost[v]
        if not 0 <= p < born or (joins[i] and p == v):
            verdict[i] = SOUND if p < 0 and joins[i] else NO_PARENT
            continue
        parent_cost[i] = cost[p]
        if not joins[i]:
            # Where no edge is shorter than 0, whatever is below a node costs no less than it.
            above = rising and cost[p] < cost[v]
            if not above and _descends(v, p, parent):
                verdict[i] = CIRCLE
                continue
            _leave(v, parent, links)
        _join(v, p, parent, links)
        lengths[v] = stated[i] - cost[p] if np.isnan(length[i]) else length[i]
        rising = rising and lengths[v] >= 0.0
        cost[v] = cost[p] + lengths[v]
        at = _below(v, v, parent, links)
        while at >= 0:
            cost[at] = cost[parent[at]] + lengths[at]
            at = _below(v, at, parent, links)
    place[0], place[1] = born, rising
    _answer(question, len(node), moments, asked, answers, cost, born)
