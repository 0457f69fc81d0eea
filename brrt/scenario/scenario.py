"""A scenario: everything that determines a run, as users write it and files store it."""

import math
import tomllib
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any, Literal, Self

import numpy as np

from brrt.errors import BrrtError, unknown
from brrt.files import read_text
from brrt.robots import Robot, make_robot, mark_robot_file, names_robot_file
from brrt.settings import MOST
from brrt.worlds import world_beside

RANDOM: Literal["random"] = "random"
"""A start or goal that is drawn from the scenario's seed."""

_LONGEST_S = 1e9
"""Greatest time in seconds: 31 years, whose nanoseconds fit into 64 bits."""

UNLIMITED = 10**15
"""A limit that no count of a run reaches; fits into 64 bits."""

_MAX_BYTES = 1_000_000
"""Of a file; real ones have some hundreds."""

DEFAULT_ITERATIONS = 1_000_000
"""Iterations of a run without a budget, unless its planner has another default."""

_FORMER_NAMES: Mapping[str, Mapping[str, str]] = {
    planner: {"epsilon": "cell"} for planner in ("a-star", "lrta-star")
}
"""For each planner, former names of settings, still accepted, and what they are called now."""


@dataclass(frozen=True, slots=True)
class Scenario:
    """World, robot, query, planner, parameters, seed and budget.

    Attributes:
        world: A generator with parameters (`circles2d:n=50`) or a file.
        robot: A robot with parameters (`polygon:length=4`) or a file.
        planner: Name of a planner.
        params: The planner's settings; the others have its defaults. A scenario does not check
            them, `brrt.planners.check_params` does.
        start: First configuration, or `random`; the world's own by default.
        goal: Last configuration, or `random`; the world's own by default.
        seed: Seed of the draws of planner and smoother. A random start and goal are drawn from
            generators of their own, so the other draws do not depend on them.
        iterations: Limit of the planner's iterations; by default none if `time` is given, and
            otherwise the planner's default.
        draws: Limit of its draws, including those that do not count as iterations; used to
            reproduce a run.
        time: Limit of its time in seconds.
        smooth: Shortcut the path.
        shortcuts: Attempts of the smoother.
        execute: Execute the path in moves, one in each deadline.
        max_move: Longest move, in the robot's metric.
        deadline: Seconds for each move.
        clock: `real`, or `logical`: event n at n us, so that equal runs give equal files.
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
        """Check what can be checked without world and planner.

        Raises:
            BrrtError: A name is unknown or a number out of range.
        """
        given: Any = self.params
        params = {} if given is None else given
        if not isinstance(params, Mapping):
            raise BrrtError("params must be a table of names and values")
        plain = {"params": {name: _plain(value) for name, value in params.items()}}
        plain |= {f.name: _plain(getattr(self, f.name)) for f in fields(self) if f.name != "params"}
        for name, value in plain.items():
            object.__setattr__(self, name, value)
        for name in ("world", "robot", "planner", "clock"):
            if not isinstance(getattr(self, name), str):
                raise BrrtError(f"{name} must be a text, not {getattr(self, name)!r}")
        for name in ("smooth", "execute"):
            if not isinstance(getattr(self, name), bool):
                raise BrrtError(f"{name} must be true or false, not {getattr(self, name)!r}")
        for name in ("start", "goal"):
            if getattr(self, name) is not None:
                object.__setattr__(self, name, _configuration(name, getattr(self, name)))
        object.__setattr__(self, "params", _renamed(self.planner, self.params))
        object.__setattr__(self, "robot", _robot(self.robot))
        if self.clock not in ("real", "logical"):
            raise unknown("clock", self.clock, ("real", "logical"))
        self._check_numbers()

    def _check_numbers(self) -> None:
        for name, low in (("seed", 0), ("shortcuts", 0), ("iterations", 1), ("draws", 1)):
            value = getattr(self, name)
            if value is not None or name in ("seed", "shortcuts"):
                object.__setattr__(self, name, _whole(name, value, low=low))
        for name, high, unit in (
            ("time", _LONGEST_S, " seconds"), ("deadline", _LONGEST_S, " seconds"),
            ("max_move", MOST, ""),
        ):  # fmt: skip
            value = getattr(self, name)
            if value is None and name == "time":
                continue
            if not _positive(value):
                raise BrrtError(f"{name} must be above 0{unit}, not {value!r:.60}")
            if value > high:
                raise BrrtError(f"{name} must be at most {high:g}{unit}, not {value!r:.60}")

    @classmethod
    def parse(cls, values: Mapping[str, Any]) -> Self:
        """Make a scenario from named values, as from TOML or a manifest.

        Raises:
            BrrtError: A name is unknown or a value is wrong.
        """
        if not isinstance(values, Mapping):
            raise BrrtError("a scenario must be a table of names and values")
        names = [f.name for f in fields(cls)]
        for name in values:
            if name not in names:
                raise unknown("key of a scenario", name, names)
        return cls(**values)

    @classmethod
    def load(cls, path: Path) -> Self:
        """Read a scenario from a TOML file.

        Raises:
            BrrtError: The file cannot be read or is not a scenario.
        """
        try:
            values = tomllib.loads(read_text(path, "a scenario", _MAX_BYTES))
        except RecursionError:
            raise BrrtError(f"{path}: not a scenario: it is nested too deeply") from None
        except tomllib.TOMLDecodeError as error:
            raise BrrtError(f"{path}: not TOML: {error}") from None
        # Files of the world and the robot are relative to this file.
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

    def iteration_limit(self, default: int = DEFAULT_ITERATIONS) -> int:
        """Return the limit of the planner's iterations; `UNLIMITED` if only its time is limited.

        Args:
            default: The planner's default, for a run without a budget.
        """
        usual = UNLIMITED if self.time is not None else default
        return usual if self.iterations is None else self.iterations

    def make_robot(self) -> Robot:
        """Make the robot.

        Raises:
            BrrtError: Its file cannot be read or is not a robot.
        """
        return make_robot(self.robot)


def _renamed(planner: str, params: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return settings of a planner under the names that they have now.

    Raises:
        BrrtError: One is given under both names.
    """
    names = _FORMER_NAMES.get(planner, {})
    for former, name in names.items():
        if former in params and name in params:
            raise BrrtError(f"{former} is the former name of {name}; give only {name}")
    return {names.get(name, name): value for name, value in params.items()}


def _robot(spec: str) -> str:
    """Return a robot's specification; a file's is marked as one, even if it does not exist.

    Raises:
        BrrtError: There is no such robot.
    """
    if not names_robot_file(spec):
        make_robot(spec)
        return spec
    return mark_robot_file(spec)


def _positive(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and 0 < value < np.inf


def _plain(value: Any) -> Any:
    """Return numpy's numbers and arrays as Python's."""
    return value.tolist() if isinstance(value, np.generic | np.ndarray) else value


def _whole(name: str, value: Any, *, low: int) -> int:
    """Return a whole number; TOML writes 1e3 as a float."""
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if not number or not math.isfinite(value) or int(value) != value:
        raise BrrtError(f"{name} must be a whole number, not {value!r:.60}")
    if value < low:
        raise BrrtError(f"{name} must be at least {low}, not {value!r:.60}")
    if name != "seed" and value > UNLIMITED:
        raise BrrtError(f"{name} must be at most {UNLIMITED:,}, not {value!r:.60}")
    return int(value)


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
