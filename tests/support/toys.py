"""Planners in plain Python, for logs with every kind of event: slow, and simple to verify.

They represent foreign planners: they emit events and state a contract, nothing else.
"""

from collections.abc import Iterator
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrt import Events, Kind, Problem
from brrt.events import Phase, Reason, Source, Stage, Status
from brrt.kernels.event_log import EventLog
from brrt.planners.base.stop import Stop
from brrt.scenario.contract import Contract, Lattice, Near
from tests.support import naive

Floats = NDArray[np.float64]
STEP = 12.0


def far(a: Floats, b: Floats) -> float:
    """Euclidean distance."""
    return float(np.linalg.norm(np.subtract(b, a)))


def free(problem: Problem, a: Floats, b: Floats) -> bool:
    """Whether a motion is free."""
    return problem.world.inside(b) and not naive.nearly_hits(problem.world, a, b)


class Star:
    """RRT* that goes on to the end of its budget; the goal is a node like others."""

    def contract(self, problem: Problem) -> Contract:
        """A radius of the step."""
        return Contract(step=STEP, near=Near(1e9, STEP, problem.dof))

    def solve(
        self, problem: Problem, rng: np.random.Generator, log: EventLog, stop: Stop
    ) -> Iterator[Events]:
        """See `Planner.solve`."""
        q, parent, goal, best = [problem.start], [-1], -1, np.inf
        lower, upper = problem.world.lower, problem.world.upper

        def cost(node: int) -> float:
            return 0.0 if parent[node] < 0 else cost(parent[node]) + far(q[parent[node]], q[node])

        def lineage(node: int) -> list[int]:
            return [node] if parent[node] < 0 else [*lineage(parent[node]), node]

        log.emit(Kind.PHASE, 0, name=Phase.PLAN, status=Status.BEGIN)
        log.emit(Kind.EDGE, 0, tree=0, node=0, parent=-1, cost=0.0, q=q[0])
        for iteration in range(1, stop.iterations + 1):
            aims_at_goal = goal < 0 and rng.random() < 0.2
            source = Source.GOAL if aims_at_goal else Source.UNIFORM
            sample = problem.goal if aims_at_goal else rng.uniform(lower, upper)
            log.emit(Kind.SAMPLE, iteration, tree=0, source=source, q=sample)
            nearest = min(range(len(q)), key=lambda i: far(q[i], sample))
            length = far(q[nearest], sample)
            new = sample if length <= STEP else q[nearest] + STEP / length * (sample - q[nearest])
            # The nearest one counts where rounding puts the new node a hair beyond the step.
            close = [i for i in range(len(q)) if i == nearest or far(q[i], new) <= STEP]
            around = [i for i in close if free(problem, q[i], new)]
            if not around:
                log.emit(
                    Kind.REJECT, iteration, tree=0, node=nearest, reason=Reason.COLLISION, q=new
                )
                continue
            node, choice = len(q), min(around, key=lambda i: cost(i) + far(q[i], new))
            q.append(new)
            parent.append(choice)
            log.emit(Kind.EDGE, iteration, tree=0, node=node, parent=choice, cost=cost(node), q=new)
            for other in around:
                if cost(node) + far(new, q[other]) < cost(other) - 1e-9:
                    parent[other] = node
                    log.emit(
                        Kind.REWIRE, iteration, tree=0, node=other, parent=node, cost=cost(other)
                    )
            goal = node if aims_at_goal and new is sample else goal
            if goal >= 0 and cost(goal) < best - 1e-9:
                stage, best = Stage.IMPROVED if best < np.inf else Stage.RAW, cost(goal)
                log.emit(
                    Kind.PATH, iteration, stage=stage, cost=best,
                    waypoints=np.array([q[i] for i in lineage(goal)]),
                )  # fmt: skip
            if log.room < 200:
                yield log.drain()
        status = Status.SOLVED if goal >= 0 else Status.ITERATION_LIMIT
        log.emit(Kind.PHASE, stop.iterations, name=Phase.PLAN, status=status)
        yield log.drain()


class Pair:
    """Two trees that each make a step towards every sample, linked when their newest nodes meet."""

    def contract(self, problem: Problem) -> Contract:
        """Edges and links of a step."""
        return Contract(step=STEP, link=STEP)

    def solve(
        self, problem: Problem, rng: np.random.Generator, log: EventLog, stop: Stop
    ) -> Iterator[Events]:
        """See `Planner.solve`."""
        trees = [[(problem.start, -1, 0.0)], [(problem.goal, -1, 0.0)]]
        log.emit(Kind.PHASE, 0, name=Phase.PLAN, status=Status.BEGIN)
        for tree in (0, 1):
            log.emit(Kind.EDGE, 0, tree=tree, node=0, parent=-1, cost=0.0, q=trees[tree][0][0])
        status = Status.ITERATION_LIMIT
        iteration = 0
        while status is Status.ITERATION_LIMIT and iteration < stop.iterations:
            iteration += 1
            sample = rng.uniform(problem.world.lower, problem.world.upper)
            for tree, nodes in enumerate(trees):
                log.emit(Kind.SAMPLE, iteration, tree=tree, source=Source.UNIFORM, q=sample)
                near = min(range(len(nodes)), key=lambda i: far(nodes[i][0], sample))
                base, _, cost = nodes[near]
                new = base + min(1.0, STEP / far(base, sample)) * (sample - base)
                if free(problem, base, new):
                    cost += far(base, new)
                    log.emit(
                        Kind.EDGE,
                        iteration,
                        tree=tree,
                        node=len(nodes),
                        parent=near,
                        cost=cost,
                        q=new,
                    )
                    nodes.append((new, near, cost))
            (a, _, cost), (b, _, rest) = trees[0][-1], trees[1][-1]
            if far(a, b) <= STEP and free(problem, a, b):
                total = cost + far(a, b) + rest
                log.emit(
                    Kind.CONNECT, iteration, node=len(trees[0]) - 1, other=len(trees[1]) - 1,
                    cost=total,
                )  # fmt: skip
                ways: list[list[Floats]] = [[], []]
                for way, nodes in zip(ways, trees, strict=True):
                    node = len(nodes) - 1
                    while node >= 0:
                        way.append(nodes[node][0])
                        node = nodes[node][1]
                path = np.array([*ways[0][::-1], *ways[1]])
                log.emit(Kind.PATH, iteration, stage=Stage.RAW, cost=total, waypoints=path)
                status = Status.SOLVED
            if log.room < 20:
                yield log.drain()
        log.emit(Kind.PHASE, iteration, name=Phase.PLAN, status=status)
        yield log.drain()


class Walk:
    """LRTA* with a lookahead of 1 on a lattice; it walks `trials` times."""

    edge, max_move, trials = 10.0, 10.0, 2

    def contract(self, problem: Problem) -> Contract:
        """A lattice without diagonals."""
        return Contract(lattice=Lattice(self.edge, False, self.max_move, 1))

    def solve(  # noqa: C901 - a paragraph of a paper, in one piece
        self, problem: Problem, rng: np.random.Generator, log: EventLog, stop: Stop
    ) -> Iterator[Events]:
        """See `Planner.solve`."""
        goal, dim = problem.goal, problem.dof
        steps = [s for s in product((-1, 0, 1), repeat=dim) if sum(map(abs, s)) == 1]
        h: dict[tuple[int, ...], float] = {}
        numbers: dict[tuple[int, ...], int] = {}
        looked: set[tuple[int, ...]] = set()

        def place(cell: tuple[int, ...]) -> Floats:
            return problem.start + self.edge * np.array(cell)

        def estimate(cell: tuple[int, ...]) -> float:
            return h.get(cell, far(place(cell), goal))

        log.emit(Kind.PHASE, 0, name=Phase.PLAN, status=Status.BEGIN)
        moves, status = 0, Status.SOLVED
        for trial in range(self.trials):
            cell, cost, step, path = (0,) * dim, 0.0, 0, [problem.start]
            while (path[-1] != goal).any() and moves < stop.iterations:
                here = place(cell)
                number = numbers.setdefault(cell, len(numbers))
                log.emit(Kind.EXPAND, moves, cell=number, parent=-1, cost=0.0, q=here)
                arrives = far(here, goal) <= self.max_move and free(problem, here, goal)
                choices = []
                for delta in steps if not arrives else []:
                    other = tuple(x + d for x, d in zip(cell, delta, strict=True))
                    if free(problem, here, place(other)):
                        choices.append((self.edge + estimate(other), other))
                    elif cell not in looked:
                        q, world = place(other), problem.world
                        beyond = ((q < world.lower) | (world.upper < q)).any()
                        reason = Reason.LIMITS if beyond else Reason.COLLISION
                        log.emit(Kind.REJECT, moves, tree=0, node=number, reason=reason, q=q)
                looked.add(cell)
                if not arrives:
                    best, cell_next = min(choices)
                    if best > estimate(cell):
                        h[cell] = best
                        log.emit(Kind.HEURISTIC, moves, cell=number, h=best, q=here)
                    cell = cell_next
                moves, step = moves + 1, step + 1
                target = goal if arrives else place(cell)
                cost += far(here, target) if arrives else self.edge
                log.emit(
                    Kind.MOVE, moves, trial=trial, step=step, cost=cost, q=target,
                    cell=-1 if arrives else numbers.setdefault(cell, len(numbers)),
                )  # fmt: skip
                path.append(target)
                if log.room < 20:
                    yield log.drain()
            if (path[-1] == goal).all():
                log.emit(Kind.PATH, moves, stage=Stage.RAW, cost=cost, waypoints=np.array(path))
            else:
                status = Status.ITERATION_LIMIT
        log.emit(Kind.PHASE, moves, name=Phase.PLAN, status=status)
        yield log.drain()


class March:
    """A straight path, executed in moves of at most 1."""

    def contract(self, problem: Problem) -> Contract:
        """Nothing special."""
        return Contract()

    def solve(
        self, problem: Problem, rng: np.random.Generator, log: EventLog, stop: Stop
    ) -> Iterator[Events]:
        """See `Planner.solve`."""
        a, b = problem.start, problem.goal
        corner = np.array([a[0], b[1], *b[2:]])
        path, length = np.array([a, corner, b]), far(a, corner) + far(corner, b)
        log.emit(Kind.PHASE, 0, name=Phase.PLAN, status=Status.BEGIN)
        log.emit(Kind.PATH, 1, stage=Stage.RAW, cost=length, waypoints=path)
        log.emit(Kind.PHASE, 1, name=Phase.PLAN, status=Status.SOLVED)
        log.emit(Kind.PHASE, 1, name=Phase.EXECUTE, status=Status.BEGIN)
        cost, step, here = 0.0, 0, a
        for end in path[1:]:
            for part in np.linspace(0, 1, 1 + int(np.ceil(far(here, end))))[1:]:
                target = here + part * (end - here) if part < 1 else end
                before = here + (part - 1 / np.ceil(far(here, end))) * (end - here)
                cost, step = cost + far(before, target), step + 1
                log.emit(Kind.MOVE, 1, trial=0, step=step, cell=-1, cost=cost, q=target)
            here = end
        log.emit(Kind.PHASE, 1, name=Phase.EXECUTE, status=Status.DONE)
        yield log.drain()


class Silent:
    """A toy that states no contract."""

    def solve(
        self, problem: Problem, rng: np.random.Generator, log: EventLog, stop: Stop
    ) -> Iterator[Events]:
        """See `Planner.solve`."""
        yield from Pair().solve(problem, rng, log, stop)


TOYS: dict[str, Any] = {"star": Star(), "pair": Pair(), "walk": Walk(), "march": March()}
