"""A scenario: everything that decides what a run does, as a user writes it and a file keeps it."""

import tomllib
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from pathlib import Path
from typing import Any, Literal, Self

import numpy as np

from brrt.errors import BrrtError, unknown
from brrt.planners import PLANNERS, Planner
from brrt.planners.base.problem import Problem, random_configuration
from brrt.planners.base.stop import Stop
from brrt.planners.postprocessing.execute import Execute
from brrt.planners.postprocessing.shortcut import Shortcut
from brrt.robots import Robot, make_robot, names_robot_file
from brrt.worlds import World, make_world, world_beside

RANDOM: Literal["random"] = "random"
"""A start or goal that the scenario's seed decides."""

MOST = 10**15
"""Above any count that a run could reach, and well within 64 bits."""

_NOWHERE = np.full(3, np.nan)
"""Stands for a configuration until it is drawn: robots that stand somewhere still say where."""


@dataclass(frozen=True, slots=True)
class Scenario:
    """World, robot, query, planner, parameters, seed and budget.

    Attributes:
        world: A generator with parameters (`circles2d:n=50`) or a file.
        robot: A robot with parameters (`polygon:length=4`) or a file.
        planner: Name of a planner.
        params: The planner's settings where they differ from its defaults.
        start: First configuration, or `random`; the world's own by default.
        goal: Last configuration, or `random`; the world's own by default.
        seed: Seed of every random draw of the planner and the smoother, and of a random start or
            goal, which have streams of their own: whatever else is random stays as it is.
        iterations: Iterations that the planner may make; by default as many as there is time for
            or, without a limit of time, the planner's own default.
        draws: Draws that it may make, whether they count as iterations or not; for a re-run.
        time: Seconds that it may take.
        smooth: Shortcut the path once there is one.
        shortcuts: Attempts of the smoother.
        execute: Drive the path in moves, as the real-time mode of the field has it.
        max_move: Longest move, in the robot's metric.
        deadline: Seconds for each move.
        clock: `real`, or `logical`: event n at n us, so that files are equal byte by byte.
    """

    world: str = "circles2d"
    robot: str = "point"
    planner: str = "rrt"
    params: Mapping[str, Any] = field(default_factory=dict)
    start: tuple[float, ...] | Literal["random"] | None = None
    goal: tuple[float, ...] | Literal["random"] | None = None
    seed: int = 0
    iterations: int | None = None
    draws: int | None = None
    time: float | None = None
    smooth: bool = True
    shortcuts: int = 100
    execute: bool = False
    max_move: float = 1.0
    deadline: float = 2.0
    clock: Literal["real", "logical"] = "real"

    def __post_init__(self) -> None:
        """Check what can be checked without making the world.

        Raises:
            BrrtError: A name is unknown or a number out of range.
        """
        for name in ("world", "robot", "planner", "clock"):
            if not isinstance(getattr(self, name), str):
                raise BrrtError(f"{name} must be a text, not {getattr(self, name)!r}")
        for name in ("smooth", "execute"):
            if not isinstance(getattr(self, name), bool):
                raise BrrtError(f"{name} must be true or false, not {getattr(self, name)!r}")
        for name in ("start", "goal"):
            if isinstance(getattr(self, name), str):
                object.__setattr__(self, name, _configuration(name, getattr(self, name)))
        object.__setattr__(self, "robot", _robot(self.robot))
        if self.clock not in ("real", "logical"):
            raise unknown("clock", self.clock, ("real", "logical"))
        self._check_numbers()
        # A recording of a planner that is not known here can be read all the same.
        if self.planner in PLANNERS:
            settings = self.settings()
            given = {name: settings[name] for name in self.params}
            object.__setattr__(self, "params", given)

    def _check_numbers(self) -> None:
        _whole("seed", self.seed, low=0)
        _whole("shortcuts", self.shortcuts, low=0)
        for name in ("iterations", "draws"):
            if getattr(self, name) is not None:
                _whole(name, getattr(self, name), low=1)
        for name, unit in (("time", " seconds"), ("deadline", " seconds"), ("max_move", "")):
            value = getattr(self, name)
            if not _positive(value) and not (name == "time" and value is None):
                raise BrrtError(f"{name} must be above 0{unit}, not {value!r}")

    @classmethod
    def parse(cls, values: Mapping[str, Any]) -> Self:
        """Make a scenario from named values, as from TOML or a manifest.

        Raises:
            BrrtError: A name is unknown or a value of no use.
        """
        if not isinstance(values, Mapping):
            raise BrrtError("a scenario must be a table of names and values")
        names = [f.name for f in fields(cls)]
        for name in values:
            if name not in names:
                raise unknown("key of a scenario", name, names)
        known = dict(values)
        for name in ("start", "goal"):
            if known.get(name) is not None:
                known[name] = _configuration(name, known[name])
        if not isinstance(known.get("params", {}), Mapping):
            raise BrrtError("params must be a table of names and values")
        return cls(**known)

    @classmethod
    def load(cls, path: Path) -> Self:
        """Read a scenario from a TOML file.

        Raises:
            BrrtError: The file cannot be read or is not a scenario.
        """
        try:
            values = tomllib.loads(path.read_text(encoding="utf-8"))
        except OSError as error:
            raise BrrtError(f"{path}: {error.strerror or error}") from None
        except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
            raise BrrtError(f"{path}: not TOML: {error}") from None
        # A map or a robot named in the file is looked for beside it first.
        world, robot = values.get("world"), values.get("robot")
        if isinstance(world, str):
            values["world"] = world_beside(path.parent, world)
        if isinstance(robot, str) and (path.parent / robot).is_file():
            values["robot"] = str(path.parent / robot)
        try:
            return cls.parse(values)
        except BrrtError as error:
            raise BrrtError(f"{path}: {error}") from None

    def as_dict(self) -> dict[str, Any]:
        """Names and values, as `parse` takes them."""
        return asdict(self)

    def with_stop_at(self, iterations: int) -> "Scenario":
        """Return the scenario of a run that the clock or a person cut, ended at that iteration."""
        most = self.make_stop().iterations
        return replace(self, draws=max(1, iterations), iterations=most, time=None)

    def make_planner(self) -> Planner:
        """Make the planner with its settings.

        Raises:
            BrrtError: There is no such planner here.
        """
        if self.planner not in PLANNERS:
            raise unknown("planner", self.planner, PLANNERS)
        return PLANNERS[self.planner].parse(f"planner {self.planner}", self.params)

    def settings(self) -> dict[str, Any]:
        """All settings of the planner; of one that is not known here, those that were given."""
        if self.planner not in PLANNERS:
            return dict(self.params)
        return self.make_planner().as_dict()

    def make_smoother(self) -> Shortcut | None:
        """Make the smoother, if there is to be one."""
        return Shortcut(attempts=self.shortcuts) if self.smooth else None

    def make_execute(self) -> Execute | None:
        """Make the real-time mode, if there is to be one."""
        return Execute(max_move=self.max_move) if self.execute else None

    def make_stop(self) -> Stop:
        """Make the budget."""
        planner = PLANNERS.get(self.planner, Planner)
        usual = MOST if self.time is not None else planner.default_iterations
        iterations = usual if self.iterations is None else self.iterations
        return Stop(iterations=iterations, draws=self.draws, time_s=self.time)

    def make_robot(self) -> Robot:
        """Make the robot.

        Raises:
            BrrtError: Its file cannot be read or is not a robot.
        """
        return make_robot(self.robot)

    def make_problem(self, world: World | None = None, robot: Robot | None = None) -> Problem:
        """Make the world and the robot, unless they are at hand, and put the query into them.

        A random start or goal is drawn in the world as it is: a generator keeps its corners free
        and not the places that are drawn later, so that each seed has its query in one world.

        Raises:
            BrrtError: World or robot cannot be made, or start or goal is missing or of no use.
        """
        robot = self.make_robot() if robot is None else robot
        given = (self.start, self.goal)
        ends = [q if q is None else _NOWHERE if isinstance(q, str) else np.array(q) for q in given]
        if world is None:
            first, last = (None if q is None else robot.position(q) for q in ends)
            world = make_world(self.world, first, last, robot.reach)
        for place, name in enumerate(("start", "goal")):
            if isinstance(given[place], str):
                rng = np.random.Generator(np.random.PCG64([self.seed, place + 1]))
                ends[place] = random_configuration(name, robot.resolved(world), world, rng)
        start, goal = (
            given if given is not None or own is None else robot.configuration(own)
            for given, own in zip(ends, (world.start, world.goal), strict=True)
        )
        for name, q in (("start", start), ("goal", goal)):
            if q is None:
                example = ",".join(robot.coordinates(world))
                raise BrrtError(
                    f"world {self.world} has no {name} of its own for the robot {self.robot}; "
                    f"give --{name} {example}"
                )
        assert start is not None and goal is not None  # noqa: S101, PT018 - told apart above
        return Problem(world, robot, start, goal)


def _robot(spec: str) -> str:
    """Return the name of a robot, so that a file's is known for one even when the file is gone.

    Raises:
        BrrtError: There is no such robot.
    """
    if not names_robot_file(spec):
        make_robot(spec)
        return spec
    return spec if "/" in spec or spec.endswith(".json") else f"./{spec}"


def _positive(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and 0 < value < np.inf


def _whole(name: str, value: Any, *, low: int) -> None:
    if isinstance(value, bool) or not isinstance(value, int):
        raise BrrtError(f"{name} must be a whole number, not {value!r}")
    if value < low:
        raise BrrtError(f"{name} must be at least {low}, not {value}")
    if name != "seed" and value > MOST:
        raise BrrtError(f"{name} must be at most {MOST:,}, not {value}")


def _configuration(name: str, value: Any) -> tuple[float, ...] | Literal["random"]:
    if isinstance(value, str) and value.strip() == RANDOM:
        return RANDOM
    parts = value.split(",") if isinstance(value, str) else value
    try:
        return tuple(float(part) for part in parts)
    except (TypeError, ValueError):
        raise _no_configuration(name, value) from None


def _no_configuration(name: str, value: Any) -> BrrtError:
    return BrrtError(f"{name} must be numbers like 1,2, or random, and not {value!r}")
