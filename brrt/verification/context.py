"""What rules look at."""

from collections.abc import Callable, Generator, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from brrt.collision.motions import Obstacles, first_hits
from brrt.events import Events, Kind, Phase, Stage, Status, Table
from brrt.replay.cost_history import CostHistory
from brrt.replay.tree_fold import (
    VALID,
    CostFold,
    Distance,
    TreeChanges,
    fold_costs,
    of_tree,
    trees_in,
)
from brrt.scenario.contract import Contract
from brrt.scenario.contracts import contracts_of
from brrt.scenario.manifest import Manifest
from brrt.scenario.query import Query
from brrt.verification.result import RuleResult
from brrt.verification.retention import Kept
from brrt.verification.timeline import Scripts
from brrt.worlds.world import World

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

CLOSE = 1e-9
"""Part of a length by which figures may differ from it; rounding stays far below."""

ROUNDING = 1e-14
"""The same, as a part of the coordinates: a short motion far from the origin is rounded most."""

_AT_ONCE = 1 << 18

Windows = Generator[None, Events | None]
"""A rule that looks at events as they are read: it is sent window after window, then None."""


def waypoints(event: Any, dof: int) -> Floats:
    """A path's configurations, shape (n, dof)."""
    return np.asarray(event["waypoints"], np.float64).reshape(-1, dof)


@dataclass(frozen=True, eq=False)
class TreeHistory:
    """All that happens to one tree.

    Attributes:
        number: The tree's.
        edges: Its edges; node n is the n-th.
        rewires: Its rewires.
        changes: Both, in order.
        length: Length of the edge that each change makes, nan for roots, shape (m,).
        fold: What a fold finds of each change.
    """

    number: int
    edges: Table
    rewires: Table
    changes: TreeChanges
    length: Floats
    fold: CostFold

    @classmethod
    def of(cls, number: int, events: Events, distance: Distance) -> Self:
        """Fold the tree of a number."""
        edges, rewires = (of_tree(events[kind], number) for kind in (Kind.EDGE, Kind.REWIRE))
        changes = TreeChanges.of(edges, rewires)
        length = changes.lengths(np.asarray(edges["q"]), distance)
        return cls(number, edges, rewires, changes, length, fold_costs(changes, length))

    def of_edges(self, column: NDArray[Any]) -> NDArray[Any]:
        """The part of a column of changes that belongs to the edges."""
        return column[self.changes.joins] if len(self.rewires) else column

    def of_rewires(self, column: NDArray[Any]) -> NDArray[Any]:
        """The part that belongs to the rewires."""
        return column[~self.changes.joins] if len(self.rewires) else column[:0]

    def spans(self) -> Iterator[slice]:
        """Yield the edges in parts: of millions not all can be looked at at once."""
        for first in range(0, len(self.edges), _AT_ONCE):
            yield slice(first, min(first + _AT_ONCE, len(self.edges)))

    @cached_property
    def _history(self) -> CostHistory:
        return CostHistory(self.changes, self.length, self.fold.verdict == VALID)

    def costs(self, seq: Ints, node: Ints) -> Floats:
        """Return what nodes cost after events, nan where they do not exist yet, shape (k,)."""
        if len(self.rewires):
            return self._history.at(seq, node)[0]
        exist = (node >= 0) & (node < np.searchsorted(self.edges["seq"], seq, side="right"))
        cost = np.full(len(node), np.nan)
        cost[exist] = self.fold.cost[node[exist]]
        return cost


@dataclass(frozen=True, eq=False)
class Context:
    """A recording under examination; what several rules need is worked out once.

    Attributes:
        manifest: The run's.
        world: The run's.
        kept: What is kept of the log, which is read in windows.
        robot: What moves.
        start: First configuration, shape (dof,).
        goal: Last configuration, shape (dof,).
        lower: Least configuration, shape (dof,).
        upper: Greatest configuration, shape (dof,).
        contract: What the planner promises, by the settings that it ended with.
        stretches: The number of the event that each contract rules from, and the contract: more
            than one where a run went on from a recorded one with other settings.
        known: Whether there is a contract.
        breaks_off: Says, once the log was read, whether it breaks off.
        figures: What stands at the recording's end, under the names of `Metrics`; None where
            nothing does.
    """

    manifest: Manifest
    world: World
    kept: Kept
    robot: Any
    start: Floats
    goal: Floats
    lower: Floats
    upper: Floats
    contract: Contract
    stretches: tuple[tuple[int, Contract], ...]
    known: bool
    breaks_off: Callable[[], bool]
    figures: Mapping[str, Any] | None = None

    @classmethod
    def of(
        cls,
        manifest: Manifest,
        world: World,
        contract: Contract | None = None,
        breaks_off: Callable[[], bool] = lambda: False,
        figures: Mapping[str, Any] | None = None,
    ) -> Self:
        """Open the case of a recording.

        Args:
            manifest: The run's.
            world: The run's.
            contract: What the planner promises; by default what the recording states.
            breaks_off: Says, once the log was read, whether it breaks off.
            figures: What stands at the recording's end.

        Raises:
            BrrtError: Its query is of no use in its world.
        """
        query = Query.recorded(manifest, world)
        stated = contracts_of(manifest, world) if contract is None else (contract,)
        stretches = tuple(
            (first, each or Contract())
            for (first, _), each in zip(manifest.stretches, stated, strict=False)
        )
        return cls(
            manifest, world, Kept(manifest.dof, stretches[-1][1]), query.robot, query.start,
            query.goal, query.lower, query.upper, stretches[-1][1], stretches,
            stated[-1] is not None, breaks_off, figures,
        )  # fmt: skip

    @cached_property
    def scripts(self) -> Scripts:
        """The log's events in one table, iteration by iteration, for rules that read it so."""
        growing = any(contract.growth is not None for _, contract in self.stretches)
        return Scripts(self.dof, {first for first, _ in self.stretches}, growing=growing)

    @cached_property
    def events(self) -> Events:
        """What is kept of the log; there once the last window was read."""
        return self.kept.events()

    @property
    def cut(self) -> bool:
        """Whether the log breaks off; known once the last window was read."""
        return self.breaks_off()

    @property
    def dof(self) -> int:
        """Numbers in a configuration."""
        return self.manifest.dof

    def stretch(self, table: Table) -> NDArray[np.int64]:
        """Return which of the `stretches` each event belongs to, shape (n,)."""
        firsts = [first for first, _ in self.stretches]
        return np.maximum(np.searchsorted(firsts, table["seq"], side="right") - 1, 0)

    def ruling(self, window: Events | None) -> Contract:
        """Return the contract that rules a window, which ends where another one begins to rule."""
        heads = [table[:1] for table in window.tables.values()] if window is not None else []
        if not heads:
            return self.contract
        return self.stretches[min(int(self.stretch(head)[0]) for head in heads if len(head))][1]

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

    def look_free(
        self,
        result: RuleResult,
        table: Table,
        a: Floats,
        b: Floats,
        what: str,
        name: str | None = None,
    ) -> None:
        """See that the motion of each row of a table is free.

        Args:
            result: Takes it in.
            table: The events, shape (n,).
            a: Where motions begin, shape (n, dof).
            b: Where they end, shape (n, dof).
            what: What a motion is.
            name: The field that tells it from others; None where none does.
        """
        hit = self.blocked(a, b)

        def say(i: int) -> str:
            which = what if name is None else f"{what} {table[name][i]}"
            return f"{which} hits {self.obstacles.name(int(hit[i]))}"

        result.look(table, hit >= 0, say)

    @cached_property
    def trees(self) -> list[TreeHistory]:
        """The trees, each with its costs at every moment."""
        tables = self.events[Kind.EDGE], self.events[Kind.REWIRE]
        return [TreeHistory.of(number, self.events, self.distance) for number in trees_in(*tables)]

    @cached_property
    def paths(self) -> list[tuple[Any, Floats]]:
        """Each path's event, and its waypoints, shape (n, dof)."""
        return [(event, waypoints(event, self.dof)) for event in self.events[Kind.PATH]]

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
