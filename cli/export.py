"""`brrt export`: a run in a file for other viewers."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from .console import print_line
from .options import Accepted, Force, Run
from .progress import ProgressBar


def export(
    run: Run,
    foxglove: Annotated[
        Path | None,
        typer.Option(
            help="Write an .mcap for Foxglove and Lichtblick, whose 3D panel shows any instant.",
            metavar="OUT",
        ),
    ] = None,
    layout: Annotated[
        Path | None,
        typer.Option(help="Write a layout to import there, a .json file.", metavar="LAYOUT"),
    ] = None,
    force: Force = False,
    _partial: Accepted = False,
) -> None:
    """Write a run in a format of other viewers.

    Examples:
      brrt export run.mcap --foxglove viz.mcap --layout layout.json
    """
    from brrt.errors import BrrtError

    from .output_file import check_output
    from .run_file import open_run

    if foxglove is None:
        raise BrrtError("nothing to export to; name a file with --foxglove OUT.mcap")
    check_output(foxglove, "--foxglove", ".mcap", force=force)
    check_output(layout, "--layout", ".json", force=force)
    if foxglove.exists() and run.exists() and foxglove.samefile(run):
        raise BrrtError(f"--foxglove {foxglove}: is the recording; choose another name")
    recording = open_run(run, partial=True)
    with ProgressBar(None, "reading the recording").running() as watch:
        batches = list(recording.batches())
        from brrt.views.foxglove.export import export as export_to_foxglove

        watch.total = 1.0
        count = export_to_foxglove(
            replace(recording, batches=lambda: batches),
            foxglove,
            layout_path=layout,
            progress=lambda part: watch.update(part, "writing", f"{part:.0%}"),
        )
    imported = "" if layout is None else f"; import {layout} as a layout first"
    text = f"{foxglove}: {count:,} messages for Foxglove or Lichtblick{imported}"
    print_line(text)
