"""A progress bar for jobs that take long."""

import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from .console import console


class ProgressBar:
    """A progress bar on stderr; it appears when a job has lasted a second, on a terminal only.

    Args:
        total: Where the bar ends; None if that is unknown.
        waiting: The text before the first `update`.
    """

    def __init__(self, total: float | None, waiting: str) -> None:
        self.total = total
        self._bar: Any = _bar() if sys.stderr.isatty() else None
        if self._bar is not None:
            self._task = self._bar.add_task(waiting, total=None, figures="")

    @contextmanager
    def running(self) -> Iterator["ProgressBar"]:
        """Show the bar while the body runs."""
        if self._bar is None:
            yield self
            return
        timer = threading.Timer(1.0, self._bar.start)
        timer.daemon = True
        timer.start()
        try:
            yield self
        finally:
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
    from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    shown = console(stderr=True)
    return Progress(
        SpinnerColumn("dots" if shown.encoding.startswith("utf") else "line"),
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.fields[figures]}"),
        TimeElapsedColumn(),
        console=shown,
        transient=True,
    )
