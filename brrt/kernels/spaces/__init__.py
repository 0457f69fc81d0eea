"""Configuration spaces of robots as kernels see them: one file and one line here for each robot."""

from collections.abc import Callable, Mapping
from typing import Any

from brrt.errors import BrrtError
from brrt.kernels.spaces.chain import chain_space
from brrt.kernels.spaces.point import point_space
from brrt.kernels.spaces.polygon import polygon_space
from brrt.robots import Chain, Point, Polygon, Robot
from brrt.worlds.world import World

SPACES: Mapping[type[Robot], Callable[[Any, World], Any]] = {
    Point: point_space,
    Polygon: polygon_space,
    Chain: chain_space,
}


def check_plannable(robot: Robot) -> None:
    """Check that it is known what a robot hits.

    Raises:
        BrrtError: It is not.
    """
    if robot.opaque:
        raise BrrtError(
            f"robot {robot.kind} cannot plan: its shape is unknown; choose point, polygon or "
            "chain, or record a planner of your own by brrt.record (docs/python.md)"
        )


def make_space(robot: Robot, world: World) -> Any:
    """Build the configuration space of a robot in a world: a NamedTuple, see `brrt.kernels.space`.

    A space holds the work space of its motion check, so only one thread at a time may use it.

    Args:
        robot: The robot, resolved in the world.
        world: Bounds and obstacles.

    Raises:
        BrrtError: No space is registered for the robot.
    """
    check_plannable(robot)
    kinds = [kind for kind in type(robot).__mro__ if kind in SPACES]  # itself, or what it extends
    if not kinds:
        raise BrrtError(
            f"robot {robot.kind} has no configuration space for planning; add one to "
            "brrt.kernels.spaces.SPACES"
        )
    return SPACES[kinds[0]](robot, world)
