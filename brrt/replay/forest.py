"""The trees at any instant: a fold over the edges of a log."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brrt.errors import RecordingError
from brrt.events import Events, Kind


@dataclass(frozen=True, slots=True, eq=False)
class Tree:
    """One tree; row n of each array belongs to node n.

    Attributes:
        q: Configurations, shape (n, dof).
        parent: Parents, -1 for a root, shape (n,).
        cost: Costs-to-come, shape (n,).
        born: `seq` of the event that made the node, shape (n,).
    """

    q: NDArray[np.float64]
    parent: NDArray[np.int32]
    cost: NDArray[np.float64]
    born: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.parent)

    @property
    def leaves(self) -> int:
        """Nodes that are nobody's parent."""
        return len(self) - len(np.unique(self.parent[self.parent >= 0]))

    @property
    def depth(self) -> int:
        """Edges from the root to the deepest node."""
        up = self.parent.copy()
        # Each round halves what is left of every way up: log2(depth) rounds.
        steps = (up >= 0).astype(np.int64)
        while (up >= 0).any():
            on_way = np.flatnonzero(up >= 0)
            above = up[on_way]
            steps[on_way] += steps[above]
            up[on_way] = up[above]
            if steps.max() > len(self):
                raise RecordingError("a node is its own ancestor")
        return int(steps.max(initial=0))

    def path_to(self, node: int) -> NDArray[np.float64]:
        """Configurations from the root to a node, shape (m, dof).

        Raises:
            RecordingError: The parents do not lead to a root.
        """
        lineage = [node]
        while self.parent[lineage[-1]] >= 0:
            lineage.append(int(self.parent[lineage[-1]]))
            if len(lineage) > len(self):
                raise RecordingError(f"node {node} is its own ancestor")
        return self.q[lineage[::-1]]


def forest(events: Events) -> Mapping[int, Tree]:
    """Rebuild the trees as they stand after the given events.

    Cut the log with `Events.until` for an earlier instant.

    Raises:
        RecordingError: A tree's nodes are not numbered 0, 1, 2 ... in order.
    """
    edges = events[Kind.EDGE]
    trees = {}
    for number in np.unique(edges["tree"]):
        rows = edges[edges["tree"] == number]
        wrong = np.flatnonzero(rows["node"] != np.arange(len(rows)))
        if len(wrong):
            row = rows[wrong[0]]
            raise RecordingError(
                f"event {row['seq']}: node {row['node']} joins tree {number} as its node {wrong[0]}"
            )
        trees[int(number)] = Tree(rows["q"], rows["parent"], rows["cost"], rows["seq"])
    return trees
