"""What became of one node of a tree: a fold over the events that concern it."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrt.errors import BrrtError
from brrt.events import Events, Kind, Reason, Source, Stage, Table
from brrt.replay.forest import Tree, forest
from brrt.replay.history_records import Draw, NodeHistory, Rejected, Turn, When
from brrt.replay.ledger import Changes, Questions, changes, edge_lengths, fold
from brrt.replay.transcript import choice_name
from brrt.robots import Robot
from brrt.verification.collision.motions import Obstacles, first_hits
from brrt.worlds.world import World

Floats = NDArray[np.float64]

NAMES = {0: "start", 1: "goal"}
"""What each tree grows from."""

_BLOCKED = (Reason.COLLISION, Reason.GOAL_BLOCKED, Reason.LINK_BLOCKED, Reason.NEAR_BLOCKED)


class NodeTrace:
    """A fold that keeps what a node's history is told from.

    Args:
        node: The node's number.
        tree: Its tree's.
        dof: Numbers in a configuration.
    """

    def __init__(self, node: int, tree: int, dof: int) -> None:
        self._node, self._tree, self._dof = node, tree, dof
        self._structure: list[Events] = []
        self._rejects: list[Table] = []
        self._drawn: Table | None = None
        self._sample: Any = None
        self._paths: dict[str, Floats] = {}
        self._trees: set[int] = set()

    def write(self, events: Events) -> None:
        """Take in a batch."""
        self._trees.update(np.unique(events[Kind.EDGE]["tree"]).tolist())
        mine = {
            kind: table[table["tree"] == self._tree]
            for kind in (Kind.EDGE, Kind.REWIRE, Kind.REJECT)
            if len(table := events[kind])
        }
        rejects = mine.pop(Kind.REJECT, events[Kind.REJECT])
        self._rejects.append(rejects[rejects["node"] == self._node])
        self._structure.append(Events(self._dof, mine))
        samples = events[Kind.SAMPLE]
        edges = mine.get(Kind.EDGE, events[Kind.EDGE][:0])
        born = edges[edges["node"] == self._node]
        if len(born):
            before = samples[samples["seq"] < born["seq"][0]]
            last = before[-1:] if len(before) else self._drawn
            if last is not None and last["iteration"][0] == born["iteration"][0]:
                self._sample = last[0]
        self._drawn = samples[-1:].copy() if len(samples) else self._drawn
        for path in events[Kind.PATH]:
            stage = "smoothed" if path["stage"] == Stage.SMOOTHED else "raw"
            self._paths[stage] = np.asarray(path["waypoints"]).reshape(-1, self._dof)

    @property
    def has_trees(self) -> bool:
        """Whether there are trees in the log."""
        return bool(self._trees)

    def history(self, robot: Robot, world: World) -> NodeHistory:
        """Tell the history.

        Args:
            robot: What moves, settled in the world.
            world: Where.

        Raises:
            BrrtError: There is no such node.
            RecordingError: The edges make no trees.
        """
        events = Events.concat(self._dof, self._structure)
        trees = forest(events, robot.distance)
        if self._tree not in trees:
            there = " and ".join(
                f"tree {number} ({tree_name(number)})" for number in sorted(self._trees)
            )
            name = f"tree {self._tree} ({tree_name(self._tree)})"
            raise BrrtError(f"{name} has no nodes by then; there is {there or 'none'}")
        tree = trees[self._tree]
        if not 0 <= self._node < len(tree):
            raise BrrtError(
                f"tree {self._tree} ({tree_name(self._tree)}) has the nodes 0 to "
                f"{len(tree) - 1:,} by then, and no node {self._node:,}"
            )
        node = self._node
        birth = events[Kind.EDGE][node]
        q = tree.q[node]
        turns = self._turns(events, tree, robot)
        below = tree.below(node)
        return NodeHistory(
            node=node,
            tree=self._tree,
            q=q.tolist(),
            born=When.of(birth),
            born_parent=int(birth["parent"]),
            born_cost=float(birth["cost"]),
            sample=self._draw(),
            rewires=[turn for turn in turns if turn.node == node],
            follows=[turn for turn in turns if turn.node != node],
            parent=int(tree.parent[node]),
            cost=float(tree.cost[node]),
            lineage=tree.lineage(node),
            children=np.flatnonzero(tree.parent == node).tolist(),
            descendants=len(below),
            paths=self._places(q),
            rejects=self._rejected(q, robot, world),
        )

    def _draw(self) -> Draw | None:
        row = self._sample
        if row is None:
            return None
        number = int(row["source"])
        return Draw(When.of(row), int(row["tree"]), choice_name(Source, number), row["q"].tolist())

    def _turns(self, events: Events, tree: Tree, robot: Robot) -> list[Turn]:
        """Find the rewires that changed the node's cost: its own, and those of its ancestors."""
        rewires = events[Kind.REWIRE]
        if not len(rewires):
            return []
        made = changes(events, self._tree)
        born = events[Kind.EDGE]["seq"][self._node]
        later = rewires[rewires["seq"] > born]
        seq = np.concatenate([[born], later["seq"]])
        asked = Questions(seq, np.full(len(seq), self._node))
        ledger = fold(made, edge_lengths(tree.q, made, robot.distance), asked)
        costs = ledger.answers
        concerned = np.flatnonzero((np.diff(costs) != 0) | (later["node"] == self._node))
        some = later[concerned]
        old = _parents_before(made)[np.searchsorted(made.seq, some["seq"])].tolist()
        both = zip(costs[concerned].tolist(), costs[concerned + 1].tolist(), strict=True)
        return [
            Turn(When.of(row), int(row["node"]), parent, int(row["parent"]), before, after)
            for row, parent, (before, after) in zip(some, old, both, strict=True)
        ]

    def _places(self, q: Floats) -> dict[str, int]:
        found = {}
        for stage, path in self._paths.items():
            at = np.flatnonzero((path == q).all(axis=1))
            if len(at):
                found[stage] = int(at[0])
        return found

    def _rejected(self, q: Floats, robot: Robot, world: World) -> list[Rejected]:
        rows = np.concatenate(self._rejects)
        blocked = np.flatnonzero(np.isin(rows["reason"], [int(reason) for reason in _BLOCKED]))
        names: dict[int, str] = {}
        if len(blocked):
            obstacles = Obstacles(world)
            ends = np.asarray(rows["q"][blocked])
            hits = first_hits(obstacles, robot, np.broadcast_to(q, ends.shape), ends)
            found = zip(blocked.tolist(), hits.tolist(), strict=True)
            names = {i: obstacles.name(hit) for i, hit in found if hit >= 0}
        return [
            Rejected(
                When.of(row),
                choice_name(Reason, int(row["reason"])),
                row["q"].tolist(),
                names.get(i),
            )
            for i, row in enumerate(rows)
        ]


def _parents_before(made: Changes) -> NDArray[np.int64]:
    """Return which parent each change takes the place of, -1 where the node joins, shape (m,)."""
    order = np.argsort(made.node, kind="stable")
    node, parent = made.node[order], made.parent[order]
    before = np.full(len(order), -1, np.int64)
    again = np.flatnonzero(node[1:] == node[:-1]) + 1
    before[order[again]] = parent[again - 1]
    return before


def tree_name(tree: int) -> str:
    """Say what a tree grows from."""
    return NAMES.get(tree, "of its own")
