"""The switch interval of threads while runs are under way."""

import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager

_SWITCH_S = 0.0005
"""Between two batches a planner must not wait 5 ms, Python's usual interval, for the thread of a
sink."""

_lock = threading.Lock()
_under_way = 0
_usual = 0.0


@contextmanager
def short_switch_interval() -> Iterator[None]:
    """Shorten the interval; restore it when the last of several runs in threads has ended."""
    global _under_way, _usual  # noqa: PLW0603 - the interval is the interpreter's
    with _lock:
        if _under_way == 0:
            _usual = sys.getswitchinterval()
            sys.setswitchinterval(min(_usual, _SWITCH_S))
        _under_way += 1
    try:
        yield
    finally:
        with _lock:
            _under_way -= 1
            if _under_way == 0:
                sys.setswitchinterval(_usual)
