"""`brrt recover`: a whole file out of one that was cut or damaged."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from brrt.replay.text import counted

from .console import Code, print_line
from .options import Force

if TYPE_CHECKING:
    from brrt.scenario.manifest import Manifest
    from brrt.worlds.world import World


def recover(
    cut: Annotated[
        Path, typer.Argument(help="A recording that was cut or damaged, .mcap.", metavar="CUT")
    ],
    whole: Annotated[
        Path,
        typer.Option("--out", help="The new file, .mcap or .rrd.", metavar="WHOLE"),
    ],
    force: Force = False,
) -> None:
    """Save the events before the first damage of a recording that was cut or damaged.

    A killed process, a full disk or a fault of the disk leaves such a file. The new one is whole:
    it has index and checksums, and the result if the run came to its end. Exit code 1: no event
    precedes the damage, and the new file holds only world, start, goal and settings.

    An .rrd file must be whole; of one that is not, save the .mcap of the run.

    brrt recover cut.mcap --out whole.mcap

    brrt recover cut.mcap --out whole.rrd
    """
    from brrt.formats.recover import recover

    from .output_file import check_output

    check_output(whole, "--out", (".mcap", ".rrd"), force=force)
    found = recover(cut, whole, _open_sink)
    events = f"{counted(found.events, 'event')} up to {found.until_s:.6f} s"
    if found.lost is None:
        text = f"{cut} is whole: {whole} holds its {events}"
    elif found.complete:
        text = f"{found.lost}; no event is lost: {whole} holds all {events}"
    elif found.events:
        text = f"{found.lost}; {whole} holds what is whole: {events}; anything later is lost"
    else:
        text = f"{found.lost}; no event is whole: {whole} holds the problem alone"
    print_line(text)
    if not (found.events or found.complete):
        raise typer.Exit(Code.FAILED)


def _open_sink(path: Path, manifest: "Manifest", world: "World") -> Any:
    """Open a sink by the suffix of the file's name."""
    if path.suffix == ".rrd":
        from brrt.views.rerun.sink import RerunSink

        return RerunSink(manifest, world, path=path)
    from brrt.formats import McapSink

    return McapSink(path, manifest, world)
