"""What a planner promises, in figures that a recording can be held to."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class Near:
    """The neighbourhood in which RRT* looks for parents: min(longest, gamma (log n / n)^(1/d)).

    Attributes:
        gamma: The factor, in units of the robot's metric.
        longest: Never farther than this.
        dof: d, numbers in a configuration.
    """

    gamma: float
    longest: float
    dof: int

    def radius(self, n: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return the radius in a tree that counts n nodes with the new one, shape of n."""
        n = np.maximum(n, 2)
        return np.minimum(self.longest, self.gamma * (np.log(n) / n) ** (1 / self.dof))


@dataclass(frozen=True, slots=True)
class Lattice:
    """The grid that a search moves on; its origin is the start.

    Attributes:
        epsilon: Edge of a cell.
        diagonals: Whether moves lead to all cells around (26 in 3D, 8 in 2D), or to 6 and 4.
        max_move: The goal is reached by a straight move of at most this length.
        lookahead: Cells expanded before each move; None where no robot moves meanwhile.
        ordered: Whether ties go to the cell closer to the goal, by what is known by then, and then
            to the one seen first.
    """

    epsilon: float
    diagonals: bool
    max_move: float
    lookahead: int | None
    ordered: bool = False


@dataclass(frozen=True, slots=True)
class Draws:
    """Where samples come from; what is not the goal is drawn evenly from the bounds.

    Attributes:
        goal_bias: Probability that a draw is of the goal; once there is a path, none is.
        goal_in_reach: Whether the goal is drawn for certain where the draw before added a node
            that is within a step of it.
        coin: Probability that a tree heads for the other's newest node instead of drawing.
        informed: Whether draws are, once there is a path, from where a better one may lead.
    """

    goal_bias: float = 0.0
    goal_in_reach: bool = False
    coin: float = 0.0
    informed: bool = False


@dataclass(frozen=True, slots=True)
class Growth:
    """How trees grow: from the node nearest to the sample, by at most a step.

    Attributes:
        slices: Nodes that each step is cut into.
        turn: Which of two trees grows: they alternate, the smaller one does, or roles swap unless
            the coin falls for the other tree's newest node; None where there is one tree.
        connects: Whether a tree goes on, step by step, until the sample is reached or blocked.
        links: How the other tree then heads for the newest node: by one step, or on and on.
        always_links: Whether it does so even where no node was added.
        goal_test: Whether the goal is tried from each new node that the contract lets join it.
    """

    slices: int = 1
    turn: Literal["alternate", "smaller", "coin"] | None = None
    connects: bool = False
    links: Literal["extend", "connect"] | None = None
    always_links: bool = False
    goal_test: bool = False


@dataclass(frozen=True, slots=True)
class Contract:
    """What a planner promises beyond what all do; None promises nothing.

    All planners promise: everything inside bounds and limits; edges, links and paths free; costs
    that are parent's cost plus distance; no cycles; paths from start to goal whose cost is their
    length. The checks take that for granted.

    Attributes:
        step: Longest edge of a tree (within rounding); an edge to the goal may be longer where
            `line_of_sight`.
        line_of_sight: Whether the goal may be joined from any distance.
        link: Longest link between two trees.
        near: Where parents are chosen and edges rewired.
        lattice: The grid of a search.
        draws: Where samples come from.
        growth: How trees grow.
        stops: Whether the run ends with its first path.
    """

    step: float | None = None
    line_of_sight: bool = False
    link: float | None = None
    near: Near | None = None
    lattice: Lattice | None = None
    draws: Draws | None = None
    growth: Growth | None = None
    stops: bool | None = None
