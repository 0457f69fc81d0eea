"""How wide the widest path from start to goal is, and whether the run got through."""

from collections.abc import Callable
from dataclasses import dataclass
from operator import itemgetter

import numpy as np

from brrt.explanation.places import coarse
from brrt.explanation.summary import RunSummary
from brrt.robots import Polygon, Robot
from brrt.worlds.arrays import Floats
from brrt.worlds.convex import inscribed
from brrt.worlds.free_space import connected
from brrt.worlds.narrow_passage import Passage, max_width, narrowest_passage
from brrt.worlds.world import World

_PROOF = (1 << 16, 1 << 18)
"""Cells of the lattices that bound the width of every path, tried in this order."""

_ALONG = 2000
"""Configurations on a path that are compared with a narrow place."""


@dataclass(frozen=True, slots=True)
class Narrow:
    """The narrowest place on the widest path; see `brrt.worlds.narrow_passage`.

    Attributes:
        low: Least width of it.
        high: Greatest width of it.
        q: Its position.
        parts: Whether it separates start and goal; otherwise it is next to one of them.
        behind: Nodes beyond it, as seen from the start.
        through: Iteration in which the first of them was added; None without one.
        near: Nodes of any tree, or cells, within `reach` of it.
        reach: A step, or the side of a coarse cell if that is longer.
        crossed: Whether the run's path leads through it; None without a path.
    """

    low: float
    high: float
    q: list[float]
    parts: bool
    behind: int
    through: int | None
    near: int
    reach: float
    crossed: bool | None


@dataclass(frozen=True, slots=True)
class Clearance:
    """What is known of the paths from start to goal.

    Attributes:
        connected: Whether there is a path for a point of the body; True and False are proven.
        reason: Why that is known, or why it is not.
        narrow: The narrowest place on the widest path; None if no path of cells was found.
        widest: Proven upper bound on the width of every path, 0 if there is none; None if it was
            not needed or not found.
        body: Diameter of a disc inside the body, so that no narrower path lets it through; 0 for
            robots other than polygons.
    """

    connected: bool | None
    reason: str
    narrow: Narrow | None = None
    widest: float | None = None
    body: float = 0.0

    @property
    def too_narrow(self) -> bool:
        """Whether every path is proven to be too narrow for the body."""
        return self.widest is not None and self.widest < self.body


class ClearanceSearch:
    """Searches for the widest path from start to goal, and compares a run with it."""

    def __init__(self, world: World, robot: Robot, summary: RunSummary) -> None:
        self._world, self._robot, self._summary = world, robot, summary
        # The reference point of a body may lie outside of it; the middle of a disc inside does not.
        self._middle, radius = None, 0.0
        if isinstance(robot, Polygon):
            self._middle, radius = max(map(inscribed, robot.parts), key=itemgetter(1))
        self._body = 2 * radius

    def find(self, start: Floats, goal: Floats, step: float | None) -> Clearance:
        """Return whether there is a path for a point of the body, and how wide the widest is."""
        if self._robot.configuration(self._world.lower) is None:
            return Clearance(None, "not computed: this robot has no position in the world")
        ends = self._points(np.stack([start, goal]))
        found = narrowest_passage(self._world, *ends)
        if found is not None:
            narrow = self._narrow(found, step)
            bound = self._widest(ends) if found.low < self._body else None
            reason = f"free cells of {found.cell:.3g} lead to the goal"
            return Clearance(True, reason, narrow, bound, self._body)
        known = connected(self._world, *ends)
        if known.connected is not None:
            return Clearance(known.connected, known.reason, body=self._body)
        bound = self._widest(ends)
        reason = f"cells of {known.cell:.3g} are too coarse to find a path"
        if bound == 0:
            reason = "obstacles without a gap separate start and goal"
        elif bound is not None:
            reason += f"; every path is at most {at_most(bound)} wide"
        return Clearance(False if bound == 0 else None, reason, None, bound, self._body)

    def _widest(self, ends: Floats) -> float | None:
        """Return an upper bound on the width of every path."""
        best = np.inf
        for cells in _PROOF:
            side = self._world.extent / cells ** (1 / self._world.dim)
            enough = max(self._body, 8 * side)
            best = min(best, max_width(self._world, ends[0], ends[1], cells, enough))
            if best < self._body or best == 0:
                break
        return best if np.isfinite(best) else None

    def _points(self, q: Floats) -> Floats:
        """Return where a point inside the body is at configurations of shape (n, dof)."""
        places = self._robot.places(q)
        if self._middle is None:
            return places
        cos, sin = np.cos(q[:, 2]), np.sin(q[:, 2])
        x, y = self._middle
        return np.asarray(places + np.stack([cos * x - sin * y, sin * x + cos * y], axis=1))

    def _narrow(self, found: Passage, step: float | None) -> Narrow:
        """Compare the run with the narrowest place."""
        summary = self._summary
        q = [summary.nodes(tree) for tree in summary.trees] or [summary.cells.q]
        passed, through = found.is_beyond(self._points(q[0])), None
        if summary.trees and passed.any():
            through = int(summary.iterations(summary.trees[0])[passed][0])
        reach = max(float(coarse(self._world).cell.max()), step or 0.0)
        near = int((found.distance(self._points(np.concatenate(q))) <= reach).sum())
        path, crossed = summary.metrics.best_path, None
        if path is not None:
            way = self._points(self._robot.along(path[1], _ALONG))
            crossed = bool(found.distance(way).min() <= found.high / 2 + found.cell)
        return Narrow(
            low=found.low,
            high=found.high,
            q=found.place.tolist(),
            parts=bool(found.beyond.any()),
            behind=int(passed.sum()),
            through=through,
            near=near,
            reach=reach,
            crossed=crossed,
        )


def at_most(value: float) -> str:
    """Write a width in three digits, rounded up."""
    return _digits(value, np.ceil)


def at_least(value: float) -> str:
    """Write a width in three digits, rounded down."""
    return _digits(value, np.floor)


def _digits(value: float, whole: Callable[[float], float]) -> str:
    size = 10.0 ** (np.floor(np.log10(value)) - 2) if value > 0 else 1.0
    # A rounding error does not change the third digit.
    return f"{whole(round(value / size, 9)) * size:.6g}"
