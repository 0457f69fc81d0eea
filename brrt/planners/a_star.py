"""A* on a lattice (Hart, Nilsson and Raphael 1968)."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from brrt.digits import at_least
from brrt.errors import BrrtError
from brrt.kernels.lattice import (
    MAX_CELLS,
    LatticeArrays,
    empty_search,
    enlarged_lattice,
    enlarged_search,
    rooted_lattice,
)
from brrt.planners import _a_star
from brrt.planners.base.kernel_planner import MOST_DRAWS, Kernel, KernelPlanner
from brrt.planners.base.problem import Problem
from brrt.planners.base.stop import Stop
from brrt.robots import Point
from brrt.scenario import contract
from brrt.scenario.query import Query
from brrt.settings import param
from brrt.worlds.free_space import grid_only

_ROUNDING = 1e-12

_FIRST_ROOM = 1 << 18
"""Cells to allocate at first, where the bounds hold more."""


@dataclass(frozen=True, slots=True)
class LatticePlanner(KernelPlanner):
    """Base of searches on a lattice whose origin is the start."""

    fixed_params: ClassVar[tuple[str, ...]] = ("cell", "diagonals", "max_move")
    continuous: ClassVar[str | None] = "rrt-connect"

    cell: float | None = param(
        None,
        "edge of a cell; by default that of a grid map's cells, and otherwise 0.5 or what is "
        "nearest to it between 0.5 % and 5 % of the world's longest side",
        above=0,
    )
    diagonals: bool | None = param(
        None, "move to all neighbours (26 in 3D), not only across faces; by default on grid maps"
    )
    max_move: float | None = param(
        None, "longest straight move to the goal; by default twice `cell`", low=0
    )

    def resolved(self, query: Query) -> contract.Lattice:
        """Return the lattice in a world, with the settings that are automatic."""
        extent, grid = query.world.extent, grid_only(query.world)
        usual = grid.resolution if grid else float(np.clip(0.5, extent / 200, extent / 20))
        cell = usual if self.cell is None else self.cell
        return contract.Lattice(
            cell,
            grid is not None if self.diagonals is None else self.diagonals,
            2 * cell if self.max_move is None else self.max_move,
            lookahead=None,
        )

    def check(self, query: Query) -> None:
        """See `Planner.check`: the goal must be within a move of a cell."""
        if not isinstance(query.robot, Point):
            return
        grid = self.resolved(query)
        low, high = (query.lower - query.start, query.upper - query.start)
        along = np.rint((query.goal - query.start) / grid.cell)
        along = np.clip(along, np.ceil(low / grid.cell), np.floor(high / grid.cell))
        far = float(query.robot.distance(query.start + grid.cell * along, query.goal))
        if far * (1 - _ROUNDING) > grid.max_move:
            raise BrrtError(
                f"max_move {grid.max_move:g} is too small: the goal is {far:g} from the nearest "
                f"cell; it must be at least {at_least(far)}, or choose a smaller cell"
            )

    def _lattice(self, problem: Problem) -> LatticeArrays:
        """Make a lattice that holds only the start.

        Raises:
            BrrtError: The robot is not a point, or the cells are too small for the world.
        """
        if not isinstance(problem.robot, Point):
            raise BrrtError(
                "planners on a lattice move a point; use --robot point, or --planner rrt for "
                "this robot"
            )
        grid, least = self.resolved(problem), problem.world.extent / MAX_CELLS
        if grid.cell < least:
            raise BrrtError(
                f"cell {grid.cell:g} is too small for this world; "
                f"it must be at least {at_least(least, 2)}"
            )
        sides = (problem.world.upper - problem.world.lower) / grid.cell + 1
        room = 32 + int(min(float(sides.prod()), _FIRST_ROOM))
        ends = problem.start, problem.goal
        return rooted_lattice(*ends, grid.cell, grid.max_move, room, diagonals=grid.diagonals)


@dataclass(frozen=True, slots=True)
class AStar(LatticePlanner):
    """A* (Hart, Nilsson and Raphael 1968): the shortest path on a lattice around the start.

    Cells are expanded in the order of cost-to-come plus distance to the goal; ties go to the cell
    closer to the goal, then to the oldest.
    """

    def contract(self, query: Query) -> contract.Contract:
        """See `Planner.contract`."""
        return contract.Contract(lattice=self.resolved(query))

    def kernel(self, problem: Problem, stop: Stop) -> Kernel[Any]:  # noqa: ARG002
        """See `KernelPlanner.kernel`."""
        lattice = self._lattice(problem)
        state = _a_star.AStarState(
            lattice, empty_search(len(lattice.keys)), np.zeros(_a_star.COUNTS, np.int64)
        )
        state.counts[_a_star.LAST] = -1
        most = len(lattice.deltas) + 1
        return Kernel(_a_star.advance, state, _a_star.AStarOptions(), _enlarged, most, MOST_DRAWS)


def _enlarged(state: _a_star.AStarState) -> _a_star.AStarState:
    return state._replace(
        lattice=enlarged_lattice(state.lattice), search=enlarged_search(state.search)
    )
