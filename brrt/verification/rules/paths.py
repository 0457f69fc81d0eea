"""Rules about paths: from start to goal, free, along the trees, and what the smoother made."""

from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrt.events import Kind, Phase, Stage, Status
from brrt.replay.tree_fold import VALID
from brrt.verification.context import Context
from brrt.verification.result import RuleResult
from brrt.verification.rules.log import text

Floats = NDArray[np.float64]
Place = tuple[float, ...]


def path_ends(context: Context, result: RuleResult) -> None:
    """Paths lead from the start to the goal."""
    for event, path in context.paths:
        wrong = None
        if not len(path):
            wrong = "a path without waypoints"
        elif (path[0] != context.start).any():
            wrong = f"begins at {text(path[0])}; the start is {text(context.start)}"
        elif (path[-1] != context.goal).any():
            wrong = f"ends at {text(path[-1])}; the goal is {text(context.goal)}"
        result.one(event, wrong)


def paths_free(context: Context, result: RuleResult) -> None:
    """Every motion of every path is free of obstacles."""
    ways = [path for _, path in context.paths]
    if not ways:
        return
    starts = np.concatenate([path[:-1] for path in ways])
    hits = context.blocked(starts, np.concatenate([path[1:] for path in ways]))
    ends = np.cumsum([max(len(path) - 1, 0) for path in ways])
    for (event, _), hit in zip(context.paths, np.split(hits, ends[:-1]), strict=True):
        bad = np.flatnonzero(hit >= 0)
        name = context.obstacles.name(int(hit[bad[0]])) if len(bad) else ""
        result.one(event, f"motion {bad[0]} hits {name}" if len(bad) else None)


def path_costs(context: Context, result: RuleResult) -> None:
    """A path's cost is its length in the robot's metric."""
    for event, path in context.paths:
        length, stated = context.distance(path[:-1], path[1:]).sum(), float(event["cost"])
        right = bool(context.same(np.asarray(stated), np.asarray(length)))
        said = f"said to cost {stated:.12g}; it is {length:.12g} long"
        result.one(event, None if right else said)


def paths_improve(context: Context, result: RuleResult) -> None:
    """The first path that a planner finds is raw, the others cost less; who stops finds but one.

    Of a robot that learns as it goes each trial's path is raw.
    """
    contract, before = context.contract, None
    learns = contract.learns
    one = contract.stops is True or (contract.lattice is not None and not learns)
    for event, _ in context.found:
        cost, stage, wrong = float(event["cost"]), int(event["stage"]), None
        due = Stage.RAW if before is None or learns else Stage.IMPROVED
        if before is not None and stage == Stage.IMPROVED and not cost < before:
            wrong = f"cost {cost:.12g} after {before:.12g}"
        elif before is not None and one:
            wrong = "another path, of a planner that stops at the first"
        elif context.known and stage != due:
            wrong = f"said to be of stage {stage}; it is {due.label}"
        result.one(event, wrong)
        before = cost


def paths_in_trees(context: Context, result: RuleResult) -> None:
    """The motions of a tree planner's path are edges, as parents were then, or links."""
    if not context.known or not len(context.events[Kind.EDGE]):
        return
    wanted = {place for _, path in context.found for place in _places(path)}
    trees = [_Parents(context, number, wanted) for number in range(len(context.trees))]
    links = _links(context, trees)
    for event, path in context.found:
        for tree in trees:
            tree.advance(int(event["seq"]))
        places = _places(path)
        loose = [
            i
            for i, (a, b) in enumerate(pairwise(places))
            if not (
                any(tree.joins(a, b) for tree in trees) or links.get((a, b), 1 << 62) < event["seq"]
            )
        ]
        result.one(event, f"motion {loose[0]} is no edge of a tree and no link" if loose else None)


def _places(path: Any) -> list[Place]:
    """Configurations as keys."""
    return [tuple(q) for q in np.asarray(path).tolist()]


class _Parents:
    """The parents of a tree as they stand at some event, and which nodes are at some places."""

    def __init__(self, context: Context, number: int, wanted: set[Place]) -> None:
        tree = context.trees[number]
        self.q = np.asarray(tree.edges["q"])
        self.made = tree.changes
        self.sound = (tree.fold.verdict == VALID) & (tree.changes.parent >= 0)
        self.parent = np.full(len(tree.edges), -1, np.int64)
        self.done = 0
        self.nodes: dict[Place, list[int]] = {}
        # Looking at one coordinate first leaves few of a large tree's nodes.
        some = np.unique([place[0] for place in wanted])
        x = self.q[:, 0]
        at = np.minimum(np.searchsorted(some, x), len(some) - 1)
        near = np.flatnonzero(some[at] == x) if len(some) else np.empty(0, np.int64)
        for node, place in zip(near.tolist(), _places(self.q[near]), strict=True):
            if place in wanted:
                self.nodes.setdefault(place, []).append(node)

    def advance(self, seq: int) -> None:
        """Make the changes up to an event."""
        end = int(np.searchsorted(self.made.seq, seq))
        some = np.arange(self.done, end)[self.sound[self.done : end]]
        # Of several parents of one node numpy keeps the last.
        self.parent[self.made.node[some]] = self.made.parent[some]
        self.done = max(self.done, end)

    def joins(self, a: Place, b: Place) -> bool:
        """Whether one of the places is the other's parent."""
        ours, theirs = self.nodes.get(a, []), self.nodes.get(b, [])
        up = {(node, int(self.parent[node])) for node in ours + theirs}
        return any((x, y) in up or (y, x) in up for x in ours for y in theirs)


def _links(context: Context, trees: list[_Parents]) -> dict[tuple[Place, Place], int]:
    """Pairs of places that a link joins, and the number of its event."""
    by_number = {tree.number: at.q for tree, at in zip(context.trees, trees, strict=True)}
    found: dict[tuple[Place, Place], int] = {}
    for link in context.events[Kind.CONNECT]:
        ends = []
        for number, name in ((0, "node"), (1, "other")):
            q = by_number.get(number, np.empty((0, context.dof)))
            if 0 <= link[name] < len(q):
                ends.append(tuple(q[link[name]].tolist()))
        if len(ends) == 2:
            found.setdefault((ends[0], ends[1]), int(link["seq"]))
            found.setdefault((ends[1], ends[0]), int(link["seq"]))
    return found


def shortcuts(context: Context, result: RuleResult) -> None:
    """Shortcuts replace what lies between two waypoints by a free motion; the cost never rises."""
    table = context.events[Kind.SHORTCUT]
    path, cost, due = np.empty((0, context.dof)), np.inf, list(context.found)
    for event in table:
        while due and due[0][0]["seq"] < event["seq"]:
            first, path = due.pop(0)
            cost = float(first["cost"])
        wrong, path = _attempt(context, event, path, cost)
        result.one(event, wrong)
        cost = float(event["cost"])


def _attempt(context: Context, event: Any, path: Floats, cost: float) -> tuple[str | None, Floats]:
    """Make one attempt; return what is wrong with it, and the path after it."""
    i, j = int(event["i"]), int(event["j"])
    if not 0 <= i < j < len(path):
        return f"waypoints {i} and {j} are no pair of a path with {len(path)}", path
    if event["accepted"] and (hit := int(context.blocked(path[i][None], path[j][None])[0])) >= 0:
        name = context.obstacles.name(hit)
        return f"the motion from waypoint {i} to {j} hits {name}", path
    if event["accepted"]:
        path = np.concatenate([path[: i + 1], path[j:]])
    after = float(event["cost"])
    length = np.asarray(context.distance(path[:-1], path[1:]).sum())
    if not after <= cost * (1 + 1e-12):
        return f"the cost rises from {cost:.12g} to {after:.12g}", path
    if not context.same(np.asarray(after), length):
        return f"said to cost {after:.12g}; the path is {length:.12g} long", path
    return None, path


def smoothed(context: Context, result: RuleResult) -> None:
    """One smoothed path is told: what the accepted shortcuts leave; it costs no more."""
    table, raw = context.events[Kind.SHORTCUT], None
    done = 0
    for event, path in context.paths:
        if event["stage"] != Stage.SMOOTHED:
            raw = (float(event["cost"]), path)
            continue
        end = int(np.searchsorted(table["seq"], event["seq"]))
        attempts, done = table[done:end], end
        if raw is None:
            result.one(event, "there was no path to smooth")
            continue
        left = _shortened(raw[1], attempts)
        wrong = None if np.array_equal(left, path) else "not the path that the shortcuts leave"
        if not float(event["cost"]) <= raw[0] * (1 + 1e-12):
            wrong = f"costs {event['cost']:.12g}, more than {raw[0]:.12g} before"
        result.one(event, wrong)
    phases = context.events[Kind.PHASE]
    ends = phases[(phases["name"] == Phase.SMOOTH) & (phases["status"] != Status.BEGIN)]
    told = sum(event["stage"] == Stage.SMOOTHED for event, _ in context.paths)
    if len(ends) and told != len(ends):
        result.one(ends[-1], f"the smoother has told {told} paths, not one")


def _shortened(path: Floats, attempts: NDArray[np.void]) -> Floats:
    """Make the accepted shortcuts that can be made."""
    for event in attempts[attempts["accepted"]]:
        i, j = int(event["i"]), int(event["j"])
        if 0 <= i < j < len(path):
            path = np.concatenate([path[: i + 1], path[j:]])
    return path


RULES = (
    path_ends, paths_free, path_costs, paths_improve, paths_in_trees, shortcuts, smoothed,
)  # fmt: skip
"""All rules of this file; see `brrt.verification`."""
