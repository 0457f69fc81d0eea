"""Small planners that are not brrt's own, recorded by `brrt.record` as their authors would."""

import heapq
import math
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from brrt import Contract, Kind, Polygon, Recorder, World, read, record
from brrt.scenario.contract import Draws, Growth
from tests.support.cases import Case

Floats = np.ndarray[Any, np.dtype[np.float64]]

BALLS = np.array([[5.0, 5.0, 1.5], [2.0, 7.0, 1.0], [8.0, 2.5, 1.2]])


def world_of(
    name: str, size: float, start: list[float], goal: list[float], **obstacles: Any
) -> World:
    """A square world."""
    ends = np.zeros(2), np.full(2, size)
    return World(name, *ends, start=np.array(start), goal=np.array(goal), **obstacles)


FIELD = world_of("field", 10, [1, 1], [9, 9], balls=BALLS)
LOT = world_of("lot", 20, [2, 2], [17, 3], boxes=np.array([[8.0, 0.0, 10.0, 12.0]]))

STEP, GOAL = 1.5, np.array([9.0, 9.0])


def free(a: Floats, b: Floats) -> bool:
    """Whether a segment in the field keeps off all balls."""
    step, offset = b - a, BALLS[:, :2] - a
    part = np.clip(offset @ step / max(float(step @ step), 1e-12), 0, 1)
    gap = np.hypot(*(offset - part[:, None] * step).T)
    return bool((gap > BALLS[:, 2] + 1e-6).all())


def way(node: int, parent: list[int]) -> list[int]:
    """The nodes from the root to a node."""
    found = [node]
    while parent[found[-1]] >= 0:
        found.append(parent[found[-1]])
    return found[::-1]


def steered(q: Floats, target: Floats) -> Floats:
    """A point at most a step from q on the way to the target."""
    far = math.dist(q, target)
    return target if far <= STEP else q + (target - q) * (STEP / far)


def rrt(rec: Recorder, *, samples: bool = True) -> None:
    """RRT, which counts its own iterations."""
    rng, nodes, parent = np.random.default_rng(3), [np.array([1.0, 1.0])], [-1]
    rec.edge(nodes[0])
    for iteration in range(1, 500):
        to_goal = rng.random() < 0.1
        target = GOAL if to_goal else rng.uniform(0, 10, 2)
        rec.iteration = iteration
        if samples:
            rec.sample(target, "goal" if to_goal else "uniform")
        near = int(np.hypot(*(np.array(nodes) - target).T).argmin())
        q = steered(nodes[near], target)
        if not free(nodes[near], q):
            rec.reject(q, near)
            continue
        nodes.append(q)
        parent.append(near)
        rec.edge(q, near)
        if (q == GOAL).all():
            rec.path([nodes[i] for i in way(len(nodes) - 1, parent)])
            return


def lazy(rec: Recorder) -> None:
    """Lazy RRT: edges are checked once they are on a way to the goal; what hits is abandoned."""
    rng, nodes, parent, dead = np.random.default_rng(1), [np.array([1.0, 1.0])], [-1], {-2}
    rec.edge(nodes[0])
    while len(nodes) < 1000:
        target = GOAL if rng.random() < 0.1 else rng.uniform(0, 10, 2)
        rec.sample(target, "goal" if target is GOAL else "uniform")
        far = np.hypot(*(np.array(nodes) - target).T)
        far[[i for i in range(len(nodes)) if dead.intersection(way(i, parent))]] = np.inf
        near = int(far.argmin())
        nodes.append(steered(nodes[near], target))
        parent.append(near)
        rec.edge(nodes[-1], near)
        if (nodes[-1] != GOAL).any():
            continue
        found = way(len(nodes) - 1, parent)
        for up, node in pairwise(found):
            if not free(nodes[up], nodes[node]):
                rec.reject(nodes[node], up)
                dead.add(node)
                break
        else:
            rec.path([nodes[i] for i in found])
            return


def fmt_star(rec: Recorder) -> None:
    """FMT* (Janson et al. 2015): a batch of samples, joined in the order of their costs."""
    rng, radius = np.random.default_rng(2), 1.8
    q = np.concatenate([[[1.0, 1.0]], rng.uniform(0, 10, (150, 2)), [GOAL]])
    rec.samples(q[1:-1])
    rec.sample(GOAL, "goal")
    number, parent, cost = {0: rec.edge(q[0])}, {0: -1}, {0: 0.0}
    unvisited, open_nodes, z = set(range(1, len(q))), {0}, 0
    while z != len(q) - 1:
        joined = set()
        for x in sorted(i for i in unvisited if math.dist(q[z], q[i]) < radius):
            near = [y for y in sorted(open_nodes) if math.dist(q[y], q[x]) < radius]
            best = min(near, key=lambda y: cost[y] + math.dist(q[y], q[x]))
            if not free(q[best], q[x]):
                rec.reject(q[x], number[best])
                continue
            parent[x], cost[x] = best, cost[best] + math.dist(q[best], q[x])
            number[x] = rec.edge(q[x], number[best], cost=cost[x])
            joined.add(x)
        open_nodes = (open_nodes | joined) - {z}
        unvisited -= joined
        if not open_nodes:
            return
        z = min(open_nodes, key=cost.__getitem__)
    ways = [z]
    while parent[ways[-1]] >= 0:
        ways.append(parent[ways[-1]])
    rec.path(q[ways[::-1]], cost=cost[z])


class BITStar:
    """BIT*-like (Gammell et al. 2015): batches; the best edges first; a snapshot after each."""

    def __init__(self) -> None:
        self.nodes, self.parent, self.costs = [np.array([1.0, 1.0])], [-1], [0.0]
        self.waiting = [tuple(GOAL.tolist())]
        self.queue: list[tuple[float, int, tuple[float, ...]]] = []

    def __call__(self, rec: Recorder) -> None:
        """Plan, in four batches."""
        rng, reported = np.random.default_rng(5), math.inf
        for _ in range(4):
            batch = rng.uniform(0, 10, (40, 2))
            rec.samples(batch)
            self.waiting += map(tuple, batch.tolist())
            for node in range(len(self.nodes)):
                self.push(node, self.waiting)
            self.search()
            rec.tree(np.array(self.nodes), self.parent)
            if self.best < reported:
                reported = self.best
                rec.path([self.nodes[k] for k in way(self.at(tuple(GOAL)), self.parent)])

    @property
    def best(self) -> float:
        """Cost of the best path."""
        goal = self.at(tuple(GOAL))
        return math.inf if goal < 0 else self.costs[goal]

    def at(self, place: tuple[float, ...]) -> int:
        """The node at a place, -1 for none."""
        return next((k for k, node in enumerate(self.nodes) if tuple(node) == place), -1)

    def push(self, node: int, places: Iterable[tuple[float, ...]]) -> None:
        """Put motions from a node into the queue, by the least cost of a path over each."""
        q, cost = self.nodes[node], self.costs[node]
        for b in places:
            heapq.heappush(self.queue, (cost + math.dist(q, b) + math.dist(b, GOAL), node, b))

    def search(self) -> None:
        """Take motions from the queue until it is empty."""
        while self.queue:
            bound, up, place = heapq.heappop(self.queue)
            q, far = np.array(place), math.dist(self.nodes[up], place)
            if bound >= self.best or far > 3 or not free(self.nodes[up], q):
                continue
            node = self.at(place)
            if node < 0:
                self.nodes.append(q)
                self.parent.append(up)
                self.costs.append(self.costs[up] + far)
                self.waiting.remove(place)
                self.push(len(self.nodes) - 1, [*self.waiting, *map(tuple, self.nodes)])
            elif self.costs[up] + far < self.costs[node] - 1e-9:
                self.parent[node] = up
                self.lower(node, self.costs[node] - self.costs[up] - far)

    def lower(self, node: int, by: float) -> None:
        """Lower the costs of a node and its descendants."""
        self.costs[node] -= by
        for child, up in enumerate(self.parent):
            if up == node:
                self.lower(child, by)


def bit_star(rec: Recorder) -> None:
    """See `BITStar`."""
    BITStar()(rec)


BODY = Polygon(length=1.5, width=0.8)


def arc(q: Floats, curvature: float, length: float) -> Floats:
    """Where a car is after an arc."""
    x, y, t = q
    if curvature == 0:
        return np.array([x + length * math.cos(t), y + length * math.sin(t), t])
    end = t + curvature * length
    x += (math.sin(end) - math.sin(t)) / curvature
    y -= (math.cos(end) - math.cos(t)) / curvature
    return np.array([x, y, (end + math.pi) % (2 * math.pi) - math.pi])


def hybrid_a_star(rec: Recorder) -> None:
    """Hybrid A* (Dolgov et al. 2010): arcs between poses; turns cost more than their length."""

    def key(q: Floats) -> tuple[int, int, int]:
        return int(q[0] / 0.7), int(q[1] / 0.7), int((q[2] + math.pi) / (math.pi / 12))

    body, start, goal = BODY.resolved(LOT), np.array([2.0, 2.0, 0.0]), np.array([17.0, 3.0])
    heap: list[Any] = [(math.dist(start[:2], goal), 0, 0.0, start, -1)]
    nodes, parent, done, pushed = [], [], set(), 0
    while heap:
        _, _, cost, q, up = heapq.heappop(heap)
        if key(q) in done:
            continue
        done.add(key(q))
        nodes.append(q)
        parent.append(up)
        rec.iteration = len(nodes)
        rec.edge(q, up, cost=cost)
        if math.dist(q[:2], goal) < 1.2:
            rec.path([nodes[i] for i in way(len(nodes) - 1, parent)], cost=cost)
            return
        for curvature in (-0.4, 0.0, 0.4):
            track = [arc(q, curvature, far) for far in np.linspace(0.1, 1.5, 15)]
            if any(body.collision(LOT, each) for each in track):
                rec.reject(track[-1], len(nodes) - 1)
                continue
            pushed += 1
            more = 1.5 + abs(curvature)
            left = math.dist(track[-1][:2], goal)
            heapq.heappush(
                heap, (cost + more + left, pushed, cost + more, track[-1], len(nodes) - 1)
            )


RRT_CONTRACT = Contract(
    step=STEP, stops=True, draws=Draws(goal_bias=0.1), growth=Growth()
)  # fmt: skip

HYBRID = {
    "world": LOT, "robot": BODY, "start": (2.0, 2.0, 0.0), "goal": (17.0, 3.0, 0.0),
    "claims": {"motions": "own", "costs": "own", "goal_tolerance": 4.0, "samples": "none"},
}  # fmt: skip

FOREIGN: Mapping[str, tuple[Callable[[Recorder], None], Mapping[str, Any]]] = {
    "rrt": (rrt, {"contract": RRT_CONTRACT}),
    "silent": (
        partial(rrt, samples=False), {"contract": RRT_CONTRACT, "claims": {"samples": "none"}},
    ),
    "lazy": (lazy, {"claims": {"edges": "assumed"}}),
    "fmt-star": (fmt_star, {}),
    "bit-star": (bit_star, {"claims": {"times": "snapshot"}}),
    "hybrid-a-star": (hybrid_a_star, HYBRID),
}  # fmt: skip
"""Planners, and what their authors tell `brrt.record` besides the field."""


def recorded(name: str, path: Path) -> Path:
    """Record a planner under a name that no registered one has."""
    plan, given = FOREIGN[name]
    with record(path, **{"world": FIELD, **given}, planner=f"foreign-{name}") as rec:
        plan(rec)
    return path


def case_of(path: Path) -> Case:
    """A recording that can be doctored."""
    recording = read(path)
    assert len(recording.events()[Kind.PATH]), "the planner found no path"
    return Case(recording.manifest, recording.world, recording.events())
