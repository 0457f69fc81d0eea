"""`brrt diff`: what two runs have in common, and where they part."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .console import Code, print_json, print_lines
from .saved import Saved, opened

if TYPE_CHECKING:
    from brrt.recording import Recording


def diff(
    a: Annotated[Path, typer.Argument(help="A recording, .mcap or .rrd.", metavar="A")],
    b: Annotated[Path, typer.Argument(help="Another.", metavar="B")],
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
    partial: Annotated[
        bool, typer.Option("--partial", help="Take what is whole of a cut or damaged file.")
    ] = False,
) -> None:
    """Compare two runs: settings, versions, outcome, figures, and the first event that differs.

    Times, versions and names of files do not count. The figures of a file that was cut are those up
    to the cut, and it is said to be cut.

    Exit code 0: settings and events are equal; 1: something differs.

    brrt diff a.mcap b.mcap

    brrt diff run.mcap run.rrd --json
    """
    from brrt.comparison.comparison import compare  # noqa: PLC0415

    runs = (_saved(opened(run, partial=partial), partial=partial) for run in (a, b))
    found = compare(*runs, names=(str(a), str(b)))
    if as_json:
        print_json(found.as_dict())
    else:
        print_lines(found.lines())
    if not found.equal:
        raise typer.Exit(Code.FAILED)


def _saved(recording: "Recording", *, partial: bool) -> "Recording":
    """Return a recording that, where its file is cut, says what was saved."""
    from dataclasses import replace  # noqa: PLC0415

    saved = Saved(recording, partial=partial, verb="compare them")
    return replace(recording, batches=lambda: iter(saved))
