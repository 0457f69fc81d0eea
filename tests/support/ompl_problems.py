"""Problems for OMPL's planners, and what their data are; import it where ompl is installed."""

from collections.abc import Callable
from typing import Any

from ompl import base, geometric, util

import brrt

PLANNERS = (
    "RRT", "RRTConnect", "RRTstar", "InformedRRTstar", "SORRTstar", "BITstar", "FMT", "BFMT", "PRM",
    "PRMstar", "KPIECE1", "BKPIECE1", "LBKPIECE1", "AORRTC",
)  # fmt: skip
"""All planners of ompl 2.0.1 in Python."""

Place = tuple[float, ...]

util.setLogLevel(util.LOG_NONE)


def free_in(world: brrt.World, margin: float = 0.0) -> Callable[[Any], bool]:
    """Return a validity checker of points in a world of balls and boxes.

    Args:
        world: The world.
        margin: How far from obstacles a point must be.
    """
    balls, boxes, dim = world.balls.tolist(), world.boxes.tolist(), world.dim

    def free(state: Any) -> bool:
        q = [state[k] for k in range(dim)]
        for *centre, radius in balls:
            if sum((a - b) ** 2 for a, b in zip(q, centre, strict=True)) <= (radius + margin) ** 2:
                return False
        for box in boxes:
            low, high = box[:dim], box[dim:]
            if all(a - margin <= x <= b + margin for a, x, b in zip(low, q, high, strict=True)):
                return False
        return True

    return free


def point_setup(
    planner: str, world: brrt.World, *, seed: int = 1, step: float = 5.0, margin: float = 0.5,
    resolution: float = 0.002,
) -> Any:  # fmt: skip
    """Return a set-up of a point in a world; checks are closer than the margin."""
    util.RNG.setSeed(seed)
    space = base.RealVectorStateSpace(world.dim)
    bounds = base.RealVectorBounds(world.dim)
    for k in range(world.dim):
        bounds.setLow(k, float(world.lower[k]))
        bounds.setHigh(k, float(world.upper[k]))
    space.setBounds(bounds)
    setup = geometric.SimpleSetup(space)
    information = setup.getSpaceInformation()
    information.setStateValidityCheckingResolution(resolution)
    setup.setStateValidityChecker(free_in(world, margin))
    start, goal = information.allocState(), information.allocState()
    assert world.start is not None
    assert world.goal is not None
    for k in range(world.dim):
        start[k], goal[k] = float(world.start[k]), float(world.goal[k])
    setup.setStartAndGoalStates(start, goal, 1.0)
    made = getattr(geometric, planner)(information)
    if hasattr(made, "setRange"):
        made.setRange(step)
    if hasattr(made, "setNumSamples"):
        made.setNumSamples(300)
    setup.setPlanner(made)
    return setup


def iterations(count: int) -> Any:
    """Return a stop condition; not for PRM, which a condition in Python blocks."""
    done = [0]

    def stop() -> bool:
        done[0] += 1
        return done[0] > count

    return base.PlannerTerminationCondition(stop)


def planner_graph(setup: Any, dof: int = 2) -> tuple[list[Place], set[frozenset[Place]]]:
    """Return the configurations of the vertices, and the ends of the edges, of PlannerData."""
    information = setup.getSpaceInformation()
    data = base.PlannerData(information)
    setup.getPlannerData(data)
    value = information.getStateSpace().getValueAddressAtIndex
    places = [
        tuple(value(data.getVertex(i).getState(), k) + 0.0 for k in range(dof))
        for i in range(data.numVertices())
    ]
    edges = {
        frozenset((places[i], places[j])) for i in range(len(places)) for j in data.getEdges(i)
    }
    return sorted(set(places)), {edge for edge in edges if len(edge) == 2}


def recorded_graph(recording: brrt.Recording) -> tuple[list[Place], set[frozenset[Place]]]:
    """Return the same of a recording's end."""
    graph = recording.to_networkx()
    places = {
        node: tuple(value for name, value in data.items() if name.startswith("q_"))
        for node, data in graph.nodes(data=True)
    }
    edges = {frozenset((places[a], places[b])) for a, b in graph.edges}
    return sorted(set(places.values())), {edge for edge in edges if len(edge) == 2}
