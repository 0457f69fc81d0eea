"""A rule for brrt verify."""

import numpy as np

from brrt import Kind
from brrt.verification.rule import Rule


class DistinctWaypoints(Rule):
    """Controllers that follow a path divide by the lengths of its motions."""

    name = "distinct waypoints"
    promise = "Each waypoint of a path differs from the one before it."
    kind = Kind.PATH

    def finish(self) -> None:
        """Judge all paths."""
        for event, path in self.context.paths:
            still = np.flatnonzero((path[1:] == path[:-1]).all(axis=1))
            self.judge_one(event, f"waypoint {still[0] + 1} repeats" if len(still) else None)
