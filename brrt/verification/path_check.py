"""Judge a path alone: somebody's waypoints, in a world, for a robot."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brrt.collision.bodies import wrapping_angles
from brrt.collision.clearance import Contacts, clearances, first_contacts
from brrt.collision.motions import Obstacles, first_hits, has_parts
from brrt.collision.sweep import FARTHEST
from brrt.errors import BrrtError
from brrt.formats.path_file import MOST_WAYPOINTS, read_path
from brrt.robots import Robot, make_robot
from brrt.robots.angles import wrap_angles
from brrt.verification.tolerances import ROUNDING
from brrt.worlds import World, make_world
from brrt.worlds.arrays import read_numbers

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


class Hit(NamedTuple):
    """A motion that is not free.

    Attributes:
        motion: Its number, which is that of the waypoint that it begins at.
        part: Where it first hits, from 0 at its begin to 1 at its end.
        q: The configuration there.
        obstacle: What it hits, such as "ball 3" or "the bounds".
    """

    motion: int
    part: float
    q: tuple[float, ...]
    obstacle: str


class Outside(NamedTuple):
    """A coordinate of a waypoint beyond the bounds of the world or the limits of a joint."""

    waypoint: int
    coordinate: str
    value: float
    low: float
    high: float


class End(NamedTuple):
    """How far the path's first or last waypoint is from the start or goal that was given."""

    name: str
    equal: bool
    distance: float


class Near(NamedTuple):
    """The place at which a path is nearest to an obstacle without hitting one."""

    distance: float
    motion: int
    part: float
    q: tuple[float, ...]
    obstacle: str


class Turn(NamedTuple):
    """Turns of the robot's position at waypoints, in rad: all together, and the sharpest."""

    sum: float
    sharpest: float
    waypoint: int


@dataclass(frozen=True, eq=False, repr=False)
class PathCheck:
    """What is true of a path.

    Attributes:
        world: Where it leads.
        robot: What moves, resolved in the world.
        names: Names of the numbers in a configuration.
        q: The waypoints, angles that wrap in [-pi, pi), shape (n, dof).
        lengths: Length of each motion in the robot's metric, shape (n - 1,).
        hits: The motions that are not free.
        clearance: Distance of each free motion from the nearest obstacle, for bodies also from the
            bounds; 0 for motions that are not free, infinite without obstacles; shape (n - 1,).
        nearest: Name of what each motion is nearest to, or hits; empty for nothing.
        nearest_part: Where along each motion that is, shape (n - 1,).
        outside: Coordinates beyond bounds or limits.
        ends: The ends that were given.
    """

    world: World
    robot: Robot
    names: tuple[str, ...]
    q: Floats
    lengths: Floats
    hits: tuple[Hit, ...]
    clearance: Floats
    nearest: tuple[str, ...]
    nearest_part: Floats
    outside: tuple[Outside, ...]
    ends: tuple[End, ...]

    def __repr__(self) -> str:
        verdict = "holds" if self.holds else "does not hold"
        return f"<PathCheck of {len(self.q):,} waypoints in {self.world.name}: {verdict}>"

    @property
    def holds(self) -> bool:
        """Whether all motions are free, all waypoints within limits, and the ends as given."""
        return not self.hits and not self.outside and all(end.equal for end in self.ends)

    @property
    def length(self) -> float:
        """Length of the path in the robot's metric."""
        return float(self.lengths.sum())

    @cached_property
    def tightest(self) -> Near | None:
        """The place of least clearance on free motions; None without obstacles or free motions."""
        free = np.ones(len(self.lengths), bool)
        free[[hit.motion for hit in self.hits]] = False
        rows = np.flatnonzero(free & np.isfinite(self.clearance))
        if not len(rows):
            return None
        i = int(rows[self.clearance[rows].argmin()])
        part = float(self.nearest_part[i])
        where = tuple(self.at(i, part).tolist())
        return Near(float(self.clearance[i]), i, part, where, self.nearest[i])

    @cached_property
    def turns(self) -> Turn | None:
        """The turns of the position; None for robots whose configuration has no position."""
        if self.robot.configuration(self.world.lower) is None:
            return None
        steps = np.diff(self.robot.places(self.q), axis=0)
        sizes = np.linalg.norm(steps, axis=1)
        moves = np.flatnonzero(sizes > 0)
        if len(moves) < 2:
            return Turn(0.0, 0.0, 0)
        way = steps[moves] / sizes[moves, None]
        apart, along = (np.linalg.norm(way[1:] + sign * way[:-1], axis=1) for sign in (-1, 1))
        angles = 2 * np.arctan2(apart, along)
        sharpest = int(angles.argmax())
        return Turn(float(angles.sum()), float(angles[sharpest]), int(moves[sharpest + 1]))

    def at(self, motion: int, part: float) -> Floats:
        """Return the configuration at a part, from 0 to 1, of a motion, shape (dof,)."""
        a, b = self.q[motion], self.q[min(motion + 1, len(self.q) - 1)]
        return np.asarray(self.robot.interpolate(a, b, part))

    def as_dict(self) -> dict[str, Any]:
        """Return what `brrt verify --path --json` prints."""
        hits = {hit.motion: hit for hit in self.hits}
        return {
            "holds": self.holds,
            "waypoints": len(self.q),
            "coordinates": list(self.names),
            "length": self.length,
            "turns": None if self.turns is None else self.turns._asdict(),
            "clearance": None if self.tightest is None else self.tightest._asdict(),
            "ends": [end._asdict() for end in self.ends],
            "outside": [each._asdict() for each in self.outside],
            "motions": [
                {
                    "motion": i,
                    "free": i not in hits,
                    "length": length,
                    "clearance": distance if np.isfinite(distance) else None,
                    "nearest": name or None,
                    "hit": None if i not in hits else _without_motion(hits[i]),
                }
                for i, (length, distance, name) in enumerate(
                    zip(self.lengths.tolist(), self.clearance.tolist(), self.nearest, strict=True)
                )
            ],
        }


def _without_motion(hit: Hit) -> dict[str, Any]:
    return {name: value for name, value in hit._asdict().items() if name != "motion"}


def check_path(
    q: Any,
    *,
    world: World | Path | str,
    robot: Robot | Path | str = "point",
    start: ArrayLike | None = None,
    goal: ArrayLike | None = None,
    tolerance: float = 0.0,
) -> PathCheck:
    """Judge a path of any origin, by geometry that shares no code with a planner.

    Each motion leads from one waypoint to the next as the robot interpolates: in a straight line,
    and the short way round for angles that wrap. A single waypoint is judged as a motion that
    stays there.

    Args:
        q: Waypoints, shape (n, dof), or a .csv, .txt, .json or .npy file; see `read_path`.
        world: Where it leads: a `World`, a generator's name or a file.
        robot: What moves: a `Robot`, a name with parameters or a file.
        start: Configuration that the path must begin at.
        goal: Configuration that it must end at.
        tolerance: How far its ends may be from those, in the robot's metric.

    Raises:
        BrrtError: A value is wrong, or a file cannot be read.
    """
    place = world if isinstance(world, World) else make_world(str(world))
    body = (robot if isinstance(robot, Robot) else make_robot(str(robot))).resolved(place)
    names = body.coordinates(place)
    if body.opaque:
        raise BrrtError("the robot's shape is not known, so no motion can be judged; give --robot")
    if not 0 <= tolerance < np.inf:
        raise BrrtError(f"tolerance must be a number from 0 on, not {tolerance!r:.60}")
    path = _waypoints(q, names)
    ends = {"start": start, "goal": goal}
    given = {
        name: _configuration(name, end, names) for name, end in ends.items() if end is not None
    }
    wraps, (lower, upper) = wrapping_angles(body, len(names)), body.bounds(place)
    path[:, wraps] = wrap_angles(path[:, wraps])
    if has_parts(body, len(names)):
        _check_near(path, place, names)
    slack = ROUNDING * float(np.abs([lower, upper]).max())
    low, high = np.where(wraps, -np.inf, lower - slack), np.where(wraps, np.inf, upper + slack)
    a, b = (path[:-1], path[1:]) if len(path) > 1 else (path, path)
    hits, found = _contacts(place, body, a, b)
    obstacles, blocked = Obstacles(place), np.flatnonzero(hits >= 0)
    beyond = np.argwhere((path < low) | (path > high)).tolist()
    return PathCheck(
        world=place, robot=body, names=names, q=path,
        lengths=np.asarray(body.distance(a, b)),
        hits=tuple(_hits(body, a, b, blocked, found, obstacles)),
        clearance=found.distance,
        nearest=tuple("" if j < 0 else obstacles.name(j) for j in found.other.tolist()),
        nearest_part=found.part,
        outside=tuple(
            Outside(i, names[k], float(path[i, k]), float(lower[k]), float(upper[k]))
            for i, k in beyond
        ),
        ends=tuple(
            _end(name, body, wanted, path[0 if name == "start" else -1], tolerance + slack)
            for name, wanted in given.items()
        ),
    )  # fmt: skip


def _contacts(world: World, robot: Robot, a: Floats, b: Floats) -> tuple[Ints, Contacts]:
    """Return what motions hit, or -1, and what they touch first or come nearest to."""
    obstacles = Obstacles(world)
    hits = first_hits(obstacles, robot, a, b)
    found = Contacts(np.zeros(len(a)), np.full(len(a), -1), np.full(len(a), np.inf))
    blocked, free = np.flatnonzero(hits >= 0), np.flatnonzero(hits < 0)
    for rows, contacts in (
        (blocked, first_contacts(obstacles, robot, a[blocked], b[blocked], hits[blocked])),
        (free, clearances(obstacles, robot, a[free], b[free])),
    ):
        for mine, new in zip(found, contacts, strict=True):
            mine[rows] = new
    return hits, found


def _hits(
    robot: Robot, a: Floats, b: Floats, blocked: Ints, found: Contacts, obstacles: Obstacles
) -> Iterator[Hit]:
    for i in blocked.tolist():
        part = float(found.part[i])
        where = robot.interpolate(a[i], b[i], part)
        yield Hit(i, part, tuple(where.tolist()), obstacles.name(int(found.other[i])))


def _end(name: str, robot: Robot, wanted: Floats, q: Floats, tolerance: float) -> End:
    distance = float(robot.distance(robot.canonical(wanted), q))
    return End(name, distance <= tolerance, distance)


def _configuration(name: str, value: ArrayLike, names: tuple[str, ...]) -> Floats:
    return read_numbers(name, value, f"{len(names)} numbers: {', '.join(names)}", (len(names),))


def _waypoints(q: Any, names: tuple[str, ...]) -> Floats:
    if isinstance(q, Path | str):
        return read_path(Path(q), names)
    what = f"rows of {len(names)} numbers: {', '.join(names)}"
    path = read_numbers("path", q, what, (None, len(names)))
    if not 1 <= len(path) <= MOST_WAYPOINTS:
        raise BrrtError(f"path must have 1 to {MOST_WAYPOINTS:,} waypoints, not {len(path):,}")
    return path


def _check_near(path: Floats, world: World, names: tuple[str, ...]) -> None:
    """Raise where a body is so far away that its motions cannot be bisected."""
    far = np.argwhere(np.abs(path) >= FARTHEST * (1 + world.extent))
    if len(far):
        i, k = far[0].tolist()
        raise BrrtError(
            f"waypoint {i}: {names[k]} is {path[i, k]:g}, a million times the size of the world, "
            f"{world.extent:g}; give the path in the unit and the frame of the world"
        )
