"""Drawings that change: items on pages, and a page is logged anew when something on it did.

Of an entity that changes, a viewer shows the newest row up to the cursor, so that a page is right
wherever the cursor goes. What that costs is bounded in three ways:

- There are at most `_MOST_PAGES`: when they are full, each takes twice as many items. More would
  not help: by the time a row pays, something has changed on nearly every page.
- Changed pages are logged when `_PER_CHANGE` items a change have been saved up for the ones logged
  before, and, once there have been many changes, a fraction of that. So the rows stay in proportion
  to the events, and the picture lags behind by 3 % or so of its changes; by none at first.
- The rows of a page are sent together, at most some times a second: a chunk takes a kilobyte and
  a quarter of a millisecond, and within one compression finds that the rows hardly differ.
"""

import time
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brrt.events import Table
from brrt.views.rerun.draw.canvas import MOMENT, Canvas, moments

_MOST_PAGES, _FIRST_SIZE = 64, 32
"""Pages at most, and items on a page as long as that suffices. With 100,000 items on them, a row
and the one before it are still within the 64 kB in which compression finds what comes again."""

_PER_CHANGE, _MANY_CHANGES, _PER_CHANGE_OF_MANY = 16, 100_000, 4
"""Items that may be logged for each change; and beyond so many changes."""

_MOST_UNSEEN = 1000
"""Changes so far for each one that waits in any case: taking rows costs time, however small."""

_SEND_S = 0.5
"""Seconds for which rows are gathered."""

Items = NDArray[Any]
Builder = Callable[[Items], Any]


class _Rows(NamedTuple):
    """A row of each of some pages, taken at one moment.

    Attributes:
        moment: When.
        pages: Their numbers, shape (n,).
        counts: Items on each, shape (n,).
        items: All of them, one page after the other.
    """

    moment: Any
    pages: NDArray[np.int64]
    counts: NDArray[np.int64]
    items: NDArray[np.void]


class Pages:
    """Items that change.

    Args:
        canvas: Where they are drawn.
        entity: The pages are entities below this one.
        columns: Turns items, one after the other, into what Rerun draws.
        empty: Items, shape (0,) and the type that they all have.
        style: Returns what all items share, for so many rows. It stands in each row, where it
            compresses to nearly nothing; a chunk of its own for each page would take more.
    """

    def __init__(
        self,
        canvas: Canvas,
        entity: str,
        columns: Builder,
        empty: Items,
        style: Callable[[int], Any],
    ) -> None:
        self._canvas, self._entity, self._columns, self._style = canvas, entity, columns, style
        self._items, self._count, self._size = empty, 0, _FIRST_SIZE
        self._dirty = np.zeros(_MOST_PAGES, np.bool_)
        self._sent = time.monotonic()
        self._rows: list[_Rows] = []
        self._changes, self._wait = 0, 1
        self._latest: Any = None

    def fill(self, items: Items, moment: Any) -> None:
        """Take over what was drawn elsewhere before."""
        self._put(np.arange(len(items)), items)
        self._latest = moment
        self._log()
        self._wait = 1

    def change(self, rows: Table, slots: NDArray[Any], items: Items) -> None:
        """Take in changes in their order.

        Args:
            rows: When they happened, shape (n,).
            slots: What changed, shape (n,); new slots are numbered on.
            items: To what, shape (n,).
        """
        iterations, begin = rows["iteration"], 0
        while begin < len(rows):
            end = min(begin + self._wait, len(rows))
            # What belongs to one iteration appears at once, as the timeline has it.
            end = int(np.searchsorted(iterations, iterations[end - 1], "right"))
            self._put(slots[begin:end], items[begin:end])
            self._wait -= end - begin
            self._changes += end - begin
            self._latest = moments(rows[end - 1 : end])[0]
            if self._wait <= 0:
                self._log()
            begin = end
        if time.monotonic() - self._sent > _SEND_S:
            self._send()

    def close(self) -> None:
        """Log what is not logged yet."""
        if self._dirty.any() and self._latest is not None:
            self._log()
        self._send()

    def _put(self, slots: NDArray[Any], items: Items) -> None:
        need = max(self._count, int(slots.max(initial=-1)) + 1)
        if need > len(self._items):
            more = np.zeros(max(need, 2 * len(self._items)) - len(self._items), self._items.dtype)
            self._items = np.concatenate([self._items, more])
        self._items[slots] = items  # of several changes of one slot the last one stays
        self._count = need
        if need > _MOST_PAGES * self._size:
            while need > _MOST_PAGES * self._size:
                self._size *= 2
            self._dirty[:] = True  # those at the end are empty from now on
        self._dirty[slots // self._size] = True

    def _log(self) -> None:
        """Take a row of each page that changed."""
        pages = np.flatnonzero(self._dirty)
        counts = (self._count - pages * self._size).clip(0, self._size)
        items = self._items.view(f"V{self._items.itemsize}")  # fields would make it slow
        content = items[_spans(pages * self._size, counts)]
        self._rows.append(_Rows(self._latest, pages, counts, content))
        self._dirty[:] = False
        per_change = _PER_CHANGE if self._changes < _MANY_CHANGES else _PER_CHANGE_OF_MANY
        self._wait = max(1, len(content) // per_change, self._changes // _MOST_UNSEEN)

    def _send(self) -> None:
        if self._rows:
            pages, counts, items = (
                np.concatenate(parts)
                for parts in zip(*[(r.pages, r.counts, r.items) for r in self._rows], strict=True)
            )
            times = np.repeat(
                np.array([r.moment for r in self._rows], MOMENT), [len(r.pages) for r in self._rows]
            )
            order, begins = np.argsort(pages, kind="stable"), np.cumsum(counts) - counts
            for mine in np.split(order, np.flatnonzero(np.diff(pages[order])) + 1):
                content = items[_spans(begins[mine], counts[mine])].view(self._items.dtype)
                self._canvas.send_rows(
                    f"{self._entity}/{pages[mine[0]]:03d}",
                    times[mine],
                    counts[mine],
                    self._columns(content),
                    style=self._style(len(mine)),
                )
        self._rows.clear()
        self._sent = time.monotonic()


def _spans(begins: NDArray[np.int64], counts: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the numbers of spans, so many from each beginning, one span after the other."""
    ends = np.cumsum(counts)
    return np.arange(counts.sum()) + np.repeat(begins - ends + counts, counts)
