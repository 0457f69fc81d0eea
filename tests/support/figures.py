"""Figures by matplotlib: golden runs to draw, and what a picture of a 2D run shows."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from brrt import Events, Kind, Recording, World, forest, read
from tests.conftest import Result
from tests.support.pixels import Frame, Mask, frame, near, opened
from tests.support.recordings import RECORDINGS

Command = Callable[..., Result]
Floats = NDArray[np.float64]


@cache
def golden(name: str) -> Recording:
    """Return a golden recording with its events in memory."""
    return read(RECORDINGS / f"{name}.mcap").until()


def last_event(events: Events) -> int:
    """Return the number of the last event."""
    return max(int(table["seq"][-1]) for table in events.tables.values())


@dataclass(frozen=True)
class Picture:
    """A picture of a run in a 2D world, shape (height, width, 3), and where the world is in it."""

    colours: NDArray[np.int64]
    frame: Frame

    @classmethod
    def of(cls, source: NDArray[np.int64] | Path, world: World) -> "Picture":
        """Load a picture."""
        colours = opened(source.read_bytes()) if isinstance(source, Path) else source
        return cls(colours, frame(colours, world, 60, 0.9))

    def near(self, mask: Mask, points: Floats, reach: int = 1) -> Mask:
        """Return for each point whether a pixel of the mask is within reach."""
        return np.asarray(near(mask, reach)[tuple(self.frame.pixels(points).T)])

    def around(self, points: Floats, reach: int) -> Mask:
        """Return the pixels within reach of any of the points."""
        mask = np.zeros(self.colours.shape[:2], np.bool_)
        mask[tuple(self.frame.pixels(points).T)] = True
        return near(mask, reach)

    def inside(self) -> Mask:
        """Return the pixels well within the frame."""
        where, mask = self.frame, np.zeros(self.colours.shape[:2], np.bool_)
        top, left = int(where.top) + 4, int(where.left) + 4
        mask[top : int(where.bottom) - 3, left : int(where.right) - 3] = True
        return mask

    @property
    def blue(self) -> Mask:
        """The pixels of the start's tree with its rewired edges."""
        red, green, blue = np.moveaxis(self.colours, 2, 0)
        return np.asarray((blue - red > 25) & (blue > green))

    @property
    def red(self) -> Mask:
        """The pixels of the goal's tree."""
        red, green, blue = np.moveaxis(self.colours, 2, 0)
        return np.asarray((red - green > 40) & (green - blue < 25))

    @property
    def gold(self) -> Mask:
        """The pixels of paths and of the start."""
        _, green, blue = np.moveaxis(self.colours, 2, 0)
        return np.asarray((green - blue > 60) & (self.colours[..., 0] > green))


def picture_of(brrt: Command, name: str, *options: object) -> Picture:
    """Draw the tree of a golden recording by the command."""
    run = RECORDINGS / f"{name}.mcap"
    done = brrt("plot", run, "--what", "tree", "--out", "x.png", "--force", "--dpi", 150, *options)
    assert done.code == 0, done.err
    return Picture.of(Path("x.png"), golden(name).world)


def along(lines: Floats) -> Floats:
    """Return points on lines, shape (n, 2, 2), with at most a few pixels between them."""
    part = np.linspace(0, 1, 80)[:, None, None]
    points = lines[:, 0] + (lines[:, 1] - lines[:, 0]) * part
    return np.asarray(points.reshape(-1, 2))


def along_path(path: Floats) -> Floats:
    """Return points along a path."""
    return along(np.stack([path[:-1], path[1:]], axis=1))


def along_hull(hull: Floats) -> Floats:
    """Return points along the outline of a polygon."""
    return along(np.stack([hull, np.roll(hull, -1, axis=0)], axis=1))


def newest_paths(events: Events) -> Floats:
    """Return points along the last two paths."""
    paths = [along_path(np.asarray(row["waypoints"])) for row in events[Kind.PATH][-2:]]
    return np.concatenate([np.empty((0, 2)), *paths])


def edges_of(events: Events, number: int) -> Floats:
    """Return the edges of a tree by the fold that replay uses, shape (n, 2, 2)."""
    tree = forest(events)[number]
    child = np.flatnonzero(tree.parent >= 0)
    return np.stack([tree.q[tree.parent[child]], tree.q[child]], axis=1)
