"""Planners on graphs as others write them: a PRM, a lazy PRM, and an RRT* that prunes its tree.

Each takes an open recorder, as `brrt.record` returns it, and a world of which it knows only whether
motions are free.
"""

import heapq
from collections.abc import Callable
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from brrt import Recorder, World
from brrt.collision.motions import Obstacles, first_hits
from brrt.robots import Point

Floats = NDArray[np.float64]
Planner = Callable[[Recorder, World, np.random.Generator], None]


class _Motions:
    """Checks motions of a point."""

    def __init__(self, world: World) -> None:
        self._obstacles = Obstacles(world)

    def free(self, a: Floats, b: Floats) -> NDArray[np.bool_]:
        """Return which motions from a configuration to others are free, shape (n,)."""
        ends = np.reshape(b, (-1, len(a)))
        starts = np.broadcast_to(a, ends.shape)
        return np.asarray(first_hits(self._obstacles, Point(), starts, ends) < 0)

    def part(self, a: Floats, b: Floats) -> float:
        """Return how much of a motion is free, in steps of a tenth."""
        parts = np.linspace(0, 1, 11)[1:]
        free = np.append(self.free(a, a + (b - a) * parts[:, None]), False)
        return float(np.append(0, parts)[int(free.argmin())])


def _shortest(links: dict[int, dict[int, float]], start: int, goal: int) -> list[int] | None:
    """Dijkstra's algorithm."""
    heap, above, done = [(0.0, start, -1)], dict[int, int](), set[int]()
    while heap:
        cost, node, up = heapq.heappop(heap)
        if node in done:
            continue
        done.add(node)
        above[node] = up
        if node == goal:
            path = [goal]
            while above[path[-1]] >= 0:
                path.append(above[path[-1]])
            return path[::-1]
        for other, length in links.get(node, {}).items():
            heapq.heappush(heap, (cost + length, other, node))
    return None


def prm(
    rec: Recorder, world: World, rng: np.random.Generator, count: int = 80, near: int = 8
) -> None:
    """A probabilistic roadmap: each edge is checked before it is linked (Kavraki 1996)."""
    motions, links = _Motions(world), dict[int, dict[int, float]]()
    places = [np.asarray(world.start, float), np.asarray(world.goal, float)]
    for q in places:
        rec.vertex(q)
    while len(places) < count:
        q = rng.uniform(world.lower, world.upper)
        rec.sample(q)
        if not motions.free(q, q)[0]:
            continue
        node = rec.vertex(q)
        far = np.linalg.norm(np.array(places) - q, axis=1)
        for other in np.argsort(far)[:near].tolist():
            part = motions.part(q, places[other])
            rec.check(node, other, part)
            if part == 1:
                rec.link(node, other)
                links.setdefault(node, {})[other] = links.setdefault(other, {})[node] = far[other]
        places.append(q)
    path = _shortest(links, 0, 1)
    if path is not None:
        rec.path([places[node] for node in path])


def lazy_prm(rec: Recorder, world: World, rng: np.random.Generator, count: int = 120) -> None:
    """Edges are linked unchecked; those of the best path are checked, and cut (Bohlin 2000)."""
    motions, links = _Motions(world), dict[int, dict[int, float]]()
    some = rng.uniform(world.lower, world.upper, (count, world.dim))
    places = np.concatenate([[world.start, world.goal], some])
    rec.samples(some)
    rec.vertices(places)
    for node in range(1, len(places)):
        far = np.linalg.norm(places[:node] - places[node], axis=1)
        for other in np.argsort(far)[:8].tolist():
            links.setdefault(node, {})[other] = links.setdefault(other, {})[node] = far[other]
            rec.link(node, other)
    while (path := _shortest(links, 0, 1)) is not None:
        blocked = [node for node in path if not motions.free(places[node], places[node])[0]]
        if blocked:
            rec.check(None, blocked[0], 0.0)
            rec.remove(blocked[0])
            for other in links.pop(blocked[0]):
                del links[other][blocked[0]]
            continue
        for node, other in pairwise(path):
            part = motions.part(places[node], places[other])
            rec.check(node, other, part)
            if part < 1:
                rec.cut(node, other)
                del links[node][other], links[other][node]
                break
        else:
            rec.path(places[path])
            return


def pruning_rrt_star(
    rec: Recorder, world: World, rng: np.random.Generator, count: int = 400, step: float = 12.0
) -> None:
    """RRT* that removes what no better path can use, and plans its orphans anew."""
    motions, start, goal = _Motions(world), np.array(world.start), np.array(world.goal)
    q, parent, cost = {0: start}, {0: -1}, {0: 0.0}
    best = np.inf
    rec.edge(start)
    for _ in range(count):
        sample = goal if rng.random() < 0.1 else rng.uniform(world.lower, world.upper)
        rec.sample(sample, "goal" if sample is goal else "uniform")
        nodes = np.array(list(q))
        far = np.linalg.norm(np.array([q[node] for node in nodes]) - sample, axis=1)
        origin = int(nodes[far.argmin()])
        if far.min() == 0:
            continue
        new = q[origin] + (sample - q[origin]) * min(1.0, step / far.min())
        if far.min() <= step:
            new = sample
        if not motions.free(q[origin], new)[0]:
            rec.reject(new, origin, "collision")
            continue
        node = rec.edge(new, origin)
        q[node], parent[node] = new, origin
        _update(q, parent, cost)
        for other in [each for each in q if 0 < np.linalg.norm(q[each] - new) < 1.5 * step]:
            through = cost[node] + float(np.linalg.norm(q[other] - new))
            if through < cost[other] - 1e-9 and motions.free(new, q[other])[0]:
                rec.rewire(other, node)
                parent[other] = node
                _update(q, parent, cost)
        if (new == goal).all() and cost[node] < best - 1e-9:
            best, path = cost[node], [node]
            while parent[path[-1]] >= 0:
                path.append(parent[path[-1]])
            rec.path([q[each] for each in path[::-1]])
            _prune(rec, q, parent, cost, goal, best)


def _update(q: dict[int, Floats], parent: dict[int, int], cost: dict[int, float]) -> None:
    """Compute all costs anew: those of nodes that no root is above are infinite."""
    cost.clear()
    cost[0] = 0.0
    for node in q:
        way = [node]
        while way[-1] not in cost and parent[way[-1]] >= 0:
            way.append(parent[way[-1]])
        cost.setdefault(way[-1], np.inf)
        for up, below in zip(way[::-1][:-1], way[::-1][1:], strict=True):
            cost[below] = cost[up] + float(np.linalg.norm(q[up] - q[below]))


def _prune(
    rec: Recorder,
    q: dict[int, Floats],
    parent: dict[int, int],
    cost: dict[int, float],
    goal: Floats,
    best: float,
) -> None:
    """Cut off all nodes that cost too much, then remove them; their children are orphans."""
    useless = [n for n in q if cost[n] + np.linalg.norm(q[n] - goal) > best + 1e-9]
    for node in useless:
        if parent[node] >= 0 and parent[node] not in useless:
            rec.cut(node)
        rec.remove(node)
        del q[node]
        for child in [each for each in q if parent[each] == node]:
            parent[child] = -1
    _update(q, parent, cost)


PLANNERS: dict[str, Planner] = {"prm": prm, "lazy-prm": lazy_prm, "pruning": pruning_rrt_star}
