"""The palette of all views: red, green and blue from 0 to 255.

Viewers have a dark ground; for figures on white paper the same hues are darker.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brrt.events import Reason, Source, Stage

Colour = tuple[int, int, int]

FREE: Colour = (18, 20, 26)
OBSTACLE: Colour = (102, 101, 100)
"""Lighter than free space by 3:1 at least, in 2D as in 3D; trees and paths are lighter still. Its
hue differs from that of the world's outline."""
OBSTACLE_3D: Colour = (112, 120, 137)
OUTLINE: Colour = (96, 103, 118)
START: Colour = (255, 145, 30)
GOAL: Colour = (60, 215, 100)
OTHER: Colour = (180, 120, 255)
"""For what has no colour of its own."""
LINK: Colour = (255, 236, 170)
GRAPH: Colour = (86, 128, 132)
"""Edges of a graph, beside those of trees."""
GHOST: Colour = (150, 128, 60)
"""The body along a path."""
TRACE: Colour = (205, 205, 215)
TRACE_ON_CELLS: Mapping[int, Colour] = {2: (24, 26, 34), 3: (130, 132, 146)}
"""By dimensions: in 2D the trace lies on the visited cells, in 3D among them."""
ROBOT: Colour = (255, 255, 255)
NEWEST: Colour = (120, 170, 235)
RING: Colour = (255, 64, 216)
"""Around the place of one event; nothing else has this hue."""
RUNS: tuple[Colour, Colour] = ((92, 170, 255), (255, 160, 60))
"""Plots of two runs side by side."""
SAMPLES: Mapping[Source, Colour] = {
    Source.UNIFORM: (170, 177, 190),
    Source.GOAL: GOAL,
    Source.OTHER_TREE: (176, 128, 168),
    Source.INFORMED: (94, 158, 160),
}
REJECTS: Mapping[Reason, Colour] = {
    Reason.COLLISION: (170, 82, 88),
    Reason.NO_PROGRESS: (120, 110, 90),
    Reason.GOAL_BLOCKED: (140, 90, 150),
    Reason.LINK_BLOCKED: (176, 112, 66),
    Reason.NEAR_BLOCKED: (108, 66, 72),
    Reason.NO_GAIN: (84, 90, 108),
    Reason.LIMITS: (150, 142, 70),
}
REWIRED: Mapping[str, Colour] = {"start": (150, 235, 255), "goal": (255, 190, 220)}
"""New edges of the trees of these names."""
_TREES: Mapping[int, tuple[str, Colour]] = {
    0: ("start", (74, 144, 255)),
    1: ("goal", (255, 82, 82)),
}
TREE_NAMES = tuple(name for name, _ in _TREES.values())
_PATHS: Mapping[Stage, tuple[Colour, float]] = {
    Stage.RAW: ((255, 240, 100), 1.5),
    Stage.SMOOTHED: ((255, 184, 0), 3.0),
    Stage.IMPROVED: ((255, 226, 60), 2.5),
}
_HEAT = ((98, 74, 190), (54, 110, 200), (30, 158, 164), (112, 196, 92), (250, 224, 60))
"""From low to high, each bright enough for a dark ground."""

PAPER_OBSTACLE: Colour = (10, 11, 14)
PAPER_START: Colour = (228, 108, 10)
PAPER_GOAL: Colour = (24, 150, 62)
PAPER_PATH: Colour = (216, 164, 0)
PAPER_SMOOTHED: Colour = (168, 110, 0)
PAPER_REJECTED: Colour = (178, 120, 124)
PAPER_HIT: Colour = (206, 38, 46)
PAPER_GRAPH: Colour = (118, 150, 154)
PAPER_ROBOT: Colour = (20, 22, 28)
PAPER_TREES: Mapping[int, tuple[str, Colour, Colour]] = {
    0: ("start", (38, 104, 214), (0, 158, 190)),
    1: ("goal", (206, 38, 46), (222, 92, 150)),
}
"""Names of trees, their colours, and those of their rewired edges."""
PAPER_OTHER: Colour = (124, 74, 190)
PAPER_CURVES: tuple[Colour, ...] = (
    (38, 104, 214), (206, 38, 46), PAPER_GOAL, PAPER_START, PAPER_OTHER, (0, 140, 168),
    (150, 90, 60), OUTLINE,
)  # fmt: skip


def tree_style(number: int) -> tuple[str, Colour]:
    """Return a tree's name and colour."""
    return _TREES.get(number, (str(number), OTHER))


def path_style(stage: Stage) -> tuple[str, Colour, float]:
    """Return a path's name, its colour, and the radius of its lines in points of the screen."""
    return (stage.key, *_PATHS.get(stage, (OTHER, 2.0)))


def heat(values: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Return colours for values from 0 to 1, shape (n, 3)."""
    at = np.linspace(0, 1, len(_HEAT))
    channels = [np.interp(values, at, channel) for channel in np.transpose(_HEAT)]
    return np.stack(channels, axis=-1).astype(np.uint8)


def packed(colours: Any) -> NDArray[np.uint32]:
    """Return opaque colours, shape (..., 3), as Rerun packs them, shape (...)."""
    red, green, blue = np.moveaxis(np.asarray(colours, np.uint32), -1, 0)
    return np.asarray(red << 24 | green << 16 | blue << 8 | 255, np.uint32)


def rgb(colour: Colour) -> tuple[float, ...]:
    """Return a colour with parts from 0 to 1, as matplotlib takes it."""
    return tuple(value / 255 for value in colour)
