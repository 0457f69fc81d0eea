"""Slow twins of the planners on a lattice: dictionaries, lists and `min`, event by event."""

import heapq
import math
from collections.abc import Callable
from itertools import combinations, product

import numpy as np
from numpy.typing import NDArray

from brrt.events import Kind, Reason
from brrt.worlds import World

Floats = NDArray[np.float64]
Emitted = tuple[Kind, int, tuple[float, ...], tuple[float, ...]]
"""Kind, iteration, the other fields in their order, and q."""


class Twin:
    """The lattice and its estimates; events are appended to `emitted`."""

    def __init__(
        self, world: World, start: Floats, goal: Floats, free: Callable[[Floats, Floats], bool],
        *, cell: float = 0.5, diagonals: bool = False, max_move: float = 1.0,
    ) -> None:  # fmt: skip
        self.world, self.start, self.goal, self.free = world, start, goal, free
        self.cell, self.max_move = cell, max_move
        self.steps: list[tuple[tuple[int, ...], float]] = []
        for along in range(1, world.dim + 1 if diagonals else 2):
            for axes in combinations(range(world.dim), along):
                for signs in product((1, -1), repeat=along):
                    step = [0] * world.dim
                    for axis, sign in zip(axes, signs, strict=True):
                        step[axis] = sign
                    self.steps.append((tuple(step), cell * math.sqrt(along)))
        self.number = {(0,) * world.dim: 0}
        self.at = [(0,) * world.dim]
        self.h = [self.straight(start)]
        self.near: dict[int, list[tuple[int, float]]] = {}
        self.arrives: set[int] = set()
        self.moves = 0
        self.emitted: list[Emitted] = []

    def straight(self, q: Floats) -> float:
        """Distance to the goal."""
        square = 0.0
        for a, b in zip(q.tolist(), self.goal.tolist(), strict=True):
            square += (b - a) * (b - a)
        return math.sqrt(square)

    def q(self, at: tuple[int, ...]) -> Floats:
        """Position of a cell."""
        return self.start + self.cell * np.array(at)

    def emit(self, kind: Kind, *fields: float, q: Floats) -> None:
        """Append an event."""
        self.emitted.append((kind, self.moves, fields, tuple(q.tolist())))

    def look(self, cell: int) -> None:
        """Find a cell's neighbours, unless the goal is in reach."""
        if cell in self.near or cell in self.arrives:
            return
        here = self.at[cell]
        if self.h[cell] <= self.max_move and self.free(self.q(here), self.goal):
            self.arrives.add(cell)
            return
        self.near[cell] = []
        for step, cost in self.steps:
            there = tuple(a + b for a, b in zip(here, step, strict=True))
            q = self.q(there)
            first, second = sorted((here, there), key=lambda at: at[::-1])
            if not self.world.inside(q):
                self.emit(Kind.REJECT, 0, cell, Reason.LIMITS, q=q)
            elif not self.free(self.q(first), self.q(second)):
                self.emit(Kind.REJECT, 0, cell, Reason.COLLISION, q=q)
            else:
                if there not in self.number:
                    self.number[there] = len(self.at)
                    self.at.append(there)
                    self.h.append(self.straight(q))
                self.near[cell].append((self.number[there], cost))

    def search(self, root: int, lookahead: float) -> tuple[int, list[int], list[int]] | None:
        """Expand the best cells; return the best then, the way to it, and what was expanded."""
        g, parent, closed, opened = {root: 0.0}, {root: -1}, list[int](), {root}
        while opened:
            best = min(opened, key=lambda c: (g[c] + self.h[c], self.h[c], c))
            done = len(closed) >= lookahead
            if not done:
                if lookahead == math.inf:
                    self.moves += 1
                self.emit(Kind.EXPAND, best, parent[best], g[best], q=self.q(self.at[best]))
                self.look(best)
                done = best in self.arrives
            if done:
                way = [best]
                while parent[way[-1]] >= 0:
                    way.append(parent[way[-1]])
                self.cost = g[best] + self.h[best]
                return best, way[::-1], closed
            opened.remove(best)
            closed.append(best)
            for other, cost in self.near[best]:
                if other not in closed and g[best] + cost < g.get(other, math.inf):
                    g[other], parent[other] = g[best] + cost, best
                    opened.add(other)
            if lookahead < math.inf and len(self.near) == len(self.at):
                return None
        return None

    def learn(self, closed: list[int]) -> None:
        """Bellman's equations on the expanded cells, iterated until nothing changes."""
        learned = dict.fromkeys(closed, math.inf)
        before = None
        while before != learned:
            before = dict(learned)
            for cell in closed:
                learned[cell] = min(
                    cost + learned.get(other, self.h[other]) for other, cost in self.near[cell]
                )
        for cell in closed:
            if learned[cell] > self.h[cell]:
                self.h[cell] = learned[cell]
                self.emit(Kind.HEURISTIC, cell, learned[cell], q=self.q(self.at[cell]))

    def trial(self, number: int, lookahead: int) -> float | None:
        """Walk to the goal; return how far that was, or None where there is no way."""
        cell, step, length = 0, 0, 0.0
        while True:
            found = self.search(cell, lookahead)
            if found is None:
                return None
            best, way, closed = found
            self.learn(closed)
            for target in way[1:]:
                length += dict(self.near[cell])[target]
                cell, step, self.moves = target, step + 1, self.moves + 1
                self.emit(Kind.MOVE, number, step, cell, length, q=self.q(self.at[cell]))
            if best in self.arrives and len(closed) < lookahead:
                if self.h[best] > 0:
                    length, self.moves = length + self.h[best], self.moves + 1
                    self.emit(Kind.MOVE, number, step + 1, -1, length, q=self.goal)
                return length


def costs_to_go(twin: Twin) -> dict[int, float]:
    """Least cost to the goal of each cell that can be reached (Dijkstra); empty if none can."""
    cell = 0
    while cell < len(twin.at):
        twin.look(cell)
        cell += 1
    queue = [(twin.straight(twin.q(twin.at[cell])), cell) for cell in twin.arrives]
    heapq.heapify(queue)
    back: dict[int, list[tuple[int, float]]] = {}
    for cell, near in twin.near.items():
        for other, cost in near:
            back.setdefault(other, []).append((cell, cost))
    least: dict[int, float] = {}
    while queue:
        far, cell = heapq.heappop(queue)
        if cell not in least:
            least[cell] = far
            for other, cost in back.get(cell, ()):
                heapq.heappush(queue, (far + cost, other))
    return least
