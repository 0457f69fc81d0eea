"""The flight recorder for motion planners: run, record every event, replay offline.

import brrt

recording = brrt.Run(brrt.Scenario(world="circles2d:n=80", seed=7)).record()
tree = brrt.snapshot(recording).forest[0]

PYTEST_DONT_REWRITE: pytest would warn that it cannot rewrite brrt, which is imported before it.
"""

from importlib import import_module
from typing import Any

_MODULES = {
    "BrrtError": "errors",
    "RecordingError": "errors",
    "Events": "events",
    "Kind": "events",
    "Memory": "recording",
    "Recorder": "recorder.recorder",
    "log": "recorder.log",
    "record": "recorder.record",
    "Recording": "recording",
    "Sink": "recording",
    "Arm": "robots",
    "Chain": "robots",
    "Opaque": "robots",
    "Point": "robots",
    "Polygon": "robots",
    "ROBOTS": "robots",
    "Robot": "robots",
    "make_robot": "robots",
    "GENERATORS": "worlds",
    "Grid": "worlds",
    "World": "worlds",
    "load_world": "worlds",
    "make_world": "worlds",
    "Claims": "scenario.claims",
    "Contract": "scenario.contract",
    "Manifest": "scenario.manifest",
    "Scenario": "scenario.scenario",
    "PLANNERS": "planners",
    "Planner": "planners",
    "RRT": "planners",
    "Problem": "planners.base.problem",
    "Run": "runs.run",
    "BranchedRun": "runs.branch",
    "ReproducedRun": "runs.reproduce",
    "Reproduction": "runs.reproduce",
    "reproduce": "runs.reproduce",
    "McapSink": "formats",
    "read": "formats",
    "Metrics": "replay.metrics",
    "metrics": "replay.metrics",
    "Snapshot": "replay.snapshot",
    "snapshot": "replay.snapshot",
    "Tree": "replay.forest",
    "forest": "replay.forest",
    "transcript": "replay.transcript",
    "Comparison": "comparison.report",
    "Difference": "comparison.difference",
    "first_difference": "comparison.events",
    "compare": "comparison.comparison",
    "Finding": "verification.result",
    "Verification": "verification.verification",
    "verify": "verification.verification",
    "PathCheck": "verification.path_check",
    "check_path": "verification.path_check",
    "Explanation": "explanation",
    "explain": "explanation",
    "plot": "views.matplotlib.figure",
    "show": "views.rerun.notebook",
    "Verdict": "testing.gate",
    "gate": "testing.gate",
}
"""The module that each public name is imported from when it is first used: `import brrt` is fast,
and reading a recording never imports a planner. `__init__.pyi` says the same to type checkers."""

__all__ = list(_MODULES)


def __getattr__(name: str) -> Any:
    if name == "ompl":
        return import_module("brrt.ompl")
    if name not in _MODULES:
        raise AttributeError(f"module 'brrt' has no attribute {name!r}")
    value = getattr(import_module(f"brrt.{_MODULES[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
