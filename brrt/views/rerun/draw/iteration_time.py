"""How long an iteration takes, as a plot."""

import numpy as np

from brrt.events import Events, Kind
from brrt.views.rerun import layout
from brrt.views.rerun.draw.canvas import Canvas, growing_rows

_ENTITY = "/series/pace"


class Pace:
    """Plots the mean time of the iterations since the value before, some hundred values in all.

    Args:
        canvas: Where it is plotted.
    """

    def __init__(self, canvas: Canvas) -> None:
        self._canvas, self._count = canvas, 0
        self._before = (0, 0)
        canvas.plot_style(_ENTITY, "time an iteration", layout.NEWEST)

    def write(self, events: Events) -> None:
        """Take in a batch: most planners draw a sample in each iteration, or expand cells."""
        for kind in (Kind.SAMPLE, Kind.EXPAND):
            table = events[kind]
            if not len(table):
                continue
            rows = table[growing_rows(self._count, len(table)) - 1]
            self._count += len(table)
            t, iteration = (rows[name].astype(np.int64) for name in ("t", "iteration"))
            passed = np.diff(t, prepend=self._before[0])
            made = np.diff(iteration, prepend=self._before[1])
            told = made > 0
            self._canvas.plot(_ENTITY, rows[told], passed[told] / made[told] / 1e3)
            self._before = (int(t[-1]), int(iteration[-1]))
