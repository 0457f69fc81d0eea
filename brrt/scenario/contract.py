"""What a planner promises, in numbers that `brrt verify` checks a recording against."""

import math
from collections.abc import Mapping
from dataclasses import MISSING, dataclass, field, fields, is_dataclass, replace
from typing import Any, Literal, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from brrt.errors import BrrtError
from brrt.scenario.scenario import DEFAULT_ITERATIONS
from brrt.settings import Settings, param

S = TypeVar("S", bound=Settings)


@dataclass(frozen=True, slots=True)
class Near(Settings):
    """The neighbourhood in which RRT* looks for parents: min(longest, gamma (log n / n)^(1/d))."""

    gamma: float = param(None, "the factor, in units of the robot's metric", above=0)
    longest: float = param(None, "the greatest radius", above=0)
    dof: int = param(None, "d, numbers in a configuration", low=1)

    def radius(self, n: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return the radius in a tree that has n nodes with the new one, shape of n."""
        n = np.maximum(n, 2)
        return np.minimum(self.longest, self.gamma * (np.log(n) / n) ** (1 / self.dof))


@dataclass(frozen=True, slots=True)
class Lattice(Settings):
    """The lattice that a search moves on; its origin is the start."""

    cell: float = param(None, "edge of a cell", above=0)
    diagonals: bool = param(None, "moves lead to all 26 (in 2D 8) neighbours, not to 6 (4)")
    max_move: float = param(None, "longest straight move to the goal", low=0)
    lookahead: int | None = param(
        None, "cells expanded before each move; none where no robot moves meanwhile", low=1
    )
    ordered: bool = param(
        False, "ties go to the cell closer to the goal by its current estimate, then to the oldest"
    )
    trials: int = param(1, "runs from the start, each with what the ones before learned", low=1)
    backs_up: bool = param(
        True,
        "with a lookahead of more than 1 the estimates of expanded cells become the least that the "
        "cells around them allow, and the robot moves to the cell that would be expanded next",
    )


@dataclass(frozen=True, slots=True)
class Draws(Settings):
    """Where samples come from; all that are not the goal are drawn uniformly from the bounds."""

    goal_bias: float = param(
        0.0, "probability of drawing the goal, until there is a path", low=0, high=1
    )
    goal_in_reach: bool = param(
        False, "the goal is always drawn after a draw that added a node within a step of it"
    )
    coin: float = param(
        0.0, "probability that a tree grows towards the other's newest node", low=0, high=1
    )
    informed: bool = param(
        False, "once there is a path, draws come from where a better one may lead"
    )


@dataclass(frozen=True, slots=True)
class Growth(Settings):
    """How trees grow: from the node nearest to the sample, by at most a step."""

    slices: int = param(1, "nodes that each step is cut into", low=1)
    turn: Literal["alternate", "smaller", "coin"] | None = param(
        None,
        "which of two trees grows: they alternate; the smaller one; or roles swap unless the coin "
        "picks the other tree's newest node as the sample. None for one tree",
    )
    connects: bool = param(
        False, "a tree grows step by step until it reaches the sample or is blocked"
    )
    links: Literal["extend", "connect"] | None = param(
        None, "how the other tree grows towards the newest node: one step, or step by step"
    )
    always_links: bool = param(False, "it does so even if no node was added")
    goal_test: bool = param(False, "the goal is tried from each new node that may be joined to it")
    counts_failed: bool = param(True, "draws that add no node count as iterations")


@dataclass(frozen=True, slots=True)
class PlannerInfo(Settings):
    """The planner that states a contract, for reports and advice; no rule judges by it.

    Attributes:
        settings: Every setting of the planner; None where the planner chooses the value.
        chosen: The values that it chose.
        greatest: The greatest value of each setting that has one.
        fixed_params: Settings that a branch cannot change.
    """

    registered: bool = param(False, "`brrt plan --planner` has it")
    default_iterations: int = param(DEFAULT_ITERATIONS, "limit of a run without a budget", low=1)
    bidirectional: str | None = param(None, "the planner that grows a second tree, from the goal")
    first_path: str | None = param(None, "the cheaper planner that stops at the first path")
    continuous: str | None = param(None, "a planner that needs no lattice")
    settings: Mapping[str, Any] = field(default_factory=dict)
    chosen: Mapping[str, float] = field(default_factory=dict)
    greatest: Mapping[str, float] = field(default_factory=dict)
    fixed_params: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Check every value."""
        Settings.__post_init__(self)
        for name in ("settings", "chosen", "greatest"):
            allowed = (bool, int, float, str, type(None)) if name == "settings" else (int, float)
            _check_table(name, getattr(self, name), allowed)
        names: Any = self.fixed_params
        if not isinstance(names, list | tuple) or not all(isinstance(name, str) for name in names):
            raise BrrtError(f"fixed_params must be a list of names, not {names!r:.60}")
        object.__setattr__(self, "fixed_params", tuple(names))


def _check_table(name: str, table: Any, allowed: tuple[type, ...]) -> None:
    if not isinstance(table, Mapping):
        raise BrrtError(f"{name} must be a table of names and values, not {table!r:.60}")
    for key, value in table.items():
        finite = not isinstance(value, float) or math.isfinite(value)
        if not isinstance(value, allowed) or not finite:
            raise BrrtError(f"{name} {key} must be a finite number or a text, not {value!r:.60}")


@dataclass(frozen=True, slots=True)
class Contract(Settings):
    """What a planner promises beyond what all planners do; None promises nothing.

    All planners promise: configurations inside bounds and limits; free edges, links and paths;
    costs that are the parent's cost plus the distance; no cycles; paths from start to goal whose
    cost is their length. Rules check these without a contract.

    Attributes:
        near: Where RRT* chooses parents and rewires.
        lattice: The lattice of a search.
        draws: Where samples come from.
        growth: How trees grow.
        planner: The planner that states the contract.
    """

    step: float | None = param(
        None, "longest edge of a tree; edges to the goal may exceed it with line_of_sight", above=0
    )
    line_of_sight: bool = param(False, "the goal may be joined from any distance")
    link: float | None = param(None, "longest link between two trees", above=0)
    stops: bool | None = param(None, "the run ends with its first path")
    near: Near | None = None
    lattice: Lattice | None = None
    draws: Draws | None = None
    growth: Growth | None = None
    planner: PlannerInfo = field(default_factory=PlannerInfo)

    @property
    def cell(self) -> float:
        """Edge of the lattice's cells; 0 without a lattice."""
        return 0.0 if self.lattice is None else self.lattice.cell

    @property
    def improves(self) -> bool:
        """Whether the planner can improve its first path."""
        return self.near is not None

    @property
    def learns(self) -> bool:
        """Whether the robot moves while the planner raises its estimates of the cost-to-go."""
        return self.lattice is not None and self.lattice.lookahead is not None

    def as_dict(self) -> dict[str, Any]:
        """Return what `from_dict` takes; values equal to the default are left out."""
        return _stated(self)

    @classmethod
    def from_dict(cls, values: Any) -> Self:
        """Read what `as_dict` returned.

        Raises:
            BrrtError: A value is wrong, or a field is unknown here.
        """
        lattice = values.get("lattice") if isinstance(values, dict) else None
        if isinstance(lattice, dict) and "epsilon" in lattice:
            values = _renamed(values)
        return _read(cls, "a contract", values)


_PARTS: Mapping[str, type[Settings]] = {
    "near": Near, "lattice": Lattice, "draws": Draws, "growth": Growth, "planner": PlannerInfo,
}  # fmt: skip


def _renamed(values: Any) -> Any:
    """Return values of a contract in which the setting `cell` has its former name, `epsilon`."""
    if isinstance(values, dict):
        return {"cell" if key == "epsilon" else key: _renamed(v) for key, v in values.items()}
    if isinstance(values, list):
        return ["cell" if value == "epsilon" else value for value in values]
    return values


def _read(kind: type[S], name: str, values: Any) -> S:
    """Read a contract or a part of one from what `_stated` returned."""
    if not isinstance(values, dict):
        raise BrrtError(f"{name} must be an object, not {values!r:.60}")
    nested = {f.name for f in fields(kind) if "doc" not in f.metadata}
    made = kind.parse(name, {key: value for key, value in values.items() if key not in nested})
    parts = {
        key: _read(_PARTS[key], key, value) if key in _PARTS else value
        for key, value in values.items()
        if key in nested
    }
    return replace(made, **parts)


def _stated(part: Any) -> dict[str, Any]:
    """Return the fields of a part of a contract that differ from their defaults."""
    found = {}
    for f in fields(part):
        value = getattr(part, f.name)
        default = f.default if f.default_factory is MISSING else f.default_factory()
        if value != default:
            found[f.name] = _stated(value) if is_dataclass(value) else value
    return found
