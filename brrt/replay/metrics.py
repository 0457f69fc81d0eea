"""The metrics of a run: one fold over its events, live or from a file."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrt.errors import BrrtError
from brrt.events import COUNTS, Events, Instant, Kind, Phase, Stage, Status, Table
from brrt.recording import Recording
from brrt.replay.fold import feed
from brrt.scenario.manifest import Manifest
from brrt.scenario.scenario import Scenario

Path = tuple[float, NDArray[np.float64]]
"""Cost and waypoints."""


class Metrics:
    """A fold of constant memory.

    Attributes:
        counts: Number of events of each kind, 0 included.
        draws: The last event's iteration.
    """

    def __init__(self, manifest: Manifest) -> None:
        self._scenario = manifest.scenario
        self.counts = dict.fromkeys(Kind, 0)
        self.draws = self._last_t = 0
        self._counted = _CountedIterations(manifest)
        self._raw: Path | None = None
        self._smoothed: Path | None = None
        self._first: tuple[Instant, float] | None = None
        self._moves = _Moves(manifest.scenario)
        self._began: dict[Phase, int] = {}
        self._ended: dict[Phase, tuple[int, Status]] = {}

    def write(self, events: Events) -> None:
        """Take a batch.

        Raises:
            BrrtError: A phase or a status is unknown.
        """
        for kind, count in events.counts.items():
            self.counts[kind] += count
        last = events.last
        self.draws = max(self.draws, last.iteration)
        self._last_t = max(self._last_t, last.t)
        for event in events[Kind.PATH]:
            self._take_path(event, events.dof)
        for event in events[Kind.PHASE]:
            try:
                phase, status = Phase(int(event["name"])), Status(int(event["status"]))
            except ValueError as error:
                why = f"{error}; a phase is one of events.Phase"
                raise BrrtError(f"event {event['seq']:,}: {why}") from None
            if status is Status.BEGIN:
                self._began[phase] = int(event["t"])
            else:
                self._ended[phase] = (int(event["t"]), status)
        self._counted.write(events[Kind.EDGE])
        self._moves.write(events[Kind.MOVE], self._began.get(Phase.PLAN, 0))

    def _take_path(self, event: Any, dof: int) -> None:
        path = (float(event["cost"]), np.array(event["waypoints"]).reshape(-1, dof))
        if event["stage"] == Stage.SMOOTHED:
            self._smoothed = path
            return
        # A better path replaces the one before.
        self._raw = path
        if self._first is None:
            self._first = Instant(int(event["t"]), int(event["iteration"])), path[0]

    @property
    def iterations(self) -> int:
        """The iterations that a limit counts: all, or all but draws that failed."""
        return self._counted.total(self.draws)

    @property
    def nodes(self) -> int:
        """Nodes of all trees and graphs that are there."""
        counts = self.counts
        return counts[Kind.EDGE] + counts[Kind.VERTEX] - counts[Kind.REMOVE]

    @property
    def solved(self) -> bool:
        """Whether a path was found."""
        return self._raw is not None

    @property
    def best_path(self) -> Path | None:
        """The smoothed path, or else the last that the planner found."""
        return self._smoothed or self._raw

    @property
    def status(self) -> str:
        """How planning ended; "running" if the log ends before."""
        ended = self._ended.get(Phase.PLAN)
        return "running" if ended is None else ended[1].label

    @property
    def cut(self) -> bool:
        """Whether the log ends within a phase, or before the first."""
        return not self._began or not self._began.keys() <= self._ended.keys()

    def _seconds(self, phase: Phase) -> float | None:
        """Return a phase's duration, up to the last event if it did not end; None without one."""
        if phase not in self._began:
            return None
        end = self._ended.get(phase, (self._last_t, Status.BEGIN))[0]
        return (end - self._began[phase]) / 1e9

    def as_dict(self) -> dict[str, Any]:
        """Return the metrics under the names that `--json` prints; None for one without a value.

        `edges` counts the events of kind edge, roots included; `nodes` the nodes that they and
        vertices made, less those that were removed. `path` is the last that
        the planner found. `moves` counts the last trial's moves if the robot moved, otherwise the
        motions of the final path (waypoints - 1).
        """
        scenario, raw, smoothed = self._scenario, self._raw, self._smoothed
        final = self.best_path
        return {
            "planner": scenario.planner,
            "world": scenario.world,
            "robot": scenario.robot,
            "seed": scenario.seed,
            "solved": self.solved,
            "status": self.status,
            "iterations": self.draws,
            "counted_iterations": self.iterations,
            "events": sum(self.counts.values()),
            "nodes": self.nodes,
            **{count.key: self.counts[kind] for kind, count in COUNTS.items() if count.key},
            "path_cost": _finite(raw and raw[0]),
            "path": None if raw is None else raw[1].tolist(),
            "smoothed_cost": _finite(smoothed and smoothed[0]),
            "smoothed_path": None if smoothed is None else smoothed[1].tolist(),
            "plan_time_s": self._seconds(Phase.PLAN),
            "smooth_time_s": self._seconds(Phase.SMOOTH),
            "moves": None if final is None else len(final[1]) - 1,
            **self._first_path(),
            **self._moves.as_dict(),
        }

    def _first_path(self) -> dict[str, Any]:
        """Return when the first path was found, and its cost."""
        if self._first is None:
            return dict.fromkeys(("first_path_s", "first_path_iteration", "first_path_cost"))
        (t, iteration), cost = self._first
        return {
            "first_path_s": (t - self._began.get(Phase.PLAN, 0)) / 1e9,
            "first_path_iteration": iteration,
            "first_path_cost": _finite(cost),
        }


class _CountedIterations:
    """The iterations that a limit counts: where failed draws do not count, those with a new node.

    Args:
        manifest: What was run; each of its stretches counts by its own settings.
    """

    def __init__(self, manifest: Manifest) -> None:
        self._ends = [branch.iteration for branch in manifest.branches]
        self._all = [
            contract.growth.counts_failed
            if contract is not None and contract.growth is not None
            else scenario.params.get("count_failed", True) is not False
            for contract, (_, scenario) in zip(manifest.contracts, manifest.stretches, strict=True)
        ]
        self._joined, self._last = np.zeros(len(self._all), np.int64), 0

    def write(self, edges: Table) -> None:
        """Take the edges of a batch."""
        if not all(self._all) and len(edges):
            joins = np.unique(edges["iteration"])
            joins = joins[joins > self._last]
            self._joined += np.bincount(
                np.searchsorted(self._ends, joins), minlength=len(self._all)
            )
            self._last = max(self._last, int(edges["iteration"][-1]))

    def total(self, last: int) -> int:
        """Return the number of iterations up to the last one."""
        made = np.diff([0, *(min(end, last) for end in self._ends), last])
        return int(np.where(self._all, made, self._joined).sum())


class _Moves:
    """The metrics of a robot that moves, one move in every deadline.

    A move's planning time is the time since the move before; the first one's, since planning began.
    """

    def __init__(self, scenario: Scenario) -> None:
        self._deadline = max(1, round(1e9 * scenario.deadline))
        self._trial, self._count = 0, 0
        self._last_t: int | None = None
        self._longest = self._misses = self._charged = self._stays = 0

    def write(self, moves: Table, began: int) -> None:
        """Take a batch; `began` is when planning began, in ns."""
        if not len(moves):
            return
        before = began if self._last_t is None else self._last_t
        times = np.diff(moves["t"], prepend=before)
        deadlines = np.maximum(1, -(-times // self._deadline))
        self._longest = max(self._longest, int(times.max()))
        self._misses += int((times > self._deadline).sum())
        self._charged += int(deadlines.sum())
        self._stays += int((deadlines - 1).sum())
        self._last_t, trial = int(moves["t"][-1]), int(moves["trial"][-1])
        if trial != self._trial:
            self._trial, self._count = trial, 0
        self._count += int((moves["trial"] == trial).sum())

    def as_dict(self) -> dict[str, Any]:
        """Return the metrics; None for each without moves."""
        if self._last_t is None:
            return dict.fromkeys(("max_move_time_s", "deadline_misses", "charged_moves", "stays"))
        return {
            "moves": self._count,
            "max_move_time_s": self._longest / 1e9,
            "deadline_misses": self._misses,
            "charged_moves": self._charged,
            "stays": self._stays,
        }


def _finite(value: float | None) -> float | None:
    """Return None for infinity and nan, which JSON does not have."""
    return value if value is not None and math.isfinite(value) else None


def metrics(recording: Recording) -> Metrics:
    """Fold the events of a run into its metrics."""
    found = Metrics(recording.manifest)
    feed(recording.batches(), [found])
    return found
