"""A ring around the place of one event, for the eye of who was sent to look at it."""

from collections.abc import Mapping
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from brrt.events import Events, Kind
from brrt.scenario.manifest import Manifest
from brrt.views.colours import Colour
from brrt.views.rerun import draw_world, layout
from brrt.views.rerun.sink import recording_id
from brrt.views.rerun.stream import filled, new_stream
from brrt.worlds.world import World

MARK: Colour = (255, 64, 216)
"""Like nothing else in the picture."""
_RING = {2: 0.02, 3: 0.04}
"""Its radius as a part of the world's extent, by the world's dimensions."""
_CIRCLE = np.linspace(0, 2 * np.pi, 49)


def draw_mark(path: Path, manifest: Manifest, world: World, events: Events, seq: int) -> None:
    """Write an .rrd file with the ring alone; a viewer that has the recording open adds it.

    Args:
        path: The file; it is overwritten.
        manifest: The run's.
        world: The run's.
        events: Its whole log, or as much of it as reaches to the event.
        seq: The event's number.

    Raises:
        RecordingError: The file cannot be written.
    """
    kinds = [kind for kind, table in events.tables.items() if seq in table["seq"]]
    text = ": ".join([f"event {seq}", *(kind.label for kind in kinds)])
    rec = new_stream(recording_id(manifest), layout.application(manifest, world))
    with filled(rec, layout.blueprint(manifest, world), path, view=False):
        ring(rec, manifest, world, place_of(events, manifest, seq), text)


def ring(rec: Any, manifest: Manifest, world: World, q: NDArray[np.float64], text: str) -> None:
    """Ring a configuration's place, at all times: it is what one looks for."""
    place = layout.places([q], manifest.make_robot())
    radius = _RING[world.dim]
    axes = np.eye(world.dim) * radius * world.extent
    rings = [
        place + np.outer(np.cos(_CIRCLE), a) + np.outer(np.sin(_CIRCLE), b)
        for a, b in combinations(axes, 2)
    ]
    layer = {"draw_order": 110} if world.dim == 2 else {}
    strips: Any = rr.LineStrips2D if world.dim == 2 else rr.LineStrips3D
    rec.log("/world/mark", strips(rings, colors=MARK, radii=-2, **layer), static=True)
    draw_world.log_label(rec, world, "mark", place, MARK, text, radius + 0.012)


def place_of(
    events: Events, manifest: Manifest, seq: int, other: Mapping[str, Any] | None = None
) -> NDArray[np.float64]:
    """Return the configuration that an event is about; without one, the newest before.

    Args:
        events: The run's log.
        manifest: The run's.
        seq: The event's number.
        other: Another run's event, to find the waypoint at which two paths part.
    """
    until = events.until(seq=seq)
    newest = {kind: table[-1] for kind, table in until.tables.items() if len(table)}
    if not newest:
        return np.array(manifest.start)
    kind, row = max(newest.items(), key=lambda item: int(item[1]["seq"]))
    if kind is Kind.PATH:
        theirs = () if other is None else other.get("waypoints", ())
        pairs = zip(row["waypoints"], theirs, strict=False)
        parted = (i for i, (ours, their) in enumerate(pairs) if (ours != their).any())
        return np.asarray(row["waypoints"][next(parted, -1)])
    if kind in (Kind.REWIRE, Kind.CONNECT):
        edges = until[Kind.EDGE]
        tree = row["tree"] if kind is Kind.REWIRE else 0
        return np.asarray(edges["q"][(edges["tree"] == tree) & (edges["node"] == row["node"])][0])
    placed = [each for each in newest.values() if "q" in (each.dtype.names or ())]
    if not placed:
        return np.array(manifest.start)
    return np.asarray(max(placed, key=lambda each: int(each["seq"]))["q"])
