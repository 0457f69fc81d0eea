"""A ring around the place of one event."""

from collections.abc import Mapping
from itertools import combinations
from typing import Any

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from brrt.events import Events, Kind
from brrt.replay.graph import joined_nodes
from brrt.scenario.manifest import Manifest
from brrt.views.colours import RING
from brrt.views.rerun.draw_world import log_label
from brrt.views.rerun.frame import Frame
from brrt.worlds.world import World

_RADIUS = {2: 0.02, 3: 0.04}
"""The ring's radius as a part of the world's extent, by the world's dimensions."""
_ANGLES = np.linspace(0, 2 * np.pi, 49)


def draw_ring(
    rec: rr.RecordingStream, manifest: Manifest, world: World, q: NDArray[np.float64], text: str
) -> None:
    """Draw a ring around a configuration, shape (dof,), at all times, with a text below."""
    frame = Frame.of(world)
    place, world = frame.places([q], manifest.make_robot()), frame.drawn
    radius = _RADIUS[world.dim]
    axes = np.eye(world.dim) * radius * world.extent
    rings = [
        place + np.outer(np.cos(_ANGLES), a) + np.outer(np.sin(_ANGLES), b)
        for a, b in combinations(axes, 2)
    ]
    layer = {"draw_order": 110} if world.dim == 2 else {}
    strips: Any = rr.LineStrips2D if world.dim == 2 else rr.LineStrips3D
    rec.log("/world/ring", strips(rings, colors=RING, radii=-2, **layer), static=True)
    log_label(rec, world, "ring", place, RING, text, radius + 0.012)


def place_of(
    events: Events, manifest: Manifest, seq: int, other: Mapping[str, Any] | None = None
) -> NDArray[np.float64]:
    """Return the configuration of an event, or else of the newest one before it that has one.

    If it is a path and so is the `other` run's event, return the first waypoint that differs.
    """
    until = events.until(seq=seq)
    newest = {kind: table[-1] for kind, table in until.tables.items() if len(table)}
    if not newest:
        return np.array(manifest.start)
    kind, row = max(newest.items(), key=lambda item: int(item[1]["seq"]))
    if kind is Kind.PATH:
        theirs = () if other is None else other.get("waypoints", ())
        pairs = zip(row["waypoints"], theirs, strict=False)
        differ = (i for i, (ours, their) in enumerate(pairs) if (ours != their).any())
        return np.asarray(row["waypoints"][next(differ, -1)])
    if kind in (Kind.REWIRE, Kind.CONNECT, Kind.LINK, Kind.CUT, Kind.REMOVE):
        edges = joined_nodes(until)
        tree = 0 if kind is Kind.CONNECT else row["tree"]
        return np.asarray(edges["q"][(edges["tree"] == tree) & (edges["node"] == row["node"])][0])
    placed = [each for each in newest.values() if "q" in (each.dtype.names or ())]
    if not placed:
        return np.array(manifest.start)
    return np.asarray(max(placed, key=lambda each: int(each["seq"]))["q"])
