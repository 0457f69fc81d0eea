"""Explanations of runs, and the commands that they advise."""

import shlex

from brrt import Scenario, snapshot
from brrt.explanation import Explanation, explain
from tests.support.logs import recording

GAP = Scenario(world="gap2d:gap=5", iterations=300, seed=4, clock="logical")
TRAP = Scenario(
    world="bugtrap2d", planner="lrta-star", params={"cell": 3}, iterations=800, clock="logical"
)
STAR = Scenario(
    world="circles2d:n=40,seed=3", planner="rrt-star", iterations=250, seed=7, clock="logical"
)
FEW_ITERATIONS = ["--world", "squares2d:n=120,seed=4", "--seed", "7", "--iterations", "300"]


def explained(scenario: Scenario, size: int = 500, **at: int) -> Explanation:
    """Explain a scenario's run, read in batches of so many events."""
    return explain(snapshot(recording(scenario, size), **at))


def commands(text: str) -> list[list[str]]:
    """Return the commands on a screen as a shell reads them, without `brrt`."""
    lines = text.replace("\\\n", "").splitlines()
    return [shlex.split(line)[1:] for line in lines if line.startswith("   brrt ")]
