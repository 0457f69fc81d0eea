"""The table of trees: how many nodes, leaves and links, how deep, and the greatest cost."""

from collections import Counter
from typing import Any, NamedTuple

import numpy as np

from brrt.events import Events, Kind
from brrt.replay.forest import check_numbers, check_verdicts, depth_of, final_costs, leaves_of
from brrt.replay.graph import GraphFold, links_after
from brrt.replay.tree_fold import DETACHED, Distance, TreeChanges, of_tree, trees_in

_LINKS = (Kind.LINK, Kind.CUT, Kind.REMOVE)


class TreeFigures(NamedTuple):
    """One row of the table.

    Attributes:
        tree: Number of the tree.
        nodes: Nodes.
        leaves: Nodes without children.
        depth: Edges from the root to the deepest node.
        greatest_cost: The greatest finite cost-to-come; -inf without one.
        links: Edges of a graph, beside those to parents.
    """

    tree: int
    nodes: int
    leaves: int
    depth: int
    greatest_cost: float
    links: int = 0


class TreeStats:
    """A sink that keeps what the table needs: 12 bytes a node, and its configuration."""

    def __init__(self, distance: Distance) -> None:
        self._distance = distance
        self._nodes: Counter[int] = Counter()
        self._removed: Counter[int] = Counter()
        self._graph, self._links = GraphFold(), list[Events]()
        self._parts: dict[int, list[tuple[Any, ...]]] = {}  # columns, batch by batch

    def write(self, events: Events) -> None:
        """Take a batch.

        Raises:
            LogError: A tree's nodes are not numbered 0, 1, 2 ... in order, or a node gets a parent
                that does not exist, or is rewired before it exists.
        """
        made = self._graph.take(events)
        self._keep_links(events)
        for tree in trees_in(made[Kind.EDGE], made[Kind.REWIRE]):
            edges, rewires = (of_tree(made[kind], tree) for kind in (Kind.EDGE, Kind.REWIRE))
            nodes = self._nodes[tree]
            check_numbers(edges, tree, nodes)
            changes = TreeChanges.of(edges, rewires, nodes)
            check_verdicts(changes, changes.existence(nodes))
            self._nodes[tree] += len(edges)
            kept = (edges[name].copy() for name in ("parent", "cost", "q"))
            rewired = np.stack([rewires["node"], rewires["parent"]], axis=1)
            self._parts.setdefault(tree, []).append((*kept, rewired))

    def _keep_links(self, events: Events) -> None:
        """Keep the events that links are folded from, and count the removed nodes."""
        kept = {kind: events[kind].copy() for kind in _LINKS if kind in events.counts}
        if kept:
            self._links.append(Events(events.dof, kept))
        for tree in trees_in(events[Kind.REMOVE]):
            self._removed[tree] += len(of_tree(events[Kind.REMOVE], tree))

    def figures(self) -> list[TreeFigures]:
        """Return the row of each tree.

        Raises:
            LogError: A node is its own ancestor.
        """
        found = []
        for tree, parts in sorted(self._parts.items()):
            parents, costs, places, rewired = zip(*parts, strict=True)
            parent, cost = np.concatenate(parents), np.concatenate(costs)
            node, new = np.concatenate(rewired).T
            if len(node) or np.isinf(cost).any():
                parent[node] = new  # of several rewires of a node the last one counts
                cost[parent == DETACHED] = np.inf
                parent = np.maximum(parent, -1)
                cost = final_costs(parent, cost, np.concatenate(places), self._distance)
            greatest = float(cost.max(initial=-np.inf, where=np.isfinite(cost)))
            removed = self._removed[tree]
            shape = len(parent) - removed, leaves_of(parent) - removed, depth_of(parent)
            links = len(links_after(self._links_events(), tree)) if self._links else 0
            found.append(TreeFigures(tree, *shape, greatest, links))
        return found

    def _links_events(self) -> Events:
        return Events.concat(self._links[0].dof, self._links)
