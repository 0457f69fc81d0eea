"""Robots as bodies of convex parts: where the parts are in a motion, and how they move.

Along a motion each number of a configuration changes at a constant rate, so each part of a body
turns at one. That gives the velocity of its points, and bounds of their speed and acceleration.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brrt.collision.convex import Complex, convex_shapes
from brrt.robots import Chain, Polygon

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_ROUNDED = 1 + 1e-9
"""What bounds are multiplied by, since they are rounded."""


def wrapping_angles(robot: Any, dof: int) -> NDArray[np.bool_]:
    """Return which numbers of a configuration are angles that wrap, shape (dof,)."""
    if not hasattr(robot, "canonical"):
        return np.zeros(dof, bool)
    zero = np.zeros(dof)
    turned = [np.asarray(robot.canonical(zero + 2 * np.pi * axis)) for axis in np.eye(dof)]
    return np.array([abs(q[k]) < 1.0 for k, q in enumerate(turned)], bool)


def towards(robot: Any, a: Floats, b: Floats) -> Floats:
    """Return b - a, the short way round where an angle wraps, shape (n, dof)."""
    step, wraps = b - a, wrapping_angles(robot, a.shape[1])
    step[:, wraps] -= 2 * np.pi * np.round(step[:, wraps] / (2 * np.pi))
    return np.asarray(step)


class Poses(NamedTuple):
    """The parts of a body at configurations along motions, shapes (n, parts).

    Attributes:
        at: Origins of the parts.
        turn: Their rotations, as unit complex numbers.
        velocity: Velocities of the origins, per motion.
        rate: Angles by which the parts turn in the whole motion.
    """

    at: Complex
    turn: Complex
    velocity: Complex
    rate: Floats


class Placed(NamedTuple):
    """One part of a body at each of n places.

    Attributes:
        vertices: Vertices, shape (k, n).
        axes: Axes, shape (m, n).
        velocity: Velocities of the vertices, shape (k, n).
    """

    vertices: Complex
    axes: Complex
    velocity: Complex


class Bounds(NamedTuple):
    """Bounds of how the points of a part move in whole motions, shape (n, parts) or (n, pairs).

    Attributes:
        move: Their way.
        bend: Their acceleration; infinite if their velocity is unknown.
    """

    move: Floats
    bend: Floats


class Body:
    """A robot's parts: their poses, and how their points move.

    Args:
        robot: A polygon, a chain, or an object with `outline`, `distance`, and parts whose points
            move at most `dof` times the motion's length in the metric.
        dof: Numbers in a configuration.
    """

    def __init__(self, robot: Any, dof: int) -> None:
        self.robot, self.dof, self.hulls = robot, dof, _hulls(robot, dof)
        self.shapes = convex_shapes(self.hulls)
        self._far = np.array([np.hypot(*hull.T).max() for hull in self.hulls])
        self.pairs = np.empty((0, 2), np.int64)
        if isinstance(robot, Chain):
            self._offset = np.array([complex(*joint.offset) for joint in robot.joints])
            if robot.self_collision:
                n = len(self.hulls)
                pairs = [(i, j) for i in range(n) for j in range(i + 2, n)]
                self.pairs = np.array(pairs, np.int64).reshape(-1, 2)

    def poses(self, Q: Floats, step: Floats) -> Poses:
        """Return the poses of a chain or a polygon at configurations along motions."""
        if isinstance(self.robot, Chain):
            robot = self.robot
            assert robot.base_x is not None and robot.base_y is not None  # noqa: S101, PT018 - settled
            turn, rate = np.exp(1j * np.cumsum(Q, axis=1)), np.cumsum(step, axis=1)
            arms = self._offset * np.concatenate([np.ones((len(Q), 1)), turn[:, :-1]], axis=1)
            at = complex(robot.base_x, robot.base_y) + np.cumsum(arms, axis=1)
            return Poses(at, turn, 1j * np.cumsum(_before(rate) * arms, axis=1), rate)
        shape = (len(Q), len(self.hulls))
        one = (Q[:, 0] + 1j * Q[:, 1], np.exp(1j * Q[:, 2]), step[:, 0] + 1j * step[:, 1])
        return Poses(*(np.broadcast_to(x[:, None], shape) for x in (*one, step[:, 2])))

    def placed(self, poses: Poses, rows: Ints, part: Ints) -> Placed:
        """Return one part at each of these rows of poses."""
        turn, arms = poses.turn[rows, part], self.shapes.vertices[:, part]
        arms = turn * arms
        velocity = poses.velocity[rows, part] + 1j * poses.rate[rows, part] * arms
        return Placed(poses.at[rows, part] + arms, turn * self.shapes.axes[:, part], velocity)

    def outlined(self, Q: Floats, part: Ints) -> Placed:
        """Return one part of a robot of another kind at each configuration."""
        hulls = [self.robot.outline(q)[p] for q, p in zip(Q, part, strict=True)]
        shapes = convex_shapes([np.asarray(hull, np.float64) for hull in hulls])
        return Placed(shapes.vertices, shapes.axes, np.zeros_like(shapes.vertices))

    def bounds(self, a: Floats, b: Floats, step: Floats) -> Bounds:
        """Return bounds for each part."""
        if isinstance(self.robot, Chain):
            rate = np.cumsum(step, axis=1)
            return self._chain_bounds(_before(rate), rate, 0)
        if isinstance(self.robot, Polygon):
            straight, turns = np.hypot(step[:, :1], step[:, 1:2]), np.abs(step[:, 2:3])
            move, bend = straight + turns * self._far, turns**2 * self._far
            return Bounds(move * _ROUNDED, bend * _ROUNDED)
        far = self.dof * np.asarray(self.robot.distance(a, b))[:, None] * _ROUNDED
        return Bounds(np.repeat(far, len(self.hulls), axis=1), np.full(far.shape, np.inf))

    def pair_bounds(self, step: Floats) -> Bounds:
        """Return bounds for the second part of each pair, as seen from the first."""
        move, bend = np.empty((2, len(step), len(self.pairs)))
        rate = np.cumsum(step, axis=1)
        before = _before(rate)
        for i in np.unique(self.pairs[:, 0]).tolist():
            mine = self.pairs[:, 0] == i
            arms, links = (each[:, i + 1 :] - rate[:, [i]] for each in (before, rate))
            found = self._chain_bounds(arms, links, i + 1)
            which = self.pairs[mine, 1] - (i + 1)
            move[:, mine], bend[:, mine] = found.move[:, which], found.bend[:, which]
        return Bounds(move, bend)

    def _chain_bounds(self, before: Floats, rate: Floats, first: int) -> Bounds:
        """Return bounds for the links from one on, from the rates of the arms and of the links."""
        arms, far = np.abs(self._offset[first:]), self._far[first:]
        move = np.cumsum(np.abs(before) * arms, axis=1) + np.abs(rate) * far
        bend = np.cumsum(before**2 * arms, axis=1) + rate**2 * far
        return Bounds(move * _ROUNDED, bend * _ROUNDED)


def _before(rate: Floats) -> Floats:
    """Return the rate of the link before each; the base does not turn."""
    return np.concatenate([np.zeros((len(rate), 1)), rate[:, :-1]], axis=1)


def _hulls(robot: Any, dof: int) -> list[Floats]:
    """Return the parts in their own frames, for robots of other kinds those at the origin."""
    if isinstance(robot, Polygon):
        return [np.asarray(part) for part in robot.parts]
    if isinstance(robot, Chain):
        return [np.asarray(joint.link) for joint in robot.joints]
    return [np.asarray(part, np.float64) for part in robot.outline(np.zeros(dof))]
