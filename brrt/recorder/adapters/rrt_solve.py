"""One solve of a planner in the style of PythonRobotics, from what its methods return."""

import math
import sys
from collections.abc import Sequence
from dataclasses import replace
from operator import is_not
from pathlib import Path
from typing import Any

import numpy as np

from brrt.errors import BrrtError
from brrt.events import Status
from brrt.recorder.adapters.solves import Solves
from brrt.recorder.recorder import Recorder
from brrt.worlds import World

_STRAIGHT = 1e-6
"""How far points of a straight motion are from it, relative to its length."""

Place = tuple[float, float]


class Solve:
    """Records a solve; an error of the recording ends it, and never the script.

    The file is opened once the first motion shows whether motions are straight.

    Args:
        planner: The planner.
        solves: Opens the recording.

    Attributes:
        inside: Whether one of the planner's methods runs, which may call others.
    """

    def __init__(self, planner: Any, solves: Solves) -> None:
        self.planner, self._solves, self.inside = planner, solves, False
        self._name = f"{type(planner).__name__}.planning"
        self._rec: Recorder | None = None
        self._failed = False
        self._waiting: list[Place] = []
        self._rows: dict[int, int] = {}  # of each node that was ever in the list, by its identity
        self._kept: list[Any] = []  # those nodes, so that no other gets the identity of one
        self._q, self._up = np.empty((0, 2)), np.empty(0, np.int64)
        self._nodes: list[Any] = []  # the list as it was last recorded,
        self._parents: list[Any] = []  # and the parents then

    @property
    def is_open(self) -> bool:
        """Whether there is a file."""
        return self._rec is not None

    def called(self, name: str, given: Sequence[Any], named: Any, found: Any) -> None:
        """Record what a method did, after what the planner itself did to its list before."""
        if self._failed or (name == "check_collision" and found):
            return
        try:
            self._record(name, given, named, found)
        except Exception as error:  # noqa: BLE001 - the script must go on
            self._fail(error)

    def ended(self, path: Any) -> None:
        """Record the path that `planning` returned, if it is one, and close the file."""
        try:
            if self._failed:
                return
            rec = self._open(None)
            self._follow(rec)
            if path is not None:
                self._record_path(rec, path)
            rec.close()
        except Exception as error:  # noqa: BLE001 - the script must go on
            self._fail(error)

    def interrupted(self) -> None:
        """Close the file of a solve that an exception ended."""
        try:
            if self._rec is not None and not self._failed:
                self._follow(self._rec)
                self._rec.close(Status.INTERRUPTED)
        except Exception as error:  # noqa: BLE001 - the script's own exception counts
            self._fail(error)

    def _fail(self, error: Exception) -> None:
        self._failed = True
        self._solves.failed(self._name, error)
        if self._rec is not None:
            try:
                self._rec.close(Status.INTERRUPTED)
            except Exception as again:  # noqa: BLE001 - it may be the same error
                self._solves.failed(self._name, again)

    def _record(self, name: str, given: Sequence[Any], named: Any, found: Any) -> None:
        rec = self._rec
        if name == "get_random_node" and rec is None:
            self._waiting.append(_place(found))
        elif name == "get_random_node" and rec is not None:
            self._follow(rec)
            self._sample(rec, _place(found))
        elif name == "steer" and rec is None and found is not None:
            self._open(found)
        elif name == "check_collision" and not found and rec is not None:
            self._follow(rec)
            tried = [each for each in (*given, *named.values()) if hasattr(each, "parent")]
            near = self._row(tried[0].parent) if tried else -1
            if near >= 0:
                rec.reject(_place(tried[0]), near, "collision")

    def _sample(self, rec: Recorder, place: Place) -> None:
        rec.sample(place, "goal" if place == _place(_goal(self.planner)) else "uniform")

    def _open(self, motion: Any) -> Recorder:
        """Return the recording; open it with what the first motion shows, if there is one."""
        if self._rec is not None:
            return self._rec
        straight = motion is None or _is_straight(motion)
        claims = {} if straight else {"motions": "own"}
        if hasattr(type(self.planner), "rewire"):  # parents are compared now and then
            claims |= {"times": "snapshot"}
        ends = {"start": _place(self.planner.start), "goal": _place(_goal(self.planner))}
        about: dict[str, Any] = {
            **ends,
            "planner": type(self.planner).__name__,
            "params": _params(self.planner),
            "claims": claims,
        }
        try:
            world = _world(self.planner, ends)
            self._rec = self._solves.open(world=replace(world, bounded=straight), **about)
        except (BrrtError, AttributeError, TypeError, ValueError) as error:
            self._solves.failed(f"the world of {self._name}", error)
            self._rec = self._solves.open(dof=2, **about)
        self._follow(self._rec)
        for place in self._waiting:
            self._sample(self._rec, place)
        return self._rec

    def _follow(self, rec: Recorder) -> None:
        """Record which nodes are new in the planner's list, and which have other parents."""
        nodes = list(self.planner.node_list)
        parents = [node.parent for node in nodes]
        if len(nodes) < len(self._nodes):
            raise BrrtError("node_list lost nodes, which cannot be told from rewired ones")
        for row in _changed(nodes, self._nodes):  # rewiring may put another object for a node
            self._rows[id(nodes[row])] = row
            self._kept.append(nodes[row])
        new = [_place(node) for node in nodes[len(self._nodes) :]]
        moved = _changed(parents, self._parents)
        self._nodes, self._parents = nodes, parents
        if new:
            self._q = np.concatenate([self._q, new])
            self._up = np.concatenate([self._up, np.full(len(new), -1)])
        if moved:
            self._up[moved] = [self._row(parents[row]) for row in moved]
            rec.tree(self._q, self._up)

    def _row(self, node: Any) -> int:
        """Return the row of a node in the list, or of an equal place; -1 if there is none."""
        if node is None:
            return -1
        if isinstance(node, int):
            return node
        row = self._rows.get(id(node))
        if row is not None:
            return row
        equal = np.flatnonzero((self._q == _place(node)).all(axis=1))
        return int(equal[0]) if len(equal) else -1

    def _record_path(self, rec: Recorder, path: Any) -> None:
        """Record a path from start to goal; many of them come the other way."""
        try:
            points = np.array([point[:2] for point in path], np.float64)
            far = np.hypot(*(points[[0, -1]] - _place(self.planner.start)).T)
        except (TypeError, ValueError, IndexError):
            error = BrrtError(f"planning returned no points, but {path!r:.40}")
            self._solves.failed(f"the path of {self._name}", error)
        else:
            rec.path(points[::-1] if far[1] < far[0] else points)


def _place(node: Any) -> Place:
    return float(node.x), float(node.y)


def _goal(planner: Any) -> Any:
    return planner.end if hasattr(planner, "end") else planner.goal


def _params(planner: Any) -> dict[str, Any]:
    """Return the planner's attributes that are numbers and texts."""
    plain = {k: v for k, v in vars(planner).items() if isinstance(v, bool | int | float | str)}
    return {k: v for k, v in plain.items() if not isinstance(v, float) or math.isfinite(v)}


def _changed(now: list[Any], before: list[Any]) -> list[int]:
    """Return the rows that hold another object than before, and the new ones."""
    rows = list(range(len(before), len(now)))
    if any(map(is_not, now, before)):  # faster than the next line, and seldom so
        rows += [row for row, differs in enumerate(map(is_not, now, before)) if differs]
    return rows


def _is_straight(node: Any) -> bool:
    """Whether the points of a motion are on the line between its ends; yes if it has none."""
    if hasattr(node, "yaw"):
        return False
    points = np.array([getattr(node, "path_x", ()), getattr(node, "path_y", ())], np.float64)
    if points.shape[1] < 3:
        return True
    way = points[:, -1] - points[:, 0]
    off = np.abs(way[0] * (points[1] - points[1, 0]) - way[1] * (points[0] - points[0, 0]))
    far = float(np.hypot(*way))
    return bool((off <= _STRAIGHT * far * far).all())


def _world(planner: Any, ends: dict[str, Place]) -> World:
    """Return the circles as obstacles; the robot is a point, and its radius is added to theirs.

    Samples are drawn within the bounds, so that straight motions stay inside; others may leave.
    """
    circles = np.array(planner.obstacle_list, np.float64).reshape(-1, 3)
    circles[:, 2] += float(getattr(planner, "robot_radius", 0.0))
    low, high = float(planner.min_rand), float(planner.max_rand)
    points = np.array([(low, low), (high, high), *ends.values()])
    room = 1e-3 * float(np.ptp(points))  # the start and the goal may be on the border
    module = sys.modules.get(type(planner).__module__)
    name = Path(getattr(module, "__file__", None) or "obstacle_list").name
    return World(name, points.min(axis=0) - room, points.max(axis=0) + room, balls=circles)
