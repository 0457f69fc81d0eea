"""A `with` statement within which each `solve` of an OMPL planner becomes a recording."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray
from ompl import base, geometric

from brrt.errors import BrrtError
from brrt.ompl.problem import Problem
from brrt.ompl.tracker import Tracker
from brrt.recorder.record import record
from brrt.recorder.recorder import Recorder
from brrt.robots import Robot, make_robot
from brrt.scenario.claims import Claims
from brrt.worlds import World

Floats = NDArray[np.float64]

_DEFAULT_S = 1.0
"""How long `SimpleSetup.solve()` plans."""


@dataclass(frozen=True, slots=True)
class Options:
    """What `brrt.ompl.record` was given; see there."""

    exact: bool = False
    world: World | Path | str | None = None
    robot: Robot | Path | str | None = None
    goal: Any = None
    seed: int = 0
    claims: Claims | Mapping[str, Any] | None = None


class Session:
    """Records each `solve` of a subject while it is entered.

    Args:
        subject: A setup or a planner.
        path: The file of the first solve.
        options: How to record.

    Attributes:
        files: The files so far.
    """

    def __init__(self, subject: Any, path: Path, options: Options) -> None:
        if not isinstance(subject, geometric.SimpleSetup | base.Planner):
            raise BrrtError(
                "record takes an ompl.geometric.SimpleSetup or a planner of ompl.geometric, not "
                f"{subject!r:.60}"
            )
        if path.suffix != ".mcap":
            raise BrrtError(f"{path}: name a file that ends in .mcap")
        self._subject, self._path, self._options = subject, path, options
        self._solve: Callable[..., Any] | None = None
        self.files: list[Path] = []

    def __enter__(self) -> Self:
        """Hook into `solve` of the subject's class."""
        kind = type(self._subject)
        self._solve = original = kind.solve

        def solve(subject: Any, *request: Any, **named: Any) -> Any:
            """Plan; see the documentation of OMPL."""
            if subject is not self._subject:
                return original(subject, *request, **named)
            tracker, limit = prepare(
                subject, (*request, *named.values()), self._next_file(), self._options
            )
            status = tracker.solve(lambda condition: original(subject, condition), limit)
            if tracker.error is not None:
                raise tracker.error
            return status

        kind.solve = solve
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Take the hook out again."""
        type(self._subject).solve = self._solve

    def _next_file(self) -> Path:
        number = len(self.files) + 1
        name = self._path.name if number == 1 else f"{self._path.stem}-{number}.mcap"
        self.files.append(self._path.with_name(name))
        return self.files[-1]


def prepare(
    subject: Any,
    request: tuple[Any, ...],
    path: Path,
    options: Options,
    *,
    must_record: bool = True,
) -> tuple[Tracker, Any]:
    """Return what records a `solve`, and how long that plans.

    Args:
        subject: A setup or a planner.
        request: The arguments of `solve`: how long to plan in s, or a stop condition.
        path: The file.
        options: How to record.
        must_record: Whether planning ends where the recorder fails.

    Raises:
        BrrtError: The problem cannot be recorded.
    """
    planner = subject
    subject.setup()
    if isinstance(subject, geometric.SimpleSetup):
        planner = subject.getPlanner()
    problem = Problem(planner, options.goal)
    limit = request[0] if request else _DEFAULT_S

    def open_recorder(start: Floats, clock: Callable[[], int]) -> Recorder:
        return _open(path, problem, start, limit, options, clock)

    tracker = Tracker(problem, open_recorder, exact=options.exact, must_record=must_record)
    return tracker, limit


def _open(
    path: Path, problem: Problem, start: Floats, limit: Any, options: Options,
    clock: Callable[[], int],
) -> Recorder:  # fmt: skip
    """Open the recording of a problem."""
    robot = options.robot
    if robot is not None and not isinstance(robot, Robot):
        robot = make_robot(str(robot))
    claims = problem.claims(robot, exact=options.exact)
    if options.claims is not None:
        claims = Claims.of(claims.stated() | Claims.of(options.claims).stated())
    return record(
        path,
        world=options.world, robot=robot, start=start, goal=problem.goal,
        dof=problem.space.dof if robot is None else None,
        planner=f"ompl:{problem.name}", params=problem.params, seed=options.seed,
        time_limit=float(limit) if isinstance(limit, int | float) else None,
        claims=claims, clock=clock,
    )  # fmt: skip
