"""The flight recorder for motion planners: run, record every event, replay offline.

import brrt

run = brrt.Run(brrt.Scenario(world="circles2d:n=80", seed=7))
log = brrt.Memory()
metrics = run.execute([log])
tree = brrt.forest(log.events())[0]

PYTEST_DONT_REWRITE: whoever imports brrt ahead of pytest is not to be warned, as pytest warns of
packages that bring a plugin.
"""

from brrt.comparison.comparison import Comparison
from brrt.comparison.events import Difference, first_difference
from brrt.comparison.versus import compare
from brrt.errors import BrrtError, RecordingError
from brrt.events import Events, Kind
from brrt.explanation import Explanation, explain
from brrt.formats import McapSink, Memory, Recording, read
from brrt.planners import PLANNERS, RRT, Planner
from brrt.planners.base.problem import Problem
from brrt.replay.forest import Tree, forest
from brrt.replay.metrics import Metrics
from brrt.replay.snapshot import Snapshot
from brrt.robots import ROBOTS, Chain, Point, Polygon, Robot, make_robot
from brrt.runs.branched import BranchedRun, RepeatedRun
from brrt.runs.reproduce import Again, plan_again
from brrt.runs.run import Run, Sink
from brrt.scenario.manifest import Manifest
from brrt.scenario.scenario import Scenario
from brrt.testing.gate import Verdict, gate
from brrt.verification import Finding, check
from brrt.worlds import GENERATORS, Grid, World, make_world

__all__ = [
    "GENERATORS",
    "PLANNERS",
    "ROBOTS",
    "RRT",
    "Again",
    "BranchedRun",
    "BrrtError",
    "Chain",
    "Comparison",
    "Difference",
    "Events",
    "Explanation",
    "Finding",
    "Grid",
    "Kind",
    "Manifest",
    "McapSink",
    "Memory",
    "Metrics",
    "Planner",
    "Point",
    "Polygon",
    "Problem",
    "Recording",
    "RecordingError",
    "RepeatedRun",
    "Robot",
    "Run",
    "Scenario",
    "Sink",
    "Snapshot",
    "Tree",
    "Verdict",
    "World",
    "check",
    "compare",
    "explain",
    "first_difference",
    "forest",
    "gate",
    "make_robot",
    "make_world",
    "plan_again",
    "read",
]
