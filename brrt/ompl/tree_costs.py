"""Costs-to-come in a tree that grows and is rewired, as fast as plain Python can."""


class TreeCosts:
    """The nodes of a tree, numbered as they join.

    Attributes:
        cost: Cost-to-come of each node, from the top of what it is connected to.
    """

    def __init__(self) -> None:
        self.cost: list[float] = []
        self._parent: list[int] = []
        # Nodes that are or were children of each node; a list only where there are any.
        self._below: list[list[int] | None] = []

    def __len__(self) -> int:
        return len(self.cost)

    def join(self, parent: int, length: float) -> float:
        """Add a node at the end of an edge from its parent, -1 for none; return its cost."""
        if parent >= 0:
            length += self.cost[parent]
            below = self._below[parent]
            if below is None:
                self._below[parent] = [len(self.cost)]
            else:
                below.append(len(self.cost))
        self._parent.append(parent)
        self._below.append(None)
        self.cost.append(length)
        return length

    def move(self, node: int, parent: int, length: float) -> float:
        """Give a node another parent; return its cost. Those of its descendants follow."""
        cost, parents, belows = self.cost, self._parent, self._below
        total = cost[parent] + length
        parents[node] = parent
        below = belows[parent]
        if below is None:
            belows[parent] = [node]
        elif node not in below:
            below.append(node)
        change = total - cost[node]
        cost[node] = total
        rest = [node]
        while rest:
            at = rest.pop()
            for child in belows[at] or ():
                if parents[child] == at:
                    cost[child] += change
                    rest.append(child)
        return total

    def detach(self, node: int, other: int) -> None:
        """Remove the edge between two nodes, if one is the other's parent."""
        if self._parent[node] == other:
            self._parent[node] = -1
        elif self._parent[other] == node:
            self._parent[other] = -1
