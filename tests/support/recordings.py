"""Recordings for tests: the golden ones, and new ones of short runs."""

from pathlib import Path

from brrt import McapSink, Run, Scenario

RECORDINGS = Path(__file__).parents[2] / "recordings"
GOLDEN = RECORDINGS / "circles2d-rrt.mcap"


def record(path: Path, **values: object) -> Path:
    """Record a run among 20 circles."""
    run = Run(Scenario.parse({"world": "circles2d:n=20,seed=2", **values}))
    run.execute([McapSink(path, run.manifest, run.problem.world)])
    return path
