"""The tree of a run in pictures of the viewer, against the tree of the fold."""

import numpy as np
from numpy.typing import NDArray

from brrt import Events, forest
from brrt.views.colours import GOAL, REWIRED, START
from tests.support.pixels import Frame, Mask, near, of_colour

SIZE = (1000, 700)


def rasterised(events: Events, where: Frame, shape: tuple[int, int]) -> Mask:
    """Return the pixels of the edges of the start's tree as the fold has them."""
    tree = forest(events)[0]
    child = np.flatnonzero(tree.parent >= 0)
    part = np.linspace(0, 1, 400)[:, None, None]
    a, b = tree.q[tree.parent[child], :2], tree.q[child, :2]
    at = where.pixels((a + part * (b - a)).reshape(-1, 2))
    mask = np.zeros(shape, bool)
    mask[at[:, 0], at[:, 1]] = True
    return mask


def tree_pixels(picture: NDArray[np.int64]) -> Mask:
    """Return the pixels of the start's tree: its blue, blended at the lines' borders."""
    red, green, blue = np.moveaxis(picture, -1, 0)
    return np.asarray((blue - green > 40) & (blue - red > 60))


def rewired_pixels(picture: NDArray[np.int64]) -> Mask:
    """Return the pixels of edges that were just rewired; some have changed again since."""
    return of_colour(picture, REWIRED["start"], 70)


def on_top(picture: NDArray[np.int64]) -> Mask:
    """Return the pixels that may hide a tree: paths in yellow and gold, start and goal."""
    red, green, blue = np.moveaxis(picture, -1, 0)
    path = (red > 120) & (green > 90) & (red - blue > 60)
    return near(path | of_colour(picture, START, 40) | of_colour(picture, GOAL, 40), 2)
