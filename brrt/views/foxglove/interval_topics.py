"""What is there at each instant, told by the last message of each of a few topics.

A viewer that seeks knows the last message of each topic and nothing else. So time is cut like a
binary counter: batches of instants, pairs of batches, pairs of pairs; there is a topic for each
size. When a span of time begins, its topic gets one message with the items that are there during
all of the span and were not told by a larger one; so each item is told once or twice a size,
whether it stays or goes. Within a batch, another topic tells what is there for a part of it only.
"""

from collections.abc import Iterator
from heapq import merge
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Ints = NDArray[np.int64]

BATCH = 16
"""Instants in a batch. What is there for a part of a batch is told anew whenever it changes: more
would make these messages long, fewer would make more of them."""

_NOTHING: Ints = np.empty(0, np.int64)


class Told(NamedTuple):
    """A message.

    Attributes:
        instant: When; it stays true until the topic's next one.
        topic: 0 for what comes and goes within a batch; k + 1 for spans of 2^k batches.
        items: What is there, in rising order.
    """

    instant: int
    topic: int
    items: Ints


def tell(born: Ints, gone: Ints, instants: int, batch: int = BATCH) -> Iterator[Told]:
    """Tell which items are there at each instant.

    At any instant, the last message of each topic up to and including it hold, together, each
    item with born <= instant < gone, and each of them once.

    Args:
        born: From which instant on each item is there, at least 0, shape (n,).
        gone: From which instant on it is not, above `born`; `instants` for never; shape (n,).
        instants: How many there are.
        batch: Instants in a batch.

    Yields:
        Messages by instant, and by topic within one.
    """
    spans = _spans(born, gone, instants, batch)
    whole = (_whole(topic, *span, batch << (topic - 1), instants) for topic, span in spans)
    last: dict[int, Ints] = {}
    for told in merge(_parts(born, gone, instants, batch), *whole, key=lambda told: told[:2]):
        # A life that has two spans of a size, or parts of two batches, side by side.
        if not np.array_equal(last.get(told.topic, _NOTHING), told.items):
            last[told.topic] = told.items
            yield told


def topics(instants: int, batch: int = BATCH) -> int:
    """Count the topics that may be used for so many instants."""
    return 2 + _sizes(instants, batch)


def _sizes(instants: int, batch: int) -> int:
    """How often batches are paired until one span has all instants."""
    return max(0, -(-instants // batch) - 1).bit_length()


def _spans(
    born: Ints, gone: Ints, instants: int, batch: int
) -> Iterator[tuple[int, tuple[Ints, Ints]]]:
    """Cut the whole batches of each item's life into the fewest spans.

    Yields:
        For each topic from 1 on: numbers of its spans, and the item that is there, shapes (m,).
    """
    sizes, items = _sizes(instants, batch), np.arange(len(born))
    first, end = -(-born // batch), np.where(gone >= instants, 1 << sizes, gone // batch)
    for size in range(sizes + 1):
        # A span that is the second of its pair at the front, or the first of its pair at the
        # back, does not make a pair within the life.
        front = (first < end) & ((first & 1 == 1) | (size == sizes))
        back = (first + front < end) & (end & 1 == 1)
        numbers = np.concatenate([first[front], end[back] - 1])
        owners = np.concatenate([items[front], items[back]])
        begun = numbers * (batch << size) < instants
        yield size + 1, (numbers[begun], owners[begun])
        first, end = (first + front) // 2, (end - back) // 2


def _whole(topic: int, spans: Ints, items: Ints, length: int, instants: int) -> Iterator[Told]:
    """Tell what is there during whole spans of a length, and that there is nothing after them."""
    order = np.lexsort((items, spans))
    items, (numbers, begins) = items[order], np.unique(spans[order], return_index=True)
    ends = np.append(begins, len(items))
    for i, number in enumerate(numbers.tolist()):
        yield Told(number * length, topic, items[ends[i] : ends[i + 1]])
        over = (number + 1) * length
        if over < instants and (i + 1 == len(numbers) or numbers[i + 1] != number + 1):
            yield Told(over, topic, items[:0])


def _parts(born: Ints, gone: Ints, instants: int, batch: int) -> Iterator[Told]:
    """Tell what is there for a part of a batch, whenever that changes."""
    items, stays = np.arange(len(born)), gone >= instants
    joins = born % batch != 0
    leaves = ~stays & (gone % batch != 0) & ~(joins & (born // batch == gone // batch))
    until = np.minimum(np.minimum(gone, instants), (born // batch + 1) * batch)
    begins = np.concatenate([born[joins], np.maximum(born, gone // batch * batch)[leaves]])
    ends = np.concatenate([until[joins], gone[leaves]])
    owners = np.concatenate([items[joins], items[leaves]])
    changes = np.unique(np.concatenate([begins, ends]))
    order = np.argsort(begins, kind="stable")
    begins, ends, owners = begins[order], ends[order], owners[order]
    # All that is there at a change began in the change's batch, or in the batch that it ends.
    low = np.searchsorted(begins, changes // batch * batch)
    high = np.searchsorted(begins, changes, side="right")
    for i in np.flatnonzero(changes < instants).tolist():
        begun = slice(low[i], high[i])
        there = owners[begun][ends[begun] > changes[i]]
        yield Told(int(changes[i]), 0, np.sort(there))
