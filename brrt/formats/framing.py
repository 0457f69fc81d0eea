"""The bounds that a recording without a world is drawn in: those of its configurations."""

from contextlib import suppress
from dataclasses import replace

import numpy as np

from brrt.events import FIELDS, Events, Kind
from brrt.formats.integrity import BrokenError
from brrt.recording import Recording
from brrt.robots import Robot
from brrt.worlds.arrays import Floats, box_around


def framed(recording: Recording) -> Recording:
    """Return a recording without a world with bounds around all that happens in it.

    Its events are read once, up to the first damage.
    """
    if recording.world.bounded:
        return recording
    robot, manifest = recording.robot(), recording.manifest
    ends = np.array([manifest.start, manifest.goal])
    found = robot.places(ends)
    if body := [line for line in robot.skeleton(ends) if len(line)]:
        found = np.concatenate([found, *body])
    with suppress(BrokenError):
        for batch in recording.batches():
            found = np.concatenate([found, *_places(batch, robot)])
            found = np.stack([found.min(axis=0), found.max(axis=0)])
    lower, upper = box_around(found)
    return replace(recording, world=replace(recording.world, lower=lower, upper=upper))


def _places(events: Events, robot: Robot) -> list[Floats]:
    """Return where the configurations of a batch are drawn."""
    rows = [
        np.asarray(events[kind][field.name])
        for kind, fields in FIELDS.items()
        for field in fields
        if field.type == "q"
    ]
    rows += [np.reshape(path, (-1, events.dof)) for path in events[Kind.PATH]["waypoints"]]
    found = (robot.places(q) for q in rows if len(q))
    return [places[np.isfinite(places).all(axis=1)] for places in found]
