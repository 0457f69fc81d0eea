"""A world alone in Rerun: a file, or the viewer."""

import hashlib
from pathlib import Path

import numpy as np
import rerun.blueprint as rrb

from brrt.errors import RecordingError
from brrt.views.colours import GOAL, START
from brrt.views.rerun import draw_world
from brrt.views.rerun.stream import filled, new_stream
from brrt.worlds.world import World

_GREATEST = 1e30
"""Within single precision even where a viewer multiplies lengths by sizes of its own."""


def show_world(world: World, *, path: Path | None = None, view: bool = False) -> None:
    """Write a world to an .rrd file, or show it in Rerun's viewer, or both.

    Args:
        world: The world.
        path: The file; it is overwritten.
        view: Open the viewer, or use one that is open.

    Raises:
        RecordingError: The file cannot be written, there is no viewer, or the world is beyond the
            numbers that Rerun draws with.
    """
    if max(np.abs(world.lower).max(), np.abs(world.upper).max()) > _GREATEST:
        raise RecordingError(
            f"{world.name}: Rerun draws in single precision, with coordinates up to {_GREATEST:g}; "
            f"make the world smaller"
        )
    name = f"world-{hashlib.sha256(world.to_json().encode()).hexdigest()[:16]}"
    rec = new_stream(name, draw_world.application(world, f"{world.dim}d world"))
    with filled(rec, _layout(world), path, view=view):
        draw_world.log_world(rec, world)
        for mark, point, colour in (("start", world.start, START), ("goal", world.goal, GOAL)):
            if point is not None:
                draw_world.log_mark(rec, world, mark, point[None].astype(np.float32), colour)


def _layout(world: World) -> rrb.Blueprint:
    return rrb.Blueprint(
        draw_world.world_view(world),
        rrb.TimePanel(state="hidden"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.BlueprintPanel(state="collapsed"),
    )
