"""`brrt explain`: why a run failed, or took long."""

from pathlib import Path
from typing import Annotated

import typer

from .console import note, out, print_json, print_lines
from .instants import At, AtEvent, AtIteration, Counted, beyond, instant
from .saved import Saved, opened


def explain(
    run: Annotated[Path, typer.Argument(help="A recording, .mcap or .rrd.")],
    at: At = None,
    at_event: AtEvent = None,
    at_iteration: AtIteration = None,
    partial: Annotated[
        bool, typer.Option("--partial", help="Take what is whole of a cut or damaged file.")
    ] = False,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print one JSON object with every figure.")
    ] = False,
) -> None:
    """Say why a run failed, or took long, by figures from its recording, and what to try.

    Shares of the free space are counted in coarse cells, 16 x 16 or 8 x 8 x 8.
    Widths are those of the widest way from start to goal, at its narrowest
    place, measured in cells. Each command writes a file of its own, here.

    brrt explain run.mcap

    brrt explain run.mcap --at-iteration 400

    brrt explain run.mcap --json
    """
    from dataclasses import replace  # noqa: PLC0415

    from brrt.explanation import explain as explained  # noqa: PLC0415
    from brrt.replay.snapshot import Snapshot  # noqa: PLC0415

    limits = instant(at, at_event, at_iteration)
    recording = opened(run, partial=partial)
    batches = Counted(Saved(recording, partial=partial, verb="explain them"))
    moment = Snapshot(replace(recording, batches=lambda: iter(batches)), limits)
    found = explained(moment, str(run))
    late = beyond(limits, batches.count, batches.last)
    if late is not None:
        note(f"{late}; this is how it stood then")
    if as_json:
        print_json(found.as_dict())
        return
    print_lines(found.table())
    for i, advice in enumerate(found.advice):
        print_lines(["", *advice.reason(i + 1)])
        for line in advice.command_lines():
            out.print(line, style="bold", markup=False, soft_wrap=True)
