"""What rules look at, and how they say what they found."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from brrt.events import Events, Kind, Phase, Stage, Status, Table
from brrt.planners import PLANNERS
from brrt.planners.contract import Contract
from brrt.replay.checks.motions import Obstacles, first_hits
from brrt.replay.ledger import Changes, Ledger, changes, edge_lengths, fold
from brrt.scenario import Manifest
from brrt.worlds.world import World

Floats = NDArray[np.float64]

CLOSE = 1e-9
"""Part of a length by which figures may differ from it; rounding stays far below."""

ROUNDING = 1e-14
"""The same, as a part of the coordinates: a short motion far from the origin is rounded most."""

_SHOWN = 20


@dataclass(frozen=True, slots=True)
class Finding:
    """A promise that an event breaks.

    Attributes:
        rule: Name of the rule.
        seq: The event's number; -1 where the whole log is meant.
        t: Its time in ns.
        message: What is wrong with it.
    """

    rule: str
    seq: int
    t: int
    message: str


@dataclass(slots=True)
class Tally:
    """What a rule looked at; of many findings the first are kept, all are counted.

    Attributes:
        rule: Name of the rule.
        promise: What it holds a run to.
        examined: Things looked at.
        broken: Things that break the promise.
        findings: The first of those.
    """

    rule: str
    promise: str
    examined: int = 0
    broken: int = 0
    findings: list[Finding] = field(default_factory=list)

    def look(self, table: Table, wrong: NDArray[np.bool_], say: Callable[[int], str]) -> None:
        """Take in rows of a table.

        Args:
            table: Events, shape (n,).
            wrong: Which of them break the promise, shape (n,).
            say: What is wrong with the row of that number.
        """
        self.examined += len(table)
        at = np.flatnonzero(wrong)
        self.broken += len(at)
        for i in at[: _SHOWN - len(self.findings)].tolist():
            row = table[i]
            self.findings.append(Finding(self.rule, int(row["seq"]), int(row["t"]), say(i)))

    def one(self, event: Any, message: str | None) -> None:
        """Take in one event, or None for the log as a whole; no message where all is well."""
        self.examined += 1
        if message is None:
            return
        self.broken += 1
        if len(self.findings) < _SHOWN:
            seq, t = (-1, 0) if event is None else (int(event["seq"]), int(event["t"]))
            self.findings.append(Finding(self.rule, seq, t, message))


@dataclass(frozen=True, eq=False)
class Grown:
    """All that happened to one tree.

    Attributes:
        number: The tree's.
        edges: Its edges; node n is the n-th.
        rewires: Its rewires.
        made: Both, in order.
        length: Length of the edge that each change makes, nan for roots, shape (m,).
        ledger: The costs as they stood.
    """

    number: int
    edges: Table
    rewires: Table
    made: Changes
    length: Floats
    ledger: Ledger

    def of_edges(self, column: NDArray[Any]) -> NDArray[Any]:
        """The part of a column of changes that belongs to the edges."""
        return column[self.made.joins]

    def of_rewires(self, column: NDArray[Any]) -> NDArray[Any]:
        """The part that belongs to the rewires."""
        return column[~self.made.joins]


@dataclass(frozen=True, eq=False)
class Case:
    """A recording under examination; what several rules need is worked out once.

    Attributes:
        manifest: The run's.
        world: The run's.
        events: The whole log.
        robot: What moves.
        start: First configuration, shape (dof,).
        goal: Last configuration, shape (dof,).
        lower: Least configuration, shape (dof,).
        upper: Greatest configuration, shape (dof,).
        contract: What the planner promises, by the settings that it ended with.
        stretches: The number of the event that each contract rules from, and the contract: more
            than one where a run went on from a recorded one with other settings.
        known: Whether the planner is known here, so that there is a contract.
        cut: Whether the log breaks off.
    """

    manifest: Manifest
    world: World
    events: Events
    robot: Any
    start: Floats
    goal: Floats
    lower: Floats
    upper: Floats
    contract: Contract
    stretches: tuple[tuple[int, Contract], ...]
    known: bool
    cut: bool = False

    @classmethod
    def of(
        cls,
        manifest: Manifest,
        world: World,
        events: Events,
        contract: Contract | None = None,
        *,
        cut: bool = False,
    ) -> Self:
        """Open the case of a recording.

        Args:
            manifest: The run's.
            world: The run's.
            events: The whole log.
            contract: What the planner promises; by default what the registered one does.
            cut: Whether the log breaks off.

        Raises:
            BrrtError: Its query is of no use in its world.
        """
        scenario = replace(manifest.scenario, start=manifest.start, goal=manifest.goal)
        problem = scenario.make_problem(world)
        known = contract is not None or scenario.planner in PLANNERS
        stretches: tuple[tuple[int, Contract], ...] = ((0, contract or Contract()),)
        if contract is None and known:
            stretches = tuple(
                (first, ruling.make_planner().contract(problem))
                for first, ruling in manifest.stretches
            )
        bounds = np.array(problem.space.lower), np.array(problem.space.upper)
        return cls(
            manifest, world, events, problem.robot, problem.start, problem.goal, *bounds,
            stretches[-1][1], stretches, known, cut,
        )  # fmt: skip

    def stretch(self, table: Table) -> NDArray[np.int64]:
        """Return which of the `stretches` each event belongs to, shape (n,)."""
        firsts = [first for first, _ in self.stretches]
        return np.maximum(np.searchsorted(firsts, table["seq"], side="right") - 1, 0)

    def limits(self, table: Table, figure: Callable[[Contract], float | None]) -> Floats:
        """Return a limit that each event is held to, infinite where there is none, shape (n,)."""
        found = [figure(contract) for _, contract in self.stretches]
        each = np.array([np.inf if limit is None else limit for limit in found])
        return np.asarray(each[self.stretch(table)])

    def distance(self, a: Floats, b: Floats) -> Floats:
        """Distances in the robot's metric between rows of configurations."""
        return np.asarray(self.robot.distance(np.asarray(a), np.asarray(b)))

    @cached_property
    def blur(self) -> float:
        """Lengths that differ by this much are the same, however short they are."""
        ends = np.abs([self.lower, self.upper])
        return ROUNDING * float(ends.max())

    def same(self, a: Floats, b: Floats) -> NDArray[np.bool_]:
        """Whether lengths are equal within rounding; not a number equals nothing."""
        return np.asarray(np.abs(a - b) <= CLOSE * np.abs(b) + self.blur)

    def at_most(self, a: Floats, most: Floats | float) -> NDArray[np.bool_]:
        """Whether lengths are within a limit, but for rounding."""
        return np.asarray(a <= np.asarray(most) * (1 + CLOSE) + self.blur)

    @cached_property
    def obstacles(self) -> Obstacles:
        """The world's obstacles under one numbering."""
        return Obstacles(self.world)

    def blocked(self, a: Floats, b: Floats) -> NDArray[np.int64]:
        """For each motion the number of an obstacle that it runs into, or -1."""
        return first_hits(self.obstacles, self.robot, np.asarray(a), np.asarray(b))

    def look_free(self, tally: Tally, table: Table, a: Floats, b: Floats, what: str) -> None:
        """See that the motion of each row of a table is free; shapes (n, dof)."""
        hit = self.blocked(a, b)
        tally.look(table, hit >= 0, lambda i: f"{what} hits {self.obstacles.name(int(hit[i]))}")

    @cached_property
    def trees(self) -> list[Grown]:
        """The trees, each with its costs at every moment."""
        numbers = {
            int(number)
            for kind in (Kind.EDGE, Kind.REWIRE)
            for number in np.unique(self.events[kind]["tree"])
        }
        return [self._grown(number) for number in sorted(numbers)]

    def _grown(self, number: int) -> Grown:
        edges, rewires = (
            table[table["tree"] == number]
            for table in (self.events[Kind.EDGE], self.events[Kind.REWIRE])
        )
        made = changes(self.events, number)
        length = edge_lengths(np.asarray(edges["q"]), made, self.distance)
        return Grown(number, edges, rewires, made, length, fold(made, length))

    @cached_property
    def paths(self) -> list[tuple[Any, Floats]]:
        """Each path's event, and its waypoints, shape (n, dof)."""
        dof = self.events.dof
        return [
            (event, np.asarray(event["waypoints"], np.float64).reshape(-1, dof))
            for event in self.events[Kind.PATH]
        ]

    @property
    def found(self) -> list[tuple[Any, Floats]]:
        """The paths that the planner found, better ones after worse."""
        return [path for path in self.paths if path[0]["stage"] != Stage.SMOOTHED]

    @cached_property
    def outcome(self) -> Status | None:
        """How planning ended; None where the log does not say."""
        phases = self.events[Kind.PHASE]
        ends = phases[(phases["name"] == Phase.PLAN) & (phases["status"] != Status.BEGIN)]
        last = int(ends["status"][-1]) if len(ends) else -1
        return Status(last) if last in set(Status) else None
