"""What changed between two looks at a planner's data, as events in a possible order."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from brrt.event_columns import EventColumns
from brrt.events import Kind, Reason
from brrt.ompl.batch import (
    FIRST,
    LAST,
    LATE,
    Batch,
    Moment,
    depths,
    iterations_at,
    occurrences,
    rise,
)
from brrt.ompl.checks import Checks, find_last, hash_rows
from brrt.ompl.planner_data import PlannerGraph
from brrt.ompl.tree_costs import TreeCosts

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]


_COSTING = [Kind.EDGE, Kind.REWIRE, Kind.VERTEX, Kind.CUT, Kind.CONNECT]
"""Kinds that have a cost-to-come, or change what those of others are."""


class Changes:
    """The graph as recorded so far; `update` returns what is new.

    A vertex is known by its configuration and tree: OMPL uses the memory of states again. Rows of
    the arrays are vertices ever seen.

    Args:
        dof: Numbers in a configuration.
        start: The start configuration, shape (dof,); its vertex is the root of tree 0.

    Attributes:
        q: Configurations, shape (k, dof).
        tree: The tree of each vertex, shape (k,).
        number: Its number in the tree, shape (k,).
        parent: Row of its parent, or -1, shape (k,).
        present: Whether it is there now, shape (k,).
        rows: Row of each vertex of the last graph, shape (n,).
        trees: The costs of both trees.
    """

    def __init__(self, dof: int, start: Floats) -> None:
        self._dof, self._start = dof, start
        self.q, self._hash = np.empty((0, dof)), np.empty(0, np.uint64)
        self._key, self._birth = np.empty(0, np.uint64), np.empty(0, np.int64)
        self.tree, self.number, self.parent, self.rows = (np.empty(0, np.int64) for _ in range(4))
        self.present = np.empty(0, np.bool_)
        self._links, self._bridges = set[tuple[int, int]](), set[tuple[int, int]]()
        self.trees = TreeCosts(), TreeCosts()
        self._has_root = [False, False]
        self._last = Moment(0, 0)

    def update(
        self,
        graph: PlannerGraph,
        checks: Checks,
        now: Moment,
        length: Callable[[Ints, Ints], Floats],
    ) -> EventColumns:
        """Return the events that lead from the last graph to this one.

        Args:
            graph: The planner's graph now.
            checks: The motions that were checked since the last graph.
            now: When the graph was read.
            length: Returns the costs of motions between vertices of the graph.
        """
        known = len(self.q)
        self._find_rows(graph)
        index = np.full(len(self.q), -1)
        index[self.rows] = np.arange(len(self.rows))
        parent = np.full(len(self.q), -1)
        has_parent = graph.parent >= 0
        parent[self.rows[has_parent]] = self.rows[graph.parent[has_parent]]
        batch = Batch(self._dof)
        there = index >= 0
        self._cut(batch, parent, there, known)
        self._grow(batch, parent, index, checks, now, known, length)
        self._join(batch, graph, parent, there, checks, now, length)
        self._reject(batch, checks)
        gone = np.flatnonzero(self.present & ~there)
        batch.add(
            Kind.REMOVE, np.full(len(gone), now.t), np.full(len(gone), now.iteration), LAST,
            self.tree[gone], self.number[gone],
        )  # fmt: skip
        self.parent, self.present = parent, there
        columns = batch.columns(self._last)
        self._set_costs(columns)
        end = int(columns.t[-1]) if len(columns.t) else now.t
        self._last = Moment(max(now.t, end), now.iteration)
        return columns

    def _find_rows(self, graph: PlannerGraph) -> None:
        """Find the row of each vertex; append those that are new."""
        hashes = hash_rows(graph.q)
        keys = hashes ^ (graph.tree.astype(np.uint64) << np.uint64(63))
        keys += occurrences(keys)
        present = np.flatnonzero(self.present)
        found = find_last(self._key[present], keys)
        self.rows = np.where(found >= 0, present[found] if len(present) else -1, -1)
        new = np.flatnonzero(found < 0)
        self.rows[new] = len(self.q) + np.arange(len(new))
        nothing = np.full(len(new), -1)
        for name, values in (
            ("q", graph.q[new]), ("_hash", hashes[new]), ("_key", keys[new]), ("_birth", nothing),
            ("tree", graph.tree[new]), ("number", nothing), ("parent", nothing),
            ("present", nothing > 0),
        ):  # fmt: skip
            setattr(self, name, np.concatenate([getattr(self, name), values]))

    def _cut(self, batch: Batch, parent: Ints, there: Flags, known: int) -> None:
        """Add the edges to parents that are gone; first of all, or others would make circles."""
        lost = there[:known] & (self.parent[:known] >= 0) & (parent[:known] < 0)
        rows = np.flatnonzero(lost)
        ends = np.sort(np.stack([rows, self.parent[rows]], axis=1), axis=1)
        self._links -= set(map(tuple, ends.tolist()))  # a cut takes away a link as well
        first, iteration = (np.full(len(rows), x) for x in (self._last.t, self._last.iteration))
        batch.add(
            Kind.CUT, first, iteration, FIRST,
            self.tree[rows], self.number[rows], self.number[self.parent[rows]],
        )  # fmt: skip

    def _grow(
        self, batch: Batch, parent: Ints, index: Ints, checks: Checks, now: Moment, known: int,
        length: Callable[[Ints, Ints], Floats],
    ) -> None:  # fmt: skip
        """Add the nodes that joined, and those that have another parent."""
        every, has_parent = np.arange(len(parent)), parent >= 0
        is_new = every >= known
        changed = np.flatnonzero(has_parent & (is_new | (parent != self.parent)) | is_new)
        up = parent[changed]
        found = checks.between(self._hash[changed], self._hash[np.where(up >= 0, up, changed)])
        joins = changed >= known
        found = np.where(joins & (found < 0), checks.of_configurations(self._hash[changed]), found)
        at = np.where(found >= 0, checks.t[found] if len(checks.t) else now.t, now.t)
        roots = self._roots(changed[joins & (up < 0)])
        at[np.isin(changed, roots)] = self._last.t
        t = np.full(len(parent), -1)
        t[changed] = at
        self._born_before_children(t, parent, changed[joins & (found < 0)], now)
        # A node joins after its parent; a rewire comes after all that changes above, or there
        # could be a circle for a while.
        above = np.where(is_new & has_parent & is_new[parent], parent, every)
        born = rise(np.where(is_new, t, -1), above)
        above = np.where(has_parent, parent, every)
        moved, depth = rise(np.where(is_new, born, t), above), depths(above)
        t = np.where(is_new, born, moved)[changed]
        self._birth[changed[joins]] = t[joins]
        self._give_numbers(changed[joins], t[joins], depth)
        lengths = np.zeros(len(changed))
        inner = up >= 0
        lengths[inner] = length(index[up[inner]], index[changed[inner]])
        kind = np.where(joins, int(Kind.EDGE), int(Kind.REWIRE))
        kind[joins & (up < 0) & ~np.isin(changed, roots)] = int(Kind.VERTEX)
        batch.add(
            kind, t, iterations_at(t, checks, now), depth[changed], self.tree[changed],
            self.number[changed], np.where(inner, self.number[up], -1), real=lengths,
            q=self.q[changed] * (kind != Kind.REWIRE)[:, None],
        )  # fmt: skip

    def _roots(self, rows: Ints) -> list[int]:
        """Return which new nodes without parents are roots: one a tree."""
        found = []
        for tree in (0, 1):
            own = rows[self.tree[rows] == tree]
            if tree == 0:
                own = own[(self.q[own] == self._start).all(axis=1)]
            if len(own) and not self._has_root[tree]:
                self._has_root[tree] = True
                found.append(int(own[0]))
        return found

    @staticmethod
    def _born_before_children(t: Ints, parent: Ints, unknown: Ints, now: Moment) -> None:
        """Give nodes whose motion was not checked by itself the time of their first child."""
        rows = np.flatnonzero(np.isin(parent, unknown)) if len(unknown) else unknown
        while len(rows):
            before = t[unknown].copy()
            np.minimum.at(t, parent[rows], np.where(t[rows] < 0, now.t, t[rows]))
            if (t[unknown] == before).all():
                return

    def _give_numbers(self, rows: Ints, t: Ints, depth: Ints) -> None:
        """Number new nodes in the order in which their events will be."""
        order = rows[np.lexsort((depth[rows], t))]
        for tree, nodes in enumerate(self.trees):
            own = order[self.tree[order] == tree]
            self.number[own] = len(nodes) + np.arange(len(own))

    def _join(
        self, batch: Batch, graph: PlannerGraph, parent: Ints, there: Flags, checks: Checks,
        now: Moment, length: Callable[[Ints, Ints], Floats],
    ) -> None:  # fmt: skip
        """Add edges beside those to parents, and take away those that are gone."""
        pairs = np.sort(self.rows[graph.links], axis=1)
        links = dict(zip(map(tuple, pairs.tolist()), graph.links.tolist(), strict=True))
        bridges = dict(
            zip(map(tuple, self.rows[graph.bridges].tolist()), graph.bridges.tolist(), strict=True)
        )
        for kind, new, old in (
            (Kind.LINK, links, self._links), (Kind.CONNECT, bridges, self._bridges),
        ):  # fmt: skip
            fresh = [pair for pair in new if pair not in old]
            if not fresh:
                continue
            a, b = np.array(fresh, np.int64).reshape(-1, 2).T
            i, j = np.array([new[pair] for pair in fresh], np.int64).reshape(-1, 2).T
            found = checks.between(self._hash[a], self._hash[b])
            t = np.where(found >= 0, checks.t[found] if len(checks.t) else now.t, now.t)
            t = np.maximum(t, np.maximum(self._birth[a], self._birth[b]))
            integers = [self.number[a], self.number[b]]
            if kind is Kind.LINK:
                integers.insert(0, self.tree[a])
            batch.add(kind, t, iterations_at(t, checks, now), LATE, *integers, real=length(i, j))
        # A cut takes away the edge to a parent as well: a link of such a pair stays.
        kept = {(a, b) for a, b in self._links if parent[a] == b or parent[b] == a}
        lost = [
            pair
            for pair in self._links
            if pair not in links and pair not in kept and there[list(pair)].all()
        ]
        a, b = np.array(lost, np.int64).reshape(-1, 2).T
        when = np.full(len(a), now.t), np.full(len(a), now.iteration)
        batch.add(Kind.CUT, *when, LATE, self.tree[a], self.number[a], self.number[b])
        self._links, self._bridges = kept.union(links), set(bridges)

    def _reject(self, batch: Batch, checks: Checks) -> None:
        """Add motions that are not free, as far as a node is at one end."""
        blocked = np.flatnonzero(~checks.is_free)
        alive = np.flatnonzero(self._birth >= 0)
        ends = [find_last(self._hash[alive], each[blocked]) for each in (checks.begin, checks.end)]
        if not len(alive):
            return
        at = np.where(ends[0] >= 0, ends[0], ends[1])
        target = np.where((ends[0] >= 0)[:, None], checks.q[blocked], checks.origin[blocked])
        rows, blocked, target = alive[at[at >= 0]], blocked[at >= 0], target[at >= 0]
        t = np.maximum(checks.t[blocked], self._birth[rows])
        batch.add(
            Kind.REJECT, t, checks.iteration[blocked], LATE, self.tree[rows], self.number[rows],
            int(Reason.COLLISION), q=target,
        )  # fmt: skip

    def _set_costs(self, columns: EventColumns) -> None:
        """Turn the lengths of motions into costs-to-come."""
        rows = np.flatnonzero(np.isin(columns.kind, _COSTING))
        costs, lengths = columns.reals[:, 0], columns.reals[rows, 0].tolist()
        events = zip(
            rows.tolist(), columns.kind[rows].tolist(), *columns.integers[rows].T.tolist(), lengths,
            strict=True,
        )  # fmt: skip
        joins, moves = zip(*((tree.join, tree.move) for tree in self.trees), strict=True)
        edge, rewire, vertex = int(Kind.EDGE), int(Kind.REWIRE), int(Kind.VERTEX)
        for row, kind, first, second, third, length in events:
            if kind == edge:
                costs[row] = joins[first](third, length)
            elif kind == rewire:
                costs[row] = moves[first](second, third, length)
            elif kind == vertex:
                joins[first](-1, 0.0)
            elif kind == Kind.CUT:
                self.trees[first].detach(second, third)
            elif kind == Kind.CONNECT:
                costs[row] = self.trees[0].cost[first] + length + self.trees[1].cost[second]
