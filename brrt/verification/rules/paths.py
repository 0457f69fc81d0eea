"""Rules about paths: from start to goal, free, along the trees, and what the smoother makes."""

from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrt.collision.motions import all_clear
from brrt.events import Events, Kind, Phase, Stage, Status, Table
from brrt.replay.graph import LinkHistory
from brrt.replay.text import vectors
from brrt.replay.tree_fold import DETACHED
from brrt.verification.context import Context
from brrt.verification.rule import ANY_PART, Rule
from brrt.verification.tree_history import TreeHistory

Floats = NDArray[np.float64]
Place = tuple[float, ...]

_NEVER = 1 << 62

MOST = 20_000
"""Refused shortcuts that are judged, spread over the log."""


class PathEnds(Rule):
    name = "path ends"
    promise = "Paths lead from the start to the goal, or as close to it as claimed."

    def finish(self) -> None:
        start, goal = self.context.start, self.context.goal
        for event, path in self.context.paths:
            wrong = None
            if not len(path):
                wrong = "a path without waypoints"
            elif (path[0] != start).any():
                wrong = "begins at {}; the start is {}".format(*vectors(path[0], start))
            elif (path[-1] != goal).any() and not self._reaches(path[-1]):
                wrong = "ends at {}; the goal is {}".format(*vectors(path[-1], goal))
            self.judge_one(event, wrong)

    def _reaches(self, q: Floats) -> bool:
        """Whether a path may end at a configuration by the claims."""
        context, tolerance = self.context, self.context.claims.goal_tolerance
        far = context.distance(q[None], context.goal[None])
        return tolerance > 0 and bool(context.at_most(far, tolerance)[0])


class PathsFree(Rule):
    name = "paths free"
    promise = "Every motion of every path is free of obstacles."
    assumes = ("motions", "collisions")

    def finish(self) -> None:
        context, paths = self.context, self.context.paths
        if not paths:
            return
        starts = np.concatenate([path[:-1] for _, path in paths])
        hits = context.first_hits(starts, np.concatenate([path[1:] for _, path in paths]))
        ends = np.cumsum([max(len(path) - 1, 0) for _, path in paths])
        for (event, path), hit in zip(paths, np.split(hits, ends[:-1]), strict=True):
            wrong = None
            if (hit >= 0).any():
                i = int(np.argmax(hit >= 0))
                wrong = f"motion {i} hits {context.hit_text(path[i], path[i + 1], int(hit[i]))}"
            self.judge_one(event, wrong)


class PathCosts(Rule):
    name = "path costs"
    promise = "A path's cost is its length in the robot's metric; no less if motions are own."
    assumes = ("costs",)

    def finish(self) -> None:
        for event, path in self.context.paths:
            length = self.context.distance(path[:-1], path[1:]).sum()
            right = bool(self.context.right_cost(event["cost"], length))
            wrong = f"the cost is {event['cost']:.12g}; the length, {length:.12g}"
            self.judge_one(event, None if right else wrong)


class PathsImprove(Rule):
    name = "paths improve"
    promise = (
        "The first path is raw, and later ones cost less. Planners that stop report one path, "
        "LRTA* one in each trial."
    )

    def finish(self) -> None:
        contract, before = self.context.contract, None
        only_one = contract.stops is True or (contract.lattice is not None and not contract.learns)
        for event, _ in self.context.planned_paths:
            cost, stage, wrong = float(event["cost"]), int(event["stage"]), None
            due = Stage.RAW if before is None or contract.learns else Stage.IMPROVED
            if before is not None and stage == Stage.IMPROVED and not cost < before:
                wrong = f"cost {cost:.12g} after {before:.12g}"
            elif before is not None and only_one:
                wrong = "a second path of a planner that stops at the first"
            elif self.context.has_contract and stage != due:
                wrong = f"has stage {stage}, not {due.label}"
            self.judge_one(event, wrong)
            before = cost


class PathsInTrees(Rule):
    name = "paths in trees"
    promise = "The motions of a path are edges of trees or graphs at that moment, or links."
    needs = ANY_PART
    kind = Kind.EDGE
    assumes = ("times",)

    def finish(self) -> None:
        paths = self.context.planned_paths
        wanted = {place for _, path in paths for place in _places(path)}
        trees = [_Edges(tree, self.context.events, wanted) for tree in self.context.trees]
        links = _links(self.context)
        for event, path in paths if trees else ():
            for tree in trees:
                tree.advance(int(event["seq"]))
            loose = [
                i
                for i, (a, b) in enumerate(pairwise(_places(path)))
                if not any(tree.joins(a, b) for tree in trees)
                and links.get((a, b), _NEVER) >= event["seq"]
            ]
            self.judge_one(
                event, f"motion {loose[0]} is neither an edge nor a link" if loose else None
            )


def _places(path: Any) -> list[Place]:
    """Return configurations as keys."""
    return [tuple(q) for q in np.asarray(path).tolist()]


class _Edges:
    """The edges of a tree or graph at some event, and which nodes are at some places."""

    def __init__(self, tree: TreeHistory, events: Events, wanted: set[Place]) -> None:
        self.tree, self.done, self.seq = tree, 0, 0
        self.links = LinkHistory(events, tree.number, len(tree))
        self.connected = tree.connected | (tree.changes.parent == DETACHED)
        self.parent = np.full(len(tree), -1, np.int64)
        self.nodes: dict[Place, list[int]] = {}
        # The first coordinate alone excludes most nodes of a large tree.
        some = np.unique([place[0] for place in wanted])
        x = tree.q[:, 0]
        at = np.minimum(np.searchsorted(some, x), len(some) - 1)
        near = np.flatnonzero(some[at] == x) if len(some) else np.empty(0, np.int64)
        for node, place in zip(near.tolist(), _places(tree.q[near]), strict=True):
            if place in wanted:
                self.nodes.setdefault(place, []).append(node)

    def advance(self, seq: int) -> None:
        """Make the changes before an event."""
        changes = self.tree.changes
        end = int(np.searchsorted(changes.seq, seq))
        rows = np.arange(self.done, end)[self.connected[self.done : end]]
        self.parent[changes.node[rows]] = changes.parent[rows]  # the last of several counts
        self.done, self.seq = max(self.done, end), seq

    def joins(self, a: Place, b: Place) -> bool:
        """Return whether one of two places is the other's parent, or a link joins them."""
        ours, theirs = self.nodes.get(a, []), self.nodes.get(b, [])
        up = {(node, int(self.parent[node])) for node in ours + theirs}
        if any((x, y) in up or (y, x) in up for x in ours for y in theirs):
            return True
        ends = np.array([(x, y) for x in ours for y in theirs], np.int64).reshape(-1, 2)
        seq = np.full(len(ends), self.seq)
        return bool(self.links.at(ends[:, 0], ends[:, 1], seq).any())


def _links(context: Context) -> dict[tuple[Place, Place], int]:
    """Return the number of the first link between two places, in both directions."""
    trees = {tree.number: tree for tree in context.trees}
    found: dict[tuple[Place, Place], int] = {}
    for link in context.events[Kind.CONNECT] if {0, 1} <= trees.keys() else ():
        start, goal = int(link["node"]), int(link["other"])
        if 0 <= start < len(trees[0]) and 0 <= goal < len(trees[1]):
            a, b = (tuple(q.tolist()) for q in (trees[0].q[start], trees[1].q[goal]))
            found.setdefault((a, b), int(link["seq"]))
            found.setdefault((b, a), int(link["seq"]))
    return found


class Shortcuts(Rule):
    name = "shortcuts"
    promise = (
        "Shortcuts replace what is between two waypoints by a free motion, at no more cost; the "
        "motions of refused ones are not free."
    )
    assumes = ("motions", "costs", "collisions")

    def finish(self) -> None:
        context = self.context
        path, cost, due = np.empty((0, context.dof)), np.inf, context.planned_paths
        table = context.events[Kind.SHORTCUT]
        ends, every = np.full((2, len(table), context.dof), np.nan), -(-len(table) // MOST)
        for row, event in enumerate(table):
            while due and due[0][0]["seq"] < event["seq"]:
                first, path = due.pop(0)
                cost = float(first["cost"])
            wrong, shorter = self._attempt(event, path, cost)
            self.judge_one(event, wrong)
            if wrong is None and not event["accepted"] and row % every == 0:
                ends[:, row] = path[event["i"]], path[event["j"]]
            path, cost = shorter, float(event["cost"])
        rows = np.flatnonzero(np.isfinite(ends[0, :, 0]))
        a, b = ends[:, rows]
        for row in rows[all_clear(context.obstacles, context.robot, a, b)].tolist():
            i, j = table["i"][row], table["j"][row]
            message = f"refused, but the motion from waypoint {i} to {j} is clear"
            self.result.add_finding(table[row], message)

    def _attempt(self, event: Any, path: Floats, cost: float) -> tuple[str | None, Floats]:
        """Make an attempt; return what is wrong with it, and the path after it."""
        context, i, j, after = self.context, int(event["i"]), int(event["j"]), float(event["cost"])
        if not 0 <= i < j < len(path):
            return f"waypoints {i} and {j} are not a pair of a path of {len(path)}", path
        if j == i + 1:
            return f"there is nothing between waypoints {i} and {j}", path
        if event["accepted"]:
            hit = int(context.first_hits(path[i][None], path[j][None])[0])
            if hit >= 0:
                where = context.hit_text(path[i], path[j], hit)
                return f"the motion from waypoint {i} to {j} hits {where}", path
            path = np.concatenate([path[: i + 1], path[j:]])
        length = np.asarray(context.distance(path[:-1], path[1:]).sum())
        if not after <= cost * (1 + 1e-12):
            return f"the cost rises from {cost:.12g} to {after:.12g}", path
        if not context.equal(np.asarray(after), length):
            return f"the cost is {after:.12g}; the length, {length:.12g}", path
        return None, path


class Smoothed(Rule):
    name = "smoothed"
    promise = "The smoother reports one path, what the accepted shortcuts leave, at no more cost."

    def finish(self) -> None:
        for event, raw, path, attempts in self._smoothed():
            wrong = None
            if raw is None:
                wrong = "there is no path to smooth"
            elif not float(event["cost"]) <= raw[0] * (1 + 1e-12):
                wrong = f"costs {event['cost']:.12g}, more than {raw[0]:.12g} before"
            elif not np.array_equal(_shortened(raw[1], attempts), path):
                wrong = "not the path that the shortcuts leave"
            self.judge_one(event, wrong)
        phases = self.context.events[Kind.PHASE]
        ends = phases[(phases["name"] == Phase.SMOOTH) & (phases["status"] != Status.BEGIN)]
        count = sum(event["stage"] == Stage.SMOOTHED for event, _ in self.context.paths)
        if len(ends) and count != len(ends):
            self.judge_one(ends[-1], f"the smoother has reported {count} paths, not {len(ends)}")

    def _smoothed(self) -> Iterator[tuple[Any, tuple[float, Floats] | None, Floats, Table]]:
        """Yield each smoothed path: event, cost and waypoints before, waypoints, attempts."""
        table, raw, done = self.context.events[Kind.SHORTCUT], None, 0
        for event, path in self.context.paths:
            if event["stage"] == Stage.SMOOTHED:
                end = int(np.searchsorted(table["seq"], event["seq"]))
                yield event, raw, path, table[done:end]
                done = end
            else:
                raw = float(event["cost"]), path


def _shortened(path: Floats, attempts: Table) -> Floats:
    """Make the accepted shortcuts that can be made."""
    for event in attempts[attempts["accepted"]]:
        i, j = int(event["i"]), int(event["j"])
        if 0 <= i < j < len(path):
            path = np.concatenate([path[: i + 1], path[j:]])
    return path


RULES = (PathEnds, PathsFree, PathCosts, PathsImprove, PathsInTrees, Shortcuts, Smoothed)
