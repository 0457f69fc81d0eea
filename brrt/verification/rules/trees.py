"""Rules about trees: nodes and parents, costs at every moment, rewires, links."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from brrt.events import Kind, Table
from brrt.replay.forest import reason
from brrt.replay.tree_fold import VALID
from brrt.verification.context import Context, TreeHistory
from brrt.verification.result import RuleResult
from brrt.verification.rules.log import text

Floats = NDArray[np.float64]


_EDGE = "the edge to node", "node"
"""What is said of a motion that is not free, and the field with its number."""


def nodes(context: Context, result: RuleResult) -> None:
    """Nodes join a tree as 0, 1, 2 ... below a node that is there."""
    for tree in context.trees:
        verdict = tree.of_edges(tree.fold.verdict)
        for span in tree.spans():
            edges, first = tree.edges[span], span.start
            misnumbered = edges["node"] != np.arange(span.start, span.stop)
            result.look(
                edges, misnumbered | (verdict[span] != VALID),
                lambda i, e=edges, m=misnumbered, n=first: (  # type: ignore[misc]
                    f"node {e['node'][i]} joins tree {e['tree'][i]} as its node {n + i}" if m[i]
                    else f"node {n + i} gets parent {e['parent'][i]}, which is not there"
                ),
            )  # fmt: skip


def roots(context: Context, result: RuleResult) -> None:
    """Each tree has one root, its first node, at cost 0: the start, or in tree 1 the goal."""
    for tree in context.trees:
        edges = tree.edges
        root = edges["parent"] < 0
        first = np.arange(len(edges)) == 0
        wanted = {0: context.start, 1: context.goal}.get(tree.number)
        wrong = root != first
        wrong |= root & (edges["cost"] != 0)
        if wanted is not None:
            wrong |= root & (np.asarray(edges["q"]) != wanted).any(axis=1)
        looked = root | first
        some, bad = edges[looked], wrong[looked]
        result.look(
            some, bad,
            lambda i, e=some: (  # type: ignore[misc]
                f"root {e['node'][i]} of tree {e['tree'][i]} at {text(e['q'][i])}, "
                f"parent {e['parent'][i]}, cost {e['cost'][i]:g}"
            ),
        )  # fmt: skip


def edge_lengths(context: Context, result: RuleResult) -> None:
    """Edges are no longer than the step; to the goal they may be, by line of sight."""
    stepping = any(contract.step is not None for _, contract in context.stretches)
    sees = np.array([contract.line_of_sight for _, contract in context.stretches])
    for tree in context.trees if stepping else ():
        lengths, verdict = tree.of_edges(tree.length), tree.of_edges(tree.fold.verdict)
        for span in tree.spans():
            edges, length = tree.edges[span], lengths[span]
            step = context.limits(edges, lambda contract: contract.step)
            there = np.isfinite(length) | (edges["parent"] >= 0)
            wrong = there & ~context.at_most(length, step) & (verdict[span] == VALID)
            wrong &= ~sees[context.stretch(edges)] | (np.asarray(edges["q"]) != context.goal).any(
                axis=1
            )
            result.look(
                edges[there], wrong[there],
                lambda i, e=edges[there], n=length[there], s=step[there]: (  # type: ignore[misc]
                    f"the edge to node {e['node'][i]} is {n[i]:.12g} long; the step is {s[i]:.12g}"
                ),
            )  # fmt: skip


def _sound_edges(tree: TreeHistory) -> Iterator[tuple[Table, NDArray[np.int64]]]:
    """Yield edges that join a node to a parent that is there, and their numbers, part by part."""
    verdict = tree.of_edges(tree.fold.verdict)
    for span in tree.spans():
        edges = tree.edges[span]
        rows = np.flatnonzero((verdict[span] == VALID) & (edges["parent"] >= 0))
        yield edges[rows], rows + span.start


def edge_costs(context: Context, result: RuleResult) -> None:
    """A node's cost is its parent's at that moment and the distance between them."""
    for tree in context.trees:
        above, length = tree.of_edges(tree.fold.parent_cost), tree.of_edges(tree.length)
        for edges, rows in _sound_edges(tree):
            _look_cost(context, result, edges, above[rows] + length[rows])


def edges_free(context: Context, result: RuleResult) -> None:
    """Every edge of a tree is free of obstacles."""
    for tree in context.trees:
        q = np.asarray(tree.edges["q"])
        for edges, _ in _sound_edges(tree):
            context.look_free(
                result,
                edges,
                q[edges["parent"]],
                np.asarray(edges["q"]),
                "the edge to node",
                "node",
            )


def rewires(context: Context, result: RuleResult) -> None:
    """A rewire gives a node that is there a parent that is there and not its descendant."""
    for tree in context.trees:
        verdict = tree.of_rewires(tree.fold.verdict)
        node, parent = tree.rewires["node"], tree.rewires["parent"]
        result.look(
            tree.rewires, verdict != VALID,
            lambda i, n=node, p=parent, v=verdict: reason(int(n[i]), int(p[i]), int(v[i])),  # type: ignore[misc]
        )  # fmt: skip


def rewire_costs(context: Context, result: RuleResult) -> None:
    """A rewired node's cost is its new parent's at that moment and the distance between them."""
    for tree in context.trees:
        sound = tree.of_rewires(tree.fold.verdict == VALID)
        cost = tree.of_rewires(tree.fold.parent_cost + tree.length)[sound]
        _look_cost(context, result, tree.rewires[sound], cost)


def _look_cost(context: Context, result: RuleResult, table: Table, cost: Floats) -> None:
    stated = np.asarray(table["cost"])
    result.look(
        table, ~context.same(stated, cost),
        lambda i: f"node {table['node'][i]} costs {cost[i]:.12g}, not {stated[i]:.12g}",
    )  # fmt: skip


def rewires_gain(context: Context, result: RuleResult) -> None:
    """A rewire never makes a node dearer."""
    for tree in context.trees:
        sound = tree.of_rewires(tree.fold.verdict == VALID)
        table, before = tree.rewires[sound], tree.of_rewires(tree.fold.before)[sound]
        after = tree.of_rewires(tree.fold.parent_cost + tree.length)[sound]
        result.look(
            table, ~context.at_most(after, before),
            lambda i, t=table, b=before, a=after: (  # type: ignore[misc]
                f"node {t['node'][i]} cost {b[i]:.12g} before, {a[i]:.12g} now"
            ),
        )  # fmt: skip


def rewires_near(context: Context, result: RuleResult) -> None:
    """A rewire's new parent is within the radius that the planner promises."""
    nears = [contract.near for _, contract in context.stretches]
    for tree in context.trees if any(nears) else ():
        sound = tree.of_rewires(tree.fold.verdict == VALID)
        nodes = tree.of_rewires(np.cumsum(tree.changes.joins))[sound]
        length, table = tree.of_rewires(tree.length)[sound], tree.rewires[sound]
        radius, stretch = np.full(len(nodes), np.inf), context.stretch(table)
        for number, near in enumerate(nears):
            mine = stretch == number
            if near is not None:
                radius[mine] = near.radius(nodes[mine])
        result.look(
            table, ~context.at_most(length, radius),
            lambda i, n=length, r=radius: f"a parent {n[i]:.12g} away; the radius is {r[i]:.12g}",  # type: ignore[misc]
        )  # fmt: skip


def rewires_free(context: Context, result: RuleResult) -> None:
    """The edge to a new parent is free of obstacles."""
    for tree in context.trees:
        sound, q = tree.of_rewires(tree.fold.verdict == VALID), np.asarray(tree.edges["q"])
        # Where events are out of order, the verdicts are those of others.
        for name in ("parent", "node"):
            sound = sound & (tree.rewires[name] >= 0) & (tree.rewires[name] < len(q))
        table = tree.rewires[sound]
        context.look_free(
            result, table, q[table["parent"]], q[table["node"]], "the edge to node", "node"
        )


def links(context: Context, result: RuleResult) -> None:
    """A link joins nodes that are there, is no longer than promised and free; its cost is right."""
    table = context.events[Kind.CONNECT]
    ends = [_asked(context, number, table, name) for number, name in ((0, "node"), (1, "other"))]
    (a, cost_a), (b, cost_b) = ends
    there = np.isfinite(cost_a) & np.isfinite(cost_b)
    result.look(
        table, ~there,
        lambda i: f"nodes {table['node'][i]} and {table['other'][i]} are not both there",
    )  # fmt: skip
    sound, a, b = table[there], a[there], b[there]
    length = context.distance(a, b)
    cost = (cost_a + cost_b)[there] + length
    limit = context.limits(sound, lambda contract: contract.link)
    if np.isfinite(limit).any():
        long = ~context.at_most(length, limit)
        result.look(
            sound, long, lambda i: f"link of {length[i]:.12g}; the limit is {limit[i]:.12g}"
        )
    result.look(
        sound, ~context.same(np.asarray(sound["cost"]), cost),
        lambda i: f"said to cost {sound['cost'][i]:.12g}; it costs {cost[i]:.12g}",
    )  # fmt: skip
    context.look_free(result, sound, a, b, "link")


def _asked(context: Context, number: int, table: Table, name: str) -> tuple[Floats, Floats]:
    """Where the ends of links in a tree are, and what they cost then; nan where they are not."""
    q, cost = np.full((len(table), context.dof), np.nan), np.full(len(table), np.nan)
    for tree in context.trees:
        if tree.number == number and len(table):
            node = table[name].astype(np.int64)
            cost = tree.costs(table["seq"], node)
            there = np.isfinite(cost)
            q[there] = tree.edges["q"][node[there]]
    return q, cost


RULES = (
    nodes, roots, edge_lengths, edge_costs, edges_free,
    rewires, rewire_costs, rewires_gain, rewires_near, rewires_free, links,
)  # fmt: skip
"""All rules of this file; see `brrt.verification`."""
