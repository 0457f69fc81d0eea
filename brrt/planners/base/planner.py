"""What every planner is: settings with one method."""

from abc import abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from brrt.events import Events
from brrt.kernels.emit import EventLog
from brrt.planners.base.problem import Problem
from brrt.planners.base.stop import Stop
from brrt.scenario.contract import Contract
from brrt.settings import Settings


@dataclass(frozen=True, slots=True)
class Planner(Settings):
    """Base class; a planner from outside may as well be any object with this method.

    Attributes:
        default_iterations: Iterations that a run may make where no budget is given.
    """

    default_iterations: ClassVar[int] = 1_000_000

    @abstractmethod
    def solve(
        self, problem: Problem, rng: np.random.Generator, log: EventLog, stop: Stop
    ) -> Iterator[Events]:
        """Yield batches of events until solved or stopped; the log is the only output.

        Args:
            problem: Robot, world, start and goal.
            rng: Every random draw comes from here.
            log: Numbers and times the events.
            stop: Budget and interruption.
        """

    def contract(self, problem: Problem) -> Contract:  # noqa: ARG002
        """Say what a recording of this planner can be held to, beyond what all planners promise."""
        return Contract()
