"""Slow twins of the tree planners: plain Python, from the papers and the settings' docstrings.

A twin draws the same random numbers as the compiled loop and emits the same events.
Nearest nodes, nodes near and costs are found by looking at every node; collisions are decided by
exact arithmetic. A log is a list of tuples: kind, iteration, and the kind's fields.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np

from brrt.events import FIELDS, Events, Kind, Phase, Reason, Source, Stage, Status
from brrt.planners.base.problem import Problem
from brrt.scenario.contract import Near
from tests.support import naive

Point = tuple[float, ...]
Event = tuple[Any, ...]


def rows_of(events: Events) -> list[Event]:
    """A recorded log, as twins have it."""
    rows = []
    for kind, table in events.tables.items():
        names = [f.name for f in FIELDS[kind]]
        for event in table:
            values = [np.asarray(event[name]).tolist() for name in names]
            rows.append((int(event["seq"]), (kind, int(event["iteration"]), *map(_flat, values))))
    return [event for _, event in sorted(rows)]


def _flat(value: Any) -> Any:
    """Lists as tuples, all the way down."""
    return tuple(map(_flat, value)) if isinstance(value, list) else value


def in_order(events: Sequence[Event]) -> list[Event]:
    """Put what one new node brings about for those near it into an order: a log has any."""
    ordered: list[Event] = []
    group: list[Event] = []
    newest = None
    for event in events:
        kind, _, tree, *rest = event
        serves = kind is Kind.REWIRE and newest == (tree, rest[1])
        fails = kind is Kind.REJECT and rest[1] == Reason.NEAR_BLOCKED and newest == (tree, rest[0])
        if serves or fails:
            group.append(event)
            continue
        ordered += sorted(group)
        group = []
        ordered.append(event)
        if kind is Kind.EDGE:
            newest = (tree, rest[0])
    return ordered + sorted(group)


def distance(a: Point, b: Point) -> float:
    """Euclidean, summed axis by axis."""
    return math.sqrt(squared(a, b))


def squared(a: Point, b: Point) -> float:
    """Square of the distance."""
    total = 0.0
    for x, y in zip(a, b, strict=True):
        total += (y - x) * (y - x)
    return total


@dataclass
class Tree:
    """Nodes with parents; costs are computed on demand."""

    q: list[Point]
    parent: list[int] = field(default_factory=lambda: [-1])

    def nearest(self, q: Point) -> int:
        """The first of the nodes that are nearest."""
        return min(range(len(self.q)), key=lambda node: squared(self.q[node], q))

    def branch(self, node: int) -> list[Point]:
        """Configurations from a node to the root."""
        points = []
        while node >= 0:
            points.append(self.q[node])
            node = self.parent[node]
        return points

    def cost(self, node: int) -> float:
        """Length of the branch, summed from the root on."""
        points, total = self.branch(node)[::-1], 0.0
        for a, b in pairwise(points):
            total += distance(a, b)
        return total


class Twin:
    """What all twins share: draws, trees, and a log.

    Args:
        problem: Robot, world, start and goal.
        seed: Of the draws.
        step: Longest edge.
        trees: One or two.
    """

    def __init__(self, problem: Problem, seed: int, step: float, trees: int) -> None:
        self.world, self.step = problem.world, step
        self.start, self.goal = tuple(problem.start.tolist()), tuple(problem.goal.tolist())
        self.lower, self.upper = tuple(self.world.lower.tolist()), tuple(self.world.upper.tolist())
        self.random = np.random.Generator(np.random.PCG64(seed)).random
        self.trees = [Tree([root]) for root in (self.start, self.goal)[:trees]]
        self.newest = [0] * trees
        self.iteration = 0
        self.log: list[Event] = []
        self.emit(Kind.PHASE, Phase.PLAN, Status.BEGIN)
        for which, tree in enumerate(self.trees):
            self.emit(Kind.EDGE, which, 0, -1, 0.0, tree.q[0])

    def emit(self, kind: Kind, *fields: Any) -> None:
        """Append an event."""
        self.log.append((kind, self.iteration, *fields))

    def free(self, a: Point, b: Point) -> bool:
        """Whether a motion is free of obstacles."""
        return not naive.hits(self.world, a, b)

    def uniform(self) -> Point:
        """Draw from the bounds."""
        bounds = zip(self.lower, self.upper, strict=True)
        return tuple(min(low + (high - low) * self.random(), high) for low, high in bounds)

    def steer(self, a: Point, b: Point) -> Point:
        """At most a step from a towards b."""
        far = distance(a, b)
        if far <= self.step:
            return b
        part = self.step / far
        moved = [x + (y - x) * part for x, y in zip(a, b, strict=True)]
        return tuple(map(min, map(max, moved, self.lower), self.upper))

    def add(self, which: int, parent: int, q: Point) -> int:
        """Let a node join a tree."""
        tree = self.trees[which]
        tree.q.append(q)
        tree.parent.append(parent)
        node = self.newest[which] = len(tree.q) - 1
        self.emit(Kind.EDGE, which, node, parent, tree.cost(node), q)
        return node

    def path(self, node: int, other: int | None = None) -> tuple[Point, ...]:
        """From the start over a node of tree 0, and on over one of tree 1."""
        there = self.trees[0].branch(node)[::-1]
        back = [] if other is None else self.trees[1].branch(other)
        return (*there, *(back[1:] if back and back[0] == there[-1] else back))


class BiRRT(Twin):
    """Kuffner and LaValle 2000; see `brrt.planners.bi_rrt`."""

    def __init__(self, problem: Problem, seed: int, settings: dict[str, Any]) -> None:
        super().__init__(problem, seed, settings["step"], 2)
        self.settings = settings
        self.turn = 0

    def run(self, iterations: int) -> list[Event]:
        """The whole log of a run."""
        near = distance(self.start, self.goal) <= self.step
        solved = near and self.head_for_newest(1)
        while not solved and self.iteration < iterations:
            self.iteration += 1
            solved = self.iterate()
        self.emit(Kind.PHASE, Phase.PLAN, Status.SOLVED if solved else Status.ITERATION_LIMIT)
        return self.log

    def iterate(self) -> bool:
        """One draw and what comes of it; whether the trees have met."""
        turn = self.settings["turn"]
        if turn == "coin" and self.random() < 0.5:
            other = 1 - self.turn
            target = self.trees[other].q[self.newest[other]]
            self.emit(Kind.SAMPLE, self.turn, Source.OTHER_TREE, target)
            return self.head_for_newest(self.turn)
        sizes = [len(tree.q) for tree in self.trees]
        if turn == "smaller" and sizes[0] != sizes[1]:
            self.turn = sizes.index(min(sizes))
        elif self.iteration > 1:
            self.turn = 1 - self.turn
        sample = self.uniform()
        self.emit(Kind.SAMPLE, self.turn, Source.UNIFORM, sample)
        grew = self.grow(self.turn, sample)
        if turn != "coin" and (grew or self.settings["always_link"]):
            return self.head_for_newest(1 - self.turn)
        return False

    def grow(self, which: int, sample: Point) -> bool:
        """Extend a tree towards a sample, once or until it is reached or blocked."""
        tree = self.trees[which]
        near, grew = tree.nearest(sample), False
        while True:
            new = self.steer(tree.q[near], sample)
            if new == tree.q[near]:
                self.emit(Kind.REJECT, which, near, Reason.NO_PROGRESS, new)
                return grew
            if not self.free(tree.q[near], new):
                self.emit(Kind.REJECT, which, near, Reason.COLLISION, new)
                return grew
            near, grew = self.add(which, near, new), True
            if new == sample or self.settings["grow"] == "extend":
                return True

    def head_for_newest(self, which: int) -> bool:
        """Extend a tree towards the other's newest node; where it is reached there is a path."""
        tree, other = self.trees[which], self.trees[1 - which]
        target = other.q[self.newest[1 - which]]
        near = tree.nearest(target)
        while True:
            new = self.steer(tree.q[near], target)
            if not self.free(tree.q[near], new):
                reason = Reason.LINK_BLOCKED if new == target else Reason.COLLISION
                self.emit(Kind.REJECT, which, near, reason, new)
                return False
            if new == target:
                self.meet(which, near)
                return True
            if new == tree.q[near]:
                self.emit(Kind.REJECT, which, near, Reason.NO_PROGRESS, new)
                return False
            near = self.add(which, near, new)
            if self.settings["link"] == "extend":
                return False

    def meet(self, which: int, node: int) -> None:
        """A node of one tree, and the newest one of the other, close the gap."""
        self.newest[which] = node
        ours, theirs = self.newest
        costs = [tree.cost(end) for tree, end in zip(self.trees, self.newest, strict=True)]
        gap = distance(self.trees[0].q[ours], self.trees[1].q[theirs])
        cost = costs[0] + gap + costs[1]
        self.emit(Kind.CONNECT, ours, theirs, cost)
        self.emit(Kind.PATH, Stage.RAW, cost, self.path(ours, theirs))


class Star(Twin):
    """What RRT* with one tree and with two have in common (Karaman and Frazzoli 2011)."""

    def __init__(
        self, problem: Problem, seed: int, settings: dict[str, Any], near: Near, trees: int
    ) -> None:
        super().__init__(problem, seed, near.longest, trees)
        self.settings, self.near = settings, near
        self.best = math.inf

    def run(self, iterations: int) -> list[Event]:
        """The whole log of a run."""
        self.begin()
        self.report()
        while self.iteration < iterations and not self.done:
            self.iteration += 1
            self.iterate()
            self.report()
        status = Status.SOLVED if self.done else Status.ITERATION_LIMIT
        self.emit(Kind.PHASE, Phase.PLAN, status)
        return self.log

    @property
    def done(self) -> bool:
        """Whether there is a path, and one is enough."""
        return self.best < math.inf and bool(self.settings["stop_at_first"])

    def begin(self) -> None:
        """What there is to do before the first draw."""
        raise NotImplementedError

    def iterate(self) -> None:
        """One draw and what comes of it."""
        raise NotImplementedError

    def found(self) -> tuple[float, int, int | None]:
        """The best path that is known: its cost, and where the trees are left for the goal."""
        raise NotImplementedError

    def report(self) -> None:
        """Say that there is a better path, if there is one."""
        cost, node, other = self.found()
        if cost < self.best:
            stage = Stage.RAW if self.best == math.inf else Stage.IMPROVED
            self.emit(Kind.PATH, stage, cost, self.path(node, other))
            self.best = cost

    def sample(self, which: int) -> Point:
        """Draw from all that may be of use."""
        informed = self.settings["informed"] and self.best < math.inf
        target = self.from_ellipsoid() if informed else self.uniform()
        source = Source.INFORMED if informed else Source.UNIFORM
        self.emit(Kind.SAMPLE, which, source, target)
        return target

    def from_ellipsoid(self) -> Point:
        """Gammell 2014: stretch a point of the unit ball, turn it, move it; inside the bounds.

        It is turned by the reflection that takes the first axis to the line from start to goal.
        """
        start, goal, d = self.start, self.goal, len(self.start)
        square = 0.0
        for k in range(d):
            square += (goal[k] - start[k]) * (goal[k] - start[k])
        focal = math.sqrt(square)
        normal = [0.0] * d
        if focal > 0:
            normal = [float(k == 0) - (goal[k] - start[k]) / focal for k in range(d)]
        norm = 0.0
        for x in normal:
            norm += x * x
        axes = [0.5 * self.best]
        axes += [0.5 * math.sqrt(max(0.0, self.best * self.best - square))] * (d - 1)
        for _ in range(1000):
            ball = [2.0] * d
            while sum(x * x for x in ball) > 1:
                ball = [2.0 * self.random() - 1.0 for _ in range(d)]
            stretched = [x * axis for x, axis in zip(ball, axes, strict=True)]
            dot = 0.0
            for x, y in zip(normal, stretched, strict=True):
                dot += x * y
            if norm > 0:
                stretched = [
                    x - 2.0 * dot / norm * y for x, y in zip(stretched, normal, strict=True)
                ]
            moved = [x + 0.5 * (start[k] + goal[k]) for k, x in enumerate(stretched)]
            inside = tuple(map(min, map(max, moved, self.lower), self.upper))
            if inside == tuple(moved):
                break
        return inside

    def extend(self, which: int, target: Point) -> int | None:
        """Steer, choose a parent, add, rewire; return the new node."""
        tree = self.trees[which]
        nearest = tree.nearest(target)
        new = self.steer(tree.q[nearest], target)
        if new == tree.q[nearest]:
            self.emit(Kind.REJECT, which, nearest, Reason.NO_PROGRESS, new)
            return None
        if (
            self.settings["informed"]
            and distance(self.start, new) + distance(new, self.goal) >= self.best
        ):
            self.emit(Kind.REJECT, which, nearest, Reason.NO_GAIN, new)
            return None
        if not self.free(tree.q[nearest], new):
            self.emit(Kind.REJECT, which, nearest, Reason.COLLISION, new)
            return None
        radius = float(self.near.radius(np.array([len(tree.q) + 1]))[0])
        near = [n for n, q in enumerate(tree.q) if distance(q, new) <= radius]
        parent, blocked = self.choose_parent(which, nearest, near, new)
        node = self.add(which, parent, new)
        for other in near:
            if other in blocked:
                continue
            if tree.cost(node) + distance(new, tree.q[other]) < tree.cost(other):
                if self.free(new, tree.q[other]):
                    tree.parent[other] = node
                    self.emit(Kind.REWIRE, which, other, node, tree.cost(other))
                else:
                    self.emit(Kind.REJECT, which, node, Reason.NEAR_BLOCKED, tree.q[other])
        return node

    def choose_parent(
        self, which: int, nearest: int, near: list[int], new: Point
    ) -> tuple[int, set[int]]:
        """The cheapest free way to the new node, and the nodes that cannot see it."""
        tree, blocked = self.trees[which], set[int]()
        cost = {n: tree.cost(n) + distance(tree.q[n], new) for n in {nearest, *near}}
        for n in sorted(near, key=lambda n: cost[n]):
            if cost[n] >= cost[nearest]:
                break
            if self.free(tree.q[n], new):
                return n, blocked
            blocked.add(n)
            self.emit(Kind.REJECT, which, n, Reason.NEAR_BLOCKED, new)
        return nearest, blocked


class RRTStar(Star):
    """One tree; see `brrt.planners.rrt_star`."""

    def __init__(self, problem: Problem, seed: int, settings: dict[str, Any], near: Near) -> None:
        super().__init__(problem, seed, settings, near, 1)
        self.at_goal: int | None = None
        self.within_reach = False

    def begin(self) -> None:
        """The start may be the goal, or a step away."""
        self.look_at(0)

    def look_at(self, node: int) -> None:
        """Whether a new node is at the goal, or can reach it."""
        far = distance(self.trees[0].q[node], self.goal)
        if self.at_goal is None and far == 0:
            self.at_goal = node
        self.within_reach = far <= self.step

    def iterate(self) -> None:
        """Draw the goal where it is within reach, and by chance; or a sample."""
        if self.at_goal is None and (
            self.within_reach or self.random() < self.settings["goal_bias"]
        ):
            self.within_reach = False
            target = self.goal
            self.emit(Kind.SAMPLE, 0, Source.GOAL, target)
        else:
            target = self.sample(0)
        node = self.extend(0, target)
        if node is not None:
            self.look_at(node)

    def found(self) -> tuple[float, int, int | None]:
        """The branch to the goal."""
        if self.at_goal is None:
            return math.inf, -1, None
        return self.trees[0].cost(self.at_goal), self.at_goal, None


class BiRRTStar(Star):
    """Two trees; see `brrt.planners.bi_rrt_star`."""

    def __init__(self, problem: Problem, seed: int, settings: dict[str, Any], near: Near) -> None:
        super().__init__(problem, seed, settings, near, 2)
        self.links: list[tuple[int, int]] = []
        self.shortest: tuple[int, int] | None = None
        self.turn = 0

    def begin(self) -> None:
        """The roots are the newest nodes."""
        self.link()

    def iterate(self) -> None:
        """Grow one tree towards a sample, the other towards what has grown."""
        if self.iteration > 1:
            self.turn = 1 - self.turn
        node = self.extend(self.turn, self.sample(self.turn))
        if node is not None:
            self.extend(1 - self.turn, self.trees[self.turn].q[node])
            self.link()

    def link(self) -> None:
        """Join the newest nodes where they are close and see each other."""
        ours, theirs = self.newest
        a, b = self.trees[0].q[ours], self.trees[1].q[theirs]
        if distance(a, b) > (self.settings["connect_distance"] or self.step):
            return
        if not self.free(a, b):
            self.emit(Kind.REJECT, 0, ours, Reason.LINK_BLOCKED, b)
            return
        self.links.append((ours, theirs))
        self.emit(Kind.CONNECT, ours, theirs, self.over((ours, theirs)))

    def over(self, link: tuple[int, int]) -> float:
        """Cost of the path over a link."""
        (one, two), (a, b) = self.trees, link
        return one.cost(a) + distance(one.q[a], two.q[b]) + two.cost(b)

    def found(self) -> tuple[float, int, int | None]:
        """The cheapest of the links."""
        if not self.links:
            return math.inf, -1, None
        best = min(self.links, key=self.over)
        if self.shortest is None or self.over(best) < self.over(self.shortest):
            self.shortest = best
        return self.over(self.shortest), *self.shortest
