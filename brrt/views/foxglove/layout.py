"""A layout that Foxglove and Lichtblick import: one 3D panel that shows all topics."""

import json
from collections.abc import Iterable
from typing import Any

from brrt.views.colours import FREE, OBSTACLE, Colour
from brrt.views.foxglove.draw_world import MAP_TOPIC
from brrt.views.foxglove.messages import FRAME
from brrt.worlds.world import World

_PANEL = "3D!brrt"
_FIELD_OF_VIEW = 45.0


def layout(world: World, topics: Iterable[str]) -> str:
    """Return the layout for a run's export as JSON.

    A 3D panel hides topics until a layout, or a click for each, shows them.
    """
    shown: dict[str, dict[str, Any]] = {topic: {"visible": True} for topic in topics}
    if MAP_TOPIC in shown:
        clear = _css(FREE, 0)
        shown[MAP_TOPIC] |= {"colorMode": "custom", "minColor": clear, "maxColor": _css(OBSTACLE)}
    panel = {
        "cameraState": _camera(world),
        "followMode": "follow-none",
        "followTf": FRAME,
        "scene": {"backgroundColor": _css(FREE), "transforms": {"showLabel": False}},
        "transforms": {f"frame:{FRAME}": {"visible": False}},
        "topics": shown,
        "layers": {},
    }
    data = {
        "configById": {_PANEL: panel},
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": {"speed": 1},
        "layout": _PANEL,
    }
    return json.dumps(data, indent=2) + "\n"


def _camera(world: World) -> dict[str, Any]:
    """Return a camera that shows the whole world; in 2D from above, x to the right and y up."""
    middle = [*((world.lower + world.upper) / 2).tolist(), 0.0][:3]
    flat = world.dim == 2
    distance = (1.1 if flat else 2.2) * world.extent
    return {
        "perspective": not flat,
        "distance": distance,
        "phi": 0.0 if flat else 60.0,
        "thetaOffset": 0.0 if flat else 30.0,
        "target": [0.0, 0.0, 0.0],
        "targetOffset": middle,
        "targetOrientation": [0.0, 0.0, 0.0, 1.0],
        "fovy": _FIELD_OF_VIEW,
        "near": 1e-3 * distance,
        "far": 20 * distance,
    }


def _css(colour: Colour, alpha: int = 255) -> str:
    return "#" + "".join(f"{part:02x}" for part in (*colour, alpha))
