"""The entry of the `brrt` command: Ctrl-C ends it with exit code 130 and without a traceback."""

import os
import signal
import sys
from collections.abc import Sequence
from typing import Any, NoReturn

_INTERRUPTED = 130
_AGAIN_S = 0.5


def main(args: Sequence[str] | None = None) -> None:
    """Run the command line; it ends by SystemExit.

    While modules are imported, and while the interpreter ends, Ctrl-C ends the process at once. In
    between it raises KeyboardInterrupt, so that unfinished files are removed.
    """
    if signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        from .app import main as run  # ignored, as in the background of a shell, or a host's own

        run(args)
        return
    hook = sys.unraisablehook
    try:
        signal.signal(signal.SIGINT, _end)
        from .app import main as run

        sys.unraisablehook = _report
        signal.signal(signal.SIGALRM, _interrupt)
        signal.signal(signal.SIGINT, _interrupt)
        run(args)
    except KeyboardInterrupt:
        if args is None:
            _end()
        raise SystemExit(_INTERRUPTED) from None
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        whole = args is None  # the process ends with the command, unlike in tests
        signal.signal(signal.SIGINT, _end if whole else signal.default_int_handler)
        sys.unraisablehook = hook


def _end(*_: Any) -> NoReturn:
    os._exit(_INTERRUPTED)


def _interrupt(*_: Any) -> NoReturn:
    """Interrupt, and again while the command runs on: callbacks from C swallow exceptions."""
    signal.setitimer(signal.ITIMER_REAL, _AGAIN_S)
    raise KeyboardInterrupt


def _report(unraisable: Any) -> None:
    """Print what a callback swallowed, but for interruptions."""
    if unraisable.exc_type is not KeyboardInterrupt:
        sys.__unraisablehook__(unraisable)
