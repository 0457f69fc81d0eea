"""A world alone in Rerun: a file, or the viewer."""

import hashlib
from pathlib import Path
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from brrt.colours import GOAL, START
from brrt.errors import RecordingError
from brrt.recording import landscape, viewer
from brrt.recording.drain import Drain
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
    rr.set_strict_mode(True)  # otherwise Rerun drops what it does not understand
    name = f"world-{hashlib.sha256(world.to_json().encode()).hexdigest()[:16]}"
    rec: Any = rr.RecordingStream(viewer.APPLICATION, recording_id=name, send_properties=False)
    rr.set_log_time_enabled(False, recording=rec)
    if view:
        viewer.open_viewer(rec)
    drain = None if path is None else Drain(path)
    try:
        sinks: list[Any] = [rr.GrpcSink(viewer.address())] if view else []
        try:
            if drain is not None:
                sinks.append(rr.FileSink(drain.inlet))
            rec.set_sinks(*sinks, default_blueprint=_layout(world))
        finally:
            if drain is not None:
                drain.leave()
        landscape.log_world(rec, world)
        for mark, point, colour in (("start", world.start, START), ("goal", world.goal, GOAL)):
            if point is not None:
                landscape.log_mark(rec, world, mark, point[None].astype(np.float32), colour)
        rec.flush()
    finally:
        rec.disconnect()
        if drain is not None:
            drain.close()


def _layout(world: World) -> rrb.Blueprint:
    return rrb.Blueprint(
        landscape.world_view(world),
        rrb.TimePanel(state="hidden"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.BlueprintPanel(state="collapsed"),
    )
