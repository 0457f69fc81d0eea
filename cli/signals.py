"""Signals that ask a program to end: Ctrl-C, SIGTERM, and SIGHUP from a closing terminal."""

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from brrt.planners.base.stop import Stop


@contextmanager
def stop_on_signals(stop: "Stop") -> Iterator[None]:
    """Let the first signal stop the run at the next batch, and a second one raise at once."""

    def interrupt(number: int, _: FrameType | None) -> None:
        if stop.interrupted:
            raise KeyboardInterrupt
        stop.interrupted, stop.signal = True, number

    with handling_signals(interrupt):
        yield


@contextmanager
def handling_signals(handler: Callable[[int, FrameType | None], None]) -> Iterator[None]:
    """Install a handler for these signals; SIGHUP stays ignored where it is, as under nohup."""
    numbers = [signal.SIGINT, signal.SIGTERM]
    if signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:
        numbers.append(signal.SIGHUP)
    before = {number: signal.signal(number, handler) for number in numbers}
    try:
        yield
    finally:
        for number, old in before.items():
            signal.signal(number, old)
