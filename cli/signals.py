"""Signals that ask a program to end: Ctrl-C, SIGTERM, and SIGHUP from a closing terminal."""

import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, NoReturn

from brrt.shell import file_argument
from brrt.text import visible

from .console import SIGNALLED

if TYPE_CHECKING:
    from brrt.planners.base.stop import Stop


_CLOSING_S = 5.0
"""For how long files are closed after a second signal."""

_SHOW_CURSOR = "\x1b[?25h"
"""A progress bar hides it."""


@contextmanager
def stop_on_signals(stop: "Stop", unfinished: Callable[[], Sequence[Path]]) -> Iterator[None]:
    """Let signals stop a run.

    The first one stops it at the next batch, and its files are closed. A second one says so, and
    ends the process if that takes longer than `_CLOSING_S`; a third one ends it at once.

    Args:
        stop: The run's.
        unfinished: Returns the files that are not closed yet.
    """
    timer: threading.Timer | None = None

    def interrupt(number: int, _: FrameType | None = None) -> None:
        nonlocal timer
        if timer is not None:
            _end(number, unfinished())
        if stop.interrupted:
            names = " and ".join(map(str, unfinished())) or "what is open"
            _say(
                f"closing {names}, for {_CLOSING_S:g} s at most; "
                "one more Ctrl-C ends that at once and cuts the files"
            )
            timer = threading.Timer(_CLOSING_S, lambda: _end(number, unfinished()))
            timer.daemon = True
            timer.start()
        stop.interrupted, stop.signal = True, stop.signal or number

    try:
        with handling_signals(interrupt):
            yield
    finally:
        if timer is not None:
            timer.cancel()


def _end(number: int, cut: Sequence[Path]) -> NoReturn:
    """End the process, whatever its threads wait for, and say which files are cut."""
    for path in cut:
        if path.suffix == ".mcap":
            name = file_argument(path)
            _say(f"{path} is cut: save it with brrt recover {name} --out whole.mcap")
        else:
            _say(f"{path} is cut and cannot be read")
    os._exit(SIGNALLED + number)


def _say(text: str) -> None:
    """Print on stderr past its buffer, which a signal may have interrupted."""
    with suppress(OSError):
        shown = visible(f"brrt: {text}", one_line=True)
        terminal = _SHOW_CURSOR if os.isatty(2) else ""
        os.write(2, f"{terminal}{shown}\n".encode(errors="replace"))


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
