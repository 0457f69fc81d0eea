"""The way from start to goal: whether there is one, how narrow it is, what a run did about it."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brrt.explanation.gather import Gather
from brrt.explanation.places import coarse
from brrt.robots import Polygon, Robot
from brrt.worlds.convex import inscribed
from brrt.worlds.free_space import connected
from brrt.worlds.narrow_passage import Passage, max_width, narrowest_passage
from brrt.worlds.world import World

Floats = NDArray[np.float64]

_PROOF = (1 << 16, 1 << 18)
"""Cells of the lattices by which the width of any way is bounded."""

_ALONG = 2000
"""Configurations on a path that are held against a narrow place."""


@dataclass(frozen=True, slots=True)
class Narrow:
    """The narrowest place on the widest way from start to goal; see `brrt.worlds.narrow_passage`.

    Attributes:
        low: Least width of it.
        high: Greatest width of it.
        q: Where it is.
        parts: Whether it parts start and goal; else one of these is where there is least room.
        behind: Nodes that are behind it, seen from the start.
        through: Iteration in which the first of them joined; None without one.
        near: Nodes of any tree, or cells, within `reach` of it.
        reach: A step, or the side of a coarse cell where that is longer.
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
class Way:
    """What is known of the way from start to goal.

    Attributes:
        connected: Whether there is one, for a point or a point of the body: both are proven.
        reason: On what that rests.
        narrow: The narrowest place on the widest one; None where no cells showed one.
        widest: No way is wider than this, which is proven: 0 where there is none; None where it
            was not asked for, or no such bound was found.
        body: The body is at least that wide in every direction: a disc of it fits inside; 0 for a
            point, and where nobody knows.
    """

    connected: bool | None
    reason: str
    narrow: Narrow | None = None
    widest: float | None = None
    body: float = 0.0

    @property
    def too_narrow(self) -> bool:
        """Whether the body is proven to be too wide for any way."""
        return self.widest is not None and self.widest < self.body


class Ways:
    """What there is to say of the way.

    Args:
        world: The run's.
        robot: What moves, settled in it.
        gather: What the log says.
    """

    def __init__(self, world: World, robot: Robot, gather: Gather) -> None:
        self._world, self._robot, self._gather = world, robot, gather
        # A place of a body may lie outside of it; the middle of a disc within does not.
        parts = robot.parts if isinstance(robot, Polygon) else ()
        discs = [inscribed(part) for part in parts]
        none: tuple[Floats | None, float] = None, 0.0
        self._middle, radius = max(discs, key=lambda disc: disc[1], default=none)
        self._body = 2 * radius

    def find(self, start: Floats, goal: Floats, step: float | None) -> Way:
        """Say whether there is a way, for a point or one of the body, and how narrow it is.

        Args:
            start: First configuration, shape (dof,).
            goal: Last configuration.
            step: The planner's; None where it has none.
        """
        if self._robot.configuration(self._world.lower) is None:
            return Way(None, "not looked for: this robot has no place of its own in the world")
        ends = self._points(np.stack([start, goal]))
        found = narrowest_passage(self._world, *ends)
        if found is not None:
            narrow = self._narrow(found, step)
            bound = self._widest(ends) if found.low < self._body else None
            reason = f"free cells of {found.cell:.3g} lead to the goal"
            return Way(True, reason, narrow, bound, self._body)
        known = connected(self._world, *ends)
        if known.connected is not None:
            return Way(known.connected, known.reason, body=self._body)
        bound = self._widest(ends)
        if bound == 0:
            return Way(
                False, "a closed wall of obstacles stands between them", None, 0.0, self._body
            )
        reason = f"cells of {known.cell:.3g} are too coarse to show one"
        if bound is not None:
            reason += f"; it is at most {at_most(bound)} wide"
        return Way(None, reason, None, bound, self._body)

    def _widest(self, ends: Floats) -> float | None:
        """Bound the width of any way by cells, the fewer first."""
        best = np.inf
        for cells in _PROOF:
            side = self._world.extent / cells ** (1 / self._world.dim)
            enough = max(self._body, 8 * side)
            best = min(best, max_width(self._world, ends[0], ends[1], cells, enough))
            if best < self._body or best == 0:
                break
        return best if np.isfinite(best) else None

    def _points(self, q: Floats) -> Floats:
        """Where a point of the body is at configurations, shape (n, dof)."""
        places = self._robot.places(q)
        if self._middle is None:
            return places
        cos, sin = np.cos(q[:, 2]), np.sin(q[:, 2])
        x, y = self._middle
        return np.asarray(places + np.stack([cos * x - sin * y, sin * x + cos * y], axis=1))

    def _narrow(self, found: Passage, step: float | None) -> Narrow:
        """Say what the run did about the narrowest place."""
        gather, behind, through, parts = self._gather, 0, None, bool(found.beyond.any())
        for tree in gather.trees[:1]:
            passed = found.is_beyond(self._points(gather.nodes(tree)))
            behind = int(passed.sum())
            through = int(gather.iterations(tree)[passed][0]) if behind else None
        q = [gather.nodes(tree) for tree in gather.trees] or [gather.cells.q]
        if not gather.trees:
            behind = int(found.is_beyond(self._points(q[0])).sum())
        reach = max(float(coarse(self._world).cell.max()), step or 0.0)
        near = int((found.distance(self._points(np.concatenate(q))) <= reach).sum())
        path, crossed = gather.metrics.best_path, None
        if path is not None:
            way = self._points(self._robot.along(path[1], _ALONG))
            crossed = bool(found.distance(way).min() <= found.high / 2 + found.cell)
        place = found.place.tolist()
        sizes = found.low, found.high
        return Narrow(*sizes, place, parts, behind, through, near, reach, crossed)


def at_most(value: float) -> str:
    """Write a width in three digits, rounded up."""
    return _digits(value, np.ceil)


def at_least(value: float) -> str:
    """Write a width in three digits, rounded down."""
    return _digits(value, np.floor)


def _digits(value: float, whole: Callable[[float], float]) -> str:
    size = 10.0 ** (np.floor(np.log10(value)) - 2) if value > 0 else 1.0
    # What rounding alone adds or takes is no reason for another digit.
    return f"{whole(round(value / size, 9)) * size:.6g}"
