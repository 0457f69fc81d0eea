"""The last messages at any instant, against a loop over all items."""

from collections import Counter
from itertools import chain

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from brrt.views.foxglove.interval_topics import _sizes, interval_messages


@st.composite
def lives(draw: st.DrawFn) -> tuple[int, list[tuple[int, int]], int]:
    """Draw a number of instants, lives within them, and a size of batches."""
    instants = draw(st.integers(1, 70))
    born = st.integers(0, instants - 1)
    life = born.flatmap(lambda b: st.tuples(st.just(b), st.integers(b + 1, instants)))
    return instants, draw(st.lists(life, max_size=40)), draw(st.sampled_from([1, 2, 3, 8, 16]))


@given(lives())
def test_last_messages_hold_what_is_there(drawn: tuple[int, list[tuple[int, int]], int]) -> None:
    """At each instant the last messages of all topics have each existing item once."""
    instants, items, batch = drawn
    born, gone = np.array(items, np.int64).reshape(-1, 2).T
    sent = list(interval_messages(born, gone, instants, batch))
    assert [t[:2] for t in sent] == sorted({t[:2] for t in sent})
    last: dict[int, list[int]] = {}
    for instant in range(instants):
        while sent and sent[0].instant == instant:
            message = sent.pop(0)
            assert 0 <= message.topic < 2 + _sizes(instants, batch)
            # No message repeats the one before it on its topic.
            assert message.items.tolist() != last.get(message.topic, [])
            last[message.topic] = message.items.tolist()
        there = [i for i, (b, g) in enumerate(items) if b <= instant < g]
        assert sorted(chain.from_iterable(last.values())) == there
        assert all(sent == sorted(sent) for sent in last.values())
    assert not sent


@given(lives())
def test_each_item_is_sent_rarely(drawn: tuple[int, list[tuple[int, int]], int]) -> None:
    """An item that stays is sent at most once a size, one that goes at most twice."""
    instants, items, batch = drawn
    born, gone = np.array(items, np.int64).reshape(-1, 2).T
    count: Counter[tuple[int, int]] = Counter()
    for message in interval_messages(born, gone, instants, batch):
        if message.topic:
            count.update((message.topic, item) for item in message.items.tolist())
    for (_, item), times in count.items():
        assert times <= (1 if gone[item] == instants else 2)
