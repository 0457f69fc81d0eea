"""`brrt diff`: what two runs have in common, and their first difference."""

from pathlib import Path
from typing import Annotated

import typer

from .console import Code, print_json, print_lines
from .options import Json, Partial
from .progress import ProgressBar


def diff(
    a: Annotated[Path, typer.Argument(help="A recording, .mcap or .rrd.", metavar="A")],
    b: Annotated[Path, typer.Argument(help="Another one.", metavar="B")],
    as_json: Json = False,
    partial: Partial = False,
) -> None:
    """Compare two runs: settings, versions, outcome, metrics, and the first event that differs.

    Times, versions and file names do not count as differences. With --partial, the metrics of a
    cut file are those up to the cut.

    Exit code 0: settings and events are equal; 1: something differs.

    Examples:
      brrt diff a.mcap b.mcap
      brrt diff run.mcap run.rrd --json
    """
    from brrt.comparison.comparison import compare

    from .run_file import open_run

    runs = [open_run(run, partial=partial) for run in (a, b)]
    with ProgressBar(None, "comparing").running():
        found = compare(*runs, names=(str(a), str(b)))
    if as_json:
        print_json(found.as_dict())
    else:
        print_lines(found.lines())
    if not found.equal:
        raise typer.Exit(Code.FAILED)
