"""The history of one node of a tree or graph: a fold over the events that concern it."""

import math
from collections import Counter
from dataclasses import asdict, dataclass, replace
from typing import Any, Self

import numpy as np

from brrt.collision.motions import Obstacles, first_hits
from brrt.errors import BrrtError
from brrt.events import Events, Kind, Reason, Source, Stage, Table
from brrt.replay.cost_history import CostHistory
from brrt.replay.forest import Tree, forest
from brrt.replay.graph import STRUCTURE, as_forest
from brrt.replay.tree_fold import Floats, TreeChanges, trees_in
from brrt.robots import Robot
from brrt.worlds.world import World

_NAMES = {0: "start", 1: "goal"}

_BLOCKED = (Reason.COLLISION, Reason.GOAL_BLOCKED, Reason.LINK_BLOCKED, Reason.NEAR_BLOCKED)


@dataclass(frozen=True, slots=True)
class When:
    """When an event happened: its number, its time in seconds, and its iteration."""

    event: int
    time_s: float
    iteration: int

    @classmethod
    def of(cls, row: Any) -> Self:
        """Return when the event in a row of a table happened."""
        return cls(int(row["seq"]), int(row["t"]) / 1e9, int(row["iteration"]))


@dataclass(frozen=True, slots=True)
class Draw:
    """The last sample before a node was added, in the same iteration.

    Attributes:
        when: Its event.
        tree: The tree that was to grow towards it.
        source: Where it came from.
        q: Configuration.
    """

    when: When
    tree: int
    source: str
    q: list[float]

    @classmethod
    def of(cls, row: Any) -> Self:
        """Return the sample in a row of a table."""
        source = Source.label_of(int(row["source"]))
        return cls(When.of(row), int(row["tree"]), source, row["q"].tolist())


@dataclass(frozen=True, slots=True)
class CostChange:
    """A rewire that changed a node's cost, or a cut or removal that took a parent away.

    Attributes:
        when: The event.
        node: The node that got another parent: the node itself or an ancestor.
        old_parent: Its parent before; -1 for none.
        parent: Its parent afterwards; -1 for none.
        before: Cost-to-come, before, of the node whose history this is; infinite for none.
        after: Its cost-to-come afterwards.
    """

    when: When
    node: int
    old_parent: int
    parent: int
    before: float
    after: float


@dataclass(frozen=True, slots=True)
class Rejection:
    """A rejected extension from the node.

    Attributes:
        when: Its event.
        reason: Why it was rejected.
        q: The configuration that it was to reach.
        hit: The obstacle in its way, by verify's geometry; None if there is none.
    """

    when: When
    reason: str
    q: list[float]
    hit: str | None


@dataclass(frozen=True, slots=True)
class Link:
    """An edge of a graph at the node.

    Attributes:
        when: The last event that stated it.
        other: The node at its other end.
        cost: Its cost.
        gone: The event that cut it, or removed a node of it; None if it is there.
    """

    when: When
    other: int
    cost: float
    gone: When | None


@dataclass(frozen=True, slots=True)
class CheckedMotion:
    """A motion from or to the node that was checked for collisions.

    Attributes:
        when: Its event.
        node: The node at which it begins; -1 for none.
        other: The node at which it ends; -1 for none.
        part: How much of it is free.
        q: The configuration at which it ends.
    """

    when: When
    node: int
    other: int
    part: float
    q: list[float]


@dataclass(frozen=True, slots=True)
class NodeHistory:
    """A node up to an instant.

    Attributes:
        node: Its number.
        tree: Number of its tree.
        q: Its configuration.
        born: The event that added it.
        born_parent: Its first parent; -1 for a root or a vertex.
        born_cost: Its first cost-to-come; infinite for a vertex.
        sample: The sample before it was added; None for roots.
        rewires: Each time it was rewired.
        follows: Each time its cost changed because an ancestor was rewired.
        parent: Its parent at the instant.
        cost: Its cost-to-come at the instant.
        lineage: Nodes from the root to it.
        children: Its children.
        descendants: Number of nodes below it.
        paths: For each current path through it, by stage, the number of its waypoint.
        rejects: The rejected extensions from it.
        removed: The event that removed it; None if it is there.
        links: Its links, those that are gone included.
        checks: Checked motions from and to it.
    """

    node: int
    tree: int
    q: list[float]
    born: When
    born_parent: int
    born_cost: float
    sample: Draw | None
    rewires: list[CostChange]
    follows: list[CostChange]
    parent: int
    cost: float
    lineage: list[int]
    children: list[int]
    descendants: int
    paths: dict[str, int]
    rejects: list[Rejection]
    removed: When | None
    links: list[Link]
    checks: list[CheckedMotion]

    def as_dict(self) -> dict[str, Any]:
        """Return plain numbers, texts, lists and dicts; None for a cost that is not there."""
        found: dict[str, Any] = _finite(asdict(self))
        return found

    def reasons(self) -> dict[str, int]:
        """Count the rejected extensions by reason, most frequent first."""
        return dict(Counter(each.reason for each in self.rejects).most_common())

    def hits(self) -> dict[str, int]:
        """Count the rejected extensions by obstacle, most frequent first."""
        return dict(Counter(each.hit for each in self.rejects if each.hit).most_common())


class NodeTrace:
    """A fold that keeps the events that concern a node."""

    def __init__(self, node: int, tree: int, dof: int) -> None:
        self._node, self._tree, self._dof = node, tree, dof
        self._structure: list[Events] = []
        self._rejects: list[Table] = []
        self._checks: list[CheckedMotion] = []
        self._drawn: Table | None = None
        self._sample: Draw | None = None
        self._paths: dict[str, Floats] = {}
        self._trees: set[int] = set()

    def write(self, events: Events) -> None:
        """Take a batch."""
        self._trees.update(trees_in(events[Kind.EDGE], events[Kind.VERTEX]))
        mine = {
            kind: table[table["tree"] == self._tree]
            for kind in (*STRUCTURE, Kind.REJECT, Kind.CHECK)
            if len(table := events[kind])
        }
        checks = mine.pop(Kind.CHECK, events[Kind.CHECK])
        at = (checks["node"] == self._node) | (checks["other"] == self._node)
        self._checks += [_checked(row) for row in checks[at]]
        rejects = mine.pop(Kind.REJECT, events[Kind.REJECT])
        self._rejects.append(rejects[rejects["node"] == self._node])
        self._structure.append(Events(self._dof, mine))
        samples = events[Kind.SAMPLE]
        edges, vertices = (mine.get(k, events[k][:0]) for k in (Kind.EDGE, Kind.VERTEX))
        added = edges[edges["node"] == self._node]
        if not len(added):
            added = vertices[vertices["node"] == self._node]
        if len(added):
            before = samples[samples["seq"] < added["seq"][0]]
            last = before[-1:] if len(before) else self._drawn
            if last is not None and last["iteration"][0] == added["iteration"][0]:
                self._sample = Draw.of(last[0])
        self._drawn = samples[-1:].copy() if len(samples) else self._drawn
        for path in events[Kind.PATH]:
            stage = "smoothed" if path["stage"] == Stage.SMOOTHED else "raw"
            self._paths[stage] = np.asarray(path["waypoints"]).reshape(-1, self._dof)

    @property
    def has_trees(self) -> bool:
        """Whether the log has trees."""
        return bool(self._trees)

    def history(self, robot: Robot, world: World) -> NodeHistory:
        """Return the history.

        Raises:
            BrrtError: The node does not exist.
            RecordingError: The events do not make trees.
        """
        events = Events.concat(self._dof, self._structure)
        trees = forest(events, robot.distance)
        if self._tree not in trees:
            others = ", ".join(map(tree_name, sorted(self._trees))) or "none"
            raise BrrtError(
                f"{tree_name(self._tree)} has no nodes at this instant; trees with nodes: {others}"
            )
        tree, node = trees[self._tree], self._node
        if not 0 <= node < len(tree):
            raise BrrtError(
                f"node {node:,} does not exist at this instant: {tree_name(self._tree)} has the "
                f"nodes 0 to {len(tree) - 1:,}"
            )
        made = as_forest(events)
        edge, q = made[Kind.EDGE][node], tree.q[node]
        costs = self._cost_changes(made, tree, robot)
        removals = events[Kind.REMOVE]
        removed = [When.of(row) for row in removals[removals["node"] == node]]
        return NodeHistory(
            node=node,
            tree=self._tree,
            q=q.tolist(),
            born=When.of(edge),
            born_parent=int(edge["parent"]),
            born_cost=float(edge["cost"]),
            sample=self._sample,
            rewires=[change for change in costs if change.node == node],
            follows=[change for change in costs if change.node != node],
            parent=int(tree.parent[node]),
            cost=float(tree.cost[node]),
            lineage=tree.lineage(node),
            children=np.flatnonzero(tree.parent == node).tolist(),
            descendants=len(tree.below(node)),
            paths=self._waypoints(q),
            rejects=self._rejections(q, robot, world),
            removed=removed[0] if removed else None,
            links=_links_of(events, node),
            checks=self._checks,
        )

    def _cost_changes(self, events: Events, tree: Tree, robot: Robot) -> list[CostChange]:
        """Return the node's own rewires, and those of ancestors that changed its cost."""
        edges, rewires = events[Kind.EDGE], events[Kind.REWIRE]
        if not len(rewires):
            return []
        changes = TreeChanges.of(edges, rewires)
        length = changes.lengths(tree.q, robot.distance)
        history = CostHistory(changes, length, np.ones(len(length), np.bool_))
        found, node = [], np.array([self._node])
        cost, until = history.at(edges["seq"][node], node)
        while until[0] < len(length):
            i, before = int(until[0]), float(cost[0])
            cost, until = history.at(changes.seq[i : i + 1], node)
            row = rewires[np.searchsorted(rewires["seq"], changes.seq[i])]
            moved, parent, after = int(changes.node[i]), int(changes.parent[i]), float(cost[0])
            old = int(changes.parent[history.latest(np.array([moved]), np.array([i]))[0]])
            if after != before or moved == self._node:
                ends = max(old, -1), max(parent, -1)
                found.append(CostChange(When.of(row), moved, *ends, before, after))
        return found

    def _waypoints(self, q: Floats) -> dict[str, int]:
        at = {stage: (path == q).all(axis=1) for stage, path in self._paths.items()}
        return {stage: int(here.argmax()) for stage, here in at.items() if here.any()}

    def _rejections(self, q: Floats, robot: Robot, world: World) -> list[Rejection]:
        rows = np.concatenate(self._rejects)
        blocked = np.flatnonzero(np.isin(rows["reason"], [int(reason) for reason in _BLOCKED]))
        found = [
            Rejection(When.of(row), Reason.label_of(int(row["reason"])), row["q"].tolist(), None)
            for row in rows
        ]
        if len(blocked):
            obstacles = Obstacles(world)
            ends = np.asarray(rows["q"][blocked])
            hits = first_hits(obstacles, robot, np.broadcast_to(q, ends.shape), ends)
            for i, hit in zip(blocked.tolist(), hits.tolist(), strict=True):
                if hit >= 0:
                    found[i] = replace(found[i], hit=obstacles.name(hit))
        return found


def _checked(row: Any) -> CheckedMotion:
    """Return the motion in a row of a table of checks."""
    ends = int(row["node"]), int(row["other"])
    return CheckedMotion(When.of(row), *ends, float(row["part"]), row["q"].tolist())


def _links_of(events: Events, node: int) -> list[Link]:
    """Return the links of a node, by their first event."""
    kinds = Kind.LINK, Kind.CUT, Kind.REMOVE
    rows = [(int(row["seq"]), kind, row) for kind in kinds for row in events[kind]]
    found: dict[int, Link] = {}
    for _, kind, row in sorted(rows, key=lambda each: each[0]):
        at, when = int(row["node"]), When.of(row)
        if kind is Kind.REMOVE:
            gone = list(found) if at == node else [at] if at in found else []
        elif node not in (at, other := int(row["other"])):
            continue
        else:
            end = other if at == node else at
            gone = [end] if kind is Kind.CUT and end in found else []
            if kind is Kind.LINK:
                found[end] = Link(when, end, float(row["cost"]), None)
        for end in gone:
            found[end] = replace(found[end], gone=found[end].gone or when)
    return list(found.values())


def _finite(value: Any) -> Any:
    """Return plain data with None for numbers that JSON does not have."""
    if isinstance(value, dict):
        return {key: _finite(each) for key, each in value.items()}
    if isinstance(value, list):
        return [_finite(each) for each in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def tree_name(tree: int) -> str:
    """Name a tree: `tree 0 (start)`."""
    return f"tree {tree} ({_NAMES[tree]})" if tree in _NAMES else f"tree {tree}"
