"""Rules about trees that rewire: the best parents, lower costs, and better paths."""

from abc import abstractmethod
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brrt.events import Kind, Stage
from brrt.scenario.contract import Near
from brrt.verification.context import Context
from brrt.verification.neighbours import NeighbourSearch
from brrt.verification.rule import Rule
from brrt.verification.timeline import row_keys
from brrt.verification.tolerances import CLOSE
from brrt.verification.tree_history import TreeHistory

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]

MOST = 2000
"""Nodes of a tree that are judged, spread over it."""

_PAIRS, _MOMENTS, _LINKS = 2_000_000, 100_000, 100
"""Distances to measure in each doubling of a tree, costs to compute, links to judge, at most."""


class Joined(NamedTuple):
    """Nodes that joined a tree, and all nodes that were near them then.

    Attributes:
        tree: The tree.
        rows: The nodes that are judged, shape (n,).
        radius: Within which nodes are near, shape (n,).
        cost: Costs of the judged nodes, shape (n,).
        at: For each near node, which of the rows it was near, shape (m,), rising.
        other: Its number, shape (m,).
        far: Its distance, shape (m,).
    """

    tree: TreeHistory
    rows: Ints
    radius: Floats
    cost: Floats
    at: Ints
    other: Ints
    far: Floats

    def costs(self, seq: Ints) -> Floats:
        """Return what near nodes cost, each after the event of its row, shape (m,)."""
        return self.tree.costs(seq[self.at], self.other)


def _keys(iteration: Ints, tree: Ints, node: Ints, q: Floats) -> NDArray[np.uint64]:
    """Return numbers of motions from nodes to configurations, equal for equal ones."""
    return row_keys((iteration, tree, node), q)


class JoinedRule(Rule):
    """A rule about nodes of trees that rewire, and the nodes near them.

    Only planners with a contract of growth report each blocked motion between neighbours.
    """

    needs = "near"
    kind = Kind.EDGE
    assumes = ("motions", "costs", "times")

    def finish(self) -> None:
        """Judge the nodes of each tree by the contract under which they joined."""
        table = self.context.events[Kind.REJECT]
        blocked = _keys(table["iteration"], table["tree"], table["node"], np.asarray(table["q"]))
        for number, (_, contract) in enumerate(self.context.stretches):
            for tree in self.context.trees if contract.growth is not None else ():
                mine = tree.of_edges(tree.connected) & (self.context.stretch(tree.edges) == number)
                rows = np.flatnonzero(mine)
                if contract.near is not None and len(rows):
                    chosen = np.linspace(0, len(rows) - 1, min(MOST, len(rows))).astype(np.int64)
                    joined = _joined(self.context, contract.near, tree, rows[chosen])
                    self.judge_joined(joined, blocked)

    @abstractmethod
    def judge_joined(self, joined: Joined, blocked: NDArray[np.uint64]) -> None:
        """Judge nodes of a tree, given the keys of motions that were found blocked."""


def _joined(context: Context, near: Near, tree: TreeHistory, rows: Ints) -> Joined:
    """Find the nodes near those in rows."""
    radius = near.radius(rows + 1)
    # Nodes at the radius, within rounding, may be near or not.
    inside = radius * (1 - CLOSE) - context.tolerance
    search = NeighbourSearch(tree.q, context.distance, tree.q[rows], inside, rows, _PAIRS)
    none = np.empty(0, np.int64), np.empty(0, np.int64), np.empty(0)
    found = zip(none, *search.pairs(), strict=True)
    at, other, far = (np.concatenate(parts) for parts in found)
    order = np.argsort(at, kind="stable")
    searched = np.flatnonzero(search.searched)
    at, rows = np.searchsorted(searched, at[order]), rows[searched]
    cost = tree.of_edges(tree.new_cost)[rows]
    return Joined(tree, rows, radius[searched], cost, at, other[order], far[order])


def _worst(joined: Joined, wrong: Flags, gain: Floats) -> Ints:
    """Return for each row the near node in which it is most wrong, or -1, shape (n,)."""
    found = np.flatnonzero(wrong)
    found = found[np.argsort(gain[found], kind="stable")]
    worst = np.full(len(joined.rows), -1)
    worst[joined.at[found]] = found
    return worst


class Parents(JoinedRule):
    name = "parents"
    promise = "A new node's parent is the near node through which it costs least."

    def judge_joined(self, joined: Joined, blocked: NDArray[np.uint64]) -> None:
        context, tree, at, other = self.context, joined.tree, joined.at, joined.other
        cost = joined.cost
        edges, length = tree.edges[joined.rows], tree.of_edges(tree.length)[joined.rows]
        through = joined.costs(edges["seq"] - 1) + joined.far
        event = edges[at]
        keys = _keys(event["iteration"], event["tree"], other, np.asarray(event["q"]))
        wrong = ~context.at_most(cost[at], through) & ~np.isin(keys, blocked)
        worst = _worst(joined, wrong, cost[at] - through)
        # If none is near, the parent is the nearest node, however far.
        some_near = np.bincount(at, minlength=len(edges)) > 0
        too_far = ~context.at_most(length, joined.radius) & some_near
        self.judge(
            edges, (worst >= 0) | too_far,
            lambda i: (
                f"node {edges['node'][i]} costs {cost[i]:.9g}; through node {other[worst[i]]}, "
                f"which is near, it would cost {through[worst[i]]:.9g}" if worst[i] >= 0
                else f"node {edges['node'][i]} has a parent {length[i]:.9g} away; others are near"
            ),
        )  # fmt: skip


class Rewirings(JoinedRule):
    name = "rewirings"
    promise = "After a node joins, no near node would cost less through it."

    def judge_joined(self, joined: Joined, blocked: NDArray[np.uint64]) -> None:
        context, tree, at, other = self.context, joined.tree, joined.at, joined.other
        edges, all_edges = tree.edges[joined.rows], tree.edges
        # All rewires that follow from a node precede the next node.
        end = -1 if context.may_be_unfinished else 1 << 62
        ends = np.append(all_edges["seq"][1:] - 1, end)[joined.rows]
        through, now = joined.cost[at] + joined.far, joined.costs(np.maximum(ends, 0))
        event = edges[at]
        here = _keys(event["iteration"], event["tree"], other, np.asarray(event["q"]))
        there = _keys(event["iteration"], event["tree"], event["node"], tree.q[other])
        wrong = ~context.at_most(now, through) & (ends[at] >= 0)
        wrong &= ~np.isin(here, blocked) & ~np.isin(there, blocked)
        worst = _worst(joined, wrong, now - through)
        self.judge(
            edges, worst >= 0,
            lambda i: (
                f"node {other[worst[i]]} costs {now[worst[i]]:.9g}; through the new node "
                f"{edges['node'][i]}, which is near, it would cost {through[worst[i]]:.9g}"
            ),
        )  # fmt: skip


class PathsReported(Rule):
    name = "paths reported"
    promise = "Whenever the trees hold a path better than the best reported one, it is reported."
    needs = "near"
    kind = Kind.EDGE
    assumes = ("motions", "costs", "times")

    def finish(self) -> None:
        context, edges = self.context, self.context.events[Kind.EDGE]
        if context.contract.near is None or context.contract.growth is None:
            return
        # A path is reported at the end of an iteration, in which each of two trees may grow.
        ends = np.diff(edges["iteration"]) > 0
        moments = edges["seq"][1:][ends] - 1
        moments = moments if context.may_be_unfinished else np.append(moments, 1 << 62)
        routes = list(self._routes())
        stride = max(1, int(np.ceil(len(moments) * len(routes) / _MOMENTS)))
        moments = moments[::-1][::stride][::-1]
        if not routes or not len(moments):
            return
        least = self._least(routes, moments)
        paths = context.events[Kind.PATH]
        paths = paths[paths["stage"] != Stage.SMOOTHED]
        best = np.append(np.inf, paths["cost"])[
            np.searchsorted(paths["seq"], moments, side="right")
        ]
        heads = edges[["seq", "t"]][np.maximum(np.searchsorted(edges["seq"], moments) - 1, 0)]
        self.judge(
            heads, ~context.at_most(best, least),
            lambda i: f"the trees have a path of {least[i]:.9g}; the best reported: {best[i]:.9g}",
        )  # fmt: skip

    def _least(self, routes: "list[Route]", moments: Ints) -> Floats:
        """Return the least cost of a path in the trees at each moment, shape (n,)."""
        cost = np.array([route.between for route in routes]) + np.zeros((len(moments), 1))
        seq = np.repeat(moments, len(routes))
        for number, tree in enumerate(self.context.trees[: len(routes[0].nodes)]):
            nodes = np.array([route.nodes[number] for route in routes])
            cost += tree.costs(seq, np.tile(nodes, len(moments))).reshape(cost.shape)
        known = moments[:, None] >= np.array([route.since for route in routes])
        return np.asarray(np.fmin.reduce(np.where(known, cost, np.inf), axis=1))

    def _routes(self) -> "Iterator[Route]":
        """Yield the routes from start to goal, over the last links if there are many."""
        trees = self.context.trees
        if len(trees) == 1:
            at_goal = (trees[0].q == self.context.goal).all(axis=1)
            for node in np.flatnonzero(at_goal)[:1].tolist():
                yield Route(int(trees[0].edges["seq"][node]), (node,), 0.0)
        if len(trees) != 2:
            return
        for link in self.context.events[Kind.CONNECT][-_LINKS:]:
            ends = int(link["node"]), int(link["other"])
            if all(0 <= node < len(tree) for node, tree in zip(ends, trees, strict=True)):
                a, b = (tree.q[node][None] for node, tree in zip(ends, trees, strict=True))
                yield Route(int(link["seq"]), ends, float(self.context.distance(a, b)[0]))


class Route(NamedTuple):
    """A way from start to goal.

    Attributes:
        since: Number of the event that makes it possible.
        nodes: The node that it leads over, in each tree.
        between: Distance between the two nodes, 0 for one.
    """

    since: int
    nodes: tuple[int, ...]
    between: float


RULES = (Parents, Rewirings, PathsReported)
