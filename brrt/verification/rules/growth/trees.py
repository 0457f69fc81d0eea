"""Rules about trees: nodes and parents, costs at every moment, rewires, links."""

from abc import abstractmethod
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brrt.events import Kind, Table
from brrt.replay.forest import reason
from brrt.replay.graph import is_vertex
from brrt.replay.text import vector
from brrt.replay.tree_fold import VALID
from brrt.verification.rule import Rule, TreeRule
from brrt.verification.tree_history import TreeHistory

Floats = NDArray[np.float64]

_EDGE = "the edge to node", "node"
"""What messages call an edge, and the field that they append."""


class Nodes(TreeRule):
    name = "nodes"
    promise = "Nodes join a tree as 0, 1, 2 ... below a node that exists."

    def judge_tree(self, tree: TreeHistory) -> None:
        edges, n = tree.edges, np.arange(len(tree))
        misnumbered = edges["node"] != n
        self.judge(
            edges, misnumbered | (tree.of_edges(tree.fold.verdict) != VALID),
            lambda i: (
                f"node {edges['node'][i]} joins tree {tree.number} as its node {i}"
                if misnumbered[i]
                else f"node {i} gets parent {edges['parent'][i]}, which does not exist"
            ),
        )  # fmt: skip


class Roots(TreeRule):
    name = "roots"
    promise = (
        "A tree has one root, its first node, at cost 0 if costs are lengths: the start, or in "
        "tree 1 the goal."
    )

    def judge_tree(self, tree: TreeHistory) -> None:
        vertex = is_vertex(tree.edges)
        is_root = (tree.edges["parent"] < 0) & ~vertex
        first = (np.cumsum(~vertex) == 1) & ~vertex
        edges, rightly = tree.edges[is_root | first], (is_root & first)[is_root | first]
        context = self.context
        wrong = ~rightly | ((edges["cost"] != 0) & (context.claims.costs == "length"))
        wanted = {0: context.start, 1: context.goal}.get(tree.number)
        if wanted is not None:
            off = (edges["q"] != wanted).any(axis=1)
            if tree.number == 1 and context.claims.goal_tolerance:
                far = context.distance(edges["q"], wanted[None])
                off &= ~context.at_most(far, context.claims.goal_tolerance)
            wrong |= off
        self.judge(
            edges, wrong,
            lambda i: (
                f"root {edges['node'][i]} of tree {tree.number} at {vector(edges['q'][i])}, "
                f"parent {edges['parent'][i]}, cost {edges['cost'][i]:g}"
            ),
        )  # fmt: skip


class EdgeLengths(TreeRule):
    name = "edge lengths"
    promise = "Edges are no longer than the step, except to the goal in line of sight."
    needs = "step"

    def judge_tree(self, tree: TreeHistory) -> None:
        for chunk in tree.chunks():
            self._judge(tree, chunk)

    def _judge(self, tree: TreeHistory, chunk: slice) -> None:
        context, edges = self.context, tree.edges[chunk]
        length = tree.of_edges(tree.length)[chunk]
        step = context.limits(edges, lambda contract: contract.step)
        sees = np.array([contract.line_of_sight for _, contract in context.stretches])
        to_goal = sees[context.stretch(edges)] & (edges["q"] == context.goal).all(axis=1)
        wrong = ~context.at_most(length, step) & ~to_goal
        wrong &= tree.of_edges(tree.fold.verdict)[chunk] == VALID
        exists = np.isfinite(length) | (edges["parent"] >= 0)
        edges, wrong, length, step = edges[exists], wrong[exists], length[exists], step[exists]
        self.judge(
            edges, wrong,
            lambda i: (
                f"the edge to node {edges['node'][i]} is {length[i]:.12g} long; "
                f"the step is {step[i]:.12g}"
            ),
        )  # fmt: skip


class CostRule(TreeRule):
    """A rule that judges the costs that events state.

    Where the planner's motions are its own, these are at least as long as the distance.
    """

    def judge_costs(self, table: Table, cost: Floats) -> None:
        """Judge the stated costs of events by the right ones, shape (n,)."""
        stated = np.asarray(table["cost"])
        self.judge(
            table, ~self.context.right_cost(stated, cost),
            lambda i: f"node {table['node'][i]} costs {cost[i]:.12g}, not {stated[i]:.12g}",
        )  # fmt: skip


class EdgeCosts(CostRule):
    name = "edge costs"
    promise = (
        "A node's cost is its parent's at that moment plus the distance between them; no less if "
        "motions are own."
    )
    assumes = ("costs",)

    def judge_tree(self, tree: TreeHistory) -> None:
        if len(tree.rewires) and "times" in self.context.unknown:
            return  # what the parent cost at that moment is not known
        cost = tree.of_edges(tree.new_cost)
        connected = tree.of_edges(tree.connected) & (cost < np.inf)  # below a root
        for chunk in tree.chunks():
            self.judge_costs(tree.edges[chunk][connected[chunk]], cost[chunk][connected[chunk]])


class EdgesFree(TreeRule):
    name = "edges free"
    promise = "Every edge of a tree is free of obstacles."
    assumes = ("motions", "edges", "collisions")

    def judge_tree(self, tree: TreeHistory) -> None:
        connected = tree.of_edges(tree.connected)
        for chunk in tree.chunks():
            edges = tree.edges[chunk][connected[chunk]]
            self.judge_free(edges, tree.q[edges["parent"]], edges["q"], *_EDGE)


class Rewires(TreeRule):
    name = "rewires"
    promise = "A rewire gives an existing node an existing parent, not one of its descendants."
    kind = None

    def judge_tree(self, tree: TreeHistory) -> None:
        verdict, table = tree.of_rewires(tree.fold.verdict), tree.rewires
        self.judge(
            table, verdict != VALID,
            lambda i: reason(int(table["node"][i]), int(table["parent"][i]), int(verdict[i])),
        )  # fmt: skip


class RewireCosts(CostRule):
    name = "rewire costs"
    promise = "A rewired node's cost is its new parent's at that moment plus the distance."
    kind = None
    assumes = ("costs", "times")

    def judge_tree(self, tree: TreeHistory) -> None:
        cost = tree.of_rewires(tree.new_cost)
        valid = tree.of_rewires(tree.connected) & (cost < np.inf)
        self.judge_costs(tree.rewires[valid], cost[valid])


class RewiresGain(TreeRule):
    name = "rewires gain"
    promise = "A rewire never raises the cost of its node."
    kind = None
    assumes = ("times",)

    def judge_tree(self, tree: TreeHistory) -> None:
        valid = tree.of_rewires(tree.connected)
        table, before = tree.rewires[valid], tree.of_rewires(tree.fold.before)[valid]
        after = tree.of_rewires(tree.new_cost)[valid]
        if not {"motions", "costs"}.isdisjoint(self.context.unknown):
            before, after = tree.of_rewires(tree.stated_before)[valid], np.asarray(table["cost"])
        self.judge(
            table, ~self.context.at_most(after, before),
            lambda i: f"the cost of node {table['node'][i]} rises to {after[i]:.12g}"
            f" from {before[i]:.12g}",
        )  # fmt: skip


class RewiresNear(TreeRule):
    name = "rewires near"
    promise = "A rewire's new parent is within the radius of the contract."
    needs = "near"
    kind = None
    assumes = ("times",)

    def judge_tree(self, tree: TreeHistory) -> None:
        valid = tree.of_rewires(tree.connected)
        nodes = tree.of_rewires(np.cumsum(tree.changes.joins))[valid]
        length, table = tree.of_rewires(tree.length)[valid], tree.rewires[valid]
        radius, stretch = np.full(len(nodes), np.inf), self.context.stretch(table)
        for number, (_, contract) in enumerate(self.context.stretches):
            if contract.near is not None:
                radius[stretch == number] = contract.near.radius(nodes[stretch == number])
        self.judge(
            table, ~self.context.at_most(length, radius),
            lambda i: f"a parent {length[i]:.12g} away; the radius is {radius[i]:.12g}",
        )  # fmt: skip


class RewiresFree(TreeRule):
    name = "rewires free"
    promise = "The edge to a new parent is free of obstacles."
    kind = None
    assumes = ("motions", "edges", "collisions")

    def judge_tree(self, tree: TreeHistory) -> None:
        table = tree.rewires[tree.of_rewires(tree.connected)]
        self.judge_free(table, tree.q[table["parent"]], tree.q[table["node"]], *_EDGE)


class LinkEnds(NamedTuple):
    """The links between existing nodes.

    Attributes:
        table: Their events, shape (n,).
        a: Where they begin, in tree 0, shape (n, dof).
        b: Where they end, in tree 1, shape (n, dof).
        through: What the two nodes cost together, shape (n,).
        length: Distances between them, shape (n,).
    """

    table: Table
    a: Floats
    b: Floats
    through: Floats
    length: Floats


class LinkRule(Rule):
    """A rule about links between two trees."""

    def finish(self) -> None:
        """Judge the links between existing nodes."""
        links = self.context.events[Kind.CONNECT]
        (a, cost_a), (b, cost_b) = self._ends(0, links, "node"), self._ends(1, links, "other")
        exist = np.asarray(np.isfinite(a).all(axis=1) & np.isfinite(b).all(axis=1))
        self.judge_lost(links, ~exist)
        a, b = a[exist], b[exist]
        through, length = (cost_a + cost_b)[exist], self.context.distance(a, b)
        self.judge_links(LinkEnds(links[exist], a, b, through, length))

    def judge_lost(self, links: Table, lost: NDArray[np.bool_]) -> None:
        """Judge links of which some are between nodes that do not exist."""

    @abstractmethod
    def judge_links(self, links: LinkEnds) -> None:
        """Judge links."""

    def _ends(self, number: int, links: Table, name: str) -> tuple[Floats, Floats]:
        """Return the ends of links in a tree, and their costs; nan where they do not exist."""
        q, cost = np.full((len(links), self.context.dof), np.nan), np.full(len(links), np.nan)
        for tree in self.context.trees:
            if tree.number == number and len(links):
                node = links[name].astype(np.int64)
                exist = tree.exist(links["seq"], node)
                cost[exist] = tree.costs(links["seq"][exist], node[exist])
                q[exist] = tree.q[node[exist]]
        return q, cost


class Links(LinkRule):
    name = "links"
    promise = "A link joins existing nodes, and is no longer than stated."

    def judge_lost(self, links: Table, lost: NDArray[np.bool_]) -> None:
        self.judge(
            links, lost,
            lambda i: f"nodes {links['node'][i]} and {links['other'][i]} do not both exist",
        )  # fmt: skip

    def judge_links(self, links: LinkEnds) -> None:
        table, length = links.table, links.length
        limit = self.context.limits(table, lambda contract: contract.link)
        if np.isfinite(limit).any():
            self.judge(
                table, ~self.context.at_most(length, limit),
                lambda i: f"a link of {length[i]:.12g}; the limit is {limit[i]:.12g}",
            )  # fmt: skip


class LinkCosts(LinkRule):
    name = "link costs"
    promise = "A link's cost is that of its nodes at that moment plus the distance between them."
    assumes = ("costs", "times")

    def judge_links(self, links: LinkEnds) -> None:
        stated, cost = np.asarray(links.table["cost"]), links.through + links.length
        self.judge(
            links.table, ~self.context.right_cost(stated, cost) & (cost < np.inf),
            lambda i: f"costs {cost[i]:.12g}, not {stated[i]:.12g}",
        )  # fmt: skip


class LinksFree(LinkRule):
    name = "links free"
    promise = "Every link between two trees is free of obstacles."
    assumes = ("motions", "edges", "collisions")

    def judge_links(self, links: LinkEnds) -> None:
        self.judge_free(links.table, links.a, links.b, "link")


RULES = (
    Nodes, Roots, EdgeLengths, EdgeCosts, EdgesFree, Rewires, RewireCosts, RewiresGain,
    RewiresNear, RewiresFree, Links, LinkCosts, LinksFree,
)  # fmt: skip
