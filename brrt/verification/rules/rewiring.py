"""Rules about trees that rewire: the best parent of those near, no node left dearer, paths told."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brrt.events import Kind, Stage, Table
from brrt.replay.tree_fold import VALID
from brrt.scenario.contract import Near
from brrt.verification.context import CLOSE, Context, TreeHistory
from brrt.verification.neighbours import Neighbours
from brrt.verification.result import RuleResult
from brrt.verification.timeline import numbered

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]

MOST = 2000
"""Of more nodes than this, so many are looked at, evenly spread over each tree."""

_PAIRS, _MOMENTS = 2_000_000, 100_000
"""Distances to measure in each doubling of a tree, and costs to ask for, at most."""


class _Joined(NamedTuple):
    """Nodes that joined a tree, and all that were near them then.

    Attributes:
        tree: The tree.
        rows: Nodes that are looked at, shape (n,).
        radius: How far those near may be, shape (n,).
        at: For each that was near, which of the rows it was near, shape (m,), rising.
        other: Its number, shape (m,).
        far: How far it was, shape (m,).
    """

    tree: TreeHistory
    rows: Ints
    radius: Floats
    at: Ints
    other: Ints
    far: Floats

    def costs(self, moments: Ints) -> Floats:
        """What those near cost, each after the event of its row in `moments`, shape (m,)."""
        return self.tree.costs(moments[self.at], self.other)


def _joined(context: Context) -> Iterator[_Joined]:
    """Yield each tree's nodes that are looked at, by the settings that ruled when they joined.

    Only of planners that say how they grow: they tell of each motion between neighbours that was
    found blocked.
    """
    for number, (_, contract) in enumerate(context.stretches):
        for tree in context.trees if contract.growth is not None else ():
            sound = tree.of_edges((tree.fold.verdict == VALID) & (tree.changes.parent >= 0))
            rows = np.flatnonzero(sound & (context.stretch(tree.edges) == number))
            if contract.near is not None and len(rows):
                some = np.linspace(0, len(rows) - 1, min(MOST, len(rows))).astype(np.int64)
                yield _around(context, contract.near, tree, rows[some])


def _around(context: Context, near: Near, tree: TreeHistory, rows: Ints) -> _Joined:
    q = np.asarray(tree.edges["q"])
    radius = near.radius(rows + 1)
    # What is at the radius but for a rounding may be near or not.
    inside = radius * (1 - CLOSE) - context.blur
    search = Neighbours(q, context.distance, q[rows], inside, rows, _PAIRS)
    at, other, far = (np.concatenate(part) for part in zip(*_pairs(search), strict=True))
    order = np.argsort(at, kind="stable")
    looked = np.flatnonzero(search.looked)
    at = np.searchsorted(looked, at[order])
    return _Joined(tree, rows[looked], radius[looked], at, other[order], far[order])


def _pairs(search: Neighbours) -> list[tuple[Ints, Ints, Floats]]:
    none = np.empty(0, np.int64), np.empty(0, np.int64), np.empty(0)
    return [none, *search.pairs()]


def _keys(iteration: Ints, tree: Ints, node: Ints, q: Floats) -> NDArray[np.uint64]:
    """Number motions from a node to a place in an iteration; equal ones have equal numbers."""
    return numbered((iteration, tree, node), q)


def _blocked(context: Context) -> NDArray[np.uint64]:
    """Motions between neighbours that were found blocked."""
    table = context.events[Kind.REJECT]
    return _keys(*(np.asarray(table[name]) for name in ("iteration", "tree", "node", "q")))


def _worst(joined: _Joined, wrong: Flags, gain: Floats) -> tuple[Flags, Ints]:
    """Which rows are wrong, and for each the pair by which it is most."""
    found = np.flatnonzero(wrong)
    found = found[np.argsort(gain[found], kind="stable")]
    worst = np.full(len(joined.rows), -1)
    worst[joined.at[found]] = found
    return worst >= 0, worst


def parents(context: Context, result: RuleResult) -> None:
    """A node's parent is the one over which it costs least, of those near it that reach it.

    Of more than 2,000 nodes of a tree so many are looked at. Where none is near, the parent is the
    nearest node, however far.
    """
    blocked = _blocked(context)
    for joined in _joined(context):
        tree, at, other = joined.tree, joined.at, joined.other
        edges = tree.edges[joined.rows]
        length = tree.of_edges(tree.length)[joined.rows]
        cost = tree.of_edges(tree.fold.parent_cost)[joined.rows] + length
        through = joined.costs(edges["seq"] - 1) + joined.far
        gain = cost[at] - through
        event = edges[at]
        keys = _keys(event["iteration"], event["tree"], other, np.asarray(event["q"]))
        wrong = ~context.at_most(cost[at], through) & ~np.isin(keys, blocked)
        dearer, worst = _worst(joined, wrong, gain)
        afar = ~context.at_most(length, joined.radius) & (np.bincount(at, minlength=len(edges)) > 0)
        result.look(
            edges, dearer | afar,
            lambda i, e=edges, w=worst, o=other, t=through, c=cost, n=length: (  # type: ignore[misc]
                f"node {e['node'][i]} costs {c[i]:.9g}; over node {o[w[i]]}, which is near, it "
                f"would cost {t[w[i]]:.9g}" if w[i] >= 0
                else f"node {e['node'][i]} has a parent {n[i]:.9g} away, and others are near"
            ),
        )  # fmt: skip


def rewirings(context: Context, result: RuleResult) -> None:
    """Once a node has joined, no node near it costs more than over it, where it reaches that.

    Of more than 2,000 nodes of a tree so many are looked at.
    """
    blocked = _blocked(context)
    for joined in _joined(context):
        tree, at, other = joined.tree, joined.at, joined.other
        edges, all_edges = tree.edges[joined.rows], tree.edges
        # All that a node's joining leads to is told before the next one joins.
        ends = np.append(all_edges["seq"][1:] - 1, -1 if context.cut else 1 << 62)[joined.rows]
        length = tree.of_edges(tree.length)[joined.rows]
        cost = tree.of_edges(tree.fold.parent_cost)[joined.rows] + length
        through, now = cost[at] + joined.far, joined.costs(np.maximum(ends, 0))
        event, far_end = edges[at], np.asarray(all_edges["q"][other])
        here = _keys(event["iteration"], event["tree"], other, np.asarray(event["q"]))
        there = _keys(event["iteration"], event["tree"], event["node"], far_end)
        wrong = ~context.at_most(now, through) & (ends[at] >= 0)
        wrong &= ~np.isin(here, blocked) & ~np.isin(there, blocked)
        dearer, worst = _worst(joined, wrong, now - through)
        result.look(
            edges, dearer,
            lambda i, e=edges, w=worst, o=other, t=through, n=now: (  # type: ignore[misc]
                f"node {o[w[i]]} costs {n[w[i]]:.9g}; over node {e['node'][i]}, which has joined "
                f"near it, it would cost {t[w[i]]:.9g}"
            ),
        )  # fmt: skip


def paths_told(context: Context, result: RuleResult) -> None:
    """Whenever the trees hold a better path than the best that was told, it is told."""
    if context.contract.near is None or context.contract.growth is None:
        return
    edges = context.events[Kind.EDGE]
    # A path is told at the end of an iteration, in which two trees may each have grown.
    ends = np.diff(edges["iteration"]) > 0
    moments = edges["seq"][1:][ends] - 1
    moments = moments if context.cut else np.append(moments, 1 << 62)
    ways = _ways(context)
    fewer = max(1, int(np.ceil(len(moments) * len(ways) / _MOMENTS)))
    moments = moments[::-1][::fewer][::-1]
    if not len(ways) or not len(moments):
        return
    cost = np.array([far for *_, far in ways]) + np.zeros((len(moments), len(ways)))
    for number, tree in enumerate(context.trees[: len(ways[0][1])]):
        nodes = np.array([pair[number] for _, pair, _ in ways])
        all_nodes = np.tile(nodes, len(moments))
        cost += tree.costs(np.repeat(moments, len(ways)), all_nodes).reshape(cost.shape)
    known = moments[:, None] >= np.array([since for since, *_ in ways])
    least = np.fmin.reduce(np.where(known, cost, np.inf), axis=1)
    paths = context.events[Kind.PATH]
    paths = paths[paths["stage"] != Stage.SMOOTHED]
    told = np.append(np.inf, paths["cost"])[np.searchsorted(paths["seq"], moments, side="right")]
    heads = edges[["seq", "t"]][np.maximum(np.searchsorted(edges["seq"], moments) - 1, 0)]
    result.look(
        heads, ~context.at_most(told, least),
        lambda i: f"a path of {least[i]:.9g} is in the trees; the best told costs {told[i]:.9g}",
    )  # fmt: skip


def _ways(context: Context) -> list[tuple[int, tuple[int, ...], float]]:
    """Ways from start to goal: since which event, over which node of each tree, and what between.

    Of more than a hundred links the last are looked at.
    """
    if len(context.trees) == 1:
        nodes = context.trees[0].edges
        at = np.flatnonzero((np.asarray(nodes["q"]) == context.goal).all(axis=1))[:1]
        return [(int(nodes["seq"][k]), (int(k),), 0.0) for k in at.tolist()]
    ways: list[tuple[int, tuple[int, ...], float]] = []
    table: Table = context.events[Kind.CONNECT]
    for link in table[-100:]:
        ends = int(link["node"]), int(link["other"])
        there = [0 <= n < len(tree.edges) for n, tree in zip(ends, context.trees, strict=False)]
        if len(context.trees) == 2 and all(there):
            a, b = (tree.edges["q"][n] for n, tree in zip(ends, context.trees, strict=True))
            ways.append((int(link["seq"]), ends, float(context.distance(a[None], b[None])[0])))
    return ways


RULES = (parents, rewirings, paths_told)
"""All rules of this file; see `brrt.verification`."""
