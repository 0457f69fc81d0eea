"""Rules about graphs and pruning: links, cuts, removals, and motions that were checked."""

import numpy as np
from numpy.typing import NDArray

from brrt.collision.motions import all_clear
from brrt.events import Kind, Table
from brrt.replay.graph import LinkHistory, pair_keys, uses_of_removed
from brrt.replay.text import counted
from brrt.replay.tree_fold import of_tree, trees_in
from brrt.verification.rule import ANY_PART, Rule
from brrt.verification.tree_history import TreeHistory

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]


class PairRule(Rule):
    """A rule about events that name two nodes of a tree."""

    def finish(self) -> None:
        """Judge the events of each tree."""
        assert self.kind is not None  # noqa: S101 - subclasses name it
        table = self.context.events[self.kind]
        trees = {tree.number: tree for tree in self.context.trees}
        for number in trees_in(table):
            mine = of_tree(table, number)
            tree = trees.get(number)
            ends = [np.zeros(len(mine), bool)] * 2
            if tree is not None:
                ends = [tree.exist(mine["seq"], mine[name]) for name in ("node", "other")]
            self.judge_pairs(tree, mine, *ends)

    def judge_pairs(
        self, tree: TreeHistory | None, table: Table, node: Flags, other: Flags
    ) -> None:
        """Judge the events of a tree.

        Args:
            tree: The tree; None if it has no nodes.
            table: The events, shape (n,).
            node: Whether their first node exists, shape (n,).
            other: Whether their second node exists, shape (n,).
        """
        raise NotImplementedError

    def free(self, tree: TreeHistory, table: Table, motion: str) -> None:
        """Judge whether motions between nodes are free of obstacles."""
        q = tree.q
        self.judge_free(table, q[table["node"]], q[table["other"]], motion, "other")


class GraphEdges(PairRule):
    name = "graph edges"
    promise = "An edge of a graph joins two nodes that exist."
    kind = Kind.LINK

    def judge_pairs(
        self, tree: TreeHistory | None, table: Table, node: Flags, other: Flags
    ) -> None:
        self.judge(
            table, ~(node & other) | (table["node"] == table["other"]),
            lambda i: f"a link of {table['node'][i]} and {table['other'][i]}, which are not "
            "two nodes that exist",
        )  # fmt: skip


class GraphEdgeCosts(PairRule):
    name = "graph edge costs"
    promise = "The cost of a graph's edge is the distance between its ends."
    kind = Kind.LINK
    assumes = ("costs",)

    def judge_pairs(
        self, tree: TreeHistory | None, table: Table, node: Flags, other: Flags
    ) -> None:
        if tree is None:
            return
        table = table[node & other]
        stated = np.asarray(table["cost"])
        length = self.context.distance(tree.q[table["node"]], tree.q[table["other"]])
        self.judge(
            table, ~self.context.equal(stated, length),
            lambda i: f"the link of {table['node'][i]} and {table['other'][i]} costs "
            f"{length[i]:.12g}, not {stated[i]:.12g}",
        )  # fmt: skip


class GraphEdgesFree(PairRule):
    """Where motions are checked, as by lazy planners, an edge counts as free once it was."""

    name = "graph edges free"
    promise = "Every edge of a graph is free of obstacles; if motions are checked, once it was."
    kind = Kind.LINK
    assumes = ("motions", "edges", "collisions")

    def judge_pairs(
        self, tree: TreeHistory | None, table: Table, node: Flags, other: Flags
    ) -> None:
        if tree is None:
            return
        table = table[node & other]
        checks = of_tree(self.context.events[Kind.CHECK], tree.number)
        checks = checks[(checks["node"] >= 0) & (checks["other"] >= 0)]
        if len(checks):
            free = checks[checks["part"] >= 1]
            keys = pair_keys(table["node"], table["other"])
            found = np.isin(keys, pair_keys(free["node"], free["other"]))
            if not found.all():
                unknown = counted(int((~found).sum()), "edge")
                self.left_out = f"{unknown} of the graph that no check found free"
            table = table[found]
        self.free(tree, table, "the edge to node")


class Cuts(PairRule):
    name = "cuts"
    promise = "What is cut is an edge of that moment: a link, or that to a parent."
    kind = Kind.CUT

    def judge_pairs(
        self, tree: TreeHistory | None, table: Table, node: Flags, other: Flags
    ) -> None:
        right = node & other
        if tree is not None:
            links = LinkHistory(self.context.events, tree.number, len(tree))
            a, b, seq = (table[name].astype(np.int64) for name in ("node", "other", "seq"))
            joined = links.at(a, b, seq)
            joined |= (tree.parents(seq, a) == b) | (tree.parents(seq, b) == a)
            right &= joined
        self.judge(
            table, ~right,
            lambda i: f"nodes {table['node'][i]} and {table['other'][i]} have no edge then",
        )  # fmt: skip


class Removals(Rule):
    name = "removals"
    promise = "A removed node exists, and no later event names it."
    kind = Kind.REMOVE

    def finish(self) -> None:
        context, table = self.context, self.context.events[Kind.REMOVE]
        trees = {tree.number: tree for tree in context.trees}
        for number in trees_in(table):
            mine, tree = of_tree(table, number), trees.get(number)
            missing = np.ones(len(mine), bool)
            if tree is not None:
                missing = ~tree.exist(mine["seq"], mine["node"])
            self.judge(mine, missing, lambda i, t=mine: f"node {t['node'][i]} does not exist")  # type: ignore[misc]
            for event, node in uses_of_removed(context.events, number):
                self.result.add_finding(event, f"node {node} of tree {number} was removed before")


class Checks(PairRule):
    name = "checks"
    promise = "A checked motion leads from a node that exists to another, or to a configuration."
    kind = Kind.CHECK

    def judge_pairs(
        self, tree: TreeHistory | None, table: Table, node: Flags, other: Flags
    ) -> None:
        wrong = (~node & (table["node"] != -1)) | (~other & (table["other"] != -1))
        if tree is not None:
            at = np.flatnonzero(other)
            wrong[at] |= (tree.q[table["other"][at]] != table["q"][at]).any(axis=1)
        self.judge(
            table, wrong,
            lambda i: f"from node {table['node'][i]} to node {table['other'][i]}: one of them "
            "does not exist, or is elsewhere",
        )  # fmt: skip


class CheckRule(PairRule):
    """A rule about checked motions of which both ends are known."""

    kind = Kind.CHECK

    def judge_pairs(
        self, tree: TreeHistory | None, table: Table, node: Flags, other: Flags
    ) -> None:
        known = node if tree is not None else np.zeros(len(table), bool)
        if not known.all():
            unknown = counted(int((~known).sum()), "checked motion")
            self.left_out = f"{unknown} that begin at no node"
        if tree is not None:
            table = table[known]
            self.judge_motions(table, tree.q[table["node"]], np.asarray(table["q"]))

    def judge_motions(self, table: Table, a: Floats, b: Floats) -> None:
        """Judge motions.

        Args:
            table: Their events, shape (n,).
            a: Where they begin, shape (n, dof).
            b: Where they end, shape (n, dof).
        """
        raise NotImplementedError


class ChecksFree(CheckRule):
    name = "checks free"
    promise = "The part of a checked motion that is called free is free of obstacles."
    assumes = ("motions", "collisions")

    def judge_motions(self, table: Table, a: Floats, b: Floats) -> None:
        part, ends = np.asarray(table["part"]), b.copy()
        for i in np.flatnonzero((part > 0) & (part < 1)):
            ends[i] = self.context.robot.interpolate(a[i], b[i], part[i])
        some = part > 0
        self.judge_free(table[some], a[some], ends[some], "a motion")


class ChecksBlocked(CheckRule):
    name = "checks blocked"
    promise = "A checked motion that is not free touches something."
    needs = ANY_PART
    assumes = ("motions", "collisions")

    def judge_motions(self, table: Table, a: Floats, b: Floats) -> None:
        context, blocked = self.context, table["part"] < 1
        table, a, b = table[blocked], a[blocked], b[blocked]
        clear = all_clear(context.obstacles, context.robot, a, b)
        clear &= ((context.lower <= b) & (b <= context.upper)).all(axis=1)
        self.judge(
            table, clear,
            lambda i: f"{table['part'][i]:.6g} of a motion is called free, but all of it is clear",
        )  # fmt: skip


RULES = (
    GraphEdges, GraphEdgeCosts, GraphEdgesFree, Cuts, Removals, Checks, ChecksFree, ChecksBlocked,
)  # fmt: skip
