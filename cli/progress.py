"""A progress bar for jobs that take long."""

import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, ClassVar

from .console import console


class ProgressBar:
    """A progress bar on stderr; it appears when a job has lasted a second, on a terminal only.

    A terminal shows one bar at a time: a job within another reports by the bar that is running.

    Args:
        total: Where the bar ends; None if that is unknown.
        waiting: The text before the first `update`.
    """

    _shown: ClassVar["ProgressBar | None"] = None

    def __init__(self, total: float | None, waiting: str) -> None:
        self.total, self._waiting = total, waiting
        self._bar: Any = _bar() if sys.stderr.isatty() else None
        if self._bar is not None:
            self._task = self._bar.add_task(waiting, total=None, figures="")

    @contextmanager
    def running(self) -> Iterator["ProgressBar"]:
        """Show the bar while the body runs."""
        if self._bar is None:
            yield self
            return
        outer = ProgressBar._shown
        if outer is not None:
            self._bar, self._task = outer._bar, outer._task  # noqa: SLF001 - its own kind
            yield self
            self._bar.update(self._task, total=None, description=outer._waiting, figures="")  # noqa: SLF001
            return
        ProgressBar._shown = self
        timer = threading.Timer(1.0, self._bar.start)
        timer.daemon = True
        timer.start()
        try:
            yield self
        finally:
            ProgressBar._shown = None
            timer.cancel()
            if self._bar.live.is_started:
                self._bar.stop()

    def update(self, done: float, what: str, figures: str) -> None:
        """Show how far the job is."""
        if self._bar is not None:
            self._bar.update(
                self._task, completed=done, total=self.total, description=what, figures=figures
            )


def _bar() -> Any:
    from rich.progress import (
        BarColumn,
        Progress,
        ProgressColumn,
        SpinnerColumn,
        TextColumn,
        TimeElapsedColumn,
    )
    from rich.text import Text

    class Left(ProgressColumn):
        """An estimate of the time that is left, where the end is known."""

        max_refresh = 0.5

        def render(self, task: Any) -> Any:
            left = task.time_remaining
            return Text("" if not left else f"about {left:.0f} s left")

    shown = console(stderr=True)
    return Progress(
        SpinnerColumn("dots" if shown.encoding.startswith("utf") else "line"),
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.fields[figures]}"),
        TimeElapsedColumn(),
        Left(),
        console=shown,
        transient=True,
        redirect_stdout=False,  # Rich would send it to stderr
        redirect_stderr=False,  # Rich would write its styles through the escaping stream
    )
