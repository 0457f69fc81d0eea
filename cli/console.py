"""What commands print, and the exit codes they end with."""

import json
import sys
from collections.abc import Iterable, Mapping, Sequence
from enum import IntEnum
from functools import cache
from typing import TYPE_CHECKING, Any

from brrt.text import visible

from .streams import output_ended

if TYPE_CHECKING:
    from rich.console import Console


class Code(IntEnum):
    """Exit codes."""

    DONE = 0
    FAILED = 1
    BAD_INPUT = 2
    INTERRUPTED = 130


SIGNALLED = 128
"""Plus the number of the signal that ended a command: its exit code, as in shells."""


@cache
def console(*, stderr: bool = False) -> "Console":
    """Return the terminal, or the file, that stdout or stderr goes to.

    Texts are printed with their controls as escapes: before they are laid out where they come as
    plain strings, and in any case before they are written. Rich's own sequences are separate.
    """
    from rich.console import Console
    from rich.segment import Segment

    class VisibleConsole(Console):
        def render_str(self, text: str, **how: Any) -> Any:
            return super().render_str(visible(text), **how)

        def render(self, *args: Any) -> Any:
            for text, style, control in super().render(*args):
                yield Segment(text if control else visible(text), style, control)

    return VisibleConsole(stderr=stderr, highlight=False)


def complain(message: str) -> None:
    """Print an error as one line on stderr."""
    _print_on_stderr(" ".join(message.split()), "red")


def note(message: str) -> None:
    """Print a remark as one line on stderr."""
    _print_on_stderr(message, "dim")


def _print_on_stderr(text: str, style: str) -> None:
    shown = visible(f"brrt: {text}", one_line=True)
    try:
        console(stderr=True).print(shown, style=style, markup=False, soft_wrap=True)
    except MemoryError:  # of a process that is about to say so
        sys.stderr.write(f"{shown}\n")


def announce_compilation() -> None:
    """Print a note if kernels are compiled, which takes seconds, and if they cannot be kept."""
    from brrt.kernels.cache import on_unsaved
    from brrt.kernels.jit import CACHE_FOLDER, WITHOUT_CACHE, on_compiling

    if CACHE_FOLDER is None:
        note(
            "compiling the planner (10 to 20 s), again in each run: no folder for the cache "
            f"({WITHOUT_CACHE}); name one in the variable BRRT_CACHE_DIR"
        )
        return
    text = "compiling the planner for this robot, once on this machine (10 to 20 s)"
    on_compiling(lambda: note(text))
    on_unsaved(
        lambda reason: note(
            f"cannot keep the compiled planner in {reason}; it is compiled again in each run, "
            "unless the variable BRRT_CACHE_DIR names another folder"
        )
    )


def print_json(data: Mapping[str, Any]) -> None:
    """Print one object on stdout."""
    text = json.dumps(data, allow_nan=False).replace("\x7f", "\\u007f")
    sys.stdout.write(text + "\n")


def print_line(text: str = "", style: str = "") -> None:
    """Print a line on stdout as it is, however wide the terminal."""
    console().print(visible(text, one_line=True), style=style, markup=False, soft_wrap=True)


def print_lines(lines: Iterable[str]) -> None:
    """Print lines on stdout as they are, however wide the terminal."""
    for line in lines:
        if output_ended():
            return
        print_line(line)


def print_rows(rows: Sequence[Mapping[str, str]], *, whole: int = 2) -> None:
    """Print a table of rows with the same keys; the first `whole` columns are not wrapped."""
    from rich.table import Table
    from rich.text import Text

    table = Table(box=None, pad_edge=False)
    for i, name in enumerate(rows[0]):
        table.add_column(name, style="bold" if i == 0 else "", overflow="fold", no_wrap=i < whole)
    for row in rows:
        table.add_row(*(Text(visible(row[name], one_line=True)) for name in row))
    console().print(table)


def print_pairs(rows: Iterable[tuple[str, str, str]]) -> None:
    """Print rows of a name, a text and the style of the text."""
    from rich.table import Table
    from rich.text import Text

    table = Table(box=None, show_header=False, pad_edge=False)
    table.add_column(style="dim")
    table.add_column(overflow="fold")
    for name, text, style in rows:
        table.add_row(name, Text(visible(text, one_line=True)), style=style)
    console().print(table)
