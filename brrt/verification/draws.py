"""Samples, with what the planner knew when it drew them."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brrt.events import Events, Kind, Source, Stage, Table
from brrt.replay.tree_fold import Distance
from brrt.verification.tolerances import CLOSE

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]


_FINE = 1e-9
"""Ranges that are a smaller part of their coordinates are rounded too coarsely to be judged."""


class Drawn(NamedTuple):
    """Samples, and what the planner knew when it drew them.

    Attributes:
        table: The samples, shape (n,).
        best: Cost of the best path so far, inf without one, shape (n,).
        forced: Whether the newest node was within a step of the goal, so that some planners draw
            the goal for certain, shape (n,).
        unsure: Whether `forced` depends on rounding, shape (n,).
    """

    table: Table
    best: Floats
    forced: Flags
    unsure: Flags


def informed_samples(drawn: Drawn) -> tuple[Table, Floats]:
    """Return the informed samples, and what the best path cost then."""
    chosen = (drawn.table["source"] == Source.INFORMED) & np.isfinite(drawn.best)
    return drawn.table[chosen], drawn.best[chosen]


@dataclass(slots=True)
class DrawHistory:
    """What the next window needs to know of those before.

    Attributes:
        distance: The robot's metric.
        goal: The goal, shape (dof,).
        tolerance: Absolute tolerance of lengths.
        best: Cost of the best path so far.
        sample: Number of the last sample.
        edge: Number of the last edge.
        near: Whether its node is within a step of the goal, and whether that depends on rounding.
    """

    distance: Distance
    goal: Floats
    tolerance: float
    best: float = np.inf
    sample: int = -1
    edge: int = -1
    near: tuple[bool, bool] = (False, False)

    def next(self, events: Events, step: float) -> Drawn:
        """Return the samples of the next window, given the longest edge of a tree."""
        table, paths, edges = events[Kind.SAMPLE], events[Kind.PATH], events[Kind.EDGE]
        paths = paths[paths["stage"] != Stage.SMOOTHED]
        costs = np.append(self.best, paths["cost"])
        best = costs[np.searchsorted(paths["seq"], table["seq"])]
        # A node is near the goal by the contract under which it was added.
        far = np.asarray(self.distance(edges["q"], self.goal[None]))
        forced = np.append(self.near[0], (far > 0) & (far <= step))
        unsure = np.append(self.near[1], np.abs(far - step) <= CLOSE * step + self.tolerance)
        seqs = np.append(self.edge, edges["seq"])
        newest = np.maximum(np.searchsorted(seqs, table["seq"]) - 1, 0)
        fresh = seqs[newest] > np.append(self.sample, table["seq"])[:-1]
        self.best, self.edge = float(costs[-1]), int(seqs[-1])
        self.near = bool(forced[-1]), bool(unsure[-1])
        self.sample = int(table["seq"][-1]) if len(table) else self.sample
        return Drawn(table, best, fresh & forced[newest], fresh & unsure[newest])


def coarseness(lower: Floats, upper: Floats) -> Floats:
    """Return by how much coordinates exceed the range between their bounds, shape (dof,)."""
    return np.asarray(np.abs([lower, upper]).max(axis=0) / (upper - lower))


def is_fine(lower: Floats, upper: Floats) -> Flags:
    """Return which axes have enough numbers between their bounds, shape (dof,)."""
    return np.asarray(coarseness(lower, upper) < 1 / _FINE)
