"""`brrt export`: a run in files for other programs."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .console import note, print_line
from .options import Accepted, At, AtEvent, AtIteration, Force, Run, instant
from .progress import ProgressBar

if TYPE_CHECKING:
    from brrt.recording import Recording


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
    csv: Annotated[
        Path | None,
        typer.Option(
            help="Write a folder of .csv files: one for each kind of event, the nodes of the "
            "trees, the best path.",
            metavar="DIR",
        ),
    ] = None,
    parquet: Annotated[
        Path | None,
        typer.Option(help="Write these tables as .parquet files.", metavar="DIR"),
    ] = None,
    graphml: Annotated[
        Path | None,
        typer.Option(
            help="Write the trees as a graph, a .graphml file for networkx, Gephi and others.",
            metavar="FILE",
        ),
    ] = None,
    at: At = None,
    at_event: AtEvent = None,
    at_iteration: AtIteration = None,
    force: Force = False,
    _partial: Accepted = False,
) -> None:
    """Write a run, or what there is of it at an instant, in formats of other programs.

    Examples:
      brrt export run.mcap --csv run --graphml tree.graphml
      brrt export run.mcap --csv early --at-iteration 100
      brrt export run.mcap --foxglove viz.mcap --layout layout.json
    """
    from brrt.errors import BrrtError

    from .output_file import check_output
    from .run_file import open_run

    if not any((foxglove, csv, parquet, graphml)):
        raise BrrtError(
            "nothing to export to; name a file with --foxglove OUT.mcap or --graphml OUT.graphml, "
            "or a folder with --csv DIR or --parquet DIR"
        )
    check_output(foxglove, "--foxglove", ".mcap", force=force)
    check_output(layout, "--layout", ".json", force=force)
    check_output(graphml, "--graphml", ".graphml", force=force)
    _check_folders(csv, parquet, force=force)
    if layout is not None and foxglove is None:
        raise BrrtError("--layout needs --foxglove")
    if foxglove is not None and foxglove.exists() and run.exists() and foxglove.samefile(run):
        raise BrrtError(f"--foxglove {foxglove}: is the recording; choose another name")
    limits = instant(at, at_event, at_iteration)
    recording = open_run(run, limits, partial=True)
    with ProgressBar(None, "reading the recording").running() as watch:
        from brrt.replay.fold import until

        batches = list(until(recording.batches(), limits))
        recording = replace(recording, batches=lambda: batches)
        lines = list(_write_data(recording, csv, parquet, graphml, watch, force=force))
        if foxglove is not None:
            lines.append(_write_foxglove(recording, foxglove, layout, watch))
    for line in lines:
        print_line(line)


def _check_folders(csv: Path | None, parquet: Path | None, *, force: bool) -> None:
    """Check the folders, and that what writes them is installed.

    Raises:
        BrrtError: A folder cannot be written or replaced, or pyarrow is missing.
    """
    from brrt.errors import BrrtError
    from brrt.exports.extras import need
    from brrt.exports.files import check_folder

    for option, folder, suffix in (("--csv", csv, ".csv"), ("--parquet", parquet, ".parquet")):
        if folder is not None:
            try:
                check_folder(folder, suffix, force=force)
            except BrrtError as error:
                raise BrrtError(f"{option} {error}") from None
    if parquet is not None:
        need("pyarrow")
        if csv is not None and csv.absolute() == parquet.absolute():
            raise BrrtError("--csv and --parquet need folders of their own")


def _write_data(
    recording: "Recording",
    csv: Path | None,
    parquet: Path | None,
    graphml: Path | None,
    watch: ProgressBar,
    *,
    force: bool,
) -> Iterator[str]:
    """Write tables and graph; yield what to print."""
    from brrt.exports.files import write_csv, write_parquet
    from brrt.exports.graphs import write_graphml
    from brrt.exports.tables import NODES, tables
    from brrt.replay.snapshot import Snapshot

    snapshot = Snapshot(recording)
    if csv is not None or parquet is not None:
        found = tables(snapshot)
        if "edge" in found and NODES not in found:
            note("the events do not make trees, so there is no table of nodes; see brrt verify")
        rows = sum(len(next(iter(columns.values()))) for columns in found.values())
        for folder, write in ((csv, write_csv), (parquet, write_parquet)):
            if folder is not None:
                watch.update(0, "writing", str(folder))
                write(found, folder, force=force)
                yield f"{folder}: {rows:,} rows in {len(found)} files: {', '.join(found)}"
    if graphml is not None:
        watch.update(0, "writing", str(graphml))
        yield f"{graphml}: {write_graphml(snapshot, graphml):,} nodes"


def _write_foxglove(
    recording: "Recording", path: Path, layout: Path | None, watch: ProgressBar
) -> str:
    """Write the messages for Foxglove; return what to print."""
    from brrt.views.foxglove.export import export as export_to_foxglove

    watch.total = 1.0
    count = export_to_foxglove(
        recording,
        path,
        layout_path=layout,
        progress=lambda part: watch.update(part, "writing", f"{part:.0%}"),
    )
    imported = "" if layout is None else f"; import {layout} as a layout first"
    return f"{path}: {count:,} messages for Foxglove or Lichtblick{imported}"
