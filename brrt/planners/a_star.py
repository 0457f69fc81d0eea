"""A* on a lattice (Hart, Nilsson and Raphael 1968)."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from brrt.errors import BrrtError
from brrt.events import Events, Kind, Phase, Stage, Status
from brrt.kernels.emit import EventLog
from brrt.kernels.jit import prepared
from brrt.kernels.lattice import (
    MOST_CELLS,
    Lattice,
    Search,
    empty_search,
    grown_lattice,
    grown_search,
    rooted_lattice,
)
from brrt.planners import _a_star, contract
from brrt.planners.planner import Planner
from brrt.planners.stop import Stop
from brrt.problem import Problem
from brrt.robots import Point
from brrt.settings import param

_FIRST_ROOM = 1 << 18
"""Cells to make room for at first, where the bounds hold more."""

_ENDS = {_a_star.SOLVED: Status.SOLVED, _a_star.NO_PATH: Status.NO_PATH}


@dataclass(frozen=True, slots=True)
class LatticePlanner(Planner):
    """What the searches on a lattice have in common; its cells begin at the start."""

    epsilon: float = param(0.5, "edge of a cell", above=0)
    diagonals: bool = param(False, "move to all cells around (26 in 3D), not across faces alone")
    max_move: float = param(1.0, "the goal is reached by a straight move of at most this", low=0)

    def _lattice(self, problem: Problem) -> Lattice:
        """Make the lattice that knows the start alone.

        Raises:
            BrrtError: The robot is no point, or the cells are too small for the world.
        """
        if not isinstance(problem.robot, Point):
            raise BrrtError(
                "planners on a lattice move a point; use --robot point, or --planner rrt for "
                "this robot"
            )
        least = problem.world.extent / MOST_CELLS
        if self.epsilon < least:
            raise BrrtError(
                f"epsilon {self.epsilon:g} is too small for this world; "
                f"it must be at least {least:.2g}"
            )
        sides = (problem.world.upper - problem.world.lower) / self.epsilon + 1
        room = 32 + int(min(float(sides.prod()), _FIRST_ROOM))
        ends = problem.start, problem.goal
        return rooted_lattice(*ends, self.epsilon, self.max_move, room, diagonals=self.diagonals)


@dataclass(frozen=True, slots=True)
class AStar(LatticePlanner):
    """A* (Hart, Nilsson and Raphael 1968): the shortest path on a lattice around the start.

    Cells are expanded in the order of cost so far plus straight distance to the goal; ties go to
    the cell closer to the goal, then to the one seen first.
    """

    def contract(self, problem: Problem) -> contract.Contract:  # noqa: ARG002
        """See `Planner.contract`."""
        grid = contract.Lattice(self.epsilon, self.diagonals, self.max_move, lookahead=None)
        return contract.Contract(lattice=grid)

    def solve(
        self,
        problem: Problem,
        rng: np.random.Generator,  # noqa: ARG002
        log: EventLog,
        stop: Stop,
    ) -> Iterator[Events]:
        """See `Planner.solve`; an iteration is a cell expanded."""
        lattice = self._lattice(problem)
        search, counts = empty_search(len(lattice.keys)), np.array([0, -1])
        most = stop.iterations if stop.draws is None else min(stop.iterations, stop.draws)

        log.reserve(len(lattice.deltas) + 8)
        space = problem.space
        advance = prepared(_a_star.advance, lattice, search, counts, space, log.buffer, 0)
        log.emit(Kind.PHASE, 0, name=Phase.PLAN, status=Status.BEGIN)
        began = log.elapsed_s
        status = None
        while status is None:
            if log.overdue:
                yield log.drain()
            done = int(counts[_a_star.EXPANSIONS])
            due = stop.reached(done, log.elapsed_s - began)
            limit = done + stop.share(done) if due is None else done
            log.tick()
            result = advance(lattice, search, counts, space, log.buffer, min(limit, most))
            if result == _a_star.BATCH_FULL:
                yield log.drain()
            elif result == _a_star.TABLE_FULL:
                lattice, search = grown_lattice(lattice), grown_search(search)
            elif result in _ENDS:
                status = _ENDS[result]
            elif due is None and counts[_a_star.EXPANSIONS] >= most:
                status = Status.ITERATION_LIMIT
            else:
                status = due
        iteration = int(counts[_a_star.EXPANSIONS])
        if status is Status.SOLVED:
            last = int(counts[_a_star.LAST])
            cost, cells = _path(search, last)
            waypoints = lattice.q[cells]
            if lattice.h[last] > 0:
                cost, waypoints = cost + lattice.h[last], np.vstack([waypoints, problem.goal])
            log.emit(Kind.PATH, iteration, stage=Stage.RAW, cost=cost, waypoints=waypoints)
        log.emit(Kind.PHASE, iteration, name=Phase.PLAN, status=status)
        yield log.drain()


def _path(search: Search, cell: int) -> tuple[float, list[int]]:
    """Cost of a cell, and the cells from the start to it."""
    cost, cells = float(search.g[cell]), []
    while cell >= 0:
        cells.append(cell)
        cell = int(search.parent[cell])
    return cost, cells[::-1]
