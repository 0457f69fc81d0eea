"""`brrt export`: a run in a file for other viewers."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from .console import Watch, out
from .saved import Saved, opened


def export(
    run: Annotated[Path, typer.Argument(help="A recording, .mcap or .rrd.")],
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
    force: Annotated[bool, typer.Option("--force", help="Overwrite files.")] = False,
    partial: Annotated[
        bool, typer.Option("--partial", help="Take what is whole of a cut or damaged file.")
    ] = False,
) -> None:
    """Write a run in a format of other viewers.

    brrt export run.mcap --foxglove viz.mcap --layout layout.json
    """
    from brrt.errors import BrrtError  # noqa: PLC0415 - keep --help fast

    from .outputs import check_output  # noqa: PLC0415

    if foxglove is None:
        raise BrrtError("nothing to export to; name a file with --foxglove OUT.mcap")
    check_output(foxglove, "--foxglove", ".mcap", force=force)
    check_output(layout, "--layout", ".json", force=force)
    if foxglove.exists() and run.exists() and foxglove.samefile(run):
        raise BrrtError(f"--foxglove {foxglove}: is the recording; choose another name")
    recording = opened(run, partial=partial)
    with Watch(None, "reading the recording").running() as watch:
        batches = list(Saved(recording, partial=partial, verb="export them"))
        from brrt.views.foxglove.export import export as export_to_foxglove  # noqa: PLC0415

        watch.total = 1.0
        count = export_to_foxglove(
            replace(recording, batches=lambda: batches),
            foxglove,
            layout_path=layout,
            progress=lambda part: watch.update(part, "writing", f"{part:.0%}"),
        )
    imported = "" if layout is None else f"; import {layout} as a layout first"
    text = f"{foxglove}: {count:,} messages for Foxglove or Lichtblick{imported}"
    out.print(text, markup=False, soft_wrap=True)
