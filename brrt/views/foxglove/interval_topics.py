"""Messages on a few topics, the last of which show at each instant which items exist then.

A viewer that seeks knows the last message of each topic and nothing else. So time is cut like a
binary counter: batches of instants, pairs of batches, pairs of pairs, with a topic for each size.
When such a span begins, its topic gets one message with the items that exist during all of it and
that no longer span has; so each item is in one or two messages of a size. Another topic has the
items that exist for a part of a batch only.
"""

from collections.abc import Iterator
from heapq import merge
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Ints = NDArray[np.int64]

BATCH = 16
"""Instants in a batch. Topic 0 gets a message at each change within a batch: longer batches make
these messages longer, shorter ones make more of them."""

_NOTHING: Ints = np.empty(0, np.int64)


class IntervalMessage(NamedTuple):
    """A message.

    Attributes:
        instant: When it is sent; it holds until the topic's next one.
        topic: 0 for items that exist for a part of a batch; k + 1 for spans of 2^k batches.
        items: Numbers of the items, rising.
    """

    instant: int
    topic: int
    items: Ints


def interval_messages(
    born: Ints, gone: Ints, instants: int, batch: int = BATCH
) -> Iterator[IntervalMessage]:
    """Yield the messages, by instant and then by topic.

    At any instant, the last messages of all topics up to and including it hold, together, each
    item with born <= instant < gone once.

    Args:
        born: The first instant at which each item exists, at least 0, shape (n,).
        gone: The first at which it does not, above `born`; `instants` for never; shape (n,).
        instants: Number of instants.
        batch: Instants in a batch.
    """
    spans = _spans(born, gone, instants, batch)
    whole = (_whole(topic, *span, batch << (topic - 1), instants) for topic, span in spans)
    parts = _parts(born, gone, instants, batch)
    last: dict[int, Ints] = {}
    for message in merge(parts, *whole, key=lambda message: message[:2]):
        # An item may have two spans of a size, or parts of two batches, side by side.
        if not np.array_equal(last.get(message.topic, _NOTHING), message.items):
            last[message.topic] = message.items
            yield message


def _sizes(instants: int, batch: int) -> int:
    """Return how often batches are paired until one span has all instants."""
    return max(0, -(-instants // batch) - 1).bit_length()


def _spans(
    born: Ints, gone: Ints, instants: int, batch: int
) -> Iterator[tuple[int, tuple[Ints, Ints]]]:
    """Cut the whole batches of each item's life into the fewest spans.

    Yields:
        For each topic from 1 on: numbers of its spans, and the item of each, shape (m,).
    """
    sizes, items = _sizes(instants, batch), np.arange(len(born))
    first, end = -(-born // batch), np.where(gone >= instants, 1 << sizes, gone // batch)
    for size in range(sizes + 1):
        # At the front a span that is the second of its pair, at the back one that is the first of
        # its pair, belongs to no pair within the life.
        front = (first < end) & ((first & 1 == 1) | (size == sizes))
        back = (first + front < end) & (end & 1 == 1)
        numbers = np.concatenate([first[front], end[back] - 1])
        owners = np.concatenate([items[front], items[back]])
        begun = numbers * (batch << size) < instants
        yield size + 1, (numbers[begun], owners[begun])
        first, end = (first + front) // 2, (end - back) // 2


def _whole(
    topic: int, spans: Ints, items: Ints, length: int, instants: int
) -> Iterator[IntervalMessage]:
    """Yield a message for each span of a length, and an empty one after it if no span follows."""
    order = np.lexsort((items, spans))
    items, (numbers, begins) = items[order], np.unique(spans[order], return_index=True)
    ends = np.append(begins, len(items))
    for i, number in enumerate(numbers.tolist()):
        yield IntervalMessage(number * length, topic, items[ends[i] : ends[i + 1]])
        over = (number + 1) * length
        if over < instants and (i + 1 == len(numbers) or numbers[i + 1] != number + 1):
            yield IntervalMessage(over, topic, items[:0])


def _parts(born: Ints, gone: Ints, instants: int, batch: int) -> Iterator[IntervalMessage]:
    """Yield a message at each change of the items that exist for a part of a batch."""
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
    # What exists at a change began in the change's batch, or in the batch that it ends.
    low = np.searchsorted(begins, changes // batch * batch)
    high = np.searchsorted(begins, changes, side="right")
    for i in np.flatnonzero(changes < instants).tolist():
        begun = slice(low[i], high[i])
        existing = owners[begun][ends[begun] > changes[i]]
        yield IntervalMessage(int(changes[i]), 0, np.sort(existing))
