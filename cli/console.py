"""What the command line prints, and how it ends."""

import json
import sys
import threading
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from enum import IntEnum
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn
from rich.table import Table
from rich.text import Text

from brrt.replay.text import counted, seconds

out = Console(highlight=False)
err = Console(stderr=True, highlight=False)


class Code(IntEnum):
    """Exit codes."""

    DONE = 0
    FAILED = 1
    BAD_INPUT = 2
    INTERRUPTED = 130


SIGNALLED = 128
"""With the number of the signal that ended a command, its exit code, as shells have it."""


def complain(message: str) -> None:
    """Print one line on stderr."""
    err.print("brrt: " + " ".join(message.split()), style="red", markup=False, soft_wrap=True)


def note(message: str) -> None:
    """Print one line on stderr that is no error."""
    err.print("brrt: " + message, style="dim", markup=False, soft_wrap=True)


def tell_of_compiling() -> None:
    """Say once that kernels are being compiled, where they are."""
    from brrt.kernels.jit import CACHE_FOLDER, on_compiling  # noqa: PLC0415

    if CACHE_FOLDER is None:
        note(
            "compiling the planner (10 to 20 s), again in each run: no folder to keep it in can be "
            "written; name one in the variable BRRT_CACHE_DIR"
        )
        return
    text = "compiling the planner for this robot, once on this machine (10 to 20 s)"
    on_compiling(lambda: note(text))


def print_json(data: Mapping[str, Any]) -> None:
    """Print one object on stdout, as plain text."""
    sys.stdout.write(json.dumps(data, allow_nan=False) + "\n")


def print_lines(lines: Iterable[str]) -> None:
    """Print lines on stdout as they are, however wide the terminal is."""
    for line in lines:
        out.print(line, markup=False, soft_wrap=True)


def print_rows(
    rows: Sequence[Mapping[str, str]], title: str | None = None, *, whole: int = 2
) -> None:
    """Print a table of rows with the same keys; the first `whole` columns are not wrapped."""
    table = Table(title=title, box=None, title_justify="left", title_style="bold", pad_edge=False)
    for i, name in enumerate(rows[0]):
        table.add_column(name, style="bold" if i == 0 else "", overflow="fold", no_wrap=i < whole)
    for row in rows:
        table.add_row(*(escape(row[name]) for name in row))
    out.print(table)


def print_summary(figures: Mapping[str, Any], branches: Iterable[str] = ()) -> None:
    """Print a run's figures for people.

    Args:
        figures: What `Metrics.as_dict` returns.
        branches: From what the run branched off, and what it changed there.
    """
    outcomes = {"solved": "bold green", "not solved": "bold red"}
    print_pairs(
        (name, text, outcomes.get(text.split(",")[0], "") if name == "outcome" else "")
        for name, text in _summary(figures, branches)
    )


def print_pairs(rows: Iterable[tuple[str, str, str]]) -> None:
    """Print names with what there is to say about them; the third is a style."""
    table = Table(box=None, show_header=False, pad_edge=False)
    table.add_column(style="dim")
    table.add_column(overflow="fold")
    for name, text, style in rows:
        table.add_row(name, Text(text), style=style)
    out.print(table)


def _summary(f: Mapping[str, Any], branches: Iterable[str]) -> Iterator[tuple[str, str]]:
    yield "run", f"{f['planner']} · {f['robot']} · {f['world']} · seed {f['seed']}"
    for branch in branches:
        yield "branched", f"from {branch}"
    yield "outcome", _outcome(f)
    time = "" if f["plan_time_s"] is None else f" in {seconds(f['plan_time_s'])}"
    yield "planned", f"{counted(f['iterations'], 'iteration')}{time}"
    yield "events", ": ".join(filter(None, [f"{f['events']:,}", ", ".join(_counts(f))]))
    if f["path"] is not None:
        first = ""
        if f["first_path_cost"] != f["path_cost"]:
            when = f"{f['first_path_cost']:.6g} after {seconds(f['first_path_s'])}"
            first = f" (the first one {when})"
        yield "path", f"cost {f['path_cost']:.6g}{first}, {counted(len(f['path']) - 1, 'motion')}"
    if f["smoothed_path"] is not None:
        saved = 1 - f["smoothed_cost"] / f["path_cost"] if f["path_cost"] else 0.0
        motions = counted(len(f["smoothed_path"]) - 1, "motion")
        effort = counted(f["shortcuts"], "attempt")
        if f["smooth_time_s"] is not None:  # the log may not say when it began
            effort += f" in {seconds(f['smooth_time_s'])}"
        yield (
            "smoothed",
            f"cost {f['smoothed_cost']:.6g} ({saved:.1%} less), {motions}, {effort}",
        )
    if f["max_move_time_s"] is not None:
        slowest = f"the slowest planned in {seconds(f['max_move_time_s'])}"
        late = f"{f['deadline_misses']} late" if f["deadline_misses"] else "none late"
        yield "driven", f"{counted(f['moves'], 'move')}, {slowest}, {late}"
        if f["deadline_misses"]:
            charged = f"a classic run charges {counted(f['charged_moves'], 'move')}"
            yield "", f"the robot stayed for {counted(f['stays'], 'deadline')}; {charged}"


def _outcome(f: Mapping[str, Any]) -> str:
    """Say whether there is a path, and what ended the run if that was not the path."""
    if f["solved"]:
        return "solved" if f["status"] == "solved" else f"solved, ended by: {f['status']}"
    if f["status"] == "no path":
        return "not solved, no path on the lattice; smaller cells may have one (--param epsilon=)"
    return f"not solved, {f['status']}"


def _counts(f: Mapping[str, Any]) -> Iterator[str]:
    """What a run consists of, as far as there is any of it."""
    from brrt.events import COUNTS, Kind  # noqa: PLC0415 - keep --help fast

    for kind, count in COUNTS.items():
        if count.key and f[count.key] and kind is not Kind.SHORTCUT:  # smoothing has its own line
            yield count.text(f[count.key])


class Watch:
    """A progress bar that appears once a job has lasted a second, on a terminal alone.

    Args:
        total: Where the bar ends; None where nobody knows.
        waiting: What it says until the first `update`.
    """

    def __init__(self, total: float | None, waiting: str) -> None:
        self._progress = Progress(
            SpinnerColumn(),
            TextColumn("{task.description}"),
            BarColumn(),
            TextColumn("{task.fields[figures]}"),
            TimeElapsedColumn(),
            console=err,
            transient=True,
        )
        self._task = self._progress.add_task(waiting, total=None, figures="")
        self.total = total
        self._timer = threading.Timer(1.0, self._progress.start)
        self._timer.daemon = True

    @contextmanager
    def running(self) -> Iterator["Watch"]:
        """Show the bar while the body runs, if it takes long."""
        if err.is_terminal:
            self._timer.start()
        try:
            yield self
        finally:
            self._timer.cancel()
            if err.is_terminal and self._progress.live.is_started:
                with suppress(OSError):  # the terminal may have been closed
                    self._progress.stop()

    def update(self, done: float, what: str, figures: str) -> None:
        """Say how far the job is."""
        self._progress.update(
            self._task, completed=done, total=self.total, description=what, figures=figures
        )
