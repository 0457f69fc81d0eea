"""`brrt explain`: why a run failed or took long."""

from typing import Annotated

import typer

from .console import print_json, print_line, print_lines
from .options import Accepted, At, AtEvent, AtIteration, Run, instant
from .progress import ProgressBar


def explain(
    run: Run,
    at: At = None,
    at_event: AtEvent = None,
    at_iteration: AtIteration = None,
    _partial: Accepted = False,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print one JSON object with every figure.")
    ] = False,
) -> None:
    """Explain why a run failed or took long, from its recording alone, and what to try next.

    Shares of the free space are counted on a coarse grid of 16 x 16 or 8 x 8 x 8 cells.
    The width of a passage is measured on such cells too, at the narrowest place of the
    widest way from start to goal. Each proposed command writes a file of its own here.

    Examples:
      brrt explain run.mcap
      brrt explain run.mcap --at-iteration 400
      brrt explain run.mcap --json
    """
    from brrt.explanation import explain as explained
    from brrt.replay.snapshot import Snapshot

    from .run_file import open_run

    limits = instant(at, at_event, at_iteration)
    with ProgressBar(None, "explaining").running():
        found = explained(Snapshot(open_run(run, limits, partial=True), limits), str(run))
    if as_json:
        print_json(found.as_dict())
        return
    print_lines(found.table())
    for number, advice in enumerate(found.advice, 1):
        print_lines(["", *advice.reason(number)])
        for line in advice.command_lines():
            print_line(line, style="bold")
