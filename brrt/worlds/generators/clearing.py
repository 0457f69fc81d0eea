"""Obstacles close to start or goal are left out of a world; the others stay where they are."""

from dataclasses import replace

import numpy as np

from brrt.worlds.arrays import Bools, Floats
from brrt.worlds.convex import gap
from brrt.worlds.world import World

_NAMED = 5
"""Obstacles that the note names."""


def clear_ends(world: World, clearance: float) -> World:
    """Return a world without the obstacles that are no farther than a clearance from its query.

    Args:
        world: A world with start and goal, and without a grid.
        clearance: The distance.
    """
    near = [np.zeros(len(world.balls), np.bool_), np.zeros(len(world.boxes), np.bool_)]
    near += [np.zeros(len(world.polygons), np.bool_)]
    for end in (world.start, world.goal):
        if end is not None:
            near[0] |= _near_balls(world.balls, end, clearance)
            near[1] |= _near_boxes(world.boxes, end, clearance)
            near[2] |= _near_polygons(world.polygons, end, clearance)
    names = [
        f"{kind} {i}"
        for kind, which in zip(("ball", "box", "polygon"), near, strict=True)
        for i in np.flatnonzero(which).tolist()
    ]
    if not names:
        return world
    named = ", ".join(names[:_NAMED]) + (" ..." if len(names) > _NAMED else "")
    note = f"obstacles closer than {clearance:.4g} to start or goal are left out: {named}"
    return replace(
        world,
        balls=world.balls[~near[0]],
        boxes=world.boxes[~near[1]],
        polygons=tuple(p for p, bad in zip(world.polygons, near[2], strict=True) if not bad),
        notes=(*world.notes, note),
    )


def _near_balls(balls: Floats, point: Floats, clearance: float) -> Bools:
    distances = np.hypot.reduce(balls[:, :-1] - point, axis=1)
    return np.asarray(distances <= balls[:, -1] + clearance)


def _near_boxes(boxes: Floats, point: Floats, clearance: float) -> Bools:
    low, high = boxes[:, : len(point)], boxes[:, len(point) :]
    beyond = np.maximum(np.maximum(low - point, point - high), 0.0)
    return np.asarray(np.hypot.reduce(beyond, axis=1) <= clearance)


def _near_polygons(polygons: tuple[Floats, ...], point: Floats, clearance: float) -> Bools:
    around = np.stack([point - clearance, point + clearance])
    return np.array(
        [
            bool((p.max(axis=0) >= around[0]).all() and (p.min(axis=0) <= around[1]).all())
            and gap(point[None], p) <= clearance
            for p in polygons
        ],
        np.bool_,
    )
