"""The figures of a run: one fold over its events, live or from a file."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrt.events import Events, Kind, Phase, Stage, Status
from brrt.scenario import Manifest


class Metrics:
    """A sink that counts; its memory does not grow with the run.

    Args:
        manifest: The run's.
    """

    def __init__(self, manifest: Manifest) -> None:
        self._manifest = manifest
        self._events = 0
        self._counts = dict.fromkeys(Kind, 0)
        self._iterations = 0
        self._last_t = 0
        self._paths: dict[Stage, tuple[float, NDArray[np.float64]]] = {}
        self._began: dict[Phase, int] = {}
        self._ended: dict[Phase, tuple[int, Status]] = {}

    def write(self, events: Events) -> None:
        """Take in a batch."""
        for kind, count in events.counts.items():
            self._events += count
            self._counts[kind] += count
        last = events.last
        self._iterations = max(self._iterations, last.iteration)
        self._last_t = max(self._last_t, last.t)
        for event in events[Kind.PATH]:
            path = np.array(event["waypoints"]).reshape(-1, events.dof)
            self._paths[Stage(int(event["stage"]))] = (float(event["cost"]), path)
        for event in events[Kind.PHASE]:
            phase, status = Phase(int(event["name"])), Status(int(event["status"]))
            if status is Status.BEGIN:
                self._began[phase] = int(event["t"])
            else:
                self._ended[phase] = (int(event["t"]), status)

    def close(self, *, whole: bool = True) -> None:
        """Nothing to release."""

    @property
    def solved(self) -> bool:
        """Whether there is a path."""
        return Stage.RAW in self._paths

    @property
    def iterations(self) -> int:
        """The planner's count at the last event."""
        return self._iterations

    @property
    def status(self) -> str:
        """How planning ended, or "running" where the log ends before."""
        ended = self._ended.get(Phase.PLAN)
        return "running" if ended is None else ended[1].name.lower().replace("_", " ")

    def _seconds(self, phase: Phase) -> float | None:
        """How long a phase took, up to the last event if it did not end; None if it never began."""
        if phase not in self._began:
            return None
        end = self._ended.get(phase, (self._last_t, Status.BEGIN))[0]
        return (end - self._began[phase]) / 1e9

    def as_dict(self) -> dict[str, Any]:
        """Return the figures under the names that `--json` prints; None where there is none.

        `nodes` and `edges` count the events of kind edge, roots included; `moves` counts motions
        of the final path (waypoints - 1).
        """
        scenario = self._manifest.scenario
        raw, smoothed = self._paths.get(Stage.RAW), self._paths.get(Stage.SMOOTHED)
        final = smoothed or raw
        return {
            "planner": scenario.planner,
            "world": scenario.world,
            "robot": scenario.robot,
            "seed": scenario.seed,
            "solved": self.solved,
            "status": self.status,
            "iterations": self._iterations,
            "events": self._events,
            "samples": self._counts[Kind.SAMPLE],
            "rejects": self._counts[Kind.REJECT],
            "nodes": self._counts[Kind.EDGE],
            "edges": self._counts[Kind.EDGE],
            "rewires": 0,
            "shortcuts": self._counts[Kind.SHORTCUT],
            "path_cost": _finite(raw and raw[0]),
            "path": None if raw is None else raw[1].tolist(),
            "smoothed_cost": _finite(smoothed and smoothed[0]),
            "smoothed_path": None if smoothed is None else smoothed[1].tolist(),
            "plan_time_s": self._seconds(Phase.PLAN),
            "smooth_time_s": self._seconds(Phase.SMOOTH),
            "moves": None if final is None else len(final[1]) - 1,
            "max_move_time_s": None,
            "deadline_misses": None,
        }


def _finite(value: float | None) -> float | None:
    """Keep JSON valid: it has no infinity."""
    return value if value is not None and math.isfinite(value) else None
