"""The base class of planners: settings with the method `solve`."""

from abc import abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar, Protocol, runtime_checkable

import numpy as np

from brrt.events import Events
from brrt.kernels.event_log import EventLog
from brrt.planners.base.problem import Problem
from brrt.planners.base.stop import Stop
from brrt.scenario.contract import Contract
from brrt.scenario.query import Query
from brrt.scenario.scenario import DEFAULT_ITERATIONS
from brrt.settings import Settings


@runtime_checkable
class StatesContract(Protocol):
    """What a planner that is no `Planner` may have beside `solve`."""

    def contract(self, query: Query) -> Contract:
        """See `Planner.contract`."""


@dataclass(frozen=True, slots=True)
class Planner(Settings):
    """Base class; any other object with the method `solve` is a planner too.

    Attributes:
        default_iterations: Limit of a run without a budget.
        fixed_params: Settings that a branch cannot change.
        bidirectional: The registered planner that grows a second tree, from the goal.
        first_path: The registered planner that is cheaper and stops at the first path.
        continuous: A registered planner that needs no lattice.
    """

    default_iterations: ClassVar[int] = DEFAULT_ITERATIONS
    fixed_params: ClassVar[tuple[str, ...]] = ()
    bidirectional: ClassVar[str | None] = None
    first_path: ClassVar[str | None] = None
    continuous: ClassVar[str | None] = None

    @abstractmethod
    def solve(
        self, problem: Problem, rng: np.random.Generator, log: EventLog, stop: Stop
    ) -> Iterator[Events]:
        """Plan until solved or stopped; yield the events in batches, the only output.

        Args:
            problem: Robot, world, start and goal.
            rng: Source of all random draws.
            log: Numbers and times the events.
            stop: Budget and interruption.
        """

    def check(self, query: Query) -> None:
        """Raise if these settings cannot solve a query, whatever its obstacles.

        Raises:
            BrrtError: They cannot.
        """

    def contract(self, query: Query) -> Contract:  # noqa: ARG002
        """Return what this planner promises beyond what all planners do; see `Contract`."""
        return Contract()
