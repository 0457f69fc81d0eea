"""Drawings whose items change: items lie on pages, and a changed page is logged again.

Of an entity that changes, a viewer shows the newest row up to the cursor, so a page is right
wherever the cursor goes. Three bounds keep the cost low:

- There are at most `_MOST_PAGES`: when they are full, each takes twice as many items. More would
  not help: by the time a row pays, something has changed on nearly every page.
- Changed pages are logged once there have been as many changes since the last time as pay for the
  items logged then, `_PER_CHANGE` items a change, and, after many changes, a fraction of them. So
  the rows stay in proportion to the events; the picture lags by about 3 % of its changes, at first
  by none.
- The rows of a page are sent together, at most a few times a second: a chunk takes a kilobyte and
  a quarter of a millisecond, and similar rows within one compress well.
"""

import time
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brrt.events import Table
from brrt.views.rerun.draw.canvas import TIMES, Canvas, times_of

_MOST_PAGES, _FIRST_SIZE = 64, 32
"""Pages at most, and items on a page at first. With 100,000 items on all pages, a row and the one
before it are still within the 64 kB in which the compression finds repetitions."""

_PER_CHANGE, _MANY_CHANGES, _PER_CHANGE_OF_MANY = 16, 100_000, 4
"""Items that may be logged for each change, and the same beyond `_MANY_CHANGES`."""

_MOST_UNSEEN = 1000
"""A page waits for one change in `_MOST_UNSEEN` in any case: each row costs time, however small."""

_SEND_S = 0.5
"""Seconds for which rows are gathered."""

Items = NDArray[Any]


class _PageRows(NamedTuple):
    """A row of each of some pages, all at one time.

    Attributes:
        time: The time, as in `TIMES`.
        pages: Numbers of the pages, shape (n,).
        counts: Items on each, shape (n,).
        items: Their items, one page after another.
    """

    time: Any
    pages: NDArray[np.int64]
    counts: NDArray[np.int64]
    items: NDArray[np.void]


class Pages:
    """Items that change.

    Args:
        canvas: Where they are drawn.
        entity: The pages are entities below this one.
        columns: Turns items into columns for Rerun.
        dtype: Type of an item.
        style: Returns the columns of a style for a number of rows. They compress to nearly nothing;
            a static chunk for each page would take more.
    """

    def __init__(
        self,
        canvas: Canvas,
        entity: str,
        columns: Callable[[Items], Any],
        dtype: np.dtype[np.void],
        style: Callable[[int], Any],
    ) -> None:
        self._canvas, self._entity, self._columns, self._style = canvas, entity, columns, style
        self._items, self._count, self._size = np.zeros(0, dtype), 0, _FIRST_SIZE
        self._dirty = np.zeros(_MOST_PAGES, np.bool_)
        self._sent = time.monotonic()
        self._rows: list[_PageRows] = []
        self._changes, self._wait = 0, 1
        self._latest: Any = None

    def fill(self, items: Items, when: Any) -> None:
        """Take over items that were drawn elsewhere up to a time."""
        self._put(np.arange(len(items)), items)
        self._latest = when
        self._log()
        self._wait = 1

    def change(self, rows: Table, slots: NDArray[Any], items: Items) -> None:
        """Change items, in the order of the events.

        Args:
            rows: The events, shape (n,).
            slots: Which item each changes, shape (n,); new slots follow the last one.
            items: The new items, shape (n,).
        """
        iterations, begin = rows["iteration"], 0
        while begin < len(rows):
            end = min(begin + self._wait, len(rows))
            # Changes of one iteration appear at once, as on its timeline.
            end = int(np.searchsorted(iterations, iterations[end - 1], "right"))
            self._put(slots[begin:end], items[begin:end])
            self._wait -= end - begin
            self._changes += end - begin
            self._latest = times_of(rows[end - 1 : end])[0]
            if self._wait <= 0:
                self._log()
            begin = end
        if time.monotonic() - self._sent > _SEND_S:
            self._send()

    def close(self) -> None:
        """Log and send the rest."""
        if self._dirty.any() and self._latest is not None:
            self._log()
        self._send()

    def _put(self, slots: NDArray[Any], items: Items) -> None:
        need = max(self._count, int(slots.max(initial=-1)) + 1)
        if need > len(self._items):
            more = np.zeros(max(need, 2 * len(self._items)) - len(self._items), self._items.dtype)
            self._items = np.concatenate([self._items, more])
        self._items[slots] = items  # the last of several changes of a slot stays
        self._count = need
        if need > _MOST_PAGES * self._size:
            while need > _MOST_PAGES * self._size:
                self._size *= 2
            self._dirty[:] = True  # the last pages are empty from now on
        self._dirty[slots // self._size] = True

    def _log(self) -> None:
        """Add a row of each page that changed."""
        pages = np.flatnonzero(self._dirty)
        counts = (self._count - pages * self._size).clip(0, self._size)
        items = self._items.view(f"V{self._items.itemsize}")  # copying field by field is slow
        content = items[_spans(pages * self._size, counts)]
        self._rows.append(_PageRows(self._latest, pages, counts, content))
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
                np.array([r.time for r in self._rows], TIMES), [len(r.pages) for r in self._rows]
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
    """Return the integers of spans, `counts` from each of `begins` on, one span after another."""
    ends = np.cumsum(counts)
    return np.arange(counts.sum()) + np.repeat(begins - ends + counts, counts)
