"""Graphs and pruning: what vertices, links, cuts and removals make of trees.

Most of what reads trees knows edges and rewires. `GraphFold` turns the other kinds into these: a
vertex joins without a parent, and a node whose edge to its parent is removed is rewired to
`DETACHED`. Links are beside that; `links_after` returns those that are there at an instant.
"""

from collections import defaultdict
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrt.events import Events, Kind, Table, table_dtype
from brrt.replay.tree_fold import DETACHED, TreeChanges, of_tree, trees_in

Ints = NDArray[np.signedinteger[Any]]
Flags = NDArray[np.bool_]

_CHANGED = (Kind.VERTEX, Kind.CUT, Kind.REMOVE)
"""Kinds that change what is folded as edges and rewires."""

STRUCTURE = (Kind.EDGE, Kind.REWIRE, Kind.VERTEX, Kind.LINK, Kind.CUT, Kind.REMOVE)
"""Kinds that trees and graphs are folded from."""

NEVER = np.iinfo(np.int64).max

LINK_DTYPE = np.dtype([("seq", "<i8"), ("node", "<i4"), ("other", "<i4"), ("cost", "<f8")])
"""A link that is there: number of its last event, its ends, and its cost."""

_USES: Mapping[Kind, tuple[tuple[str, int | None], ...]] = {
    Kind.EDGE: (("parent", None),),
    Kind.REWIRE: (("node", None), ("parent", None)),
    Kind.LINK: (("node", None), ("other", None)),
    Kind.CUT: (("node", None), ("other", None)),
    Kind.REMOVE: (("node", None),),
    Kind.CHECK: (("node", None), ("other", None)),
    Kind.REJECT: (("node", None),),
    Kind.CONNECT: (("node", 0), ("other", 1)),
}
"""Fields that name nodes, and the tree of each; None for that of the event."""


def is_graph(events: Events) -> bool:
    """Whether there are events besides edges and rewires that change trees."""
    return any(kind in events.counts for kind in _CHANGED)


def structure_of(events: Events) -> Events:
    """Return the events of a batch that trees and graphs are folded from."""
    kinds = [kind for kind in STRUCTURE if kind in events.counts]
    return Events(events.dof, {kind: events[kind] for kind in kinds})


def as_forest(events: Events) -> Events:
    """Return a log whose vertices, cuts and removals are edges and rewires; see `GraphFold`."""
    return GraphFold().take(events) if is_graph(events) else events


class GraphFold:
    """Turns vertices, cuts and removals into edges and rewires, batch by batch.

    A vertex is an edge without a parent, at infinite cost. A node whose edge to its parent is cut,
    or whose parent is removed, is rewired to `DETACHED`, at infinite cost. A batch without such
    events is returned as it is.
    """

    def __init__(self) -> None:
        self._trees: defaultdict[int, _Parents] = defaultdict(_Parents)

    def take(self, events: Events) -> Events:
        """Return a batch with the edges and rewires; other kinds stay in it."""
        edges, rewires = events[Kind.EDGE], events[Kind.REWIRE]
        cuts, removals = events[Kind.CUT], events[Kind.REMOVE]
        graph = is_graph(events)
        if graph:
            edges = joined_nodes(events)
        detached = []
        for number in trees_in(edges, rewires, cuts, removals):
            joined, changed = of_tree(edges, number), of_tree(rewires, number)
            if len(cuts) or len(removals):
                own = (of_tree(table, number) for table in (cuts, removals))
                rows = self._trees[number].detach(joined, changed, *own)
                detached += [_detaching(row, node) for row, node in rows]
            else:
                self._trees[number].wait(joined, changed)
        if not graph:
            return events
        lost = np.array(detached, table_dtype(Kind.REWIRE, events.dof))
        tables = {kind: events[kind] for kind in events.counts}
        tables |= {Kind.EDGE: edges, Kind.REWIRE: _in_order(rewires, lost)}
        return Events(events.dof, {kind: table for kind, table in tables.items() if len(table)})


class _Parents:
    """The parents of a tree's nodes; changes wait until an edge is removed."""

    def __init__(self) -> None:
        self._count = 0
        self._waiting: list[tuple[Ints, Ints, Ints]] = []
        self._parent: dict[int, int] = {}
        self._children: defaultdict[int, set[int]] = defaultdict(set)

    def wait(self, edges: Table, rewires: Table) -> None:
        """Take the changes of a batch that removes no edge."""
        columns = edges["parent"], rewires["node"], rewires["parent"]
        self._waiting.append(tuple(column.copy() for column in columns))  # type: ignore[arg-type]

    def detach(
        self, edges: Table, rewires: Table, cuts: Table, removals: Table
    ) -> Iterator[tuple[np.void, int]]:
        """Take the changes of a batch; yield the nodes that lose their parent, with the event."""
        for joined, nodes, parents in self._waiting:
            self._make(self._count + np.arange(len(joined)), joined)
            self._make(nodes, parents)
            self._count += len(joined)
        self._waiting = []
        changes, done = TreeChanges.of(edges, rewires, self._count), 0
        self._count += len(edges)
        for row in sorted([*cuts, *removals], key=lambda row: int(row["seq"])):
            end = int(np.searchsorted(changes.seq, row["seq"]))
            self._make(changes.node[done:end], changes.parent[done:end])
            done = max(done, end)
            for node in self._losing(row):
                self._move(node, -1)
                yield row, node
        self._make(changes.node[done:], changes.parent[done:])

    def _losing(self, row: np.void) -> list[int]:
        """Return the nodes that lose their parent by a cut or a removal."""
        node = int(row["node"])
        if "other" in (row.dtype.names or ()):
            other = int(row["other"])
            pairs = [(node, other), (other, node)]
            return [a for a, b in pairs if b >= 0 and self._parent.get(a, -1) == b]
        own = [node] if self._parent.get(node, -1) >= 0 else []
        return [*own, *sorted(self._children[node])]

    def _make(self, nodes: Ints, parents: Ints) -> None:
        for node, parent in zip(nodes.tolist(), parents.tolist(), strict=True):
            self._move(node, parent)

    def _move(self, node: int, parent: int) -> None:
        self._children[self._parent.get(node, -1)].discard(node)
        self._parent[node] = parent
        self._children[parent].add(node)


def joined_nodes(events: Events) -> Table:
    """Return the edges of a batch, and its vertices as edges without a parent, in order."""
    return _in_order(events[Kind.EDGE], _joining(events))


def _joining(events: Events) -> Table:
    """Return the vertices of a batch as edges without a parent."""
    vertices = events[Kind.VERTEX]
    edges = np.empty(len(vertices), table_dtype(Kind.EDGE, events.dof))
    for name in vertices.dtype.names or ():
        edges[name] = vertices[name]
    edges["parent"], edges["cost"] = -1, np.inf
    return edges


def _detaching(row: np.void, node: int) -> tuple[Any, ...]:
    """Return the rewire of a node that loses its parent by an event."""
    head = (row[name] for name in ("seq", "t", "iteration", "tree"))
    return (*head, node, DETACHED, np.inf)


def _in_order(a: Table, b: Table) -> Table:
    """Join tables of one kind, ordered by `seq`."""
    if not len(b):
        return a
    rows = np.concatenate([a, b])
    return rows[np.argsort(rows["seq"], kind="stable")]


def is_vertex(edges: Table) -> Flags:
    """Return which edges of a `GraphFold` are vertices, shape (n,)."""
    return np.asarray((edges["parent"] < 0) & np.isinf(edges["cost"]))


def removal_times(events: Events, tree: int, nodes: int) -> Ints:
    """Return the number of the event that removed each node, or `NEVER`, shape (nodes,)."""
    removals, when = of_tree(events[Kind.REMOVE], tree), np.full(nodes, NEVER)
    known = (removals["node"] >= 0) & (removals["node"] < nodes)
    np.minimum.at(when, removals["node"][known], removals["seq"][known])
    return when


def uses_of_removed(events: Events, tree: int) -> list[tuple[np.void, int]]:
    """Return the events that name a node of a tree after its removal, and the node; in order."""
    removals = of_tree(events[Kind.REMOVE], tree)
    if not len(removals):
        return []
    # By the removed nodes alone: the greatest number of a node says nothing of how many there are.
    removed, first = np.unique(removals["node"], return_index=True)
    when = removals["seq"][first]
    found = []
    for kind, fields in _USES.items():
        for name, of in fields:
            table = of_tree(events[kind], tree) if of is None else events[kind]
            if of not in (None, tree) or not len(table):
                continue
            nodes = table[name]
            at = np.minimum(np.searchsorted(removed, nodes), len(removed) - 1)
            late = (nodes >= 0) & (removed[at] == nodes) & (table["seq"] > when[at])
            found += [(table[i], int(nodes[i])) for i in np.flatnonzero(late)]
    return sorted(found, key=lambda pair: int(pair[0]["seq"]))


def pair_keys(node: Ints, other: Ints) -> NDArray[np.int64]:
    """Return a number for each pair of nodes, whatever their order, shape (n,)."""
    low, high = np.minimum(node, other), np.maximum(node, other)
    return np.asarray(low.astype(np.int64) << 32 | (high.astype(np.int64) & 0xFFFFFFFF))


def links_after(events: Events, tree: int) -> Table:
    """Return the links of a tree that are there after the events, in order; see `LINK_DTYPE`."""
    links, cuts = (of_tree(events[kind], tree) for kind in (Kind.LINK, Kind.CUT))
    rows = np.empty(len(links), LINK_DTYPE)
    for name in LINK_DTYPE.names or ():
        rows[name] = links[name]
    if not len(rows):
        return rows
    keys = np.concatenate([pair_keys(part["node"], part["other"]) for part in (links, cuts)])
    order = np.lexsort((np.concatenate([links["seq"], cuts["seq"]]), keys))
    last = order[np.append(np.diff(keys[order]) != 0, True)]
    kept: Table = rows[np.sort(last[last < len(rows)])]
    gone = of_tree(events[Kind.REMOVE], tree)["node"]
    if len(gone):
        kept = kept[~(np.isin(kept["node"], gone) | np.isin(kept["other"], gone))]
    return kept


class LinkHistory:
    """Finds out which links of a tree are there at any moments.

    Args:
        events: The log.
        tree: Number of the tree.
        nodes: How many nodes the tree ever has.
    """

    def __init__(self, events: Events, tree: int, nodes: int) -> None:
        links, cuts = (of_tree(events[kind], tree) for kind in (Kind.LINK, Kind.CUT))
        keys = np.concatenate([pair_keys(part["node"], part["other"]) for part in (links, cuts)])
        seq = np.concatenate([links["seq"], cuts["seq"]])
        self._pairs, pair = np.unique(keys, return_inverse=True)
        self._scale = int(seq.max(initial=0)) + 1
        at = pair * self._scale + seq
        order = np.argsort(at)
        self._at, self._there = at[order], (order < len(links))
        self._removed = removal_times(events, tree, nodes)

    def at(self, node: Ints, other: Ints, seq: Ints) -> Flags:
        """Return which pairs of nodes a link joins right before events, shape (n,)."""
        found = np.zeros(len(node), np.bool_)
        if not len(self._pairs):
            return found
        keys = pair_keys(node, other)
        pair = np.minimum(np.searchsorted(self._pairs, keys), len(self._pairs) - 1)
        last = np.searchsorted(self._at, pair * self._scale + np.minimum(seq, self._scale)) - 1
        known = (self._pairs[pair] == keys) & (last >= 0)
        known &= self._at[last] // self._scale == pair
        found[known] = self._there[last[known]]
        for end in (node, other):
            inside = (end >= 0) & (end < len(self._removed))
            found[inside] &= self._removed[end[inside]] >= seq[inside]
        return found
