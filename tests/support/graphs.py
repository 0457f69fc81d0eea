"""Random graphs with pruning, and a twin that folds their events one by one."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrt import Kind, Memory, Recorder, Scenario, World
from brrt.events import Events
from brrt.replay.graph import STRUCTURE
from brrt.scenario.query import Query

Floats = NDArray[np.float64]

WORLD = World(
    "open",
    lower=np.zeros(2),
    upper=np.full(2, 10.0),
    start=np.ones(2),
    goal=np.full(2, 9.0),
)


def random_graph(rng: np.random.Generator, count: int) -> Memory:
    """Record random events of graphs, all of which are possible."""
    memory = Memory()
    rec = Recorder(memory, Query.of(Scenario(world="open", smooth=False), WORLD))
    twin = Twin()
    rec.edge([1, 1])
    twin.parent[0], twin.root[0] = -1, 0.0
    for _ in range(count):
        _do(rec, twin, rng)
        if rng.random() < 0.1:
            rec.flush()
    rec.close()
    return memory


def _do(rec: Recorder, twin: "Twin", rng: np.random.Generator) -> None:
    """Do something that is possible, if there is anything."""
    q, what = rng.uniform(0, 10, 2), rng.random()
    alive = sorted(twin.parent)
    a, b = (int(node) for node in rng.choice(alive or [0], 2))
    if not alive or what < 0.2:
        node = rec.vertex(q)
        twin.parent[node], twin.root[node] = -1, np.inf
    elif what < 0.4:
        node = rec.edge(q, a, cost=twin.stated(a))
        twin.parent[node] = a
    elif what < 0.6 and a != b:
        rec.link(a, b)
        twin.links[frozenset((a, b))] = 0.0
    elif what < 0.8 and a not in twin.above(b):
        rec.rewire(a, b, cost=twin.stated(b))
        twin.parent[a] = b
    elif what < 0.95:
        pairs = [*twin.links, *(frozenset(pair) for pair in twin.parent.items() if pair[1] >= 0)]
        if pairs:
            a, b = sorted(pairs[int(rng.integers(len(pairs)))])
            rec.cut(a, b)
            twin.cut(a, b)
    else:
        rec.remove(a)
        twin.remove(a)


@dataclass
class Twin:
    """A graph in dictionaries, which forget what is removed."""

    q: dict[int, Floats] = field(default_factory=dict)
    parent: dict[int, int] = field(default_factory=dict)
    root: dict[int, float] = field(default_factory=dict)
    links: dict[frozenset[int], float] = field(default_factory=dict)

    @classmethod
    def of(cls, events: Events, tree: int = 0) -> "Twin":
        """Fold the events of a tree."""
        twin, rows = cls(), [(int(r["seq"]), k, r) for k in STRUCTURE for r in events[k]]
        for _, kind, row in sorted(rows, key=lambda each: each[0]):
            if row["tree"] == tree:
                twin.take(kind, row)
        return twin

    def take(self, kind: Kind, row: Any) -> None:
        """Take one event."""
        node = int(row["node"])
        if kind is Kind.VERTEX:
            self.q[node], self.parent[node], self.root[node] = row["q"], -1, np.inf
        elif kind is Kind.EDGE:
            self.q[node], self.parent[node] = row["q"], int(row["parent"])
            self.root[node] = float(row["cost"])
        elif kind is Kind.REWIRE:
            self.parent[node] = int(row["parent"])
        elif kind is Kind.LINK:
            self.links[frozenset((node, int(row["other"])))] = float(row["cost"])
        elif kind is Kind.CUT:
            self.cut(node, int(row["other"]))
        else:
            self.remove(node)

    def cut(self, a: int, b: int) -> None:
        """Remove the edges between two nodes."""
        self.links.pop(frozenset((a, b)), None)
        for child, up in ((a, b), (b, a)):
            if self.parent.get(child) == up:
                self.parent[child], self.root[child] = -1, np.inf

    def remove(self, node: int) -> None:
        """Remove a node with its edges."""
        for other in list(self.parent):
            self.cut(node, other)
        del self.parent[node]

    def stated(self, parent: int) -> float | None:
        """Return a cost that must be stated, since a parent has none; None if it has one."""
        return 5.0 if np.isinf(self.root[self.above(parent)[-1]]) else None

    def above(self, node: int) -> list[int]:
        """Return a node and those above it."""
        found = [node]
        while self.parent[found[-1]] >= 0:
            found.append(self.parent[found[-1]])
        return found

    def cost(self, node: int) -> float:
        """Return the cost-to-come by distances."""
        *_, root = above = self.above(node)
        q = [self.q[each] for each in above]
        return self.root[root] + float(np.linalg.norm(np.diff(q, axis=0), axis=1).sum())
