"""Plots over time: shares of accepted and rejected extensions, and the time an iteration takes."""

import numpy as np
from numpy.typing import NDArray

from brrt.events import Events, Kind, Reason, Table
from brrt.views.colours import NEWEST, REJECTS
from brrt.views.rerun.draw.canvas import Canvas, growing_rows

_ACCEPTED, _ITERATION_TIME = "/series/extensions/accepted", "/series/iteration_time"

_DRAWN = frozenset((Kind.SAMPLE, Kind.EXPAND))
_UNSAMPLED = frozenset((Kind.EDGE, Kind.LINK))
"""What tells iterations apart, and what does in recordings without samples."""


class ExtensionsPlot:
    """Plots the share of all extensions so far that was accepted, or rejected for each reason."""

    def __init__(self, canvas: Canvas) -> None:
        self._canvas = canvas
        self._added, self._rejects = 0, dict.fromkeys(Reason, 0)
        canvas.plot_style(_ACCEPTED, "accepted", NEWEST)
        for reason, colour in REJECTS.items():
            canvas.plot_style(_entity(reason), reason.key, colour)

    def write(self, events: Events) -> None:
        """Plot a batch."""
        rejects = events[Kind.REJECT]
        added = events[Kind.EDGE], events[Kind.EXPAND], events[Kind.LINK]
        before = self._added + sum(self._rejects.values())

        def plot(entity: str, have: int, table: Table, which: NDArray[np.int64]) -> None:
            ends = growing_rows(have, len(which))
            rows = table[which[ends - 1]]
            tried = before + sum(
                np.searchsorted(each["seq"], rows["seq"], "right") for each in (rejects, *added)
            )
            self._canvas.plot(entity, rows, 100 * (have + ends) / tried)

        for reason in Reason:
            which = np.flatnonzero(rejects["reason"] == reason)
            if len(which):
                plot(_entity(reason), self._rejects[reason], rejects, which)
                self._rejects[reason] += len(which)
        for table in filter(len, added):
            plot(_ACCEPTED, self._added, table, np.arange(len(table)))
            self._added += len(table)


class IterationTimePlot:
    """Plots the mean time of the iterations since the value before, a few hundred values in all."""

    def __init__(self, canvas: Canvas) -> None:
        self._canvas, self._count = canvas, 0
        self._before, self._kinds = (0, 0), _UNSAMPLED
        canvas.plot_style(_ITERATION_TIME, "time an iteration", NEWEST)

    def write(self, events: Events) -> None:
        """Plot a batch: each iteration of most planners draws a sample or expands cells."""
        if not _DRAWN.isdisjoint(events.counts):
            self._kinds = _DRAWN
        tables = [events[kind][["seq", "t", "iteration"]] for kind in sorted(self._kinds)]
        table = np.concatenate(tables)
        table = table[np.argsort(table["seq"])]
        begun = np.diff(table["iteration"].astype(np.int64), prepend=self._before[1])
        table = table[begun > 0]  # the first event of each iteration
        if not len(table):
            return
        rows = table[growing_rows(self._count, len(table)) - 1]
        self._count += len(table)
        t, iteration = (rows[name].astype(np.int64) for name in ("t", "iteration"))
        passed = np.diff(t, prepend=self._before[0])
        made = np.diff(iteration, prepend=self._before[1])
        self._canvas.plot(_ITERATION_TIME, rows, passed / made / 1e3)
        self._before = (int(t[-1]), int(iteration[-1]))


def _entity(reason: Reason) -> str:
    return f"/series/extensions/{reason.key}"
