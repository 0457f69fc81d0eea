"""What rules know of a recording."""

from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrt.collision.clearance import first_contacts
from brrt.collision.motions import Obstacles, first_hits
from brrt.digits import digits_within
from brrt.events import Events, Kind, Phase, Stage, Status, Table
from brrt.recording import Recording
from brrt.replay.graph import as_forest
from brrt.replay.text import vector
from brrt.replay.tree_fold import trees_in
from brrt.robots import Robot
from brrt.scenario.claims import Claims
from brrt.scenario.contract import Contract
from brrt.scenario.contracts import contracts_of
from brrt.scenario.query import Query
from brrt.verification.draws import DrawHistory, Drawn
from brrt.verification.retention import KeptEvents
from brrt.verification.timeline import Timeline
from brrt.verification.tolerances import CLOSE, ROUNDING
from brrt.verification.tree_history import TreeHistory
from brrt.worlds.world import World

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]


def waypoints(event: Any, dof: int) -> Floats:
    """Return the configurations of a path event, shape (n, dof)."""
    return np.asarray(event["waypoints"], np.float64).reshape(-1, dof)


def _unknown(claims: Claims, robot: Robot, world: World) -> dict[str, str]:
    """Return what is not known, or not as rules take it for granted, and why."""
    stated = claims.stated()
    stated.pop("goal_tolerance", None)  # it excludes nothing
    found = {name: f"the recording claims {name}: {value}" for name, value in stated.items()}
    if robot.opaque or not world.bounded:
        if robot.limited:
            return found | {"collisions": "the robot's shape is not known"}
        why = "the robot is not known" if world.bounded else "the world is not known"
        found |= {"collisions": why, "bounds": why}
    return found


class Context:
    """A recording, and what several rules need to know of it.

    Args:
        recording: The recording.
        contract: What the planner promises; by default what the recording states.

    Attributes:
        manifest: What was run.
        world: Where.
        result: The metrics that are stored at the recording's end; None if that is missing.
        robot: What moves, resolved in the world.
        start: First configuration, shape (dof,).
        goal: Last configuration, shape (dof,).
        lower: Least value of each coordinate, shape (dof,).
        upper: Greatest value of each coordinate, shape (dof,).
        stretches: For each contract the number of its first event, and the contract: more than
            one where the run is a branch with other settings.
        claims: How the log was made.
        unknown: What rules cannot take for granted here, and why, by the names that
            `Rule.assumes` has: claims, and what the robot hits (`collisions`), and its `bounds`.
        contract: The last of them, an empty one if the recording states none.
        has_contract: Whether it states one.
        kept: The events that are kept for the end.
        drawn: The samples of the current window.
        iterations: The iterations of a planner that grows trees, as far as they end in the current
            window; see `brrt.verification.timeline`.

    Raises:
        BrrtError: Start or goal is not free in the world, or the manifest is damaged.
    """

    def __init__(self, recording: Recording, contract: Contract | None = None) -> None:
        self.manifest, self.world = recording.manifest, recording.world
        self.result, self.dof = recording.result, recording.manifest.dof
        self.claims = self.manifest.claims
        query = Query.recorded(self.manifest, self.world)
        self.robot, self.start, self.goal = query.robot, query.start, query.goal
        self.lower, self.upper = query.lower, query.upper
        self.unknown = _unknown(self.claims, self.robot, self.world)
        stated = (contract,) if contract else contracts_of(self.manifest, self.world)
        firsts = [first for first, _ in self.manifest.stretches]
        self.stretches = tuple(
            (first, each or Contract()) for first, each in zip(firsts, stated, strict=False)
        )
        self.contract, self.has_contract = self.stretches[-1][1], stated[-1] is not None
        self.kept = KeptEvents(self.dof, self.contract)
        self._draws = DrawHistory(self.distance, self.goal, self.tolerance)
        self._timeline = Timeline(self.dof, set(firsts))
        self._grows = any(contract.growth is not None for _, contract in self.stretches)
        self.drawn: Drawn
        self.iterations: Table

    def advance(self, window: Events) -> Contract:
        """Go on to the next events; return the contract that they were made under."""
        self.kept.add(window)
        firsts = [table[:1] for table in window.tables.values() if len(table)]
        # Windows end where stretches end.
        stretch = min(int(self.stretch(first)[0]) for first in firsts)
        contract = self.stretches[stretch][1]
        self.drawn = self._draws.next(window, contract.step or 0.0)
        if self._grows:
            self.iterations = self._timeline.next(window)
        return contract

    def end(self) -> None:
        """Go on to the last iteration, once all events have been read."""
        rows = self._timeline.rest()
        if self.may_be_unfinished and not self.is_cut:
            # What follows planning does not follow from an iteration that was not finished.
            rows = rows[rows["seq"] < self._planned["seq"][-1]]
        self.iterations = rows

    @property
    def is_cut(self) -> bool:
        """Whether the run's end is missing."""
        return self.result is None

    @property
    def may_be_unfinished(self) -> bool:
        """Whether the last iteration may lack events: the clock or an interruption may end it."""
        return self.is_cut or self.outcome in (Status.TIME_LIMIT, Status.INTERRUPTED)

    @cached_property
    def events(self) -> Events:
        """The events that were kept, once all windows have been read."""
        return self.kept.events()

    def stretch(self, table: Table) -> Ints:
        """Return which of the `stretches` each event belongs to, shape (n,)."""
        firsts = [first for first, _ in self.stretches]
        return np.maximum(np.searchsorted(firsts, table["seq"], side="right") - 1, 0)

    def limits(self, table: Table, limit: Callable[[Contract], float | None]) -> Floats:
        """Return the limit that the contract sets for each event, infinite for None, shape (n,)."""
        found = [limit(contract) for _, contract in self.stretches]
        return np.array([np.inf if each is None else each for each in found])[self.stretch(table)]

    def distance(self, a: Floats, b: Floats) -> Floats:
        """Measure distances between rows of configurations in the robot's metric."""
        return np.asarray(self.robot.distance(np.asarray(a), np.asarray(b)))

    @cached_property
    def tolerance(self) -> float:
        """Absolute tolerance of lengths."""
        return ROUNDING * float(np.abs([self.lower, self.upper]).max())

    def equal(self, a: Floats, b: Floats) -> Flags:
        """Return whether lengths are equal within rounding; not a number equals nothing."""
        return np.asarray(np.abs(a - b) <= CLOSE * np.abs(b) + self.tolerance)

    def right_cost(self, cost: Floats, length: Floats) -> Flags:
        """Return whether costs are right: lengths, or no less if motions are the planner's own."""
        if self.claims.motions == "own":
            return self.at_most(length, cost)
        return self.equal(cost, length)

    def at_most(self, a: Floats, limit: Floats | float) -> Flags:
        """Return whether lengths are within a limit, within rounding."""
        return np.asarray(a <= np.asarray(limit) * (1 + CLOSE) + self.tolerance)

    @cached_property
    def obstacles(self) -> Obstacles:
        """The world's obstacles under one numbering."""
        return Obstacles(self.world)

    def first_hits(self, a: Floats, b: Floats) -> Ints:
        """Return for each motion the number of an obstacle that it hits, or -1, shape (n,)."""
        return first_hits(self.obstacles, self.robot, np.asarray(a), np.asarray(b))

    def hit_text(self, a: Floats, b: Floats, hit: int) -> str:
        """Return what a motion hits, and where it begins to."""
        a, b = np.asarray(a)[None], np.asarray(b)[None]
        contact = first_contacts(self.obstacles, self.robot, a, b, np.array([hit]))
        q = self.robot.interpolate(a[0], b[0], float(contact.part[0]))
        place = vector(q, digits_within(self.lower, self.upper))
        return f"{self.obstacles.name(int(contact.other[0]))} at {place}"

    @cached_property
    def trees(self) -> list[TreeHistory]:
        """The trees."""
        made = as_forest(self.events)
        numbers = trees_in(made[Kind.EDGE], made[Kind.REWIRE])
        return [TreeHistory.of(number, made, self.distance) for number in numbers]

    @cached_property
    def paths(self) -> list[tuple[Any, Floats]]:
        """The event of each path, and its waypoints, shape (n, dof)."""
        return [(event, waypoints(event, self.dof)) for event in self.events[Kind.PATH]]

    @property
    def planned_paths(self) -> list[tuple[Any, Floats]]:
        """The paths that the planner found, the smoothed ones left out."""
        return [path for path in self.paths if path[0]["stage"] != Stage.SMOOTHED]

    @cached_property
    def outcome(self) -> Status | None:
        """How planning ended; None if the log does not state that."""
        last = int(self._planned["status"][-1]) if len(self._planned) else -1
        return Status(last) if last in set(Status) else None

    @cached_property
    def _planned(self) -> Table:
        """The events that end planning."""
        phases = self.events[Kind.PHASE]
        ends: Table = phases[(phases["name"] == Phase.PLAN) & (phases["status"] != Status.BEGIN)]
        return ends
